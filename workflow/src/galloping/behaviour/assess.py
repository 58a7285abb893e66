"""Equilibria, their stability, limit cycles and onset of an identified model.

They are computed at a constant value of each input, or along a range of one input. Intervals are
those of models drawn with the covariance of the coefficients.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise, product

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import linear_sum_assignment

from galloping.arrays import one_thread
from galloping.behaviour.assessment import (
    Assessment,
    Condition,
    Cycle,
    Onset,
    RestPosition,
    SmallMotion,
)
from galloping.behaviour.dynamics import (
    BEYOND_RECORDED,
    ROUNDING,
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
from galloping.passes import passing
from galloping.readers.units import is_span

KICK = 1e-2  # of the size of the motion, from an equilibrium
BEYOND = 2.5  # sizes of the motion: how far from its middle equilibria are looked for
APART = 1e-2  # of the size: equilibria and cycles that are nearer are one
MOST_STARTS = 256  # from which equilibria are looked for
LEAST = 1e-3  # of its share in the largest motion, that a coordinate moves at least
CEILING = 10.0  # sizes of the motion, beyond which limit cycles are not followed


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
        If there is no model, an input has no value, or an input of a span has the opposite sign of
        nearly all recorded values and is far from them (`list_extrapolations`).
    """
    if found.status == "refused":
        raise ValueError(f"there is no model to assess: {found.reason}")
    values, inputs = {}, found.model.inputs
    for name, value in (at or {}).items():
        if name not in inputs:
            there = f"must be one of {', '.join(inputs)}" if inputs else "the model has no inputs"
            raise ValueError(f"{name} is no input of the model; {there}")
        values[name] = np.unique(np.asarray(value, float))
        if not len(values[name]):
            raise ValueError(f"{name} has no value")
    for name in inputs:
        if name not in values:
            raise ValueError(f"the model has the input {name}; say at which, --at {name}=VALUE")
    ranges = [name for name, each in values.items() if len(each) > 1]
    if len(ranges) > 1:
        raise ValueError(f"a range of {ranges[0]} and of {ranges[1]}; must be of one input")
    notes = tuple(list_extrapolations(found, values))
    fixed = {name: float(each[0]) for name, each in values.items() if len(each) == 1}
    drawn = _Drawn.of(found, seed)
    if not ranges:
        return Assessment((_assess_condition(drawn, fixed),), notes=notes)
    assessed = _assess_range(drawn, fixed, ranges[0], values[ranges[0]])
    return replace(assessed, notes=(*assessed.notes, *notes))


def list_extrapolations(found: IdentifiedModel, at: Mapping[str, ArrayLike]) -> list[str]:
    """Return a note on each input whose requested values lie outside the recorded range.

    The range is that of nine tenths of the recorded values. at: one value or several of each input.
    Raises ValueError for an input of a span that has the other sign than nearly all recorded values
    and is further from them than their range is wide: no wind blows at -5 m/s.
    """
    notes = []
    for name, values in at.items():
        if not (ends := found.recorded(name)):
            continue
        low, high = ends
        least, most = float(np.nanmin(values)), float(np.nanmax(values))
        recorded = f"90 % of the recorded values lie between {low:.3g} and {high:.3g}"
        for value, bound, sign in ((least, low, 1.0), (most, high, -1.0)):
            far = sign * bound >= 0.0 > sign * value and sign * (bound - value) > high - low
            if far and is_span(found.model.states):
                wanted = "0 or more" if sign > 0 else "0 or less"
                raise ValueError(f"{name} = {value:g}: {recorded}; must be {wanted}")
        if least < low or most > high:
            asked = f"{least:.4g}" if least == most else f"{least:.4g} to {most:.4g}"
            notes.append(
                f"Extrapolation: {name} = {asked}, but {recorded}; beyond, further modes may grow, "
                "which the recording does not show"
            )
    return notes


@dataclass(frozen=True)
class _Drawn:
    """A model, models drawn with the covariance of its coefficients, and an initial state.

    found: the identified model, with its inputs. small: models drawn for small motions, with the
    effect of terms of the next degrees. start: (n_states,) recorded initial state. recorded:
    recorded range of states, by name.
    """

    found: IdentifiedModel
    model: PolynomialModel
    draws: tuple[PolynomialModel, ...]
    small: tuple[PolynomialModel, ...]
    start: np.ndarray
    recorded: Mapping[str, tuple[float, ...]]

    @classmethod
    def of(cls, found: IdentifiedModel, seed: int) -> "_Drawn":
        """Draw models from an identified model."""
        states, starts = found.model.states, found.initial_states
        known = starts[np.isfinite(starts).all(axis=1)]
        recorded = {name: ends for name in states if (ends := found.recorded(name))}
        extent = np.array([recorded.get(name, (0.0, 0.0)) for name in states])
        # without known states the largest recorded ones, or 1 in their units: not an equilibrium
        start = extent[np.arange(len(extent)), np.abs(extent).argmax(axis=1)]
        if len(known):
            sizes = np.ptp(extent, axis=1)
            sizes = np.where(sizes > 0.0, sizes, np.abs(known).max(axis=0))
            sizes = np.maximum(sizes, np.finfo(float).tiny)
            start = farthest_start(known, extent.mean(axis=1), sizes)
        elif not start.any():
            start = np.ones(len(states))
        rng = np.random.default_rng(seed)
        draws = draw_models_and_rivals(found, rng)
        small = add_higher_degree_effects(draws, found, rng)
        return cls(found, found.model, tuple(draws), tuple(small), start, recorded)

    def at(self, values: Mapping[str, float]) -> "_Drawn":
        """Return the same models at constant values of inputs."""
        held = {name: value for name, value in values.items() if name in self.model.inputs}
        draws, small = (
            tuple(each.at(held) for each in models) for models in (self.draws, self.small)
        )
        return replace(self, model=self.model.at(held), draws=draws, small=small)

    def extent(self, model: PolynomialModel, motion: Settled) -> tuple[np.ndarray, np.ndarray]:
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
            for group in (velocities, _positions(model)):
                size[group] = np.maximum(size[group], LEAST * size[group].max(initial=0.0))
        else:  # whose states may have any units
            size = np.maximum(size, LEAST * np.abs(start - middle))
        ends = [self.recorded.get(name, (0.0, 0.0)) for name in model.states]
        return middle, np.maximum(size, np.ptp(ends, axis=1) / 2.0)


def _assess_condition(
    of: _Drawn, at: Mapping[str, float], known: Sequence[Point] = ()
) -> Condition:
    """Find equilibria and attractors at one value of every input by simulation from several states.

    known: limit cycles there, found otherwise.
    """
    here = of.at(at)
    best, begin = here.model, here.start
    motion = _settle_motion(best, begin)
    middle, size = here.extent(best, motion)
    rests = find_equilibria(best, middle, size)
    largest = CEILING * size  # no model holds of larger motions
    for k, name in enumerate(best.states):
        low, high = here.recorded.get(name, (0.0, 0.0))
        if high > low:
            largest[k] = CEILING * (high - low) / 2.0
    cycles: list[Point] = []
    ends: list[str] = []
    for point in known:
        _add_cycle(cycles, point, size)
    for start in (begin, *(rest + KICK * size for rest in rests), middle + BEYOND * size):
        passing("settle")
        motion = motion if start is begin else _settle_motion(best, start)
        found = find_cycle_from_motion(constant_family(best, size), 0.0, motion)
        if found is None:  # a motion that neither grows nor dies out may be on no cycle
            ends.append("irregular" if motion.kind == "cycle" else motion.kind)
            continue
        if np.all(found.solution.half_range() < largest):
            _add_cycle(cycles, found, size)
        else:
            ends.append("diverged")
    return Condition(
        dict(at),
        tuple(_describe_equilibrium(here, rest, size) for rest in rests),
        tuple(_describe_cycle(here, each) for each in cycles),
        tuple(dict.fromkeys(ends)),
    )


def _add_cycle(cycles: list[Point], point: Point, size: np.ndarray) -> None:
    new = point.solution.half_range() / size
    others = [one.solution.half_range() / size for one in cycles]
    if all(np.max(np.abs(new - other)) > APART * np.max(new) for other in others):
        cycles.append(point)


def _assess_range(
    of: _Drawn, at: Mapping[str, float], along: str, values: np.ndarray
) -> Assessment:
    """Assess every value of a range, with limit cycles followed along the range.

    The equilibrium is followed from the first value that has one.
    """
    of = of.at(at)
    found, notes, missing = None, [], []
    onsets: tuple[Onset, ...] = ()
    for low in values[:-1].tolist():
        best, span = of.model.at({along: low}), Range(low, values[-1])
        middle, size = of.extent(best, _settle_motion(best, of.start))
        family = _make_family(of.model, along, size)
        if rests := find_equilibria(best, middle, size):
            rest = min(rests, key=lambda each: np.linalg.norm((each - middle) / size))
            found, more = _follow_branches(family, span, rest, of.start, along)
            onsets = tuple(_find_onsets(found, of, family, span, rest)) if found else ()
            notes += more
            break
        missing.append(low)
    if missing:
        until = f" to {missing[-1]:g}" if missing[1:] else ""
        notes.insert(0, f"no equilibrium was found at {along} = {missing[0]:g}{until}")
    is_complete = found is not None and found.equilibria.complete and not missing
    conditions = []
    for value in values.tolist():
        passing(f"{along} = {value:g}")
        known = []
        for branch in found.cycles.values() if found else ():
            try:
                known += find_cycles_at(family, branch, value)
            except ValueError as failure:
                notes.append(str(failure))
        conditions.append(_assess_condition(of, {**at, along: value}, known))
    return Assessment(
        tuple(conditions), along, (values[0], values[-1]), onsets, tuple(notes), is_complete
    )


def _follow_branches(
    family: Family, span: Range, rest: np.ndarray, begin: np.ndarray, along: str
) -> tuple[Diagram | None, list[str]]:
    middle = (span.low + span.high) / 2
    motion = _settle_motion(family.model(middle), begin)
    cycle = motion.kind == "cycle"
    size = float(np.linalg.norm(motion.half_range / family.sizes)) if cycle else np.inf
    start = (middle, motion.time, motion.states) if cycle else None
    try:
        bounded = replace(span, ceiling=CEILING * size)
        found = diagram(family, bounded, rest, 0, start)
    except ValueError as failure:
        return None, [f"along {along}: {failure}"]
    branches = (found.equilibria, *found.cycles.values())
    incomplete = [branch.reason for branch in branches if not branch.complete]
    without_oscillation = [
        f"between {along} = {one.solution.value:.4g} and {other.solution.value:.4g} the "
        f"equilibrium becomes {'unstable' if more > 0 else 'stable'} without oscillation"
        for one, other in pairwise(found.equilibria.points)
        if (more := _count_growing(other) - _count_growing(one)) % 2
    ]
    return found, [*without_oscillation, *found.failures, *incomplete]


def _find_onsets(
    found: Diagram, of: _Drawn, family: Family, span: Range, rest: np.ndarray
) -> Iterator[Onset]:
    """Yield the Hopf bifurcations with intervals from those of the drawn models.

    A drawn model without a bifurcation in the range counts as beyond an end of the range.
    """
    branches = []
    for model in of.small:
        passing("draw onsets")
        try:
            drawn = _make_family(model, family.parameter, family.sizes)
            branches.append(equilibrium_branch(drawn, rest, span))
        except ValueError:
            continue
    for hopf in hopf_points(found.equilibria):
        value = hopf.point.solution.value
        points = found.equilibria.points
        before = [_count_growing(p) for p in points if p.solution.value < value]
        after = [_count_growing(p) for p in points if p.solution.value > value]
        is_growing_above = bool(before) and before[-1] < (after[0] if after else 1)
        samples = []
        for branch in branches:
            others = [h.point.solution.value for h in hopf_points(branch)]
            more = _count_growing(branch.points[-1]) - (before[-1] if before else 1)
            is_later = more <= 0 if is_growing_above else more >= 0  # nothing has happened yet
            beyond = np.inf if is_later else -np.inf
            samples.append(min(others, key=lambda v: abs(v - value), default=beyond))
        frequency = hopf.point.stability.critical()[0] / (2 * np.pi)
        yield Onset(Value.of(value, interval_of_draws(samples)), float(frequency), is_growing_above)


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


def _positions(model: PolynomialModel) -> list[int]:
    """List the states that are no velocities of others."""
    velocities = velocity_pairs(model.states).values()
    return [k for k in range(len(model.states)) if k not in velocities]


def find_equilibria(
    model: PolynomialModel, middle: np.ndarray, size: np.ndarray
) -> list[np.ndarray]:
    """Search for all equilibria of a model in a region around its motion.

    They are (n_states,) each, within BEYOND times `size` of `middle`.
    """
    pairs = velocity_pairs(model.states)
    own = _positions(model)
    shares = (-BEYOND, -1.0, 0.0, 1.0, BEYOND) if len(own) < 4 else (-1.0, 0.0, 1.0)
    found: list[np.ndarray] = []
    for steps in list(product(shares, repeat=len(own)))[:MOST_STARTS]:
        start = middle.copy()
        start[list(pairs.values())] = 0.0
        start[own] += steps * size[own]
        at = find_equilibrium(model, start, size)
        near_by = np.all(np.abs(at.x - middle)[own] <= BEYOND * size[own])
        new = all(np.max(np.abs(at.x - other)[own] / size[own]) > APART for other in found)
        if at.success and near_by and new:
            found.append(at.x)
    return sorted(found, key=lambda place: float(np.linalg.norm(((place - middle) / size)[own])))


def _describe_equilibrium(of: _Drawn, rest: np.ndarray, size: np.ndarray) -> RestPosition:
    best = of.model
    values, vectors = best.small_motions(rest)
    places, matched = [], []
    for model in of.small:
        at = find_equilibrium(model, rest, size)
        if at.success:
            own = model.small_motions(at.x).values
            _, order = linear_sum_assignment(np.abs(values[:, np.newaxis] - own))
            places.append(at.x)
            matched.append(own[order])
    pairs = velocity_pairs(best.states)
    shown = _positions(best)
    order = [k for k in np.argsort(np.abs(values)) if values[k].imag >= 0]
    shares = np.abs(vectors[np.ix_(shown, order)]) / size[shown, np.newaxis]
    modes = []
    named = np.argmax(shares, axis=0)  # modes beyond the states are of the state that moves most
    at, of_mode = match_modes(shares)
    named[of_mode] = at
    for k, place in zip(order, named.tolist(), strict=True):
        state = best.states[shown[place]]
        rate, own = values[k], np.array([each[k] for each in matched])
        if rate.imag > 0:
            frequency = Value.of(
                abs(rate) / (2 * np.pi), interval_of_draws(np.abs(own) / (2 * np.pi))
            )
            damping = Value.of(
                float(_damping_ratios(rate)), interval_of_draws(_damping_ratios(own))
            )
        else:
            frequency, damping = (
                Value(0.0, 0.0, 0.0),
                Value.of(-rate.real, interval_of_draws(-own.real)),
            )
        if rate.imag > 0 and shown[place] in pairs:
            damping = widen_zero_damping(of.found, shown[place], frequency.value, damping)
        modes.append(SmallMotion(state, frequency, damping))
    place = {
        best.states[i]: Value.of(rest[i], interval_of_draws([x[i] for x in places])) for i in shown
    }
    beyond = any(
        not low <= place[name].value <= high
        for name, (low, high) in of.recorded.items()
        if name in place
    )
    return RestPosition(place, tuple(modes), beyond)


def _damping_ratios(rates: np.ndarray) -> np.ndarray:
    """Compute damping ratios of eigenvalues (n,); zero for those that are zero up to rounding."""
    size = np.abs(rates)
    ratios = np.divide(-np.real(rates), size, out=np.zeros(np.shape(rates)), where=size > 0.0)
    return np.where(np.abs(ratios) < ROUNDING, 0.0, ratios)


def _describe_cycle(of: _Drawn, point: Point) -> Cycle:
    states, kept = of.model.states, find_nearby_cycles(of.draws, point.solution, of.model)
    found = len(kept) / len(of.draws)
    shown = _positions(of.model)
    ends = cycle_intervals(kept, len(states))
    half = point.solution.half_range()
    sizes = {states[i]: Value.of(half[i], ends[:, i]) for i in shown}
    beyond = any(
        sizes[name].value > BEYOND_RECORDED * (high - low) / 2.0
        for name, (low, high) in of.recorded.items()
        if name in sizes
    )
    period = Value.of(point.solution.period, ends[:, -1])
    return Cycle(sizes, period, point.stability.stable, found, beyond)
