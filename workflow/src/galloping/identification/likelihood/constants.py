"""The constants of selection and verdict, each with where it comes from.

"Measured" means on 146 fits to random lines (seed 501, `galloping.trials.random_lines`).
"""

from __future__ import annotations

# Added to the diagonal of an information matrix with unit diagonal so that it can be factored:
# some hundred roundings. It moves a chi^2 by 1e-13 |c|^2, below 0.1 for c up to 1e6 of its unit.
RIDGE = 1e-13
# Share of a term's length that a support does not imitate, below which rounding makes it up:
# the square of the relative error 3e-5 of terms of length one after 1e-13 was added to each.
IMITATED = 1e-9
# The same for the second of two terms that are added together, in share of the determinant.
DEPENDENT = 1e-6

# Weight that the plausible supports without one of the terms found may have together: the stated
# rate at which an `ok` model holds a false term.
FALSE_TERM_RATE = 0.02
# Rate at which noise alone raises a doubt about a model that lacks no term, over all terms that
# could be added and over all pairs of them.
FALSE_DOUBT_RATE = 0.005
# Rate at which an absent term of the size of its stated limit would not have been selected.
MISS_RATE = 0.01

# How many of the cheapest changes of a support are looked at, and of how many of the best supports
# in turn. Measured: three times as many change no status and no interval by more than a tenth.
CHANGES = 60
EXPANDED = 4
