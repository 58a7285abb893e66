"""Prior knowledge of the terms of a model and of single coefficients."""

from collections.abc import Iterator
from dataclasses import dataclass
from math import isfinite

import numpy as np
from numpy.typing import NDArray

from galloping.model.polynomial import Exponents
from galloping.model.terms import Bounds, Known


@dataclass(frozen=True)
class Prior:
    """Prior odds of the terms of a model.

    Terms are present independently of each other. Among models that data cannot distinguish, these
    odds prefer the simpler one. They have no unit, so neither the choice nor the status depends on
    the units of the recording.

    With the likelihood the prior gives the evidence of a support. The integral over the coefficient
    of a term adds ln N in units of chi^2 for N samples of all channels (in `derivative_fit` of its
    equation's derivative), if the data determine the coefficient, for a prior of it with the
    information of one sample (unit information; Kass and Wasserman, after Schwarz). The selected
    support has the least

        chi^2 + sum over its terms of [ln N - 2 ln odds].

    If noise is small, a prior with the information of one sample is narrower than the range of
    possible coefficients: up to w, at which a term alone would balance its equation (that of the
    weak form). If the data determine the coefficient of a constant or linear term with a standard
    error s, and w / s is larger than the root of N, the integral over a prior as wide as w adds 2
    ln(w / s) in place of ln N; a term is removed that reaches neither this penalty nor that of a
    nonlinear term. Without this rule as many false terms were selected with small noise as with
    large noise. In the equation of the rate of a displacement the penalty of linear terms stays
    low, since the net damping of a line is small.

    The odds were calibrated on recordings of seeds that report nothing, and the effect of each rule
    was counted on others (docs/identification_parts.csv).

    Parameters
    ----------
    term : float
        Odds of a linear term.
    constant : float
        Odds of a constant, the simplest of all.
    nonlinear : float
        Factor on the odds of a linear term, for a nonlinear one. It applies twice to a constant in
        the equation of the rate of a displacement, which is measured from the equilibrium.
    power : float
        Factor for each power of an input by which a term is multiplied or divided: it decides
        between terms that fit alike, such as those of a motion at one value of the input.

    Raises
    ------
    ValueError
        If one of the odds is not in (0, 1].

    References
    ----------
    - R. E. Kass and L. Wasserman, J. Am. Stat. Assoc. 90, 1995.
    - G. Schwarz, Ann. Stat. 6, 1978.
    """

    term: float = 1.0 / 3.0
    constant: float = 0.6
    nonlinear: float = 1.0 / 20.0
    power: float = 0.8

    def __post_init__(self) -> None:
        for name in ("term", "constant", "nonlinear", "power"):
            value = getattr(self, name)
            if not isinstance(value, int | float) or not 0.0 < value <= 1.0:
                raise ValueError(f"prior: {name}: {value!r:.60}; must be a number in (0, 1]")

    def prices(self, complexity: NDArray[np.int_], powers: NDArray[np.int_]) -> NDArray[np.float64]:
        """Compute the penalty of terms, (n,), less that of a linear term.

        complexity: (n,) of `Problem.term_complexity`. powers: (n,) number of powers of inputs.
        """
        dearer = -2.0 * np.log(self.nonlinear) * complexity
        simple = np.where(complexity < 0, 2.0 * np.log(self.term / self.constant), dearer)
        return simple - 2.0 * np.log(self.power) * powers


PRIOR = Prior()
LARGEST = 1e100  # of what is known of a coefficient: squares are finite
SMALLEST = 1e-9  # deviation of what is known, in its mean: less is rounding


@dataclass(frozen=True)
class Coefficient:
    """Prior knowledge of one coefficient, in the coefficient's unit.

    Parameters
    ----------
    state : str
        In whose equation the coefficient is.
    term : Exponents
        Exponents of its term, and functions.
    mean, deviation : float
        Of its Gaussian prior; a deviation of zero fixes the coefficient. Without a mean there is no
        such prior.
    lower, upper : float
        Bounds; a coefficient whose bounds are on one side of zero is always present.

    Raises
    ------
    ValueError
        If mean or deviation are not finite or beyond what can be squared, the deviation is below
        zero or so small that it fixes the coefficient, no number is between the bounds, or nothing
        is known.
    """

    state: str
    term: Exponents
    mean: float | None = None
    deviation: float = 0.0
    lower: float = -np.inf
    upper: float = np.inf

    def __post_init__(self) -> None:
        for name in ("mean", "deviation"):
            value = getattr(self, name)
            sound = isinstance(value, int | float) and isfinite(value) and abs(value) <= LARGEST
            sound = sound or (name == "mean" and value is None)
            if not sound or (name == "deviation" and value < 0.0):
                allowed = "a number" + (" from 0" if name == "deviation" else "")
                raise ValueError(
                    f"coefficient: {name}: {value!r:.60}; must be {allowed} up to {LARGEST:g}"
                )
        least = max(SMALLEST * abs(self.mean or 0.0), 1.0 / LARGEST)
        if 0.0 < self.deviation < least:
            raise ValueError(
                f"coefficient: deviation: {self.deviation!r:.60}; must be 0, which fixes it, or at "
                f"least {least:.2g}"
            )
        if not self.lower < self.upper:
            ends = f"{self.lower!r:.60}, {self.upper!r:.60}"
            raise ValueError(f"coefficient: lower, upper: {ends}; must be numbers that increase")
        if self.mean is None and not self.is_bounded:
            raise ValueError("coefficient: must have a mean or a bound")

    @property
    def is_bounded(self) -> bool:
        """Whether the coefficient has a bound."""
        return self.lower > -np.inf or self.upper < np.inf


def as_coefficients(known: Known | Bounds) -> Iterator[Coefficient]:
    """Yield prior knowledge of single coefficients, as arguments of an identification."""
    if isinstance(known, Bounds):
        yield Coefficient(known.state, known.term, lower=known.lower, upper=known.upper)
    else:
        for term, mean in known.terms.items():
            yield Coefficient(known.state, term, mean, known.deviation or 0.0)
