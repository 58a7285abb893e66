"""Bifurcation diagram: equilibria along a parameter and all limit cycles that branch off."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import combinations, pairwise
from typing import ClassVar

import numpy as np

from galloping.cycles import continuation, limit_cycles
from galloping.cycles.continuation import Bifurcation, Branch, BranchEnd, Equations, Range
from galloping.cycles.family import Family
from galloping.model.modes import Modes
from galloping.model.polynomial import design_matrix

# --- equilibria: where they lose stability to galloping (Hopf), fold or branch ---

HOPF, FOLD, BRANCH_POINT = "Hopf", "fold", "branch point"


@dataclass(frozen=True)
class FixedPoint:
    """Equilibrium of a model at one value of its parameter.

    vector: (n_states + 1,), the state with dx/dt = 0, and the value.
    """

    vector: np.ndarray

    @property
    def state(self) -> np.ndarray:
        """State of the equilibrium, (n_states,)."""
        return self.vector[:-1]

    signature = state

    @property
    def value(self) -> float:
        """Value of the parameter at the equilibrium."""
        return float(self.vector[-1])


@dataclass(frozen=True)
class EquilibriumProblem(continuation.BranchProblem):
    """Continuation problem of the equilibria of a family of models along its parameter.

    resolution: longest step of the parameter.
    """

    family: Family
    n_states: int
    resolution: float
    sought: ClassVar[str] = "equilibrium near the given state"

    @property
    def metric(self) -> np.ndarray:
        """Weights (n_states + 1,) of the squared components of a step, which define its length."""
        sizes = np.broadcast_to(self.family.sizes, self.n_states)
        return np.append(sizes, self.resolution) ** -2.0

    def linearise(self, unknowns: np.ndarray) -> Equations:
        """Compute the rates of the states and their derivatives by states and parameter."""
        model, x = self.family.model(unknowns[-1]), unknowns[np.newaxis, :-1]
        slope = self.family.slope(unknowns[-1], self.resolution)
        by_value = design_matrix(x, model.terms) @ slope.T
        jacobian = np.column_stack([model.jacobian(x)[0], by_value[0]])
        return Equations(
            FixedPoint(unknowns), unknowns, model(x)[0], jacobian, np.eye(len(unknowns))
        )

    def examine(self, at: Equations, tangent: np.ndarray) -> tuple[Modes, dict[str, float]]:
        """Compute eigenvalues, and test functions for Hopf bifurcation, fold and branch point."""
        modes = Modes.of(at.jacobian[:, :-1])
        sums = np.array([a + b for a, b in combinations(modes.values, 2)])
        return modes, {
            HOPF: float(np.real(np.prod(sums))),
            FOLD: tangent[-1],
            BRANCH_POINT: float(np.linalg.det(at.bordered(self.metric * tangent))),
        }

    def is_confirmed(self, name: str, modes: Modes) -> bool:
        """Decide whether a zero of a test function is really the bifurcation of that name.

        A pair of real eigenvalues of opposite sign is no Hopf bifurcation.
        """
        if name != HOPF:
            return True
        rates = np.abs(modes.values[modes.oscillating].real)
        return bool(np.any(rates < 1e-6 * np.max(modes.omega)))


def equilibrium_branch(family: Family, state: np.ndarray, span: Range) -> Branch:
    """Compute the branch of equilibria along a parameter, from the low end of its range.

    It begins at the equilibrium near `state` (n_states,). Raises ValueError if there is no
    equilibrium near the state.
    """
    problem = EquilibriumProblem(family, len(state), span.longest)
    start = continuation.first_point(problem, np.append(state, span.low), problem.along_parameter())
    return continuation.continue_branch(problem, start, span)


def hopf_points(branch: Branch) -> list[Bifurcation]:
    """List the Hopf bifurcations of a branch of equilibria, in their order along the branch."""
    return [b for b in branch.bifurcations if b.name == HOPF and b.located]


def _follow_hopf(family: Family, hopf: Bifurcation, span: Range) -> tuple[Branch]:
    return (limit_cycles.from_hopf(family, hopf, span),)


# --- the diagram ---


@dataclass(frozen=True)
class Diagram:
    """Bifurcation diagram: a branch of equilibria and the branches of limit cycles from it.

    cycles: by origin, such as `Hopf 1, period doubling 1`: side 1 leads to lower values of the
    parameter and side 2 to higher ones; from a branch point, they are its two directions. failures:
    what could not be followed, in words; a branch that stopped early has its own reason.
    """

    family: Family
    equilibria: Branch
    cycles: Mapping[str, Branch]
    failures: tuple[str, ...]


def diagram(
    family: Family,
    span: Range,
    rest: np.ndarray,
    depth: int = 1,
    motion: tuple[float, np.ndarray, np.ndarray] | None = None,
) -> Diagram:
    """Compute the bifurcation diagram of a family of models over a range of its parameter.

    It begins at the equilibrium near `rest` (n_states,). depth: number of successive period
    doublings and branch points to follow. motion: without a Hopf bifurcation in the range, a
    settled motion to start from: the parameter's value, times (n,) in s and states (n, n_states).
    Raises ValueError if there is no equilibrium near `rest`.
    """
    equilibria = equilibrium_branch(family, rest, span)
    queue = [
        _Start(f"Hopf {k}", 0, partial(_follow_hopf, family, hopf, span))
        for k, hopf in enumerate(hopf_points(equilibria), start=1)
    ]
    if not queue and motion is not None:
        follow = partial(limit_cycles.from_motion, family, *motion, span)
        queue = [_Start(f"from {motion[0]:g}", 0, follow)]
    cycles: dict[str, Branch] = {}
    failures: list[str] = []
    while queue:
        start = queue.pop(0)
        if _is_known(cycles.values(), start.value, start.period):
            continue
        try:
            branches = start.follow()
        except ValueError as failure:
            failures.append(f"{start.name}: {failure}")
            continue
        for side, branch in enumerate(branches, start=1):
            name = start.name if len(branches) == 1 else f"{start.name}, side {side}"
            cycles[name] = branch
            queue += _list_starts(family, branch, name, start.level, depth, span)
    return Diagram(family, equilibria, cycles, tuple(failures))


@dataclass(frozen=True)
class _Start:
    """Branches to follow, with one of their orbits, by which known branches are recognised."""

    name: str
    level: int
    follow: Callable[[], Sequence[Branch]]
    value: float = np.nan
    period: float = np.nan


def _list_starts(
    family: Family, branch: Branch, name: str, level: int, depth: int, span: Range
) -> Iterator[_Start]:
    """Yield the starts of branches on a branch, and of the one on which a doubled branch ends."""
    if branch.end is BranchEnd.PERIOD_DOUBLING:
        last = branch.points[-1].solution
        phase = np.linspace(0, 1, 401)
        states = (last.at(phase) + last.at(phase + 0.5)) / 2  # two turns of one orbit
        follow = partial(
            limit_cycles.from_motion, family, last.value, phase * last.period, states, span
        )
        yield _Start(f"{name}, halved", level, follow, last.value, last.period / 2)
    if level == depth:
        return
    for kind in (limit_cycles.PERIOD_DOUBLING, limit_cycles.BRANCH_POINT):
        bifurcations = [b for b in branch.bifurcations if b.name == kind]
        for k, bifurcation in enumerate(bifurcations, start=1):
            leave = partial(limit_cycles.from_branching, family, bifurcation, span)
            orbit = bifurcation.point.solution
            known = (orbit.value, 2 * orbit.period) if kind == limit_cycles.PERIOD_DOUBLING else ()
            yield _Start(f"{name}, {kind} {k}", level + 1, leave, *known)


def _is_known(branches: Iterable[Branch], value: float, period: float) -> bool:
    """Decide whether a branch contains an orbit of a given period at a value of the parameter."""
    for branch in branches:
        for begin_point, end_point in pairwise(branch.points):
            first, second = begin_point.solution, end_point.solution
            left, right = sorted((first.value, second.value))
            low, high = sorted((first.period, second.period))
            margin = right - left
            if left - margin <= value <= right + margin and 0.99 * low < period < 1.01 * high:
                return True
    return False
