"""Equilibrium, natural frequencies, damping and limit cycle of a model, with intervals."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import OptimizeResult, linear_sum_assignment, root

from galloping.arrays import Immutable
from galloping.behaviour.following import half_range, ranges_of, simulator_of
from galloping.cycles.family import constant_family
from galloping.cycles.limit_cycles import Orbit, find_cycle_from_motion
from galloping.cycles.prediction import cycle_intervals, find_nearby_cycles
from galloping.cycles.settling import Pace, estimate_missing_sizes, settle_in_periods
from galloping.identification.drawn_models import add_higher_degree_effects, draw_models_and_rivals
from galloping.identification.free_motion.answer import FREE_MOTION
from galloping.identification.identified_model import IdentifiedModel
from galloping.identification.preparation.smoothing import means_of
from galloping.model.intervals import NORMAL_95, decay_interval, interval_of_draws
from galloping.model.polynomial import PolynomialModel, linear_term, velocity_pairs
from galloping.recording.samples import Recording

MIN_DRAW_SHARE = 0.9  # smallest share of the drawn models from which an interval is made
DIFFERENCE_STEP = 1e-2  # step of a coefficient in finite differences, in standard errors
EXTRAPOLATION_RATIO = 1.2  # size of an extrapolated limit cycle, relative to the recorded motion
EQUILIBRIUM_TOLERANCE = 1e-9  # error of an equilibrium, in sizes of the motion
MIN_DAMPING_RATIO = 1e-9  # smallest damping ratio that is no rounding error


@dataclass(frozen=True, eq=False)
class Value(Immutable):
    """Estimated number with its 95 % interval.

    Attributes
    ----------
    value, low, high : float
        NaN if unknown.
    """

    value: float
    low: float = np.nan
    high: float = np.nan

    @classmethod
    def about(cls, value: float, half: float) -> "Value":
        """Make a value with the interval from `value - half` to `value + half`."""
        return cls(float(value), float(value - half), float(value + half))

    @classmethod
    def of(cls, value: float, ends: Iterable[float]) -> "Value":
        """Make a value with an interval, which is widened if it does not contain the value.

        ends: of the interval, as from `interval_of_draws`.
        """
        low, high = ends
        return cls(float(value), float(min(low, value)), float(max(high, value)))


@dataclass(frozen=True, eq=False)
class Surroundings(Immutable):
    """Range of each state in the recorded motion, in which an equilibrium is searched for.

    middle, low, high: (n_states,) mean, least and greatest sample; zero and unbounded if not
    measured. rates: (n_states,) half ranges of the rates of the states, zero where unknown.
    """

    middle: NDArray[np.float64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    rates: NDArray[np.float64] | float = 0.0

    def sizes(self, model: PolynomialModel) -> NDArray[np.float64]:
        """Return the amplitudes (n_states,), estimated by a model where not measured."""
        half = half_range(self.low, self.high)
        return estimate_missing_sizes(half, model, self.middle, self.rates)

    @classmethod
    def of(cls, recordings: Sequence[Recording]) -> "Surroundings":
        """Determine the mean and the range of each state over several recordings."""
        values = np.concatenate([recording.values for recording in recordings])
        rates = [each.rates for each in recordings if each.rates is not None]
        of_rates = half_range(*ranges_of(np.concatenate(rates))) if rates else 0.0
        return cls(means_of(values), *ranges_of(values), of_rates)

    def rest(self, model: PolynomialModel) -> np.ndarray | None:
        """Find an equilibrium of a model inside the recorded range; None if there is none.

        The search for it, (n_states,), begins at the middle.
        """
        solution = find_equilibrium(model, self.middle, self.sizes(model))
        is_inside = np.all((solution.x >= self.low) & (solution.x <= self.high))
        return solution.x if solution.success and is_inside else None


def farthest_start(starts: np.ndarray, middle: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """Return the known initial state that is farthest from the middle of a motion.

    A large motion may approach a limit cycle that a small one does not. starts: (n_recordings,
    n_states), NaN where unknown. middle, sizes: (n_states,) of the motion. The last start if none
    is known.
    """
    distances = np.linalg.norm((starts - middle) / sizes, axis=1)
    return starts[np.nanargmax(distances)] if np.isfinite(distances).any() else starts[-1]


def find_equilibrium(
    model: PolynomialModel, start: np.ndarray, sizes: np.ndarray
) -> OptimizeResult:
    """Search numerically for an equilibrium of a model, starting from a given state.

    With dry friction, the middle of all equilibria is searched for. start: (n_states,) state where
    the search begins. sizes: (n_states,) of the motion. Returns `success`; `x`, the state, zero
    where it differs from zero by rounding alone; and `fun`, the rates there, in sizes of the motion
    per radian.
    """
    model = model.without_dry_friction()
    time = Pace.of(model, start).slow / (2.0 * np.pi)
    solution = root(
        lambda x: model((x * sizes)[np.newaxis])[0] * time / sizes, start / sizes,
        jac=lambda x: model.jacobian((x * sizes)[np.newaxis])[0] * time * sizes / sizes[:, None],
        tol=EQUILIBRIUM_TOLERANCE,
    )  # fmt: skip
    # the solver reports no success if the start is an equilibrium
    solution.success |= bool(np.max(np.abs(solution.fun)) < EQUILIBRIUM_TOLERANCE)
    solution.x = np.where(np.abs(solution.x) < EQUILIBRIUM_TOLERANCE, 0.0, solution.x) * sizes
    return solution


@dataclass(frozen=True, eq=False)
class Dynamics(Immutable):
    """Equilibrium, natural frequencies, damping and limit cycle of a model, with intervals.

    Attributes
    ----------
    rest : mapping of str to Value
        The equilibrium inside the recorded motion, m, by coordinate; empty if there is none.
    frequencies : mapping of str to Value
        Natural frequencies of small motions about it, Hz, by the coordinate that moves most.
    damping : mapping of str to Value
        Net damping of these motions, ratio to critical; negative if they grow.
    kind : str
        Kind of the settled motion, as in `settle`.
    period : Value or None
        Of the limit cycle, s; None if there is none, or it was not found exactly.
    half_range : mapping of str to Value
        Amplitude of the limit cycle, by coordinate.
    at : mapping of str to float
        The constant values of the inputs, their means.
    is_stable : bool
        Whether motions near the limit cycle approach it; True if there is none, or if unknown.
    """

    rest: Mapping[str, Value]
    frequencies: Mapping[str, Value]
    damping: Mapping[str, Value]
    kind: str
    period: Value | None
    half_range: Mapping[str, Value]
    at: Mapping[str, float] = field(default_factory=dict)
    is_stable: bool = True


def dynamics(
    identified: IdentifiedModel, around: Surroundings, rng: np.random.Generator
) -> Dynamics | None:
    """Compute the equilibrium, natural frequencies, damping and limit cycle of a model.

    None without a model or without any velocity state.
    """
    model = identified.model
    pairs = velocity_pairs(model.states)
    if not pairs or identified.status == "refused":
        return None
    if identified.is_forced:
        return _compute_forced_dynamics(identified, pairs, around)
    if identified.diagnostics.get("path") == FREE_MOTION:
        return _compute_free_dynamics(identified, pairs, around)
    models = draw_models_and_rivals(identified, rng)
    small = add_higher_degree_effects(models, identified, rng)
    fewest = MIN_DRAW_SHARE * len(models)
    best = _linear_properties(model, pairs, around)
    ends = interval_of_draws([_linear_properties(each, pairs, around) for each in small], fewest)
    names = [model.states[i] for i in pairs]
    rest, frequencies, damping = _name_values(names, best, ends)
    for i, name in zip(pairs, names, strict=True):
        damping[name] = widen_zero_damping(identified, i, frequencies[name].value, damping[name])
    pace, sizes = Pace.of(model, around.middle), around.sizes(model)
    start = farthest_start(identified.initial_states, around.middle, sizes)
    motion = settle_in_periods(simulator_of(model), model, start, pace, sizes)
    if motion.kind != "cycle":
        return Dynamics(rest, frequencies, damping, motion.kind, None, {})
    point = find_cycle_from_motion(constant_family(model, sizes), 0.0, motion)
    if point is None:  # the motion repeats, but the solver does not converge
        half = {model.states[i]: Value(float(motion.half_range[i])) for i in pairs}
        return Dynamics(rest, frequencies, damping, "cycle", None, half)
    orbit = point.solution
    orbits = [other for each in models if (other := _find_orbit(each, orbit, pace)) is not None]
    ends, half = cycle_intervals(orbits, len(model.states), fewest), orbit.half_range()
    return Dynamics(
        rest, frequencies, damping, "cycle", Value.of(orbit.period, ends[:, -1]),
        {model.states[i]: Value.of(half[i], ends[:, i]) for i in pairs},
        is_stable=point.stability.stable,
    )  # fmt: skip


def widen_zero_damping(
    identified: IdentifiedModel, coordinate: int, frequency: float, damping: Value
) -> Value:
    """Give zero damping of a mode an interval, in which a damping term would not be detected.

    coordinate: index of the mode's coordinate. frequency: Hz. Returns `damping` unchanged if it is
    not zero up to rounding, the library has no such term, or no limit is known.
    """
    model = identified.model
    velocity = velocity_pairs(model.states)[coordinate]
    term = linear_term(velocity, len(model.states))
    if not abs(damping.value) < MIN_DAMPING_RATIO or term not in model.terms:
        return damping
    limit = identified.detection_limits[velocity, model.terms.index(term)]
    half = float(limit / (4.0 * np.pi * frequency))
    return Value.about(0.0, half) if np.isfinite(half) else damping


def _compute_free_dynamics(
    identified: IdentifiedModel, pairs: dict[int, int], around: Surroundings
) -> Dynamics:
    """Compute the dynamics of a linear model of free motion, with its further modes.

    Modes without known errors are left out.
    """
    best, ends, _ = _propagate_covariance(identified, pairs, around)
    names = [identified.model.states[i] for i in pairs]
    rest, frequencies, damping = _name_values(names, best, ends)
    known_damping = best[2][np.isfinite(best[2])]
    if np.any(known_damping < -MIN_DAMPING_RATIO):
        kind = "diverged"
    elif len(known_damping) and np.all(known_damping <= MIN_DAMPING_RATIO):
        kind = "cycle"
    else:
        kind = "rest"
    for mode in identified.further_modes:
        if mode.is_steady or not mode.frequency_error:  # steady components have no damping
            continue
        half = NORMAL_95 * mode.frequency_error / (2.0 * np.pi)
        frequencies[mode.name] = Value.about(mode.frequency / (2.0 * np.pi), half)
        omega = np.hypot(mode.frequency, mode.growth)
        half = NORMAL_95 * mode.growth_error / omega
        damping[mode.name] = Value.about(-mode.growth / omega, half)
    return Dynamics(rest, frequencies, damping, kind, None, {})


def _propagate_covariance(
    identified: IdentifiedModel, pairs: dict[int, int], around: Surroundings
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Propagate the covariance of the coefficients to properties of small motions.

    Returns values and ends of 95 % intervals of equilibrium, frequency and damping of each
    coordinate, as `_name_values` needs them, and standard deviations of the decays, 1/s.
    """
    model, support = identified.model, np.argwhere(identified.support)
    errors = np.sqrt(np.diag(identified.covariance))
    is_known = errors == 0.0
    errors[is_known] = 1.0

    def properties(step: np.ndarray) -> np.ndarray:
        coefficients = model.coefficients.copy()
        coefficients[tuple(support.T)] += step
        return _linear_properties(replace(model, coefficients=coefficients), pairs, around)

    best = properties(np.zeros(len(errors)))
    steps = DIFFERENCE_STEP * np.diag(np.where(is_known, 0.0, errors))
    differences = np.array([properties(step) - properties(-step) for step in steps])
    slopes = differences / (2.0 * DIFFERENCE_STEP)
    correlation = identified.covariance / np.outer(errors, errors)
    deviation = np.sqrt(np.einsum("ikn,ij,jkn->kn", slopes, correlation, slopes))
    slopes = 2.0 * np.pi * (slopes[:, 1] * best[2] + slopes[:, 2] * best[1])
    decay_error = np.sqrt(np.einsum("in,ij,jn->n", slopes, correlation, slopes))
    half = NORMAL_95 * deviation
    return best, np.stack([best - half, best + half]), decay_error


def _name_values(
    names: Sequence[str], best: np.ndarray, ends: np.ndarray
) -> tuple[dict[str, Value], dict[str, Value], dict[str, Value]]:
    """Make values of equilibrium, frequency and damping by coordinate; no equilibrium if unknown.

    best: (3, n_coordinates), as of `_linear_properties`; ends: (2, 3, n_coordinates), of intervals.
    """
    rest, frequencies, damping = (
        {name: Value.of(best[k, n], ends[:, k, n]) for n, name in enumerate(names)}
        for k in range(3)
    )
    return {} if np.isnan(best[0]).any() else rest, frequencies, damping


def _compute_forced_dynamics(
    identified: IdentifiedModel, pairs: dict[int, int], around: Surroundings
) -> Dynamics:
    """Compute the dynamics of a model under random forces."""
    model = identified.model
    best, ends, decay_error = _propagate_covariance(identified, pairs, around)
    names = [model.states[i] for i in pairs]
    rest, frequencies, damping = _name_values(names, best, ends)
    decay = 2.0 * np.pi * best[1] * best[2]
    duration = float(identified.diagnostics["duration"])
    for n, name in enumerate(names):
        omega = 2.0 * np.pi * best[1, n]
        low, high = decay_interval(decay[n], decay_error[n], duration)
        damping[name] = Value(best[2, n], low / omega, high / omega)
    for mode in (resonance for resonance in identified.resonances if resonance.is_mode):
        (error, ratio_error), omega = mode.errors, mode.frequency
        half = NORMAL_95 * error / (2.0 * np.pi)
        frequencies[mode.name] = Value.about(omega / (2.0 * np.pi), half)
        low, high = decay_interval(omega * mode.damping, omega * ratio_error, duration)
        damping[mode.name] = Value(mode.damping, low / omega, high / omega)
    return Dynamics(rest, frequencies, damping, "forced", None, {})


def expected_dynamics(
    model: PolynomialModel, identified: IdentifiedModel, around: Surroundings
) -> Dynamics | None:
    """Compute equilibrium, frequencies, damping and limit cycle of a known (true) model.

    Its equilibrium is near zero. Its initial state is as far from zero as that of the identified
    model from the recorded equilibrium.
    """
    if model.states != identified.model.states:
        return None
    rest = around.rest(identified.model)
    shift = around.middle if rest is None else rest
    start = identified.initial_states - shift
    exact = IdentifiedModel(model, initial_states=start)
    ends = around.low - shift, around.high - shift
    about = Surroundings(np.zeros_like(shift), *ends, around.rates)
    return dynamics(exact, about, np.random.default_rng(0))


def _find_orbit(model: PolynomialModel, orbit: Orbit, pace: Pace) -> Orbit | None:
    """Find the limit cycle of another model near a known one, or by simulation from there."""
    if nearby := find_nearby_cycles([model], orbit):
        return nearby[0]
    motion = settle_in_periods(simulator_of(model), model, orbit.states[0], pace, orbit.sizes)
    point = find_cycle_from_motion(constant_family(model, orbit.sizes), 0.0, motion)
    return point.solution if point else None


def _linear_properties(
    model: PolynomialModel, pairs: dict[int, int], around: Surroundings
) -> np.ndarray:
    """Compute equilibrium, m, frequency, Hz, and damping ratio of the modes: (3, n_coordinates)."""
    result = np.full((3, len(pairs)), np.nan)
    if (rest := around.rest(model)) is None:
        return result
    result[0] = rest[list(pairs)]
    modes, sizes = model.small_motions(rest).oscillations(), around.sizes(model)[:, np.newaxis]
    rows, columns = match_modes(np.abs(modes.shapes / sizes)[list(pairs)])
    result[1:, rows] = modes.omega[columns] / (2 * np.pi), modes.damping[columns]
    return result


def match_modes(shares: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Match states and modes one to one, so that states move most in the modes they name.

    shares: (n_states, n_modes), how much each state moves in a mode, relative to the motion.
    Returns the indices of the states, and those of their modes.
    """
    shares = shares / np.maximum(np.linalg.norm(shares, axis=0), np.finfo(float).tiny)
    return linear_sum_assignment(shares, maximize=True)
