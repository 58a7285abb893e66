"""The constants of selection and verdict, each with where it comes from.

"Measured" means on 146 fits to random lines (seed 501, `galloping.trials.random_lines`).
"""

from __future__ import annotations

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
# in twenty of the models that are just `ok` holds a false term, and far fewer of all.
FALSE_TERM_RATE = 0.05
# Rate at which noise alone raises a doubt about a model that lacks no term, over all terms that
# could be added and over all pairs of them.
FALSE_DOUBT_RATE = 0.005
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
FALSE_ALARM = 5e-3
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
