"""Inputs: what was measured beside the motion and drives it, such as the speed of the wind.

An input is a known function of time, made of its samples by an interpolant. A model multiplies
monomials of its states by factors, monomials of its inputs, whose exponents may be negative.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.polynomial.legendre import Legendre, legvander
from numpy.typing import ArrayLike, NDArray

from galloping.arrays import Immutable, floats, increasing, seconds

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline

BETWEEN = ("zero", "linear", "cubic")
# Times the median spacing of samples from which the time between two of them is a gap.
GAP = 4.5
# Points of the Gauss-Legendre quadrature between two knots: exact for products of a cubic and a
# polynomial of degree eight.
QUADRATURE = 6


@dataclass(frozen=True, eq=False, repr=False)
class Input(Immutable):
    """One measured input, a function of time.

    time: (m,) s, strictly increasing, on the clock of the recording. values: (m,), NaN where
    missing. between: what it is between samples: `zero`, as at the last one, `linear`, or `cubic`,
    a cubic spline, the default, for what was measured is mostly smooth on the scale of its
    sampling. error: relative standard deviation of an unknown constant factor on the values, such
    as that of a calibration.
    Raises ValueError for anything else, in one line.
    """

    time: NDArray[np.float64]
    values: NDArray[np.float64]
    between: str = "cubic"
    error: float = 0.0

    def __post_init__(self) -> None:
        time = increasing("input: time", seconds("input: time", self.time))
        values = floats("input: values", self.values, time.shape)
        if np.isinf(values).any():
            raise ValueError(f"input: values: {values[np.isinf(values)][0]:g}; must be finite")
        if np.isfinite(values).sum() < 2:
            raise ValueError("input: values: fewer than two are there")
        if self.between not in BETWEEN:
            raise ValueError(f"input: between: {self.between!r:.60}; must be {', '.join(BETWEEN)}")
        if not isinstance(self.error, int | float) or not 0.0 <= self.error < 1.0:
            raise ValueError(f"input: error: {self.error!r:.60}; must be a number in [0, 1)")
        object.__setattr__(self, "time", time)
        object.__setattr__(self, "values", values)
        super().__post_init__()

    def __repr__(self) -> str:
        gone = np.isnan(self.values).mean()
        return (
            f"Input: {len(self.time)} samples from {self.time[0]:.6g} to {self.time[-1]:.6g} s"
            f"{f' ({100 * gone:.2g} % missing)' if gone else ''}, {self.between} between them"
        )

    @cached_property
    def stretches(self) -> tuple[tuple[float, float], ...]:
        """First and last time, s, of each stretch of samples without a gap.

        A gap is a missing sample where the last one holds, else a time between samples longer than
        GAP of their median spacing.
        """
        return tuple((float(time[0]), float(time[-1])) for time, _ in self._pieces)

    @cached_property
    def _pieces(self) -> list[tuple[np.ndarray, np.ndarray]]:
        there = np.isfinite(self.values)
        time, values = self.time[there], self.values[there]
        if self.between == "zero":
            apart = np.diff(np.flatnonzero(there)) > 1
        else:
            steps = np.diff(time)
            apart = steps > GAP * np.median(steps)
        at = np.flatnonzero(apart) + 1
        pieces = zip(np.split(time, at), np.split(values, at), strict=True)
        return [piece for piece in pieces if len(piece[0]) > 1]

    def covered(self, time: ArrayLike) -> NDArray[np.bool_]:
        """(n,) whether each time lies in a stretch without a gap."""
        time = np.asarray(time, float)
        inside = np.zeros(time.shape, bool)
        for first, last in self.stretches:
            inside |= (time >= first) & (time <= last)
        return inside

    @cached_property
    def _splines(self) -> list[CubicSpline]:
        from scipy.interpolate import CubicSpline  # slow to import

        return [CubicSpline(*piece) for piece in self._pieces]

    def __call__(self, time: ArrayLike) -> NDArray[np.float64]:
        """(n,) values at those times, NaN where it is not covered."""
        time = np.asarray(time, float)
        found = np.full(time.shape, np.nan)
        for k, (at, values) in enumerate(self._pieces):
            inside = (time >= at[0]) & (time <= at[-1])
            if self.between == "zero":
                found[inside] = values[np.searchsorted(at, time[inside], side="right") - 1]
            elif self.between == "linear":
                found[inside] = np.interp(time[inside], at, values)
            else:
                found[inside] = self._splines[k](time[inside])
        return found


Factor = tuple[int, ...]


def at_times(inputs: Sequence[Input], time: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n, n_inputs) values of inputs at `time` (n,), NaN where not covered."""
    return np.stack([one(time) for one in inputs], axis=1) if inputs else np.empty((len(time), 0))


def windowed(
    inputs: Sequence[Input],
    factors: Sequence[Factor],
    start: float,
    step: float,
    windows: int,
    degree: int,
) -> NDArray[np.float64]:
    """Factors of the inputs as polynomials over windows of `step` s from `start`.

    factors: exponents of the inputs, each a monomial of them. Returns (windows, degree + 1,
    n_factors), coefficients of the powers of the time since a window's start over `step`: the
    polynomial of that degree that is nearest in the mean square (Legendre), so that what it leaves
    out moves the states at the window's end only by what their own motion has beyond that degree.
    A window's times outside of what an input covers take its nearest value.
    """
    found = np.zeros((windows, degree + 1, len(factors)))
    if not factors:
        return found
    edges = start + step * np.arange(windows + 1)
    knots = [one.time[(one.time > edges[0]) & (one.time < edges[-1])] for one in inputs]
    breaks = np.unique(np.concatenate([edges, *knots]))
    window = np.clip(np.searchsorted(edges, breaks[:-1], side="right") - 1, 0, windows - 1)
    points, weights = np.polynomial.legendre.leggauss(QUADRATURE)
    half = np.diff(breaks)[:, None] / 2.0
    time = breaks[:-1, None] + half * (1.0 + points)
    held = np.stack([extrapolated(one, time) for one in inputs])
    place = np.clip((time - edges[window][:, None]) / step, 0.0, 1.0)
    basis = legvander(2.0 * place - 1.0, degree) * (2 * np.arange(degree + 1) + 1.0)
    weighted = basis * (half * weights / step)[..., None]
    first = np.searchsorted(window, np.arange(windows))
    for k, factor in enumerate(factors):
        values = np.prod(held ** np.array(factor, float)[:, None, None], axis=0)
        moments = np.einsum("sp,spd->sd", values, weighted)
        found[:, :, k] = np.add.reduceat(moments, first) @ _powers(degree)
    return found


def extrapolated(one: Input, time: np.ndarray) -> np.ndarray:
    """Values at `time` (...), s, where it is not covered those at the nearest time that is."""
    ends = np.array(one.stretches)
    after = np.clip(np.searchsorted(ends[:, 0], time, side="right") - 1, 0, len(ends) - 1)
    later = np.minimum(after + 1, len(ends) - 1)
    last, following = ends[after, 1], ends[later, 0]
    nearest = np.where((time > last) & (following - time < time - last), following, last)
    inside = (time >= ends[after, 0]) & (time <= last)
    return one(np.where(inside, time, np.where(time < ends[0, 0], ends[0, 0], nearest)))


@cache
def _powers(degree: int) -> NDArray[np.float64]:
    """(degree + 1, degree + 1): shifted Legendre polynomials as rows of powers on [0, 1]."""
    rows = np.zeros((degree + 1, degree + 1))
    for k in range(degree + 1):
        own = Legendre.basis(k, domain=[0, 1]).convert(kind=np.polynomial.Polynomial).coef
        rows[k, : len(own)] = own
    return rows
