"""Pseudo-arclength continuation of solutions along a parameter, through folds.

A predictor along the tangent is followed by a Newton corrector on the plane across it; the step
follows the corrector and the turn of the tangent (Keller 1977; Seydel, Practical Bifurcation and
Stability Analysis, ch. 4). The continued solutions, equilibria or limit cycles, are those of a
`BranchProblem`: m equations in m + 1 unknowns, of which the last is the parameter.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any, ClassVar, Protocol, Self

import numpy as np
from scipy.optimize import brentq

from galloping.cycles.family import Family

CORRECTIONS = 8
CORRECTED = 1e-9  # length of the last correction, in steps
FIRST_STEP, SMALLEST_STEP = 0.1, 1e-6  # of the longest
LEAST_COSINE = 0.9  # of the turn of the tangent in one step
CLOSED = 1e-3  # relative difference of period and size at which a branch has returned to its start


@dataclass(frozen=True)
class Equations:
    """Equations of a branch, linearised at some unknowns.

    solution: with a `vector` (n,) that identifies it, a `value` of the parameter, which is the
    vector's last entry, and a `signature` that differs between solutions at one value. unknowns: (m
    + 1,). residual: (m,), jacobian: (m, m + 1) of the equations. moved: (n, m + 1) derivative of
    the vector by the unknowns.
    """

    solution: Any
    unknowns: np.ndarray
    residual: np.ndarray
    jacobian: np.ndarray
    moved: np.ndarray

    def bordered(self, border: np.ndarray) -> np.ndarray:
        """Append the condition `border` (n,) on the vector as last row: (m + 1, m + 1)."""
        return np.vstack([self.jacobian, border @ self.moved])

    def along(self, border: np.ndarray) -> np.ndarray:
        """Compute the tangent change of the vector, (n,), of size one across the border."""
        return self.moved @ np.linalg.solve(self.bordered(border), np.eye(len(self.unknowns))[-1])


class BranchProblem(Protocol):
    """Solutions of the models of a family along its parameter.

    sought: the solutions in words, for messages.
    """

    family: Family
    sought: ClassVar[str]

    @property
    def metric(self) -> np.ndarray:
        """Weights of the squares of a change, (n,); a step of length one is the longest."""

    def unknowns(self, vector: np.ndarray) -> np.ndarray:
        """Extract the unknowns, (m + 1,), of a solution with this vector (n,)."""

    def linearise(self, unknowns: np.ndarray) -> Equations:
        """Linearise the equations. Raises NotConverged if they cannot be evaluated."""

    def examine(self, at: Equations, tangent: np.ndarray) -> tuple[Any, dict[str, float]]:
        """Compute stability, and the tests whose sign changes are bifurcations."""

    def confirmed(self, name: str, stability: Any) -> bool:
        """Decide whether a zero of test `name` is the bifurcation of that name."""

    def moved(self, solution: Any) -> Self:
        """Return the problem about a new solution."""
        return self

    def ended(self, solution: Any) -> str:
        """Return why the branch ends at a solution just found, or ''."""
        return ""

    def along_parameter(self) -> np.ndarray:
        """Return the condition, (n,), that selects the parameter's change."""
        return np.append(np.zeros(len(self.metric) - 1), 1.0)

    def length(self, change: np.ndarray) -> float:
        """Compute the length of a change of the vector, in longest steps."""
        return float(np.sqrt(np.sum(self.metric * change**2)))


class NotConverged(Exception):
    """Exception: the corrector found no solution; the message gives the reason."""


@dataclass(frozen=True)
class Point:
    """Solution on a branch, its tangent (n,), its stability and the values of the tests."""

    solution: Any
    tangent: np.ndarray
    stability: Any
    tests: dict[str, float]


@dataclass(frozen=True)
class Bifurcation:
    """A bifurcation of a branch, by its name in the literature.

    located: False if only the next point of the branch could be computed.
    """

    name: str
    point: Point
    located: bool = True


@dataclass(frozen=True)
class Branch:
    """Points in order, the bifurcations between them, and the reason of the end.

    complete: whether the branch ended at a bound of the parameter, at an equilibrium, at a period
    doubling or where it began. reason: of the end, in words.
    """

    points: tuple[Point, ...]
    bifurcations: tuple[Bifurcation, ...]
    complete: bool
    reason: str


@dataclass(frozen=True)
class Range:
    """Range of a branch: low <= parameter <= high, in at most max_points points.

    longest: step of the parameter; a fiftieth of the range by default. ceiling: size of an orbit
    (`Orbit.spread`) beyond which cycles are not followed.
    """

    low: float
    high: float
    max_points: int = 400
    longest: float = 0.0
    ceiling: float = np.inf

    def __post_init__(self) -> None:
        if not self.low < self.high:
            raise ValueError(f"range: low {self.low:g} must be below high {self.high:g}")
        object.__setattr__(self, "longest", self.longest or (self.high - self.low) / 50)


def corrected(
    problem: BranchProblem, guess: np.ndarray, border: np.ndarray, accuracy: float = CORRECTED
) -> Equations:
    """Correct a guess (n,) to the solution on the plane through it across `border` (n,).

    accuracy: length of the last correction, in steps. Raises NotConverged.
    """
    at, previous = problem.linearise(problem.unknowns(guess)), np.inf
    for _ in range(CORRECTIONS):
        residual = np.append(at.residual, border @ (at.solution.vector - guess))
        try:
            change = np.linalg.solve(at.bordered(border), -residual)
        except np.linalg.LinAlgError:
            raise NotConverged("the equations became singular") from None
        size = problem.length(at.moved @ change)
        if not np.isfinite(size) or size > max(10 * previous, 100.0):
            raise NotConverged("the correction diverged")
        at = problem.linearise(at.unknowns + change)
        if size < accuracy:
            return at
        previous = size
    raise NotConverged(f"no convergence in {CORRECTIONS} corrections (the last {size:.1e})")


def point_at(problem: BranchProblem, at: Equations, border: np.ndarray) -> Point:
    """Compute the tangent of a solution, oriented so that `border` (n,) is positive on it."""
    tangent = at.along(border)
    tangent = tangent / problem.length(tangent)
    return Point(at.solution, tangent, *problem.examine(at, tangent))


def first(problem: BranchProblem, guess: np.ndarray, border: np.ndarray) -> Point:
    """Compute the point near a guess, see `corrected` and `point_at`. Raises ValueError."""
    try:
        return point_at(problem, corrected(problem, guess, border), border)
    except NotConverged as failure:
        place = f"{guess[-1]:g} {problem.family.unit}"
        raise ValueError(f"no {problem.sought} at {place}: {failure}") from None


def follow(problem: BranchProblem, start: Point, span: Range) -> Branch:
    """Follow the branch from `start` in the direction of its tangent."""
    points: list[Point] = [start]
    bifurcations: list[Bifurcation] = []
    step = FIRST_STEP

    def ended(complete: bool, reason: str) -> Branch:
        return Branch(tuple(points), tuple(bifurcations), complete, reason)

    while len(points) < span.max_points:
        last = points[-1]
        problem = problem.moved(last.solution)
        try:
            point = _next_point(problem, last, step)
        except NotConverged as failure:
            step /= 2
            if step < SMALLEST_STEP:
                return ended(False, f"continuation failed at {last.solution.value:.6g}: {failure}")
            continue
        bound = np.clip(point.solution.value, span.low, span.high)
        beyond = point.solution.value != bound
        if beyond:
            try:
                point = _at_value(problem, point, bound)
            except NotConverged as failure:
                return ended(False, f"continuation failed at the bound {bound:g}: {failure}")
        reason = problem.ended(point.solution)
        if not reason:
            bifurcations += _find_bifurcations(problem, last, point, step)
            if beyond:
                reason = f"reached {bound:g}"
            elif len(points) > 3 and _has_returned(start.solution, last.solution, point.solution):
                reason = "returned to its start"
        points.append(point)
        if reason:
            return ended(True, reason)
        step = min(1.5 * step, 1.0)
    return ended(False, f"stopped after {len(points)} points")


def _next_point(problem: BranchProblem, last: Point, step: float) -> Point:
    """Compute the point one step ahead. Raises NotConverged."""
    border = problem.metric * last.tangent
    guess = last.solution.vector + step * last.tangent
    point = point_at(problem, corrected(problem, guess, border), border)
    lengths = problem.length(last.tangent) * problem.length(point.tangent)
    if border @ point.tangent < LEAST_COSINE * lengths:
        raise NotConverged("the branch turns too sharply")
    return point


def _at_value(problem: BranchProblem, near: Point, value: float) -> Point:
    """Compute the point of the branch at a value of the parameter close to that of `near`."""
    problem = problem.moved(near.solution)
    factor = (value - near.solution.value) / near.tangent[-1]
    guess = near.solution.vector + factor * near.tangent
    at = corrected(problem, guess, problem.along_parameter())
    return point_at(problem, at, problem.metric * near.tangent)


def _find_bifurcations(
    problem: BranchProblem, last: Point, point: Point, step: float
) -> list[Bifurcation]:
    """Find the bifurcations between two points, in order, each located along the step."""
    between = []
    for name, before in last.tests.items():
        if before * point.tests[name] < 0:
            try:
                place, at = _locate_zero(problem, last, name, step)
            except (NotConverged, ValueError):  # ValueError: the test jumps on the way
                between.append((step, Bifurcation(name, point, located=False)))
            else:
                if problem.confirmed(name, at.stability):
                    between.append((place, Bifurcation(name, at)))
    return [bifurcation for _, bifurcation in sorted(between, key=lambda pair: pair[0])]


def _locate_zero(
    problem: BranchProblem, last: Point, name: str, step: float
) -> tuple[float, Point]:
    """Find the length along the last tangent, and the point, at which a test vanishes."""
    ahead = cache(lambda s: _next_point(problem, last, s) if s else last)
    root = brentq(lambda s: ahead(s).tests[name], 0.0, step, xtol=1e-9, rtol=1e-12, maxiter=60)
    return root, ahead(root)


def _has_returned(start: Any, last: Any, now: Any) -> bool:
    """Decide whether the branch passes its start between two solutions."""
    begin, end = last.value, now.value
    if begin == end or not min(begin, end) <= start.value <= max(begin, end):
        return False
    share = (start.value - begin) / (end - begin)
    here = last.signature + share * (now.signature - last.signature)
    return bool(np.all(np.abs(here - start.signature) <= CLOSED * np.abs(start.signature)))
