"""How probable a set of terms (support) is before any data: written down, not left to a penalty.

Terms are there or not independently of each other. A term of at most the first degree has the odds
`term` for it, one of each further degree `degree` times those of the degree below: among models
that data cannot tell apart, the simpler one. Degrees and odds have no unit, so neither the choice
nor the verdict depends on those of the recording.

With the likelihood the prior makes the evidence of a support. The integral over the coefficients of
a term costs ln N in units of chi^2 for N samples, where the data tell it, for a prior of them that
is worth one sample (R. E. Kass and L. Wasserman, J. Am. Stat. Assoc. 90, 1995, after G. Schwarz,
Ann. Stat. 6, 1978). So the support is chosen by the least

    chi^2 + sum over its terms of [ln N - 2 ln term - 2 (d - 1) ln degree],  d: degree, at least 1.

The two odds were calibrated on recordings of seeds that report nothing (seed 777001): Lorenz in the
settings of `galloping.trials.published`, 178 recordings, 89 exact without a prior; with a price of
ln N + 2 and a further 0, 3, 4.5 and 6 for each degree 94, 132, 141 and 142 are, with ln N and
ln N + 4 at 4.5 141 and 135. Of 100 recordings of ten published systems 94, 98, 99 and 99 are (98),
with ln N at 4.5 96, and of 48 of random lines 28 to 30 with any of them (29). 1 to 3 and a tenth
are 2.2 and 4.6.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Prior:
    """Odds of the terms of a library before any data.

    term: odds of one of at most the first degree. degree: what each further degree multiplies them
    by. Raises ValueError where either is not in (0, 1].
    """

    term: float = 1.0 / 3.0
    degree: float = 1.0 / 10.0

    def __post_init__(self) -> None:
        for name in ("term", "degree"):
            value = getattr(self, name)
            if not isinstance(value, int | float) or not 0.0 < value <= 1.0:
                raise ValueError(f"prior: {name}: {value!r:.60}; must be a number in (0, 1]")

    def of_degrees(self, degrees: NDArray[np.int_]) -> NDArray[np.float64]:
        """How much dearer than a term of the first degree they are, (n,)."""
        return -2.0 * np.log(self.degree) * np.maximum(degrees - 1, 0)


def costs(prior: Prior | None, degrees: NDArray[np.int_], penalty: float) -> NDArray[np.float64]:
    """(n,) what terms of such degrees have to bring, in units of chi^2, to be chosen.

    penalty: 2 ln N. Without a prior all of it, so that what noise makes up is kept out.
    """
    if prior is None:
        return np.full(len(degrees), penalty)
    return penalty / 2.0 - 2.0 * np.log(prior.term) + prior.of_degrees(degrees)
