"""Constants of smooth curves, the weak form and shooting, each with where it comes from."""

from __future__ import annotations

# Smooth curves. Quintic splines: their derivatives, which the weak form's errors need, are cubic.
SPLINE_DEGREE = 5
# Knots a period: five carry a sine to 2.5e-4 of its size, twelve its third harmonic to 1.4e-3.
LEAST_KNOTS_PER_PERIOD, MOST_KNOTS_PER_PERIOD = 5, 12
SAMPLES_PER_KNOT = 3  # so that the noise can be told from the curve
ABOVE_NOISE = 20.0  # times the median of a spectrum: what counts as signal
LEAST_SAMPLES = 8  # of a channel: fewer carry no curve and no noise
GRID_PER_PERIOD = 24  # eight points to the third harmonic
SPECTRUM_SAMPLES = 2**15  # whose spectrum is taken at once: longer ones have more to resolve
GAP = 0.4  # periods from the nearest sample beyond which a curve is not believed: half a swing
EDGE = 0.5  # periods beside a gap in which a curve ends badly
SPLINE_ACCURACY = 3e-4  # of a curve with the fewest knots, relative to its size: see above
# Weight of the squared highest derivative against the samples': closes gaps, moves no curve.
ROUGHNESS = 5e-4

# Channels that measure a rate. A bias and a slow drift are a cubic over the recording.
DRIFT_DEGREE = 3

# The weak form. Test functions (1 - u^2)^5 with a radius of half a period, in steps of the grid:
# they keep 0.68 of a sine of that period and 0.18 of half of it; a third of the radius apart.
TEST_RADIUS, TEST_STRIDE, TEST_SHARPNESS = 12, 4, 5
BATCH_OF_TESTS = 4096  # whose errors are linearised at once: what they need is 3 kB each
WEAK_ITERATIONS = 3  # of the weights: the coefficients then move by less than their errors
# Periods of the stretch of a long recording that a start is fitted to. Measured: of the default
# line's 70 candidates, 14 of them true, the weak form keeps 25 over the first 1,000 periods, and 63
# over 40,000, with which the model diverges.
START_PERIODS = 1000
MOST_MISFIT = 3.0  # chi^2 per row: linearised errors explain no more

# Projections. Three a window hold all that samples tell of a motion that turns by a twelfth of a
# period in it; Taylor series of `taylor.ORDER` are then good to TRUNCATION.
WINDOWS_PER_PERIOD, ROWS = 12, 3
# Degree of the polynomial that an input is over a window. Measured on two modes in gusts sampled 20
# times a window: with degrees 2 to 5 the model is the same to a hundredth of its errors, and from 4
# on the series of so jagged an input needs windows of a quarter and less.
INPUT_DEGREE = 3
HUGE = 1e30  # of a state or a derivative, from which a solution counts as diverged

BATCH = 8  # segments integrated together: what they need is held at once, in the cache

MOST_HALVINGS = 6  # of the integrator's step, and of a Gauss-Newton step

# Segments and chains.
UNDETERMINED = 3e-7  # relative singular value below which a direction of a state is not solved for
# A chain of growth G gives an information matrix of condition G^2 or more: with rounding of
# 1e-16, what it says about a term is known better than IMITATED where G^2 < IMITATED / 1e-16.
GROWTH = 2e3
