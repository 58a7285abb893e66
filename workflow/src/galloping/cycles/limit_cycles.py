"""Limit cycles along a parameter by shooting, and their bifurcations.

One period is integrated with its derivatives by initial state and parameter; the derivative by the
initial state over the whole period is the monodromy matrix (Kuznetsov, Elements of Applied
Bifurcation Theory, ch. 5 and 10).
"""

from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations, pairwise
from typing import ClassVar, Self

import numpy as np
from scipy.interpolate import CubicSpline

from galloping.cycles import continuation
from galloping.cycles.continuation import Bifurcation, Branch, BranchEnd, Equations, Point, Range
from galloping.cycles.family import Family
from galloping.cycles.settling import Settled
from galloping.trajectory.right_hand_side import compile_system, make_tables
from galloping.trajectory.taylor import at_points, integrate

FOLD, BRANCH_POINT = "fold of cycles", "branch point"
PERIOD_DOUBLING, NEIMARK_SACKER = "period doubling", "Neimark-Sacker"

PHASES = 256  # number of phases of an orbit at which orbits are compared, a power of two
INITIAL_STEPS = 32  # first number of integration steps in a period, a power of two
MAX_STEPS = 2**14  # largest number of integration steps in a period, a power of two
TRUNCATION_TOLERANCE = 1e-13  # error of a step's Taylor series, relative to the size of each state
MAX_STEP = 0.5  # longest continuation step, relative to the size and to the period of the orbit
MIN_AMPLITUDE = 1e-12  # smallest amplitude of a moving state, relative to the greatest state
BRANCHING_STEP = 1e-2  # first step onto another branch, relative to the size of the orbit
MIN_HARMONIC = 1e-6  # smallest amplitude of a harmonic, relative to the strongest one of an orbit
FIRST_SIZES = 1e-3, 1e-2  # sizes of the first limit cycle of a branch
MIN_ORBIT_SIZE = 1e-3  # smallest size, relative to the largest of a branch: less is an equilibrium


@dataclass(frozen=True)
class Orbit:
    """Periodic solution of a model at one value of its parameter, sampled over one period.

    states: (n, n_states) at even phases of the period, n a multiple of PHASES. period: s. value: of
    the parameter. steps: of an integration that resolves the period. sizes: as of `Family`.
    """

    states: np.ndarray
    period: float
    value: float
    steps: int = INITIAL_STEPS
    sizes: np.ndarray | float = 1.0

    @cached_property
    def vector(self) -> np.ndarray:
        """Vector of the orbit: its states at PHASES equally spaced phases, period and parameter."""
        thinned = self.states[:: len(self.states) // PHASES]
        return np.append(thinned.ravel(), [self.period, self.value])

    @cached_property
    def at(self) -> CubicSpline:
        """Periodic spline that gives the states at phases, as fractions of the period.

        From (n_phases,) to (n_phases, n_states).
        """
        closed = np.vstack([self.states, self.states[:1]])
        return CubicSpline(np.linspace(0, 1, len(closed)), closed, bc_type="periodic")

    @cached_property
    def spread(self) -> float:
        """Root mean square distance of the orbit from its mean state, in units of `sizes`."""
        return float(np.sqrt(np.sum(np.var(self.states / self.sizes, axis=0))))

    @property
    def signature(self) -> np.ndarray:
        """Period and spread, which distinguish orbits at the same value of the parameter."""
        return np.array([self.period, self.spread])

    def half_range(self) -> np.ndarray:
        """Compute the amplitude of each state, half of its range over a period.

        Shape (n_states,), zero if constant.
        """
        turns = self.at.derivative().roots(extrapolate=False)  # NaN for a constant state
        half = np.array([np.ptp(self.at(turn)[:, k]) / 2 for k, turn in enumerate(turns)])
        return np.where(
            half > MIN_AMPLITUDE * self.sizes * np.abs(self.states / self.sizes).max(), half, 0.0
        )

    def compare_halves(self) -> np.ndarray:
        """Compute the difference between second and first half of the orbit, phase by phase.

        Shape (PHASES / 2, n_states), in `sizes`. A branch of doubled period ends where the halves
        are equal; beyond, continuation finds the same branch again, with the halves exchanged.
        """
        first, second = np.split(self.vector[:-2].reshape(PHASES, -1) / self.sizes, 2)
        return second - first


def circle(
    centre: np.ndarray,
    mode: np.ndarray,
    period: float,
    value: float,
    sizes: np.ndarray | float = 1.0,
) -> Orbit:
    """Make an elliptical orbit about a centre: the harmonic oscillation of one complex mode.

    The states are centre + Re(mode exp(2 pi i t / period)). sizes: as of `Family`.
    """
    turn = np.exp(2j * np.pi * np.arange(PHASES) / PHASES)[:, np.newaxis]
    return Orbit(centre + (mode * turn).real, period, value, sizes=sizes)


@dataclass(frozen=True)
class Floquet:
    """Floquet multipliers of a limit cycle, which determine its stability.

    multipliers: (n_states - 1,) complex, largest first, without the trivial one. trivial_defect:
    |mu - 1| of the multiplier along the orbit, which is 1 for an exact orbit.
    """

    multipliers: np.ndarray
    trivial_defect: float

    @property
    def largest(self) -> float:
        """Modulus of the largest multiplier; the trivial multiplier does not count."""
        return float(np.abs(self.multipliers[0])) if len(self.multipliers) else 0.0

    @property
    def stable(self) -> bool:
        """Whether the limit cycle is stable: all multipliers are inside the unit circle."""
        return self.largest < 1


def floquet(monodromy: np.ndarray) -> Floquet:
    """Compute the Floquet multipliers of a limit cycle from its monodromy matrix."""
    values = np.linalg.eigvals(monodromy).astype(complex)
    trivial = np.argmin(np.abs(values - 1))
    others = np.delete(values, trivial)
    order = np.lexsort([-others.imag, -np.abs(others)])
    return Floquet(others[order], float(np.abs(values[trivial] - 1)))


@dataclass(frozen=True)
class CycleProblem(continuation.BranchProblem):
    """Continuation problem of the limit cycles of a family of models along its parameter.

    A reference orbit fixes the phase. Unknowns are the state at phase 0, the period and the
    parameter. resolution: longest step of the parameter. slope: (n_states, n_terms) derivative of
    the coefficients by the parameter, at the reference. largest: size of the largest orbit so far.
    ceiling: size (`Orbit.spread`) beyond which the branch is not followed.
    """

    family: Family
    reference: Orbit
    resolution: float
    slope: np.ndarray
    ceiling: float
    largest: float
    sought: ClassVar[str] = "limit cycle near the given motion"

    @classmethod
    def about(
        cls, family: Family, orbit: Orbit, resolution: float, ceiling: float = np.inf
    ) -> Self:
        """Make the continuation problem of a branch that begins near a given orbit."""
        slope = family.slope(orbit.value, resolution)
        return cls(family, orbit, resolution, slope, ceiling, orbit.spread)

    @cached_property
    def metric(self) -> np.ndarray:
        """Weights (n,) of the squared components of a step, which define its length."""
        orbit = self.reference
        states = self._of_states / (PHASES * (MAX_STEP * orbit.spread) ** 2)
        return np.append(states, [(MAX_STEP * orbit.period) ** -2.0, self.resolution**-2.0])

    @cached_property
    def _of_states(self) -> np.ndarray:
        """Inverse squared sizes of the states at all phases, (PHASES n_states,)."""
        sizes = np.broadcast_to(self.family.sizes, self.reference.states.shape[1])
        return np.tile(sizes**-2.0, PHASES)

    @cached_property
    def phase(self) -> np.ndarray:
        """Coefficients (n,) of the integral phase condition on changes of the vector."""
        velocity = self.reference.at(np.arange(PHASES) / PHASES, 1)
        return np.append(self._of_states * velocity.ravel() / PHASES, [0.0, 0.0])

    def unknowns(self, vector: np.ndarray) -> np.ndarray:
        """Extract initial state, period and parameter from the vector of an orbit."""
        return np.append(vector[: len(self.slope)], vector[-2:])

    def linearise(self, unknowns: np.ndarray) -> Equations:
        """Integrate one period; return residual and Jacobian of the periodicity conditions.

        The number of steps is increased until the orbit is accurate enough.
        """
        n, (period, value) = len(self.slope), unknowns[-2:]
        model = self.family.model(value)
        free = np.argwhere(self.slope)
        slopes, steps = self.slope[tuple(free.T)], self.reference.steps
        compiled = compile_system(make_tables(model.terms, n), model.coefficients, free, slopes)
        # columns by parameter, if a coefficient depends on it, and start: to the order of unknowns
        to_unknowns = np.vstack([np.eye(n + 2)[-1:][: len(free)], np.eye(n, n + 2)])
        while True:
            states, derivative, end, end_derivative, truncation = _integrate_period(
                compiled, unknowns[:n], period, steps
            )
            if truncation < TRUNCATION_TOLERANCE:
                break
            steps *= 2
            if steps > MAX_STEPS:
                raise continuation.NotConverged(f"{MAX_STEPS} steps do not resolve the orbit")
        orbit = Orbit(states, period, value, steps, self.family.sizes)
        derivative = derivative[:: len(states) // PHASES] @ to_unknowns
        end_derivative = end_derivative @ to_unknowns
        rates = model(orbit.vector[:-2].reshape(PHASES, n))
        derivative[..., n] = np.arange(PHASES)[:, np.newaxis] / PHASES * rates
        end_derivative[:, n] = model(end[np.newaxis])[0]
        derivative = np.vstack([derivative.reshape(-1, n + 2), np.eye(n + 2)[n:]])
        shift = self.phase @ (orbit.vector - self.reference.vector)
        residual = np.append(end - unknowns[:n], shift)
        jacobian = np.vstack([end_derivative - np.eye(n, n + 2), self.phase @ derivative])
        return Equations(orbit, unknowns, residual, jacobian, derivative)

    def examine(self, at: Equations, tangent: np.ndarray) -> tuple[Floquet, dict[str, float]]:
        """Compute Floquet multipliers, and test functions for bifurcations of limit cycles."""
        n = len(self.slope)
        stability = floquet(at.jacobian[:n, :n] + np.eye(n))
        mu = stability.multipliers
        pairs = [a * b - 1 for a, b in combinations(mu, 2)]
        return stability, {
            FOLD: tangent[-1],
            BRANCH_POINT: float(np.linalg.det(at.bordered(self.metric * tangent))),
            PERIOD_DOUBLING: float(np.prod(mu + 1).real),
            NEIMARK_SACKER: float(np.prod(pairs).real) if pairs else 1.0,
        }

    def is_confirmed(self, name: str, stability: Floquet) -> bool:
        """Decide whether a zero of a test function is really the bifurcation of that name.

        Two real multipliers with product one are no Neimark-Sacker bifurcation.
        """
        if name != NEIMARK_SACKER:
            return True
        mu = stability.multipliers
        return bool(np.any((np.abs(mu.imag) > 1e-6) & (np.abs(np.abs(mu) - 1) < 1e-4)))

    def with_reference(self, orbit: Orbit) -> Self:
        """Return the problem with a new reference orbit."""
        slope = self.family.slope(orbit.value, self.resolution)
        largest = max(self.largest, orbit.spread)
        return replace(self, reference=orbit, slope=slope, largest=largest)

    def find_end(self, orbit: Orbit) -> tuple[BranchEnd, str] | None:
        """Return how and why the branch ends at an orbit, or None if it continues."""
        if orbit.spread > self.ceiling:
            return BranchEnd.CEILING, f"grew beyond {self.ceiling:g}"
        if np.sum(orbit.compare_halves() * self.reference.compare_halves()) < 0:
            return BranchEnd.PERIOD_DOUBLING, "ended at a period doubling"
        if orbit.spread < MIN_ORBIT_SIZE * self.largest:
            return BranchEnd.EQUILIBRIUM, "ended at an equilibrium"
        return None


def _integrate_period(compiled, start: np.ndarray, period: float, steps: int) -> tuple:
    """Integrate one period from `start` (n,).

    Returns states at even phases, their derivatives by the parameter and the start, the same of the
    end, and the truncation error.
    """
    n, samples_per_step = len(start), max(1, PHASES // steps)
    window = np.repeat(np.arange(steps), samples_per_step)
    tau = np.tile(np.arange(samples_per_step) / samples_per_step, steps)
    powers, samples, _ = at_points(compiled, window, tau, steps, n)
    with np.errstate(all="ignore"):
        states, derivative, end, end_derivative, truncation = integrate(
            compiled, period / steps, np.array([0, steps]), start[np.newaxis], powers,
            np.arange(n), np.zeros((steps, 1, 0)), True, samples,
        )  # fmt: skip
    states, derivative = (
        array.swapaxes(1, 2).reshape(-1, n, *array.shape[3:]) for array in (states, derivative)
    )
    return states, derivative, end[0], end_derivative[0], truncation


def from_hopf(
    family: Family, hopf: Bifurcation, span: Range, sizes: tuple[float, ...] = FIRST_SIZES
) -> Branch:
    """Compute the branch of limit cycles that starts from a Hopf bifurcation.

    hopf: of `equilibrium_branch`. sizes: of the first limit cycle, in the sizes of the family, in
    order of trial: rounding may hide a small one. Raises ValueError if there is none.
    """
    *smaller, last = sizes
    for size in smaller:
        with suppress(ValueError):
            return _from_hopf(family, hopf, span, size)
    return _from_hopf(family, hopf, span, last)


def _from_hopf(family: Family, hopf: Bifurcation, span: Range, size: float) -> Branch:
    """Apply `from_hopf` with one size of the first limit cycle."""
    equilibrium, (frequency, mode) = hopf.point.solution, hopf.point.stability.critical()
    swing = mode * (size * np.sqrt(2) / np.linalg.norm(mode / family.sizes))
    orbit = circle(equilibrium.state, swing, 2 * np.pi / frequency, equilibrium.value, family.sizes)
    problem = CycleProblem.about(family, orbit, span.longest, span.ceiling)
    growth = np.append((orbit.states - equilibrium.state).ravel(), [0.0, 0.0])
    start = continuation.first_point(problem, orbit.vector, problem.metric * growth)
    return continuation.continue_branch(problem, start, span)


def from_branching(family: Family, at: Bifurcation, span: Range) -> tuple[Branch, ...]:
    """Compute the branches of limit cycles that start at a period doubling or branch point.

    Two branches leave a branch point; those that leave a period doubling are one, shifted in phase.
    Raises ValueError for a bifurcation of another name, or if nothing branches off.
    """
    orbit, tangent = at.point.solution, at.point.tangent
    if at.name not in (PERIOD_DOUBLING, BRANCH_POINT) or not at.located:
        raise ValueError(f"no limit cycles branch off at a {at.name} at {orbit.value:g}")
    doubled = at.name == PERIOD_DOUBLING
    if doubled:
        states, change = (v[:-2].reshape(PHASES, -1) for v in (orbit.vector, tangent))
        tangent = np.append(_repeat_orbit(change).ravel(), tangent[-2:] * (2, 1))
        orbit = replace(
            orbit, states=_repeat_orbit(states), period=2 * orbit.period, steps=2 * orbit.steps
        )
    problem = CycleProblem.about(family, orbit, span.longest, span.ceiling)
    linearised = problem.linearise(problem.unknowns(orbit.vector))
    # the second null vector of the equations, perpendicular to the tangent
    *_, right = np.linalg.svd(linearised.bordered(problem.metric * tangent))
    direction = linearised.derivative @ right[-1]
    direction *= BRANCHING_STEP / (MAX_STEP * problem.length(direction))
    branches = []
    for departure in (direction,) if doubled else (direction, -direction):
        start = continuation.first_point(
            problem, orbit.vector + departure, problem.metric * departure
        )
        branches.append(continuation.continue_branch(problem, start, span))
    return tuple(branches)


def _repeat_orbit(states: np.ndarray) -> np.ndarray:
    """Sample two turns of an orbit at as many phases, (PHASES, n_states)."""
    return np.tile(states[::2], (2, 1))


def from_motion(
    family: Family, value: float, time: np.ndarray, states: np.ndarray, span: Range
) -> tuple[Branch, Branch]:
    """Compute the branch of limit cycles, in both directions, from a settled simulated motion.

    The limit cycle that the motion has reached is the start of both parts. time: (n,) s, states:
    (n, n_states) of the settled motion at `value` of the parameter, several periods long. Raises
    ValueError if the motion does not repeat.
    """
    start = cycle_from_motion(family, value, time, states, span.longest)
    problem = CycleProblem.about(family, start.solution, span.longest, span.ceiling)
    linearised = problem.linearise(problem.unknowns(start.solution.vector))
    down = continuation.point_at(problem, linearised, -problem.metric * start.tangent)
    return continuation.continue_branch(problem, down, span), continuation.continue_branch(
        problem, start, span
    )


def cycle_from_motion(
    family: Family, value: float, time: np.ndarray, states: np.ndarray, resolution: float
) -> Point:
    """Compute the exact limit cycle that a settled simulated motion has reached.

    The arguments are those of `from_motion`.
    """
    orbit = _last_turn(time, states, value, family.sizes)
    point = _correct_orbit(family, orbit, resolution)
    orbit = point.solution
    if (turns := _count_turns(orbit)) <= 1:
        return point
    one_turn = orbit.at(np.arange(PHASES) / PHASES / turns)
    orbit = replace(orbit, states=one_turn, period=orbit.period / turns, value=value)
    return _correct_orbit(family, orbit, resolution)


def _correct_orbit(family: Family, orbit: Orbit, resolution: float) -> Point:
    """Correct an orbit to the limit cycle near it, at its value of the parameter."""
    problem = CycleProblem.about(family, orbit, resolution)
    return continuation.first_point(problem, orbit.vector, problem.along_parameter())


def _count_turns(orbit: Orbit) -> int:
    """Count the turns of an orbit in its period, by the common divisor of its harmonics.

    Zero if the orbit is constant. A motion sampled coarsely may come close to its end only after
    several turns.
    """
    changes = orbit.vector[:-2].reshape(PHASES, -1) / orbit.sizes
    strength = np.linalg.norm(np.fft.rfft(changes, axis=0), axis=1)[1:]
    return int(np.gcd.reduce(1 + np.flatnonzero(strength > MIN_HARMONIC * strength.max())))


def find_cycle_from_motion(family: Family, value: float, motion: Settled) -> Point | None:
    """Compute the exact limit cycle that a motion has reached; None if it is on no limit cycle."""
    if motion.kind == "cycle":
        with suppress(ValueError):
            return cycle_from_motion(family, value, motion.time, motion.states, resolution=1.0)
    return None


def _last_turn(
    time: np.ndarray, states: np.ndarray, value: float, sizes: np.ndarray | float
) -> Orbit:
    """Extract the last period of a motion, since it was last closest to its end."""
    distance = np.linalg.norm((states - states[-1]) / sizes, axis=1)
    is_near = distance < 0.05 * np.max(distance)
    far_rows = np.flatnonzero(~is_near)
    earlier_rows = np.flatnonzero(is_near[: far_rows[-1]]) if len(far_rows) else far_rows
    if not len(earlier_rows):
        raise ValueError(f"the motion at {value:g} does not come back to where it ends")
    first = np.max(np.flatnonzero(~is_near[: earlier_rows[-1]]), initial=-1) + 1
    passage = np.arange(first, earlier_rows[-1] + 1)
    begin = passage[np.argmin(distance[passage])]
    period = float(time[-1] - time[begin])
    times = time[begin] + period * np.arange(PHASES) / PHASES
    return Orbit(CubicSpline(time, states)(times), period, value, sizes=sizes)


def find_cycles_at(family: Family, branch: Branch, value: float) -> list[Point]:
    """Compute all limit cycles of a branch at a given value of the parameter.

    Raises ValueError if one cannot be computed from its neighbours.
    """
    points = []
    for begin_point, end_point in pairwise(branch.points):
        begin, end = begin_point.solution.value, end_point.solution.value
        if (begin - value) * (end - value) > 0 or begin == end or end == value:
            continue
        neighbour = min(begin_point, end_point, key=lambda p: abs(p.solution.value - value))
        problem = CycleProblem.about(family, neighbour.solution, abs(end - begin))
        ahead = neighbour.tangent * ((value - neighbour.solution.value) / neighbour.tangent[-1])
        guess = neighbour.solution.vector + ahead
        points.append(continuation.first_point(problem, guess, problem.along_parameter()))
    if branch.points[-1].solution.value == value:
        points.append(branch.points[-1])
    return points
