"""Measures against galloping, as changes of a case, and the space of a galloping span.

The line keeps its two modes: a measure changes its supports, masses or aerodynamics, and the
derivation of the model is repeated. All lengths are in metres; formulas that their sources print in
feet are converted inside. An ellipse is upright at mid-span (major axis vertical); sag is that of
the iced line at rest.
"""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from math import log, sqrt

import numpy as np

from galloping.line.galerkin import Line, make_mode_shapes

EPRI = "EPRI, Transmission Line Reference Book: Wind-Induced Conductor Motion (2009), ch. 4"
CIGRE = "CIGRE Technical Brochure 322 (2007)"


@dataclass(frozen=True)
class Measure:
    """Measure against galloping, such as a damper, as a change of an overhead line's parameters.

    label: in words, with its size. change: of the case. damping: viscous dampers to earth, pairs of
    a place on the span (m) and a coefficient (N s/m). masses: added point masses, pairs of a place
    (m) and a mass (kg). source: of the physical model. limit: limitation of the model, or ''.
    """

    label: str
    change: Callable[[Mapping], Mapping] = lambda case: case
    damping: Sequence[tuple[float, float]] = ()
    masses: Sequence[tuple[float, float]] = ()
    source: str = EPRI
    limit: str = ""


NO_MEASURE = Measure("as it is")


def tension(factor: float) -> Measure:
    """Make the measure against galloping that multiplies the tension by a factor.

    More tension makes the line stiffer, with less sag and another frequency ratio.
    """
    word = "more" if factor > 1 else "less"

    def change(case: Mapping) -> dict:
        return {**case, "line": {**case["line"], "tension": factor * case["line"]["tension"]}}

    return Measure(f"{100 * abs(factor - 1):.3g}% {word} tension", change)


def damper(position: float, coefficient: float) -> Measure:
    """Make the measure against galloping that adds a viscous damper to earth at a point.

    Modal damping is c phi(s)^2; mode shapes are kept.
    """
    label = f"damper of {coefficient:g} N s/m at {position:g} m"
    return Measure(label, damping=((position, coefficient),))


def spacers(mass: float, positions: Sequence[float]) -> Measure:
    """Make the measure against galloping that replaces the spacers by others.

    Their mass lowers both frequencies.
    """
    label = f"spacers of {mass:g} kg at {', '.join(f'{p:g}' for p in positions)} m"
    new = {"mass": mass, "positions": list(positions)}
    return Measure(label, lambda case: {**case, "spacers": new}, source=CIGRE)


def pendulum(mass: float, positions: Sequence[float]) -> Measure:
    """Make the measure against galloping that adds detuning pendulums, as masses alone."""
    return Measure(
        f"pendulums of {mass:g} kg, mass alone",
        masses=tuple((position, mass) for position in positions),
        source=CIGRE,
        limit="detuning of torsion, the purpose of a pendulum, is not in a model without torsion",
    )


def ice_removal() -> Measure:
    """Create the countermeasure to galloping that removes the ice, and so the aerodynamic lift."""
    bare = {"reading": "custom", "vertical": [0.0, 0.0, 0.0], "horizontal": [0.0, 0.0, 0.0]}
    return Measure("ice removed", lambda case: {**case, "ice": bare}, source=CIGRE)


MEASURE_KINDS = {kind.__name__: kind for kind in (tension, damper, spacers, pendulum, ice_removal)}


def typical_measures(case: Mapping) -> tuple[Measure, ...]:
    """List measures against galloping of usual size for an overhead line, such as more tension.

    Other spacers are included if the line has any.
    """
    span, mass = case["line"]["span"], case["spacers"]["mass"]
    positions = case["spacers"]["positions"]
    digits = 0 if span > 9.0 else 3  # whole metres, unless these are no ninths of the span
    thirds = [round(share * span, digits) for share in (2 / 9, 4 / 9, 7 / 9)]
    others = (spacers(4 * mass, positions), spacers(mass, thirds)) if mass and positions else ()
    return (
        tension(1.2),
        tension(0.8),
        damper(round(0.1 * span, 3), 200.0),
        *others,
        pendulum(20.0, thirds),
        ice_removal(),
    )


def added_damping_and_mass(case: Mapping, applied: Measure) -> tuple[np.ndarray, np.ndarray]:
    """Compute the damping (N s/m) and mass (kg) that a measure adds to each of the two modes.

    Returns two arrays (2,), vertical and horizontal. Raises ValueError for a place outside the
    span.
    """
    line = Line.from_case(case)
    damping, mass = np.zeros(2), np.zeros(2)
    for total, points in ((damping, applied.damping), (mass, applied.masses)):
        for position, value in points:
            if not 0 < position < line.span:
                raise ValueError(
                    f"{applied.label}: position {position:g} m must be inside the span "
                    f"(0..{line.span:g} m)"
                )
            at = make_mode_shapes(case, replace(line, spacer_positions=(position,)))
            total += [value * float(mode.at_spacers[0]) ** 2 for mode in at]
    return damping, mass


FOOT = 0.3048  # length of a foot, m


@dataclass(frozen=True)
class Ellipse:
    """Ellipse that encloses the motion of a galloping span, by its axes and lowest point (m).

    major: vertical axis. minor: horizontal axis. below: depth of the lowest point below rest.
    """

    major: float
    minor: float
    below: float

    def outline(self) -> np.ndarray:
        """Compute 400 points (m) on the ellipse, relative to the rest position at mid-span.

        Returns (400, 2), horizontal and vertical.
        """
        angle = 2 * np.pi * np.arange(400) / 400
        centre = self.major / 2 - self.below
        return np.column_stack(
            [self.minor / 2 * np.cos(angle), centre + self.major / 2 * np.sin(angle)]
        )


def davison(sag: float) -> Ellipse:
    """Compute Davison's design ellipse of single-loop galloping from the sag of a span.

    The source is RUS Bulletin 1724E-200, ch. 6. In feet: major 1.25 S + 1, minor 0.4 of it, lowest
    point 0.25 S below rest.
    """
    s = sag / FOOT
    major = 1.25 * s + 1
    return Ellipse(major * FOOT, 0.4 * major * FOOT, 0.25 * s * FOOT)


def toye(span: float, sag: float) -> Ellipse:
    """Compute Toye's design ellipse of double-loop galloping from the length and sag of a span.

    The source is RUS Bulletin 1724E-200, ch. 6. In feet, a = sqrt((L/2)^2 + S^2): major 1 +
    sqrt(3a/8 (L + 8 S^2/(3 L) - 2a)), minor 2 sqrt(major - 1), lowest point 0.2 of the major below
    rest.
    """
    length, s = span / FOOT, sag / FOOT
    a = sqrt((length / 2) ** 2 + s**2)
    slack = length + 8 * s**2 / (3 * length) - 2 * a
    major = 1 + sqrt(3 * a / 8 * slack)
    return Ellipse(major * FOOT, 2 * sqrt(major - 1) * FOOT, 0.2 * major * FOOT)


def cigre(sag: float, diameter: float, bundle: bool) -> Ellipse:
    """Compute the design ellipse of CIGRE Technical Brochure 322 from sag and diameter.

    It is for single conductors and bundles. diameter: of one conductor, m. Major 80 d ln(8 S/(50
    d)), of bundles 170 d ln(8 S/(500 d)); minor 0.4 and lowest point 0.3 of it. Raises ValueError
    if the sag is too small for the formula.
    """
    factor, scale = (170, 500) if bundle else (80, 50)
    if 8 * sag <= scale * diameter:
        raise ValueError(
            f"sag: {sag:g} m is too small for the formula of CIGRE 322; "
            f"must be > {scale * diameter / 8:g} m for conductors of {diameter:g} m"
        )
    major = factor * diameter * log(8 * sag / (scale * diameter))
    return Ellipse(major, 0.4 * major, 0.3 * major)


def design_ellipses(case: Mapping) -> dict[str, Ellipse]:
    """Compute the design ellipses of a galloping line by several published formulas.

    That of CIGRE 322 is left out if the sag is too small for it. A conductor's diameter is the
    bundle's dimension by number.
    """
    sag, count = Line.from_case(case).sag, case["bundle"]["subconductors"]
    ellipses = {"Davison": davison(sag), "Toye": toye(case["line"]["span"], sag)}
    with suppress(ValueError):
        ellipses["CIGRE 322"] = cigre(sag, case["bundle"]["dimension"] / count, bundle=count > 1)
    return ellipses


def envelope(orbit: np.ndarray) -> tuple[float, float, float]:
    """Return height, width and depth below rest (m) of the orbit of a galloping span.

    orbit: (n, 2), horizontal and vertical places.
    """
    width, height = np.ptp(orbit, axis=0)
    return float(height), float(width), float(max(0.0, -np.min(orbit[:, 1])))


def clearance(first: np.ndarray, second: np.ndarray, distance: tuple[float, float]) -> float:
    """Compute the smallest distance (m) between the orbits of two galloping spans at mid-span.

    The phases of the motions are arbitrary; zero if the orbits cross. first, second: (n, 2) places
    (w, v) of each over one period, closed, in m. distance: (horizontal, vertical) from the first to
    the second at rest, m.
    """
    second = second + np.asarray(distance, float)
    if _has_crossing(first, second):
        return 0.0
    return min(_to_edges(first, second), _to_edges(second, first))


def _to_edges(points: np.ndarray, polygon: np.ndarray) -> float:
    edge = np.roll(polygon, -1, axis=0) - polygon
    offset = points[:, np.newaxis] - polygon
    square = np.maximum(np.sum(edge**2, axis=1), 1e-300)
    along = np.clip(np.sum(offset * edge, axis=2) / square, 0, 1)
    return float(np.min(np.linalg.norm(offset - along[..., np.newaxis] * edge, axis=2)))


def _has_crossing(first: np.ndarray, second: np.ndarray) -> bool:
    """Decide whether an edge of one closed polygon crosses an edge of the other."""

    def side(start, end, point):
        a, b = end - start, point - start
        return np.sign(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])

    a, b = first[:, np.newaxis], np.roll(first, -1, axis=0)[:, np.newaxis]
    c, d = second[np.newaxis], np.roll(second, -1, axis=0)[np.newaxis]
    between = side(a, b, c) * side(a, b, d) < 0
    return bool(np.any(between & (side(c, d, a) * side(c, d, b) < 0)))
