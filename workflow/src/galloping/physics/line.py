"""The hanging line: sag, Irvine parameter and the first symmetric mode of a shallow cable."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import cos, pi, sin
from typing import Self

import numpy as np
from scipy.optimize import brentq

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(96)  # exact to rounding for these smooth modes


@dataclass(frozen=True)
class Line:
    """An iced bundle of n sub-conductors in one span; forces and stiffnesses of the whole bundle.

    mass: kg/m, tension: N, axial_stiffness (nEA): N, bending_stiffness (nEI): N m2, span: m,
    gravity: m/s2, spacer_mass: kg each, at spacer_positions: m.
    """

    mass: float
    tension: float
    axial_stiffness: float
    bending_stiffness: float
    span: float
    gravity: float
    spacer_mass: float
    spacer_positions: tuple[float, ...]

    @classmethod
    def from_case(cls, case: Mapping) -> Self:
        """The bundle of a `cases` section of the configuration."""
        n = case["bundle"]["subconductors"]
        conductor, line, spacers = case["conductor"], case["line"], case["spacers"]
        return cls(
            mass=n * conductor["mass"],
            tension=n * line["tension"],
            axial_stiffness=n * conductor["tensile_stiffness"],
            bending_stiffness=n * conductor["bending_stiffness"],
            span=line["span"],
            gravity=case["gravity"],
            spacer_mass=spacers["mass"],
            spacer_positions=tuple(spacers["positions"]),
        )

    @property
    def sag(self) -> float:
        """Mid-span sag of the parabola, m."""
        return self.mass * self.gravity * self.span**2 / (8 * self.tension)

    @property
    def irvine_parameter(self) -> float:
        """lambda^2, the ratio of the stiffness by sag to the stiffness by tension (Irvine 1981)."""
        stretch = (self.mass * self.gravity * self.span / self.tension) ** 2
        return stretch * self.axial_stiffness / self.tension

    def static_curvature(self) -> float:
        """y'' of the parabola, 1/m."""
        return self.mass * self.gravity / self.tension


def irvine_root(irvine_parameter: float) -> float:
    """Dimensionless frequency x of the first symmetric in-plane mode, pi < x < 3 pi.

    Root of tan(x/2) = x/2 - (4/lambda^2)(x/2)^3 (Irvine 1981), written without its poles.
    """

    def characteristic(z: float) -> float:
        return sin(z) - cos(z) * (z - 4 * z**3 / irvine_parameter)

    return 2 * brentq(characteristic, pi / 2, 3 * pi / 2, xtol=1e-15, rtol=1e-15)


@dataclass(frozen=True)
class Mode:
    """A mode shape at the quadrature nodes of the span and at the spacers.

    shape, slope, curvature: (n_nodes,), 1, 1/m, 1/m2. at_spacers: (n_spacers,).
    """

    shape: np.ndarray
    slope: np.ndarray
    curvature: np.ndarray
    at_spacers: np.ndarray


def positions(span: float) -> np.ndarray:
    """Quadrature nodes along the span, m."""
    return span * (_NODES + 1) / 2


def weights(span: float) -> np.ndarray:
    """Weights of the quadrature at `positions`, m."""
    return _WEIGHTS * span / 2


def integrate(values: np.ndarray, span: float) -> float:
    """<f>, the integral over the span of values at `positions`."""
    return float(values @ _WEIGHTS) * span / 2


def sine_mode(line: Line) -> Mode:
    """sin(pi s / l)."""
    k = pi / line.span
    s = positions(line.span)
    spacers = np.asarray(line.spacer_positions, dtype=float)
    return Mode(np.sin(k * s), k * np.cos(k * s), -(k**2) * np.sin(k * s), np.sin(k * spacers))


def irvine_mode(line: Line) -> Mode:
    """First symmetric in-plane mode of a shallow sagging cable, scaled to 1 at mid-span.

    1 - tan(x/2) sin(x s/l) - cos(x s/l) written about mid-span, where it has no pole.
    """
    x = irvine_root(line.irvine_parameter)
    k, edge = x / line.span, cos(x / 2)
    scale = 1 / (1 - edge)
    u = k * (positions(line.span) - line.span / 2)
    at_spacers = np.cos(k * (np.asarray(line.spacer_positions, dtype=float) - line.span / 2))
    return Mode(
        scale * (np.cos(u) - edge),
        -scale * k * np.sin(u),
        -scale * k**2 * np.cos(u),
        scale * (at_spacers - edge),
    )


MODES = {"irvine": irvine_mode, "sine": sine_mode}
