"""Limit cycles along a parameter: their stability and where it changes (Kuznetsov, Elements of
Applied Bifurcation Theory, ch. 5 and 10)."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import combinations, pairwise
from typing import Self

import numpy as np
from scipy.interpolate import CubicSpline

from galloping.cycles import continuation
from galloping.cycles.collocation import STAGES, C, Linearisation, Orbit, circle
from galloping.cycles.family import Family, VectorField

FOLD, BRANCH_POINT = "fold of cycles", "branch point"
PERIOD_DOUBLING, NEIMARK_SACKER = "period doubling", "Neimark-Sacker"
ENDED_DOUBLED = "ended at a period doubling"

INTERVALS, MOST_INTERVALS = 20, 400
DEFECT = 1e-7  # of the trivial multiplier, beyond which the mesh is refined
LEVEL = 4.0  # largest over mean roughness of an interval, beyond which the mesh is redistributed
STEP = 0.5  # longest step, of the orbit's size and of its period
VANISHED = 1e-3  # of the largest orbit of the branch: an orbit as small is an equilibrium


@dataclass(frozen=True)
class Floquet:
    """multipliers: (n_states - 1,) complex, largest first, without the trivial one.

    trivial_defect: |mu - 1| of the multiplier along the orbit, which is 1 for an exact orbit.
    """

    multipliers: np.ndarray
    trivial_defect: float

    @property
    def largest(self) -> float:
        """Modulus of the largest multiplier."""
        return float(np.abs(self.multipliers[0])) if len(self.multipliers) else 0.0

    @property
    def stable(self) -> bool:
        return self.largest < 1


def floquet(linearisation: Linearisation) -> Floquet:
    """Multipliers of a limit cycle, the largest first, and the error of the trivial one."""
    values = np.linalg.eigvals(linearisation.monodromy()).astype(complex)
    trivial = np.argmin(np.abs(values - 1))
    others = np.delete(values, trivial)
    order = np.lexsort([-others.imag, -np.abs(others)])
    return Floquet(others[order], float(np.abs(values[trivial] - 1)))


@dataclass(frozen=True)
class CycleProblem:
    """Limit cycles of a vector field about a reference orbit, whose phase is kept.

    resolution: longest step of the parameter. slope: of the coefficients along the parameter,
    at the reference. largest: size of the largest orbit so far. ceiling: size (root mean square
    about the mean, units of the states) beyond which the branch is not followed.
    """

    field: VectorField
    reference: Orbit
    resolution: float
    slope: np.ndarray
    ceiling: float
    largest: float

    @classmethod
    def about(
        cls, field: VectorField, orbit: Orbit, resolution: float, ceiling: float = np.inf
    ) -> Self:
        slope = field.slope(orbit.value, resolution)
        return cls(field, orbit, resolution, slope, ceiling, orbit.spread)

    def linearise(self, orbit: Orbit) -> Linearisation:
        coefficients = self.field.coefficients(orbit.value)
        return Linearisation(self.field, orbit, self.reference, coefficients, self.slope)

    def across(self, change: continuation.Change) -> continuation.Change:
        weights = self.reference.stage_weights[..., np.newaxis]
        stages = weights * change.parts["stage_states"] / (STEP * self.reference.spread) ** 2
        period = change.parts["period"] / (STEP * self.reference.period) ** 2
        value = change.value / self.resolution**2
        return continuation.Change({"stage_states": stages, "period": period, "value": value})

    def along_parameter(self) -> continuation.Change:
        nothing = np.zeros_like(self.reference.stage_states)
        return continuation.Change({"stage_states": nothing, "period": 0.0, "value": 1.0})

    def examine(
        self, orbit: Orbit, linearisation: Linearisation, tangent: continuation.Change
    ) -> tuple[Floquet, dict[str, float]]:
        stability = floquet(linearisation)
        mu = stability.multipliers
        sign, log = linearisation.determinant(self.across(tangent))
        n, n_states = orbit.mesh_states.shape
        parity = -1.0 if (n - 1) * n_states % 2 else 1.0  # of the ring of mesh points
        pairs = [a * b - 1 for a, b in combinations(mu, 2)]
        return stability, {
            FOLD: tangent.value / self.resolution,
            BRANCH_POINT: parity * sign * np.exp(log / (n * n_states + 2)),
            PERIOD_DOUBLING: float(np.prod(mu + 1).real),
            NEIMARK_SACKER: float(np.prod(pairs).real) if pairs else 1.0,
        }

    def confirmed(self, name: str, stability: Floquet) -> bool:
        """Two real multipliers whose product is one are no Neimark-Sacker bifurcation."""
        if name != NEIMARK_SACKER:
            return True
        mu = stability.multipliers
        return bool(np.any((np.abs(mu.imag) > 1e-6) & (np.abs(np.abs(mu) - 1) < 1e-4)))

    def moved(self, orbit: Orbit) -> Self:
        slope = self.field.slope(orbit.value, self.resolution)
        largest = max(self.largest, orbit.spread)
        return replace(self, reference=orbit, slope=slope, largest=largest)

    def refined(
        self, orbit: Orbit, tangent: continuation.Change, stability: Floquet
    ) -> tuple[Orbit, continuation.Change] | None:
        intervals = len(orbit.widths)
        if stability.trivial_defect > DEFECT:
            if intervals == MOST_INTERVALS:
                raise continuation.NotConverged(
                    f"{intervals} intervals do not resolve the orbit: its trivial multiplier is "
                    f"off by {stability.trivial_defect:.1e}"
                )
            widths = orbit.levelled(min(MOST_INTERVALS, intervals + intervals // 2))
        else:
            roughness = orbit.roughness()
            if np.max(roughness) < LEVEL * np.mean(roughness):
                return None
            widths = orbit.levelled(intervals)
            levelled = orbit.on(widths).roughness()
            if np.max(levelled) / np.mean(levelled) > 0.7 * np.max(roughness) / np.mean(roughness):
                return None
        return orbit.on(widths), _through(lambda each: each.on(widths), orbit, tangent)

    def ended(self, orbit: Orbit, start: Orbit) -> str:
        if orbit.spread > self.ceiling:
            return f"grew beyond {self.ceiling:g}"
        if np.sum(_halves(orbit) * _halves(self.reference)) < 0:
            return ENDED_DOUBLED
        return "ended at an equilibrium" if orbit.spread < VANISHED * self.largest else ""

    def signature(self, orbit: Orbit) -> np.ndarray:
        return np.array([orbit.period, orbit.spread])


def _through(
    done: Callable[[Orbit], Orbit], orbit: Orbit, change: continuation.Change
) -> continuation.Change:
    """A change of an orbit after what is done, linearly, to the orbit itself."""
    changed = done(replace(orbit, **change.parts))
    return continuation.Change({name: getattr(changed, name) for name in change.parts})


def _halves(orbit: Orbit) -> np.ndarray:
    """(n, n_states) by how much the second half of an orbit differs from the first.

    A branch of doubled period ends where both are one orbit; what continuation finds beyond is
    the branch again, with the halves exchanged.
    """
    phase = np.arange(INTERVALS) / (2 * INTERVALS)
    return orbit.at(phase + 0.5) - orbit.at(phase)


def from_hopf(
    family: Family, hopf: continuation.Bifurcation, span: continuation.Range, size: float = 1e-3
) -> continuation.Branch:
    """The limit cycles that leave a Hopf bifurcation of `equilibrium_branch`.

    size: of the first one, in units of the states.
    """
    at, mode = hopf.point.solution, hopf.point.stability
    period = 2 * np.pi / mode.frequency
    swing = mode.mode * (size * np.sqrt(2) / np.linalg.norm(mode.mode))
    orbit = circle(at.state, swing, period, at.value, INTERVALS)
    problem = CycleProblem.about(VectorField(family, at.value), orbit, span.longest, span.ceiling)
    growth = {"stage_states": orbit.stage_states - at.state, "period": 0.0, "value": 0.0}
    start = _first(problem, orbit, problem.across(continuation.Change(growth)), family)
    return continuation.follow(problem, start, span)


def from_branching(
    family: Family, at: continuation.Bifurcation, span: continuation.Range, size: float = 1e-2
) -> tuple[continuation.Branch, ...]:
    """The limit cycles that leave a branch at a period doubling or a branch point.

    size: of their first departure, relative to the orbit. Two branches leave a branch point; those
    that leave a period doubling are one, shifted in phase. Raises ValueError for a bifurcation of
    another name, and where nothing branches off.
    """
    orbit, tangent = at.point.solution, at.point.tangent
    if at.name not in (PERIOD_DOUBLING, BRANCH_POINT) or not at.located:
        raise ValueError(f"no limit cycles branch off at a {at.name} at {orbit.value:g}")
    doubled = at.name == PERIOD_DOUBLING
    if doubled:
        orbit, tangent = orbit.twice(), _through(Orbit.twice, orbit, tangent)
    field = VectorField(family, orbit.value)
    problem = CycleProblem.about(field, orbit, span.longest, span.ceiling)
    border = problem.across(tangent)
    direction = problem.linearise(orbit).other_direction(border)
    branches = []
    for sign in (1.0,) if doubled else (1.0, -1.0):
        away = direction.scaled(sign * size / (STEP * continuation.length(problem, direction)))
        guess = away.applied(orbit)
        start = _first(problem, guess, problem.across(away), family)
        branches.append(continuation.follow(problem, start, span))
    return tuple(branches)


def from_motion(
    family: Family, value: float, time: np.ndarray, states: np.ndarray, span: continuation.Range
) -> tuple[continuation.Branch, continuation.Branch]:
    """The limit cycles below and above the one that a motion has settled on.

    time: (n,) s, states: (n, n_states) of the settled motion at `value` of the parameter; several
    periods of it. Raises ValueError where it does not come back to itself.
    """
    problem, start = settled(family, value, time, states, span.longest)
    problem = replace(problem, ceiling=span.ceiling).moved(start.solution)
    linearisation = problem.linearise(start.solution)
    back = problem.across(start.tangent.scaled(-1.0))
    down = continuation.point_at(problem, start.solution, linearisation, back)
    return continuation.follow(problem, down, span), continuation.follow(problem, start, span)


def settled(
    family: Family, value: float, time: np.ndarray, states: np.ndarray, resolution: float
) -> tuple[CycleProblem, continuation.Point]:
    """The limit cycle on which a motion has settled, as in `from_motion`."""
    orbit = _last_turn(time, states, value)
    problem = CycleProblem.about(VectorField(family, value), orbit, resolution)
    return problem, _first(problem, orbit, problem.along_parameter(), family)


def _first(
    problem: CycleProblem, orbit: Orbit, border: continuation.Change, family: Family
) -> continuation.Point:
    """The limit cycle near a guess. Raises ValueError where there is none."""
    try:
        point = continuation.point_at(
            problem, *continuation.corrected(problem, orbit, border), border
        )
        return continuation.resolved(problem, point)
    except continuation.NotConverged as failure:
        raise ValueError(
            f"no limit cycle near the given motion at {orbit.value:g} {family.unit}: {failure}"
        ) from None


def _last_turn(time: np.ndarray, states: np.ndarray, value: float) -> Orbit:
    """The last period of a motion: since it was last as close to where it ends as it gets."""
    distance = np.linalg.norm(states - states[-1], axis=1)
    near = distance < 0.05 * np.max(distance)
    away = np.flatnonzero(~near)
    before = np.flatnonzero(near[: away[-1]]) if len(away) else away
    if not len(before):
        raise ValueError(f"the motion at {value:g} does not come back to where it ends")
    stretch = np.arange(np.max(np.flatnonzero(~near[: before[-1]]), initial=-1) + 1, before[-1] + 1)
    back = stretch[np.argmin(distance[stretch])]
    spline = CubicSpline(time, states)
    period = time[-1] - time[back]
    left = np.arange(INTERVALS) / INTERVALS
    stages = left[:, np.newaxis] + C / INTERVALS
    return Orbit(
        np.full(INTERVALS, 1 / INTERVALS),
        spline(time[back] + period * left),
        spline(time[back] + period * stages).reshape(INTERVALS, STAGES, -1),
        float(period),
        value,
    )


def at_value(family: Family, branch: continuation.Branch, value: float) -> list[continuation.Point]:
    """The limit cycles of a branch at a value of the parameter, one for each time it passes there.

    Raises ValueError where one cannot be computed from its neighbours.
    """
    points, field = [], VectorField(family, value)
    for before, after in pairwise(branch.points):
        begin, end = before.solution.value, after.solution.value
        if (begin - value) * (end - value) > 0 or begin == end or end == value:
            continue
        near = min(before, after, key=lambda p: abs(p.solution.value - value))
        problem = CycleProblem.about(field, near.solution, abs(end - begin))
        along = problem.along_parameter()
        ahead = near.tangent.scaled((value - near.solution.value) / along.of(near.tangent))
        points.append(_first(problem, ahead.applied(near.solution), along, family))
    if branch.points[-1].solution.value == value:
        points.append(branch.points[-1])
    return points
