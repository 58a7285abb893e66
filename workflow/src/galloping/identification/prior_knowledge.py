"""Prior knowledge of the terms of a model and of single coefficients."""

from collections.abc import Iterator
from dataclasses import dataclass
from numbers import Real

import numpy as np
from numpy.typing import NDArray

from galloping.model.polynomial import Exponents
from galloping.model.terms import Bounds, Known


@dataclass(frozen=True)
class Prior:
    """Prior odds that terms are present in an equation, by kind of term.

    Terms are present or absent independently of each other. Degrees and odds have no unit, so that
    neither the selection nor the status depends on the units of the recording. The odds were
    calibrated on recordings with seeds that report no result (docs/identification_parts.csv).

    Parameters
    ----------
    term : float
        Odds of a linear term.
    constant : float
        Odds of a constant, the simplest term.
    nonlinear : float
        Factor on the odds of a linear term for a nonlinear term. A constant in the equation of a
        velocity has this factor twice, because displacements count from rest.
    power : float
        Factor for each power of an input in a term. It decides between terms that fit equally well,
        for example at a single value of the input.

    Raises
    ------
    ValueError
        If one of the odds is not in (0, 1].

    Notes
    -----
    The likelihood and the prior give the evidence of a support. The integral over a coefficient
    that the data determine costs ln N in units of chi^2 for N samples of all channels, if the prior
    of the coefficient has the information of one sample (Kass and Wasserman, after Schwarz). The
    support therefore minimises

        chi^2 + sum over its terms of [ln N - 2 ln odds].

    For accurate data, this prior is narrower than the range that the motion leaves to a constant or
    a linear term. Let w be the coefficient with which such a term alone would make up its equation,
    and s its standard error. If w / s is larger than the root of N, a prior of width w is used: it
    costs 2 ln(w / s) instead of ln N, but no more than a nonlinear term does. Without this rule,
    false constants and linear terms would be as frequent in accurate data as in noisy data. Linear
    terms in the equation of a velocity are excepted, because the net damping of a line is small.

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

    def penalties(
        self, complexity: NDArray[np.int_], powers: NDArray[np.int_]
    ) -> NDArray[np.float64]:
        """Compute penalties (n,) of terms on chi^2, relative to the penalty of a linear term.

        complexity: (n,) of `Problem.term_complexity`. powers: (n,) number of powers of inputs.
        """
        nonlinear = -2.0 * np.log(self.nonlinear) * complexity
        penalties = np.where(complexity < 0, 2.0 * np.log(self.term / self.constant), nonlinear)
        return penalties - 2.0 * np.log(self.power) * powers


PRIOR = Prior()
MAX_VALUE = 1e100  # largest size of a mean or deviation of a coefficient: its square is finite
# Least standard deviation of a coefficient, relative to its mean. Smaller ones are rounding.
MIN_RELATIVE_DEVIATION = 1e-9


@dataclass(frozen=True)
class Coefficient:
    """Prior knowledge of one coefficient: a Gaussian prior, a fixed value or bounds.

    In the unit of the coefficient.

    Parameters
    ----------
    state : str
        State in whose equation the coefficient is.
    term : Exponents
        Exponents of its term, and functions.
    mean, deviation : float
        Of its Gaussian prior; a deviation of zero fixes the coefficient. Without a mean there is no
        Gaussian prior.
    lower, upper : float
        Bounds; a term whose bounds exclude zero is always present.

    Raises
    ------
    ValueError
        If the term is no tuple, mean or deviation are not finite or too large to be squared, the
        deviation is negative or so small that it fixes the coefficient, no number is between the
        bounds, or nothing is known.
    """

    state: str
    term: Exponents
    mean: float | None = None
    deviation: float = 0.0
    lower: float = -np.inf
    upper: float = np.inf

    def __post_init__(self) -> None:
        if not isinstance(self.term, tuple):
            raise ValueError(f"coefficient: term: {self.term!r:.60}; must be a tuple of exponents")
        mean = 0.0 if self.mean is None else self.mean
        for name, value, lowest in (("mean", mean, -MAX_VALUE), ("deviation", self.deviation, 0.0)):
            if not isinstance(value, int | float) or not lowest <= value <= MAX_VALUE:
                kind = "a number from 0" if name == "deviation" else "a number"
                raise ValueError(
                    f"coefficient: {name}: {value!r:.60}; must be {kind} up to {MAX_VALUE:g}"
                )
        least = max(MIN_RELATIVE_DEVIATION * abs(mean), 1.0 / MAX_VALUE)
        if 0.0 < self.deviation < least:
            raise ValueError(
                f"coefficient: deviation: {self.deviation!r:.60}; must be 0, which fixes it, or at "
                f"least {least:.2g}"
            )
        are_numbers = isinstance(self.lower, Real) and isinstance(self.upper, Real)
        if not are_numbers or not self.lower < self.upper:
            ends = f"{self.lower!r:.60}, {self.upper!r:.60}"
            raise ValueError(f"coefficient: lower, upper: {ends}; must be numbers that increase")
        if self.mean is None and not self.is_bounded:
            raise ValueError("coefficient: must have a mean or a bound")

    @property
    def is_bounded(self) -> bool:
        """Whether the coefficient has a lower or an upper bound."""
        return self.lower > -np.inf or self.upper < np.inf


def as_coefficients(known: Known | Bounds) -> Iterator[Coefficient]:
    """Yield a `Coefficient` for each coefficient that known terms or bounds describe."""
    if isinstance(known, Bounds):
        yield Coefficient(known.state, known.term, lower=known.lower, upper=known.upper)
    else:
        for term, mean in known.terms.items():
            yield Coefficient(known.state, term, mean, known.deviation or 0.0)
