"""Pseudo-arclength continuation of solutions along a parameter, through folds.

A predictor along the tangent is followed by a Newton corrector on the plane across it; the step
follows the corrector and the turn of the tangent (Keller 1977; Seydel, Practical Bifurcation and
Stability Analysis, ch. 4). The continued solutions, equilibria or limit cycles, are those of a
`BranchProblem`: m equations in m + 1 unknowns, of which the last is the parameter.
"""

from dataclasses import dataclass
from enum import Enum
from functools import cache
from operator import itemgetter
from typing import Any, ClassVar, Protocol, Self

import numpy as np
from scipy.optimize import brentq

from galloping.cycles.family import Family

MAX_CORRECTIONS = 8  # largest number of Newton corrections of a point
CORRECTION_TOLERANCE = 1e-9  # largest length of the last correction, in steps
FIRST_STEP = 0.1  # first step, relative to the longest one
MIN_STEP = 1e-6  # shortest step, relative to the longest one
MIN_COSINE = 0.9  # smallest cosine of the angle between the tangents of successive points
CLOSURE_TOLERANCE = 1e-3  # difference of period and size at the ends of a closed branch, relative
BranchEnd = Enum("BranchEnd", "BOUND START CEILING EQUILIBRIUM PERIOD_DOUBLING INCOMPLETE")


@dataclass(frozen=True)
class Equations:
    """Equations that define a solution branch: residual and Jacobian at given unknowns.

    solution: with a `vector` (n,) that identifies it, a `value` of the parameter, which is the
    vector's last entry, and a `signature` that differs between solutions at one value. unknowns: (m
    + 1,). residual: (m,), jacobian: (m, m + 1) of the equations. derivative: (n, m + 1) of the
    vector by the unknowns.
    """

    solution: Any
    unknowns: np.ndarray
    residual: np.ndarray
    jacobian: np.ndarray
    derivative: np.ndarray

    def bordered(self, border: np.ndarray) -> np.ndarray:
        """Append a linear condition on the solution to the Jacobian, as its last row.

        border: (n,) condition on the vector. Returns (m + 1, m + 1).
        """
        return np.vstack([self.jacobian, border @ self.derivative])

    def along(self, border: np.ndarray) -> np.ndarray:
        """Compute the tangent of the branch, scaled to one in the direction of a condition.

        border: (n,) the condition. Returns the change of the vector, (n,).
        """
        return self.derivative @ np.linalg.solve(
            self.bordered(border), np.eye(len(self.unknowns))[-1]
        )


class BranchProblem(Protocol):
    """Interface of a continuation problem: solutions that form a branch along a parameter.

    The solutions are of the models of a family. sought: the solutions in words, for messages.
    """

    family: Family
    sought: ClassVar[str]

    @property
    def metric(self) -> np.ndarray:
        """Weights of the squared components of a step, which define its length.

        Shape (n,). A step of length one is the longest.
        """

    def unknowns(self, vector: np.ndarray) -> np.ndarray:
        """Extract the unknowns of the equations from the vector that describes a solution.

        From (n,) to (m + 1,); by default all entries are unknowns.
        """
        return vector

    def linearise(self, unknowns: np.ndarray) -> Equations:
        """Compute the residual and Jacobian of the equations at given unknowns.

        Raises NotConverged if they cannot be evaluated.
        """

    def examine(self, at: Equations, tangent: np.ndarray) -> tuple[Any, dict[str, float]]:
        """Compute the stability of a solution, and test functions that vanish at bifurcations."""

    def is_confirmed(self, name: str, stability: Any) -> bool:
        """Decide whether the zero of a test function is really the bifurcation of that name."""

    def with_reference(self, solution: Any) -> Self:
        """Return the problem with a new solution as reference."""
        return self

    def find_end(self, solution: Any) -> tuple[BranchEnd, str] | None:
        """Return how and why the branch ends at a solution, or None if it continues."""
        return None

    def along_parameter(self) -> np.ndarray:
        """Return the unit vector (n,) that selects the parameter in the solution vector."""
        return np.append(np.zeros(len(self.metric) - 1), 1.0)

    def length(self, change: np.ndarray) -> float:
        """Compute the length of a change of the solution, in units of the longest step."""
        return float(np.sqrt(np.sum(self.metric * change**2)))


class NotConverged(Exception):
    """Error that the corrector of a continuation found no solution; its message says why."""


@dataclass(frozen=True)
class Point:
    """Solution on a branch, with its tangent, stability and test functions for bifurcations.

    tangent: (n,).
    """

    solution: Any
    tangent: np.ndarray
    stability: Any
    tests: dict[str, float]


@dataclass(frozen=True)
class Bifurcation:
    """Bifurcation of a branch: its type, as named in the literature, and the solution there.

    located: False if only the next point of the branch could be computed.
    """

    name: str
    point: Point
    located: bool = True


@dataclass(frozen=True)
class Branch:
    """Branch of solutions: points in order, bifurcations, and how and why the branch ends."""

    points: tuple[Point, ...]
    bifurcations: tuple[Bifurcation, ...]
    end: BranchEnd
    reason: str

    @property
    def complete(self) -> bool:
        """Whether the branch was followed to its end."""
        return self.end is not BranchEnd.INCOMPLETE


@dataclass(frozen=True)
class Range:
    """Limits of a continuation: range and step of the parameter, number of points, orbit size.

    low <= parameter <= high, in at most max_points points. longest: step of the parameter; a
    fiftieth of the range by default. ceiling: size of an orbit (`Orbit.spread`) beyond which cycles
    are not followed.
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


def correct_guess(
    problem: BranchProblem,
    guess: np.ndarray,
    border: np.ndarray,
    accuracy: float = CORRECTION_TOLERANCE,
) -> Equations:
    """Correct a predicted point of a branch by Newton steps, perpendicular to a direction.

    The steps are in the plane through the guess (n,) that is perpendicular to `border` (n,).
    accuracy: length of the last correction, in steps. Raises NotConverged.
    """
    equations, previous = problem.linearise(problem.unknowns(guess)), np.inf
    for _ in range(MAX_CORRECTIONS):
        residual = np.append(equations.residual, border @ (equations.solution.vector - guess))
        try:
            change = np.linalg.solve(equations.bordered(border), -residual)
        except np.linalg.LinAlgError:
            raise NotConverged("the equations became singular") from None
        size = problem.length(equations.derivative @ change)
        if not np.isfinite(size) or size > max(10 * previous, 100.0):
            raise NotConverged("the correction diverged")
        equations = problem.linearise(equations.unknowns + change)
        if size < accuracy:
            return equations
        previous = size
    raise NotConverged(f"no convergence in {MAX_CORRECTIONS} corrections (the last {size:.1e})")


def point_at(problem: BranchProblem, at: Equations, border: np.ndarray) -> Point:
    """Compute the tangent and the stability of a solution, as a point of its branch.

    The tangent is oriented so that `border` (n,) is positive on it.
    """
    tangent = at.along(border)
    tangent = tangent / problem.length(tangent)
    return Point(at.solution, tangent, *problem.examine(at, tangent))


def first_point(problem: BranchProblem, guess: np.ndarray, border: np.ndarray) -> Point:
    """Compute the first point of a branch from a guess of its solution.

    See `correct_guess` and `point_at`. Raises ValueError if there is no solution.
    """
    try:
        return point_at(problem, correct_guess(problem, guess, border), border)
    except NotConverged as failure:
        place = f"{guess[-1]:g} {problem.family.unit}".rstrip()
        raise ValueError(f"no {problem.sought} at {place}: {failure}") from None


def continue_branch(problem: BranchProblem, start: Point, span: Range) -> Branch:
    """Compute the branch of solutions from a start point, in the direction of its tangent."""
    points: list[Point] = [start]
    bifurcations: list[Bifurcation] = []
    step = FIRST_STEP

    def make_branch(end: BranchEnd, reason: str) -> Branch:
        return Branch(tuple(points), tuple(bifurcations), end, reason)

    while len(points) < span.max_points:
        last = points[-1]
        problem = problem.with_reference(last.solution)
        try:
            point = _next_point(problem, last, step)
        except NotConverged as failure:
            step /= 2
            if step < MIN_STEP:
                reason = f"continuation failed at {last.solution.value:.6g}: {failure}"
                return make_branch(BranchEnd.INCOMPLETE, reason)
            continue
        bound = np.clip(point.solution.value, span.low, span.high)
        is_beyond = point.solution.value != bound
        if is_beyond:
            try:
                point = _at_value(problem, point, bound)
            except NotConverged as failure:
                reason = f"continuation failed at the bound {bound:g}: {failure}"
                return make_branch(BranchEnd.INCOMPLETE, reason)
        end = problem.find_end(point.solution)
        if end is None:
            bifurcations += _find_bifurcations(problem, last, point, step)
            if is_beyond:
                end = BranchEnd.BOUND, f"reached {bound:g}"
            elif len(points) > 3 and _has_returned(start.solution, last.solution, point.solution):
                end = BranchEnd.START, "returned to its start"
        points.append(point)
        if end is not None:
            return make_branch(*end)
        step = min(1.5 * step, 1.0)
    return make_branch(BranchEnd.INCOMPLETE, f"stopped after {len(points)} points")


def _next_point(problem: BranchProblem, last: Point, step: float) -> Point:
    """Compute the point one step ahead. Raises NotConverged."""
    border = problem.metric * last.tangent
    guess = last.solution.vector + step * last.tangent
    point = point_at(problem, correct_guess(problem, guess, border), border)
    lengths = problem.length(last.tangent) * problem.length(point.tangent)
    if border @ point.tangent < MIN_COSINE * lengths:
        raise NotConverged("the branch turns too sharply")
    return point


def _at_value(problem: BranchProblem, neighbour: Point, value: float) -> Point:
    """Compute the point of the branch at a value of the parameter close to that of `neighbour`."""
    problem = problem.with_reference(neighbour.solution)
    factor = (value - neighbour.solution.value) / neighbour.tangent[-1]
    guess = neighbour.solution.vector + factor * neighbour.tangent
    equations = correct_guess(problem, guess, problem.along_parameter())
    return point_at(problem, equations, problem.metric * neighbour.tangent)


def _find_bifurcations(
    problem: BranchProblem, last: Point, point: Point, step: float
) -> list[Bifurcation]:
    """Find the bifurcations between two points, in order, each located along the step."""
    bifurcations = []
    for name, last_value in last.tests.items():
        if last_value * point.tests[name] < 0:
            try:
                length, bifurcation_point = _locate_zero(problem, last, name, step)
            except (NotConverged, ValueError):  # ValueError: the test jumps on the way
                bifurcations.append((step, Bifurcation(name, point, located=False)))
            else:
                if problem.is_confirmed(name, bifurcation_point.stability):
                    bifurcations.append((length, Bifurcation(name, bifurcation_point)))
    return [bifurcation for _, bifurcation in sorted(bifurcations, key=itemgetter(0))]


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
    signature = last.signature + share * (now.signature - last.signature)
    return bool(
        np.all(np.abs(signature - start.signature) <= CLOSURE_TOLERANCE * np.abs(start.signature))
    )
