"""How much room a galloping span needs: the design ellipses of practice, and orbits beside them.

All lengths are in metres; formulas that their sources print in feet are converted inside. An
ellipse stands upright at mid-span (major axis vertical); sag is that of the iced line at rest.
"""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from math import log, sqrt

import numpy as np

from galloping.physics.line import Line

FOOT = 0.3048  # m


@dataclass(frozen=True)
class Ellipse:
    """Major (vertical) and minor axis, and how far the lowest point lies below rest, all in m."""

    major: float
    minor: float
    below: float

    def outline(self, points: int = 400) -> np.ndarray:
        """(points, 2) places (w, v) about the rest position at mid-span, in m."""
        angle = 2 * np.pi * np.arange(points) / points
        centre = self.major / 2 - self.below
        return np.column_stack(
            [self.minor / 2 * np.cos(angle), centre + self.major / 2 * np.sin(angle)]
        )


def davison(sag: float) -> Ellipse:
    """Single-loop galloping (Davison, as in RUS Bulletin 1724E-200, ch. 6).

    In feet: major 1.25 S + 1, minor 0.4 of it, lowest point 0.25 S below rest.
    """
    _positive(sag=sag)
    s = sag / FOOT
    major = 1.25 * s + 1
    return Ellipse(major * FOOT, 0.4 * major * FOOT, 0.25 * s * FOOT)


def toye(span: float, sag: float) -> Ellipse:
    """Double-loop galloping of long spans (Toye, as in RUS Bulletin 1724E-200, ch. 6).

    In feet, a = sqrt((L/2)^2 + S^2): major 1 + sqrt(3a/8 (L + 8 S^2/(3 L) - 2a)), minor
    2 sqrt(major - 1), lowest point 0.2 of the major below rest.
    """
    _positive(span=span, sag=sag)
    length, s = span / FOOT, sag / FOOT
    a = sqrt((length / 2) ** 2 + s**2)
    slack = length + 8 * s**2 / (3 * length) - 2 * a
    major = 1 + sqrt(3 * a / 8 * slack)
    return Ellipse(major * FOOT, 2 * sqrt(major - 1) * FOOT, 0.2 * major * FOOT)


def cigre(sag: float, diameter: float, bundle: bool) -> Ellipse:
    """CIGRE Technical Brochure 322 (2007), from observed events, for single conductors and bundles.

    diameter: of one conductor, m. Major 80 d ln(8 S/(50 d)), of bundles 170 d ln(8 S/(500 d));
    minor 0.4 and lowest point 0.3 of it. Raises ValueError where the sag is too small for the
    formula.
    """
    _positive(sag=sag, diameter=diameter)
    factor, scale = (170, 500) if bundle else (80, 50)
    if 8 * sag <= scale * diameter:
        raise ValueError(
            f"sag: {sag:g} m is too small for the formula of CIGRE 322; "
            f"must be > {scale * diameter / 8:g} m for conductors of {diameter:g} m"
        )
    major = factor * diameter * log(8 * sag / (scale * diameter))
    return Ellipse(major, 0.4 * major, 0.3 * major)


def _positive(**lengths: float) -> None:
    for name, value in lengths.items():
        if not value > 0:
            raise ValueError(f"{name}: {value:g} m must be > 0")


def design_ellipses(case: Mapping) -> dict[str, Ellipse]:
    """The ellipses of a case, without that of CIGRE 322 where the sag is too small for it.

    A conductor's diameter is the bundle's dimension by number.
    """
    sag, count = Line.from_case(case).sag, case["bundle"]["subconductors"]
    found = {"Davison": davison(sag), "Toye": toye(case["line"]["span"], sag)}
    with suppress(ValueError):
        found["CIGRE 322"] = cigre(sag, case["bundle"]["dimension"] / count, bundle=count > 1)
    return found


def envelope(orbit: np.ndarray) -> tuple[float, float, float]:
    """Height, width and lowest point below rest, in m, of an orbit (n, 2) of places (w, v)."""
    width, height = np.ptp(orbit, axis=0)
    return float(height), float(width), float(max(0.0, -np.min(orbit[:, 1])))


def clearance(first: np.ndarray, second: np.ndarray, distance: tuple[float, float]) -> float:
    """Least distance of two galloping spans at mid-span, where their modes are largest, m.

    Whatever their phases in time; zero where the orbits cross. first, second: (n, 2) places (w, v)
    of each over one period, closed, in m. distance: (horizontal, vertical) from the first to the
    second at rest, m.
    """
    second = second + np.asarray(distance, float)
    if _cross(first, second):
        return 0.0
    return min(_to_edges(first, second), _to_edges(second, first))


def _to_edges(points: np.ndarray, polygon: np.ndarray) -> float:
    edge = np.roll(polygon, -1, axis=0) - polygon
    offset = points[:, np.newaxis] - polygon
    square = np.maximum(np.sum(edge**2, axis=1), 1e-300)
    along = np.clip(np.sum(offset * edge, axis=2) / square, 0, 1)
    return float(np.min(np.linalg.norm(offset - along[..., np.newaxis] * edge, axis=2)))


def _cross(first: np.ndarray, second: np.ndarray) -> bool:
    """Whether an edge of one closed polygon crosses an edge of the other."""

    def side(start, end, point):
        a, b = end - start, point - start
        return np.sign(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])

    a, b = first[:, np.newaxis], np.roll(first, -1, axis=0)[:, np.newaxis]
    c, d = second[np.newaxis], np.roll(second, -1, axis=0)[np.newaxis]
    between = side(a, b, c) * side(a, b, d) < 0
    return bool(np.any(between & (side(c, d, a) * side(c, d, b) < 0)))
