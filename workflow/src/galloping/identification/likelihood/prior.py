"""How probable a set of terms (support) is before any data: written down, not left to a penalty.

Terms are there or not independently of each other. A linear term has the odds `term` for it, a
constant, the simplest of all, the odds `constant`; a nonlinear term `nonlinear` times those of a
linear one, and a constant in the equation of the rate of a displacement, which counts from rest,
`nonlinear` twice: among models that data cannot tell apart, the simpler one. Degrees and odds have
no unit, so neither the choice nor the verdict depends on those of the recording.

With the likelihood the prior makes the evidence of a support. The integral over the coefficients of
a term costs ln N in units of chi^2 for N samples, where the data tell it, for a prior of them that
is worth one sample (R. E. Kass and L. Wasserman, J. Am. Stat. Assoc. 90, 1995, after G. Schwarz,
Ann. Stat. 6, 1978). So the support is chosen by the least

    chi^2 + sum over its terms of [ln N - 2 ln odds].

The odds were calibrated on recordings of seeds that report nothing. Lorenz in the settings of
`galloping.trials.published` (seed 777001), 178 recordings, 89 exact without a prior: with a price
of ln N + 2 and a further 0, 3, 4.5 and 6 for a nonlinear term 94, 132, 141 and 142 are, with ln N
and ln N + 4 at 4.5 141 and 135; 1 to 3 and a tenth are 2.2 and 4.6. Of the default study's lines
(seed 910213), where a constant and weak cubic terms imitate each other, 6 of 52 recordings were
exact with a tenth for each further degree and cheap constants, 17 are as it is; of ten systems 56
of 60 were and are. Roessler's system (seed 20261126), where x, y, z and a constant imitate each
other, was exact in 67 of 108 recordings, 3 of the others `ok`, with a constant as dear as a linear
term; with odds of 0.58 in 87, with even ones in 98, none of the others `ok`; Lorenz (20261127) in
231, 228 and 222 of 288; 36 systems in 319, and with even odds in 318, of 432.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Prior:
    """Odds of the terms of a library before any data.

    term: of a linear one. constant: of a constant. nonlinear: what the odds of a linear one are
    multiplied by for a nonlinear one, and twice for a constant beside a displacement. Raises
    ValueError where one of them is not in (0, 1].
    """

    term: float = 1.0 / 3.0
    constant: float = 0.6
    nonlinear: float = 1.0 / 10.0

    def __post_init__(self) -> None:
        for name in ("term", "constant", "nonlinear"):
            value = getattr(self, name)
            if not isinstance(value, int | float) or not 0.0 < value <= 1.0:
                raise ValueError(f"prior: {name}: {value!r:.60}; must be a number in (0, 1]")

    def of_complexity(self, complexity: NDArray[np.int_]) -> NDArray[np.float64]:
        """Price of terms of such `Problem.complexity` beyond that of linear terms, (n,)."""
        dearer = -2.0 * np.log(self.nonlinear) * complexity
        return np.where(complexity < 0, 2.0 * np.log(self.term / self.constant), dearer)


def costs(prior: Prior | None, complexity: NDArray[np.int_], penalty: float) -> NDArray[np.float64]:
    """(n,) what terms of such `Problem.complexity` have to bring, in units of chi^2, to be chosen.

    penalty: 2 ln N. Without a prior all of it, so that what noise makes up is kept out.
    """
    if prior is None:
        return np.full(len(complexity), penalty)
    return penalty / 2.0 - 2.0 * np.log(prior.term) + prior.of_complexity(complexity)
