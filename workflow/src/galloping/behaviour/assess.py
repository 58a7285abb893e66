"""Equilibria, their stability, limit cycles and onset of an identified model.

They are computed at a constant value of each input, or along a range of one input. Intervals are
those of models drawn with the covariance of the coefficients.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise, product

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import linear_sum_assignment

from galloping.arrays import as_finite, one_thread
from galloping.behaviour.assessment import (
    Assessment,
    Condition,
    Cycle,
    Onset,
    RestPosition,
    SmallMotion,
)
from galloping.behaviour.dynamics import (
    EXTRAPOLATION_RATIO,
    MIN_DAMPING_RATIO,
    Value,
    farthest_start,
    find_equilibrium,
    match_modes,
    widen_zero_damping,
)
from galloping.behaviour.following import simulator_of
from galloping.cycles.continuation import Point, Range
from galloping.cycles.diagram import Diagram, diagram, equilibrium_branch, hopf_points
from galloping.cycles.family import Family, constant_family
from galloping.cycles.limit_cycles import find_cycle_from_motion, find_cycles_at
from galloping.cycles.prediction import cycle_intervals, find_nearby_cycles
from galloping.cycles.settling import Pace, Settled, estimate_missing_sizes, settle_in_periods
from galloping.identification.drawn_models import add_higher_degree_effects, draw_models_and_rivals
from galloping.identification.identified_model import IdentifiedModel
from galloping.model.intervals import interval_of_draws
from galloping.model.polynomial import PolynomialModel, velocity_pairs
from galloping.progress_reports import passing
from galloping.readers.units import is_span

# Lengths are in sizes of the motion.
DISTURBANCE = 1e-2  # displacement from an equilibrium at the start of a simulation
SEARCH_RADIUS = 2.5  # distance from the middle of the motion within which equilibria are sought
MIN_DISTANCE = 1e-2  # smallest distance between equilibria; of limit cycles, in sizes of these
MAX_STARTS = 256  # number of initial guesses of an equilibrium, at most
MIN_SIZE_RATIO = 1e-3  # smallest size of a coordinate, relative to the largest one
MAX_CYCLE_SIZE = 10.0  # largest size of a limit cycle that is computed


@one_thread
def assess(
    found: IdentifiedModel,
    at: Mapping[str, float | Sequence[float]] | None = None,
    *,
    seed: int = 0,
) -> Assessment:
    """Compute the equilibria, limit cycles and onset of galloping of an identified model.

    Parameters
    ----------
    found : IdentifiedModel
    at : mapping of str to float or sequence of float, optional
        Value of each input of the model. One input may have several values: limit cycles are then
        followed along their range, and the onset is located.
    seed : int, optional
        Seed of the random numbers for the intervals.

    Returns
    -------
    Assessment

    Raises
    ------
    ValueError
        If there is no model, an input has no value or one that is not finite, or an input of a span
        has the opposite sign of nearly all recorded values and is far from them
        (`list_extrapolations`).
    """
    if found.status == "refused":
        raise ValueError(f"there is no model to assess: {found.reason}")
    values, inputs = {}, found.model.inputs
    for name, value in (at or {}).items():
        if name not in inputs:
            wanted = f"must be one of {', '.join(inputs)}" if inputs else "the model has no inputs"
            raise ValueError(f"{name} is no input of the model; {wanted}")
        values[name] = np.unique(as_finite(name, np.atleast_1d(value), (None,)))
        if not len(values[name]):
            raise ValueError(f"{name} has no value")
    for name in inputs:
        if name not in values:
            raise ValueError(f"the model has the input {name}; give its value, --at {name}=VALUE")
    ranges = [name for name, given in values.items() if len(given) > 1]
    if len(ranges) > 1:
        raise ValueError(f"a range of {ranges[0]} and of {ranges[1]}; must be of one input")
    notes = tuple(list_extrapolations(found, values))
    fixed = {name: float(given[0]) for name, given in values.items() if len(given) == 1}
    ensemble = _Ensemble.from_identified(found, seed)
    if not ranges:
        return Assessment((_assess_condition(ensemble, fixed),), notes=notes)
    assessed = _assess_range(ensemble, fixed, ranges[0], values[ranges[0]])
    return replace(assessed, notes=(*assessed.notes, *notes))


def list_extrapolations(found: IdentifiedModel, at: Mapping[str, ArrayLike]) -> list[str]:
    """Return a note on each input whose requested values lie outside the recorded range.

    The range is that of nine tenths of the recorded values. at: one value or several of each input.
    Raises ValueError for an input of a span, such as a wind of -5 m/s, whose sign is opposite to
    that of nearly all recorded values and whose distance from their range exceeds its width.
    """
    notes = []
    for name, values in at.items():
        if not (ends := found.recorded(name)):
            continue
        low, high = ends
        least, most = float(np.nanmin(values)), float(np.nanmax(values))
        recorded = f"90 % of the recorded values lie between {low:.3g} and {high:.3g}"
        if low == high:
            recorded = f"only {low:.3g} was recorded"
        for value, bound, sign in ((least, low, 1.0), (most, high, -1.0)):
            is_far = sign * bound >= 0.0 > sign * value and sign * (bound - value) > high - low
            if is_far and is_span(found.model.states):
                requirement = "0 or more" if sign > 0 else "0 or less"
                raise ValueError(f"{name} = {value:g}: {recorded}; must be {requirement}")
        if least < low or most > high:
            value_text = f"{least:.4g}" if least == most else f"{least:.4g} to {most:.4g}"
            notes.append(
                f"Extrapolation: {name} = {value_text}, but {recorded}; beyond, further modes may "
                "grow, which the recording does not show"
            )
    return notes


@dataclass(frozen=True)
class _Ensemble:
    """An identified model, models drawn with the covariance of its coefficients, and a start.

    draws_near_rest: models drawn for small motions, with the effect of terms of the next degrees.
    start: (n_states,) recorded initial state. recorded: recorded range of states, by name.
    """

    identified: IdentifiedModel
    draws: tuple[PolynomialModel, ...]
    draws_near_rest: tuple[PolynomialModel, ...]
    start: np.ndarray
    recorded: Mapping[str, tuple[float, ...]]

    @property
    def model(self) -> PolynomialModel:
        """The identified model without its uncertainty."""
        return self.identified.model

    @classmethod
    def from_identified(cls, identified: IdentifiedModel, seed: int) -> "_Ensemble":
        states, starts = identified.model.states, identified.initial_states
        finite_starts = starts[np.isfinite(starts).all(axis=1)]
        recorded = {name: ends for name in states if (ends := identified.recorded(name))}
        extent = np.array([recorded.get(name, (0.0, 0.0)) for name in states])
        # without known states: the largest recorded ones, or 1 in their units, no equilibrium
        start = extent[np.arange(len(extent)), np.abs(extent).argmax(axis=1)]
        if len(finite_starts):
            sizes = np.ptp(extent, axis=1)
            sizes = np.where(sizes > 0.0, sizes, np.abs(finite_starts).max(axis=0))
            sizes = np.maximum(sizes, np.finfo(float).tiny)
            start = farthest_start(finite_starts, extent.mean(axis=1), sizes)
        elif not start.any():
            start = np.ones(len(states))
        rng = np.random.default_rng(seed)
        draws = draw_models_and_rivals(identified, rng)
        near_rest = add_higher_degree_effects(draws, identified, rng)
        return cls(identified, tuple(draws), tuple(near_rest), start, recorded)

    def at(self, values: Mapping[str, float]) -> "_Ensemble":
        """Return the same models at constant values of inputs."""
        constants = {name: value for name, value in values.items() if name in self.model.inputs}
        draws, near_rest = (
            tuple(model.at(constants) for model in models)
            for models in (self.draws, self.draws_near_rest)
        )
        identified = self.identified.at(constants)
        return replace(self, identified=identified, draws=draws, draws_near_rest=near_rest)

    def compute_extent(
        self, model: PolynomialModel, motion: Settled
    ) -> tuple[np.ndarray, np.ndarray]:
        """Compute middle and size, (n_states,) each, of the motion of a model from the start.

        The size is that of the start if the motion diverges, and at least half the recorded range.
        """
        start, velocities = self.start, list(velocity_pairs(model.states).values())
        if np.isfinite(motion.states).all():
            low, high = motion.states.min(axis=0), motion.states.max(axis=0)
            middle, size = (low + high) / 2, (high - low) / 2
            size = size if motion.kind != "rest" else np.abs(start - middle)
        else:
            middle, size = np.zeros_like(start), np.abs(start)
        size = estimate_missing_sizes(size, model, middle)
        if is_span(model.states):
            for group in (velocities, _list_coordinates(model)):
                size[group] = np.maximum(size[group], MIN_SIZE_RATIO * size[group].max(initial=0.0))
        else:  # its states may have any units
            size = np.maximum(size, MIN_SIZE_RATIO * np.abs(start - middle))
        ends = [self.recorded.get(name, (0.0, 0.0)) for name in model.states]
        return middle, np.maximum(size, np.ptp(ends, axis=1) / 2.0)


def _assess_condition(
    ensemble: _Ensemble, values: Mapping[str, float], known_cycles: Sequence[Point] = ()
) -> Condition:
    """Find equilibria and attractors at one value of every input by simulation from several states.

    known_cycles: limit cycles there that continuation has found.
    """
    ensemble = ensemble.at(values)
    model, recorded_start = ensemble.model, ensemble.start
    motion = _settle_motion(model, recorded_start)
    middle, size = ensemble.compute_extent(model, motion)
    rests = find_equilibria(model, middle, size)
    largest = MAX_CYCLE_SIZE * size  # the model is not valid for larger motions
    for k, name in enumerate(model.states):
        low, high = ensemble.recorded.get(name, (0.0, 0.0))
        if high > low:
            largest[k] = MAX_CYCLE_SIZE * (high - low) / 2.0
    cycles: list[Point] = []
    ends: list[str] = []
    for point in known_cycles:
        _add_cycle(cycles, point, size)
    disturbed = (rest + DISTURBANCE * size for rest in rests)
    for start in (recorded_start, *disturbed, middle + SEARCH_RADIUS * size):
        passing("settle")
        motion = motion if start is recorded_start else _settle_motion(model, start)
        cycle = find_cycle_from_motion(constant_family(model, size), 0.0, motion)
        if cycle is None:  # a motion that neither grows nor dies out may be on no cycle
            ends.append("irregular" if motion.kind == "cycle" else motion.kind)
        elif np.all(cycle.solution.half_range() < largest):
            _add_cycle(cycles, cycle, size)
        else:
            ends.append("diverged")
    return Condition(
        dict(values),
        tuple(_describe_equilibrium(ensemble, rest, size) for rest in rests),
        tuple(_describe_cycle(ensemble, cycle) for cycle in cycles),
        tuple(dict.fromkeys(ends)),
    )


def _add_cycle(cycles: list[Point], point: Point, size: np.ndarray) -> None:
    new = point.solution.half_range() / size
    others = [cycle.solution.half_range() / size for cycle in cycles]
    if all(np.max(np.abs(new - other)) > MIN_DISTANCE * np.max(new) for other in others):
        cycles.append(point)


def _assess_range(
    ensemble: _Ensemble, fixed: Mapping[str, float], parameter: str, values: np.ndarray
) -> Assessment:
    """Assess every value of a range, with limit cycles followed along the range.

    The equilibrium is followed from the first value that has one.
    """
    ensemble = ensemble.at(fixed)
    branches, missing, onsets = None, [], []
    notes: list[str] = []
    for low in values[:-1].tolist():
        model, span = ensemble.model.at({parameter: low}), Range(low, values[-1])
        middle, size = ensemble.compute_extent(model, _settle_motion(model, ensemble.start))
        family = _make_family(ensemble.model, parameter, size)
        if rests := find_equilibria(model, middle, size):
            rest = min(rests, key=lambda state: np.linalg.norm((state - middle) / size))
            branches, notes = _follow_branches(family, span, rest, ensemble.start)
            if branches:
                onsets = list(_find_onsets(branches, ensemble, family, span, rest))
            break
        missing.append(low)
    if missing:
        last_missing = f" to {missing[-1]:g}" if missing[1:] else ""
        notes.insert(0, f"no equilibrium was found at {parameter} = {missing[0]:g}{last_missing}")
    is_complete = branches is not None and branches.equilibria.complete and not missing
    conditions = []
    for value in values.tolist():
        passing(f"{parameter} = {value:g}")
        known_cycles = []
        for branch in branches.cycles.values() if branches else ():
            try:
                known_cycles += find_cycles_at(family, branch, value)
            except ValueError as failure:
                notes.append(str(failure))
        conditions.append(_assess_condition(ensemble, {**fixed, parameter: value}, known_cycles))
    return Assessment(
        tuple(conditions),
        parameter,
        (values[0], values[-1]),
        tuple(onsets),
        tuple(notes),
        is_complete,
    )


def _follow_branches(
    family: Family, span: Range, rest: np.ndarray, start: np.ndarray
) -> tuple[Diagram | None, list[str]]:
    """Follow an equilibrium and the limit cycles along a range; also return notes on them.

    A motion without damping at all values has no onset, but rounding looks like many.
    """
    middle = (span.low + span.high) / 2
    if undamped := _find_undamped(family, (span.low, middle, span.high), rest):
        frequency = f"{undamped / (2.0 * np.pi):.3g} Hz"
        return None, [f"no onset is known: in the model, a motion at {frequency} has no damping"]
    motion = _settle_motion(family.model(middle), start)
    is_cycle = motion.kind == "cycle"
    size = float(np.linalg.norm(motion.half_range / family.sizes)) if is_cycle else np.inf
    settled = (middle, motion.time, motion.states) if is_cycle else None
    try:
        branches = diagram(family, replace(span, ceiling=MAX_CYCLE_SIZE * size), rest, 0, settled)
    except ValueError as failure:
        return None, [f"along {family.parameter}: {failure}"]
    all_branches = (branches.equilibria, *branches.cycles.values())
    incomplete = [branch.reason for branch in all_branches if not branch.complete]
    without_oscillation = [
        f"between {family.parameter} = {lower.solution.value:.4g} and {upper.solution.value:.4g} "
        f"the equilibrium becomes {'unstable' if more > 0 else 'stable'} without oscillation"
        for lower, upper in pairwise(branches.equilibria.points)
        if (more := _count_growing(upper) - _count_growing(lower)) % 2
    ]
    return branches, [*without_oscillation, *branches.failures, *incomplete]


def _find_undamped(family: Family, values: Sequence[float], rest: np.ndarray) -> float:
    """Find the frequency, rad/s, of a small motion that no value damps or excites; 0 if none."""
    frequencies = []
    for value in values:
        modes = family.model(value).small_motions(rest).oscillations()
        is_neutral = np.abs(modes.damping) < MIN_DAMPING_RATIO
        frequencies.append(float(np.max(modes.omega[is_neutral], initial=0.0)))
    return min(frequencies)


def _find_onsets(
    best: Diagram, ensemble: _Ensemble, family: Family, span: Range, rest: np.ndarray
) -> Iterator[Onset]:
    """Yield the Hopf bifurcations with intervals from those of the drawn models.

    A drawn model without a bifurcation in the range counts as beyond an end of the range.
    """
    points, branches = best.equilibria.points, []
    for model in ensemble.draws_near_rest:
        passing("draw onsets")
        with suppress(ValueError):
            drawn_family = _make_family(model, family.parameter, family.sizes)
            branches.append(equilibrium_branch(drawn_family, rest, span))
    for hopf in hopf_points(best.equilibria):
        value = hopf.point.solution.value
        counts_below = [_count_growing(p) for p in points if p.solution.value < value]
        counts_above = [_count_growing(p) for p in points if p.solution.value > value]
        above = counts_above[0] if counts_above else 1
        is_growing_above = bool(counts_below) and counts_below[-1] < above
        samples = []
        for branch in branches:
            others = [h.point.solution.value for h in hopf_points(branch)]
            more = _count_growing(branch.points[-1]) - (counts_below[-1] if counts_below else 1)
            is_above_range = more <= 0 if is_growing_above else more >= 0
            beyond = np.inf if is_above_range else -np.inf
            samples.append(min(others, key=lambda v: abs(v - value), default=beyond))
        frequency = hopf.point.stability.critical()[0] / (2 * np.pi)
        ends = interval_of_draws(samples)
        yield Onset(Value.of(value, ends), float(frequency), is_growing_above)


def _count_growing(point: Point) -> int:
    """Count the small motions about an equilibrium that grow, an oscillation as two."""
    return int(np.count_nonzero(point.stability.values.real > 0.0))


def _make_family(model: PolynomialModel, along: str, sizes: np.ndarray | float) -> Family:
    return Family(lambda value: model.at({along: float(value)}), along, sizes=sizes)


def _settle_motion(model: PolynomialModel, start: np.ndarray) -> Settled:
    """Follow the motion from a state (n_states,) to its end, in periods of small motions."""
    rest = find_equilibrium(model, start, estimate_missing_sizes(np.abs(start), model, start))
    pace = Pace.of(model, rest.x if rest.success else start)
    return settle_in_periods(simulator_of(model), model, start, pace)


def _list_coordinates(model: PolynomialModel) -> list[int]:
    """List the indices of the states that are no velocities of others."""
    velocities = velocity_pairs(model.states).values()
    return [k for k in range(len(model.states)) if k not in velocities]


def find_equilibria(
    model: PolynomialModel, middle: np.ndarray, size: np.ndarray
) -> list[np.ndarray]:
    """Search for all equilibria of a model in a region around its motion.

    They are (n_states,) each, within SEARCH_RADIUS times `size` of `middle`.
    """
    velocities, rows = list(velocity_pairs(model.states).values()), _list_coordinates(model)
    shares = (-SEARCH_RADIUS, -1.0, 0.0, 1.0, SEARCH_RADIUS) if len(rows) < 4 else (-1.0, 0.0, 1.0)
    rests: list[np.ndarray] = []
    for steps in list(product(shares, repeat=len(rows)))[:MAX_STARTS]:
        start = middle.copy()
        start[velocities] = 0.0
        start[rows] += steps * size[rows]
        solution = find_equilibrium(model, start, size)
        rest = solution.x
        is_near = np.all(np.abs(rest - middle)[rows] <= SEARCH_RADIUS * size[rows])
        is_new = all(np.max(np.abs(rest - x)[rows] / size[rows]) > MIN_DISTANCE for x in rests)
        if solution.success and is_near and is_new:
            rests.append(rest)
    return sorted(rests, key=lambda x: float(np.linalg.norm(((x - middle) / size)[rows])))


def _describe_equilibrium(ensemble: _Ensemble, rest: np.ndarray, size: np.ndarray) -> RestPosition:
    states, rows = ensemble.model.states, _list_coordinates(ensemble.model)
    values, vectors = ensemble.model.small_motions(rest)
    drawn_rests, drawn_values = [], []
    for model in ensemble.draws_near_rest:
        solution = find_equilibrium(model, rest, size)
        if solution.success:
            eigenvalues = model.small_motions(solution.x).values
            _, order = linear_sum_assignment(np.abs(values[:, np.newaxis] - eigenvalues))
            drawn_rests.append(solution.x)
            drawn_values.append(eigenvalues[order])

    def with_interval(value: float, draws: Sequence[float] | np.ndarray) -> Value:
        return Value.of(value, interval_of_draws(draws))

    order = [k for k in np.argsort(np.abs(values)) if values[k].imag >= 0]
    shares = np.abs(vectors[np.ix_(rows, order)]) / size[rows, np.newaxis]
    state_rows = np.argmax(shares, axis=0)  # if more modes than states: the state that moves most
    matched_rows, matched_modes = match_modes(shares)
    state_rows[matched_modes] = matched_rows
    modes = []
    for k, row in zip(order, np.take(rows, state_rows).tolist(), strict=True):
        rate, draws = values[k], np.array([eigenvalues[k] for eigenvalues in drawn_values])
        if rate.imag > 0:
            frequency = with_interval(abs(rate) / (2 * np.pi), np.abs(draws) / (2 * np.pi))
            damping = with_interval(float(_damping_ratios(rate)), _damping_ratios(draws))
        else:
            frequency, damping = Value(0.0, 0.0, 0.0), with_interval(-rate.real, -draws.real)
        if rate.imag > 0 and row in velocity_pairs(states):
            damping = widen_zero_damping(ensemble.identified, row, frequency.value, damping)
        modes.append(SmallMotion(states[row], frequency, damping))
    equilibrium = {states[i]: with_interval(rest[i], [x[i] for x in drawn_rests]) for i in rows}
    is_extrapolated = any(
        not low <= equilibrium[name].value <= high
        for name, (low, high) in ensemble.recorded.items()
        if name in equilibrium
    )
    return RestPosition(equilibrium, tuple(modes), is_extrapolated)


def _damping_ratios(rates: np.ndarray) -> np.ndarray:
    """Compute damping ratios of eigenvalues (n,); zero for those that are zero up to rounding."""
    size = np.abs(rates)
    ratios = np.divide(-np.real(rates), size, out=np.zeros(np.shape(rates)), where=size > 0.0)
    return np.where(np.abs(ratios) < MIN_DAMPING_RATIO, 0.0, ratios)


def _describe_cycle(ensemble: _Ensemble, point: Point) -> Cycle:
    states, orbit = ensemble.model.states, point.solution
    drawn_orbits = find_nearby_cycles(ensemble.draws, orbit, ensemble.model)
    ends, half = cycle_intervals(drawn_orbits, len(states)), orbit.half_range()
    sizes = {states[i]: Value.of(half[i], ends[:, i]) for i in _list_coordinates(ensemble.model)}
    is_extrapolated = any(
        sizes[name].value > EXTRAPOLATION_RATIO * (high - low) / 2.0
        for name, (low, high) in ensemble.recorded.items()
        if name in sizes
    )
    period, share = Value.of(orbit.period, ends[:, -1]), len(drawn_orbits) / len(ensemble.draws)
    return Cycle(sizes, period, point.stability.stable, share, is_extrapolated)
