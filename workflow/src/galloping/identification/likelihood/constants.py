"""The constants of the likelihood methods, stage by stage, each with where it comes from.

"Measured" means on fits to random lines (`galloping.trials.random_lines`) and to spans
(`galloping.trials.model_error`) of seeds that report nothing. A period is the shortest of the
motion; the cubic terms of a line make harmonics up to its third.
"""

from __future__ import annotations

from typing import NamedTuple

# Time scales that are tried, each half of the one before, which gave no model: the spectrum shows
# that of most of the power, and a transient or a relaxation is quicker. Measured on systems of
# `galloping.trials.systems`: a cubic oscillator that slows down as it decays needs a half or a
# quarter of it, one that relaxes a half; of two that a quarter did not answer, neither did an
# eighth or a sixteenth.
TIME_SCALES = 3

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

# What is no measurement. Gaussian noise exceeds 5.5 deviations once in 30 million samples.
OUTLIER = 5.5
CURVE_ACCURACY = 1e-3  # of a curve that outliers still pull, relative to its largest value
MOST_OUTLIERS = 0.1  # share of a channel: with more it is not outliers that are wrong
OUTLIER_ROUNDS = 6
LOCAL_NOISE = 4.0  # periods in which the noise of a channel has a deviation of its own
# Equal extremes of a channel from which it is saturated: a digital one repeats its largest value
# a few times by chance.
LEAST_SATURATED, SATURATED_SHARE = 5, 5e-4

# Displacements by integration. Below a share of the slowest frequency that matters they are taken
# out, steeply: white noise of accelerations grows as the square of the period in them.
SLOWEST_SHARE = 0.01
CORNER, CORNER_STEEPNESS = 0.6, 12
# How far the middle of a motion may lie from rest, in deviations of the displacement. Measured on
# accelerations of the study's line, whose is 0.15: starts 0.0 to 0.1 off lead to the model always.
OFF_REST = 0.2
INTEGRAL_MARGIN = 3.0  # periods at the ends of stretches, where it errs (measured: 1 is too few)

# Channels that measure a rate. A bias and a slow drift are a cubic over the recording.
DRIFT_DEGREE = 3
FEWEST_INTEGRALS = 20  # that tell a scale to a few percent
RATE_OUTLIER = 8.0  # robust deviations about the slope of a curve, which is rougher than the curve
RATE_MARGIN = 1.0  # periods at the ends of stretches of samples, where that slope is rough

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
# period in it; Taylor series of order 12 are then good to TRUNCATION.
WINDOWS_PER_PERIOD, ROWS, ORDER = 12, 3, 12
TRUNCATION = 1e-7  # of the Taylor series, relative to each state: below the noise of any sensor
SMALLEST_NOISE = 1e-5  # of a channel, relative to its size: rounding is not weighed as noise
HUGE = 1e30  # of a state or a derivative, from which a solution counts as diverged

# Passes of the fit.
PERIODS_PER_SEGMENT = 6  # short enough for a rough start to converge from
# What a term costs, in penalties, in a start of few terms. Measured: of twenty recordings of the
# displacements of a line, three samples a second, starts of 25 to 70 terms left fourteen without a
# model; from 4 to 10 terms all are followed, at a quarter of the cost. So are twenty others, of
# which thirteen were left.
FEW_TERMS = (4, 16, 64)
SHORTER = 4  # lengths of segments that are tried, each half the one before
BATCH = 64  # segments integrated together: what they need is held at once
MOST_FREE_PASSES = 5  # with free segments, which are matched after them, however bad the fit
# Segments that are matched in the first pass, and how many times more in the next. Measured: with
# whole chains at once 6 of 92 clear lines did not settle, with these none.
FIRST_CHAIN, CHAIN_GROWTH = 4, 4


class Passes(NamedTuple):
    """Passes of a try of `matching.match`.

    name: of the try. most: in all. choosing: those of them in which terms are chosen. alike: with
    chains of one length, unless the step is SHORT before. raised: what a term costs in the first,
    in penalties.
    """

    name: str
    most: int
    choosing: int
    alike: int
    raised: tuple[int, ...] = ()


# Measured: of five recordings of chaotic lines that do not settle in the first try, four do in the
# patient one, with the right terms. Of six of clear lines in which a mixture of terms goes unseen
# and which do not settle in the first, four do with 16 penalties at first, each with the right
# terms, two with 4; among many terms of which some make up others the choice goes round in circles.
FIRST_TRY, PATIENT_TRY = Passes("first try", 20, 14, 1), Passes("patient try", 40, 28, 4)
SPARSE_TRY = Passes("sparse try", 26, 20, 1, raised=(16, 16, 8, 8, 4, 4, 2, 2))
SHORT = 100.0  # squared length of a step, in standard deviations
MOST_HALVINGS = 6  # of the integrator's step, and of a Gauss-Newton step
CLOSE = 1.5  # chi^2 per row below which a fit is good enough to choose terms by
CONVERGED = 0.01  # squared length of a step, in standard deviations
MATCHED = 1e-3  # gap between segments, relative to each state

# Where no model is right.
# Periods of a stretch. Measured: with 3 to 6 a model's error hides in the jumps, and amplitudes are
# up to three times as far off; with 20 or more gusts do not, and dampings are.
STRETCH_PERIODS = 10
# Times that of exact models: a wrong model needs stronger evidence. Measured: on each truth of the
# table of model errors one of about 7 chooses nearly the same terms of every recording; with 3 to 5
# some recordings keep five terms more, which change no number of interest.
PENALTIES = (7.0, 25.0)
WORTH = 0.25  # of a term: fall of the forecast error, in standard errors of the difference
# Passes: with all terms, in which terms are chosen, and after either with terms that stay.
WHOLE_PASSES, CHOOSING_PASSES, SETTLING_PASSES = 1, 6, 4
ERROR_CONVERGED = 0.05  # squared length of a step, in standard deviations
MOST_GROUPS = 12  # of stretches left out together
# Total variance over that between stretches: what errs alike in all may be as large.
SYSTEMATIC = 2.0
FIRST_JUMP = 0.05  # relative to each state
QUIET = 0.03  # size of a motion, relative to the whole record's, below which jumps stay as large
COVARIANCE_RIDGE = 1e-9  # of a misfit's variance, so that its covariance can be factored
STATE_RIDGE = 1e-12  # of the information about a state, where a stretch tells nothing

# Further modes, besides the model. Of a channel's main frequency, below one and a half times of
# which errors of the model are; of one over the window, above which its mean tells little.
FURTHER_FROM, FURTHER_TO = 1.5, 0.4
MOST_FURTHER = 4  # of a channel
FURTHER_SHARE = 0.1  # of what is left of a channel that a mode takes away, to be worth a word
MOST_GROWTH = 20.0  # of its logarithm over a record: with more it is the end of it alone

# Coefficients that fluctuate. Parts of a stretch in which they are constant: a tenth of the
# correlation. Measured: with ten parts the slow mode seems to fluctuate as well.
FLUCTUATION_PARTS = 24
MOST_DIVIDED = 200  # stretches of a record, each part of which needs 50 kB and more
# Periods of correlation. Measured: dampings and amplitudes in gusts are as good with the true
# spectrum of the wind as with 2 to 7 periods.
FLUCTUATION_PERIODS = 4.0
FIRST_FLUCTUATION, LEAST_FLUCTUATION = 2e-3, 1e-6  # of a coefficient, relative to 2 pi a period
CONTINUOUS = 1e-4  # jump between parts of a stretch, relative to each state
FLUCTUATING_PASSES, VARIANCE_PASSES = 4, 5  # of the fit, and of the variances in each
# Share of the logarithm of misfit over noise, of the whole library, summed over the channels.
# Measured: fluctuations explain 0.56 or more of it where gusts are all that the library lacks, 0.32
# to 0.50 on a line with more modes in the same gusts, of which the terms that are then chosen
# imitate the modes, and 0.06 or less without gusts.
EXPLAINED = 0.53

# Selection.
# Added to the diagonal of an information matrix with unit diagonal so that it can be factored:
# a few roundings. It moves a chi^2 by 1e-15 |c|^2, by 0.1 for c of 1e7 in its unit.
RIDGE = 1e-15
# Share of a term's length that a support does not imitate, below which rounding makes it up:
# the length squared of what is left of it after terms of length one with relative errors of a
# few 1e-6 from the integration (TRUNCATION and the sums of it) were taken away.
IMITATED = 1e-9
# The same for the second of two terms that are added together, in share of the determinant.
DEPENDENT = 1e-6

# Rate at which the best of all terms without effect is as plausible as its absence. Measured on 240
# fits to random lines (seed 20261122): with it, supports are right as often as their weights say;
# of models that others outweigh by 0.05 to 0.5, 10 of 35 hold a false term where 7 are expected.
CHANCE = 0.1
# Weight that the plausible supports without one of the terms found may have together: at most one
# in fifty of all models that are `ok` holds a false term. Measured on 982 fits to random lines
# (seed 314159): 11 of 692 hold a false term; with 0.3 it would be 17 of 711.
MOST_RIVAL_WEIGHT = 0.2
# Limit of a term as simple as the simplest of its equation, as a share of that equation, from which
# a model without the term is not `ok`. Measured (seed 777001), the prior always heard: of Lorenz in
# the settings of `trials.published` 140 of 178 models would be `ok` without it, of which 29 lack a
# term or have a false one; with 0.4, 107 and 2, with 0.25, 89 and none. Of a cubic oscillator with
# 40 % noise 5 of 6, all wrong; with 0.4 one, with 0.25 none. Of ten published systems 94 of 97
# sound ones stay, of random lines all 38.
SIZEABLE = 0.25
# Fall of chi^2 from which the prior does not speak against a plausible support of more terms.
# Measured (seed 777001) on 248 fits to random lines and 87 exact models of Lorenz whose every term
# is clear: 3 are `ok` and wrong, 57 are `ok`; were the prior always heard 9 and 74, never 2 and 24.
CLEARLY = 3.0
# Rate at which noise alone raises a doubt about a model that lacks no term, over all terms that
# could be added and over all pairs of them.
FALSE_DOUBT_RATE = 0.001  # with 0.005, 55 of 1,000 models were doubted for it alone, 5 wrong
# Rate at which an absent term of the size of its stated limit would not have been selected.
MISS_RATE = 0.01

# Share of the plausible supports that may put a coefficient beyond four unconditional errors.
TAIL = 0.01

# How many supports are weighed, and of how many beside the selected one all small changes are
# looked at. Measured: with 60 in place of 150, 1 % of the intervals fail that hold with 150.
CHANGES = 150
EXPANDED = 4

# Residuals. Rate at which white noise raises an objection by the highest of all its spectral
# lines, and the number of standard deviations for the tests by a sum: the same rate, rounded up.
RESIDUAL_RATE = 1e-6
SPREADS = 5.0
# Bins on each side of a spectral line that its height is measured against: their mean has a
# relative spread of a fifth.
NEIGHBOURS = 15
# chi^2 per degree of freedom from which noise is said to be correlated over a few samples: a model
# error that large is refused by its own spectrum.
COLOURED = 2.0
# How many times the power of the noise between the motion's frequencies may rise at them; intervals
# widen by its root. Noise correlated over a period, which cannot be told from the motion, has more.
MOST_COLOUR = 2.0
# Residuals relative to a channel below which they are truncation (1e-7) and rounding.
ROUNDING = 1e-5
# Noise of a derivative relative to its size below which rounding is not weighed as noise.
SMALLEST_RATE_NOISE = 1e-7

# Segments and chains.
UNDETERMINED = 3e-7  # relative singular value below which a direction of a state is not solved for
# A chain of growth G gives an information matrix of condition G^2 or more: with rounding of
# 1e-16, what it says about a term is known better than IMITATED where G^2 < IMITATED / 1e-16.
GROWTH = 2e3

# Faults of the instrument.
# Probability that a recording without any fault is accused of one.
FALSE_FAULT_RATE = 5e-3
# Segments joined into one free stretch in the tests for unknown forces: a force that comes and
# goes shows in short stretches, a phase that wanders in long ones.
STRETCHES = (1, 2, 4)
# Share of a parameter's information, of what it has alone, that the terms must leave it.
DISTINCT = 1e-6
# z from which terms are looked for that only imitate a fault; a sound recording has one a few
# times in a hundred, which costs a pass of the fit and no more.
CURIOUS = 2.5
# Mean square, in units of the noise, below which residuals are rounding: exact data are given a
# least noise, and the projections' own estimate is never this far below the true one.
EXACT = 0.25
