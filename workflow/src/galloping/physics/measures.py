"""Measures against galloping, each as a change of a case with its physical model and source.

The line keeps its two modes: a measure changes what it hangs from, what it carries or what the
wind finds, and the derivation of the model is repeated.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from galloping.physics.galerkin import frequencies, modes
from galloping.physics.line import Line

EPRI = "EPRI, Transmission Line Reference Book: Wind-Induced Conductor Motion (2009), ch. 4"
CIGRE = "CIGRE Technical Brochure 322 (2007)"


@dataclass(frozen=True)
class Measure:
    """One change of a line.

    label: in words, with its size. change: of the case. damping: viscous dampers to earth, pairs
    of a place on the span (m) and a coefficient (N s/m). masses: added point masses, pairs of a
    place (m) and a mass (kg). source: of the physical model. limit: what the model cannot say, or
    ''.
    """

    label: str
    change: Callable[[Mapping], Mapping] = lambda case: case
    damping: Sequence[tuple[float, float]] = ()
    masses: Sequence[tuple[float, float]] = ()
    source: str = field(default=EPRI, kw_only=True)
    limit: str = field(default="", kw_only=True)


NOTHING = Measure("as it is")


def tension(factor: float) -> Measure:
    """Tension times a factor: stiffer, with less sag and another ratio of the frequencies."""
    _positive(factor=factor)
    word = "more" if factor > 1 else "less"

    def change(case: Mapping) -> dict:
        line = {**case["line"], "tension": factor * case["line"]["tension"]}
        return {**case, "line": line}

    return Measure(f"{abs(factor - 1):.0%} {word} tension", change)


def damper(position: float, coefficient: float) -> Measure:
    """A viscous damper to earth at a point: c phi(s)^2 of modal damping, mode shapes kept."""
    _positive(position=position, coefficient=coefficient)
    label = f"damper of {coefficient:g} N s/m at {position:g} m"
    return Measure(label, damping=((position, coefficient),))


def spacers(mass: float, positions: Sequence[float]) -> Measure:
    """Other spacers: their mass lowers both frequencies, each by its mode at their places."""
    _positive(mass=mass, **{"first position": min(positions, default=0.0)})
    label = f"spacers of {mass:g} kg at {', '.join(f'{p:g}' for p in positions)} m"
    new = {"mass": mass, "positions": list(positions)}
    return Measure(label, lambda case: {**case, "spacers": new}, source=CIGRE)


def pendulum(mass: float, positions: Sequence[float]) -> Measure:
    """Detuning pendulums: of them, this model knows the mass."""
    _positive(mass=mass)
    return Measure(
        f"pendulums of {mass:g} kg, mass alone",
        masses=tuple((position, mass) for position in positions),
        source=CIGRE,
        limit="detuning of torsion, the purpose of a pendulum, is not in a model without torsion",
    )


def ice_removal() -> Measure:
    """No ice: a round conductor has no lift that depends on the angle of attack."""
    bare = {"reading": "custom", "vertical": [0.0, 0.0, 0.0], "horizontal": [0.0, 0.0, 0.0]}
    return Measure("ice removed", lambda case: {**case, "ice": bare}, source=CIGRE)


KINDS = {
    "tension": tension,
    "damper": damper,
    "spacers": spacers,
    "pendulum": pendulum,
    "ice_removal": ice_removal,
}


def measure(kind: str, **settings: object) -> Measure:
    """A measure by the name of its kind. Raises ValueError for another name or setting."""
    if kind not in KINDS:
        raise ValueError(f"measure: {kind!r} must be one of {', '.join(KINDS)}")
    try:
        return KINDS[kind](**settings)
    except TypeError as error:
        raise ValueError(f"measure {kind}: {error}") from None


def usual(case: Mapping) -> tuple[Measure, ...]:
    """Measures of a size that practice uses, for a case; other spacers where it has any."""
    span, mass = case["line"]["span"], case["spacers"]["mass"]
    positions = case["spacers"]["positions"]
    thirds = [float(round(share * span)) for share in (2 / 9, 4 / 9, 7 / 9)]
    others = (spacers(4 * mass, positions), spacers(mass, thirds)) if mass and positions else ()
    return (
        tension(1.2),
        tension(0.8),
        damper(round(0.1 * span, 3), 200.0),
        *others,
        pendulum(20.0, thirds),
        ice_removal(),
    )


def added(case: Mapping, applied: Measure) -> tuple[np.ndarray, np.ndarray]:
    """Modal damping (N s/m) and mass (kg) that a measure adds to the vertical and the horizontal
    mode: two arrays (2,). Raises ValueError for a place outside the span."""
    line = Line.from_case(case)
    damping, mass = np.zeros(2), np.zeros(2)
    for total, points in ((damping, applied.damping), (mass, applied.masses)):
        for position, value in points:
            if not 0 < position < line.span:
                raise ValueError(
                    f"{applied.label}: position {position:g} m must be inside the span "
                    f"(0..{line.span:g} m)"
                )
            at = modes(case, replace(line, spacer_positions=(position,)))
            total += [value * float(mode.at_spacers[0]) ** 2 for mode in at]
    return damping, mass


def modal_masses(case: Mapping) -> np.ndarray:
    """(2,) of the vertical and the horizontal mode, kg."""
    line = Line.from_case(case)
    return np.array(frequencies(line, *modes(case, line))[2:])


def _positive(**values: float) -> None:
    for name, value in values.items():
        if not value > 0:
            raise ValueError(f"{name}: {value:g} must be > 0")
