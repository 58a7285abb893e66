"""Pseudo-arclength continuation of solutions along a parameter, through folds.

Predictor along the tangent, Newton corrector on the plane across it, step controlled by the
corrector and the turn of the tangent (Keller 1977; Seydel, Practical Bifurcation and Stability
Analysis, ch. 4). What is continued, equilibria or limit cycles, is a `ContinuationProblem`.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Protocol, Self

import numpy as np
from scipy.optimize import brentq

CORRECTIONS = 8
CORRECTED = 1e-9  # size of the last correction, in steps
SMALLEST_STEP = 1e-6
LEAST_COSINE = 0.9  # of the turn of the tangent in one step
CLOSED = 1e-3  # relative difference of period and size at which a branch has returned to its start


@dataclass(frozen=True)
class Change:
    """A change of a solution; also a linear condition on such changes.

    parts: by the names of the solution's fields, among them `value`, of the parameter.
    """

    parts: Mapping[str, Any]

    @property
    def value(self) -> float:
        """Of the parameter."""
        return self.parts["value"]

    def applied(self, solution: Any, factor: float = 1.0) -> Any:
        changed = {k: getattr(solution, k) + factor * part for k, part in self.parts.items()}
        return replace(solution, **changed)

    def scaled(self, factor: float) -> Self:
        return Change({name: factor * part for name, part in self.parts.items()})

    def of(self, change: Self) -> float:
        """The sum of its products with the parts of a change."""
        return float(sum(np.sum(own * change.parts[name]) for name, own in self.parts.items()))


class ContinuationProblem(Protocol):
    """What is continued. A solution has a `value` of the parameter; a change of it is linear."""

    def linearise(self, solution: Any) -> Any: ...

    def across(self, change: Change) -> Change:
        """The inner product with a change, in which a step of one is as long as steps may be."""

    def along_parameter(self) -> Change:
        """The change of the parameter alone."""

    def examine(self, solution: Any, linearisation: Any, tangent: Change) -> tuple[Any, dict]:
        """Stability of a solution, and the tests whose sign changes are bifurcations."""

    def confirmed(self, name: str, stability: Any) -> bool:
        """Whether a zero of test `name` is the bifurcation of that name."""

    def moved(self, solution: Any) -> Self:
        """The problem about a new solution."""

    def refined(self, solution: Any, tangent: Any, stability: Any) -> tuple[Any, Any] | None:
        """Solution and tangent in a better discretisation, or None where it is good."""

    def ended(self, solution: Any, start: Any) -> str:
        """Why the branch cannot go on at a solution just found, or ''."""

    def signature(self, solution: Any) -> np.ndarray:
        """Numbers that tell two solutions at one value of the parameter apart."""


class NotConverged(Exception):
    """The corrector found no solution; the message says why."""


@dataclass(frozen=True)
class Point:
    """solution on the branch, its tangent, its stability and the values of the tests."""

    solution: Any
    tangent: Change
    stability: Any
    tests: dict[str, float]


@dataclass(frozen=True)
class Bifurcation:
    """name: as in the literature. point: where the branch has it.

    located: False where only the point after it on the branch could be computed.
    """

    name: str
    point: Point
    located: bool = True


@dataclass(frozen=True)
class Branch:
    """Points in order, the bifurcations between them, and how it ended.

    complete: whether it ended where it was meant to: at a bound of the parameter, at an
    equilibrium, at a period doubling or where it began. reason: how it ended, in words.
    """

    points: tuple[Point, ...]
    bifurcations: tuple[Bifurcation, ...]
    complete: bool
    reason: str


@dataclass(frozen=True)
class Range:
    """Where a branch is followed: low <= parameter <= high, in at most max_points points.

    longest: step of the parameter; a fiftieth of the range by default. ceiling: size of an orbit
    (root mean square about its mean, units of the states) beyond which cycles are not followed.
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


def corrected(problem: ContinuationProblem, solution: Any, border: Change) -> tuple[Any, Any]:
    """The solution near a guess on the plane of `border`, with its linearisation.

    Raises NotConverged.
    """
    previous = np.inf
    for _ in range(CORRECTIONS):
        try:
            change = problem.linearise(solution).solve(border, 0.0, True)
        except np.linalg.LinAlgError:
            raise NotConverged("the equations became singular") from None
        size = length(problem, change)
        if not np.isfinite(size) or size > max(10 * previous, 100.0):
            raise NotConverged("the correction diverged")
        solution = change.applied(solution)
        if size < CORRECTED:
            return solution, problem.linearise(solution)
        previous = size
    raise NotConverged(f"no convergence in {CORRECTIONS} corrections (the last {size:.1e})")


def length(problem: ContinuationProblem, change: Change) -> float:
    return float(np.sqrt(abs(problem.across(change).of(change))))


def point_at(
    problem: ContinuationProblem, solution: Any, linearisation: Any, border: Change
) -> Point:
    """The solution with its tangent, oriented so that `border` is positive on it."""
    tangent = linearisation.solve(border, 1.0, False)
    tangent = tangent.scaled(1 / length(problem, tangent))
    return Point(solution, tangent, *problem.examine(solution, linearisation, tangent))


def resolved(problem: ContinuationProblem, point: Point) -> Point:
    """The point in a discretisation that is good enough for it. Raises NotConverged."""
    while better := problem.refined(point.solution, point.tangent, point.stability):
        solution, tangent = better
        problem = problem.moved(solution)
        border = problem.across(tangent)
        point = point_at(problem, *corrected(problem, solution, border), border)
    return point


def follow(
    problem: ContinuationProblem, start: Point, span: Range, first_step: float = 0.1
) -> Branch:
    """The branch from `start` in the direction of its tangent."""
    points, bifurcations = [start], []
    step, largest = first_step, 1.0
    while True:
        if len(points) == span.max_points:
            return _branch(points, bifurcations, False, f"stopped after {len(points)} points")
        last = points[-1]
        problem = problem.moved(last.solution)
        try:
            point = _next(problem, last, step)
        except NotConverged as failure:
            step /= 2
            if step < SMALLEST_STEP:
                reason = f"continuation failed at {last.solution.value:.6g}: {failure}"
                return _branch(points, bifurcations, False, reason)
            continue
        beyond = not span.low <= point.solution.value <= span.high
        if beyond:
            bound = span.low if point.solution.value < span.low else span.high
            try:
                point = _at_value(problem, point, bound)
            except NotConverged as failure:
                reason = f"continuation failed at the bound {bound:g}: {failure}"
                return _branch(points, bifurcations, False, reason)
        reason = problem.ended(point.solution, start.solution)
        if not reason:
            bifurcations += _bifurcations(problem, last, point, step)
        points.append(point)
        if reason:
            return _branch(points, bifurcations, True, reason)
        if beyond:
            return _branch(points, bifurcations, True, f"reached {bound:g}")
        if len(points) > 4 and _returned(problem, start, last, point):
            return _branch(points, bifurcations, True, "returned to its start")
        step = min(1.5 * step, largest)


def _branch(points: list, bifurcations: list, complete: bool, reason: str) -> Branch:
    return Branch(tuple(points), tuple(bifurcations), complete, reason)


def _next(problem: ContinuationProblem, last: Point, step: float) -> Point:
    """The point one step ahead. Raises NotConverged."""
    border = problem.across(last.tangent)
    guess = last.tangent.applied(last.solution, step)
    point = point_at(problem, *corrected(problem, guess, border), border)
    turn = border.of(point.tangent) / np.sqrt(
        border.of(last.tangent) * problem.across(point.tangent).of(point.tangent)
    )
    if turn < LEAST_COSINE:
        raise NotConverged("the branch turns too sharply")
    return resolved(problem, point)


def _at_value(problem: ContinuationProblem, near: Point, value: float) -> Point:
    """The point of the branch at a value of the parameter close to that of `near`."""
    problem = problem.moved(near.solution)
    along = problem.along_parameter()
    factor = (value - near.solution.value) / along.of(near.tangent)
    guess = near.tangent.applied(near.solution, factor)
    solution, linearisation = corrected(problem, guess, along)
    point = point_at(problem, solution, linearisation, problem.across(near.tangent))
    return resolved(problem, point)


def _bifurcations(
    problem: ContinuationProblem, last: Point, point: Point, step: float
) -> list[Bifurcation]:
    """Bifurcations between two points, in order, each located along the step."""
    between = []
    for name, before in last.tests.items():
        if before * point.tests[name] < 0:
            try:
                place, at = _located(problem, last, name, step)
            except (NotConverged, ValueError):  # ValueError: the test jumps on the way
                between.append((step, Bifurcation(name, point, located=False)))
            else:
                if problem.confirmed(name, at.stability):
                    between.append((place, Bifurcation(name, at)))
    return [bifurcation for _, bifurcation in sorted(between, key=lambda pair: pair[0])]


def _located(
    problem: ContinuationProblem, last: Point, name: str, step: float
) -> tuple[float, Point]:
    """Length along the last tangent and the point where a test vanishes."""
    points = {0.0: last}

    def test(s: float) -> float:
        if s not in points:
            points[s] = _next(problem, last, s)
        return points[s].tests[name]

    root = brentq(test, 0.0, step, xtol=1e-9, rtol=1e-12, maxiter=60)
    test(root)
    return root, points[root]


def _returned(problem: ContinuationProblem, start: Point, last: Point, point: Point) -> bool:
    """Whether the branch passes its start between two points."""
    begin, end = last.solution.value, point.solution.value
    if begin == end or not min(begin, end) <= start.solution.value <= max(begin, end):
        return False
    share = (start.solution.value - begin) / (end - begin)
    before, after = problem.signature(last.solution), problem.signature(point.solution)
    there, here = problem.signature(start.solution), before + share * (after - before)
    return bool(np.all(np.abs(here - there) <= CLOSED * np.abs(there)))
