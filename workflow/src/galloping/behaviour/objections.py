"""Refusal of models whose recordings are not free motions of a single system."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import floor, log10
from typing import NamedTuple

import numpy as np

from galloping.arrays import first_from
from galloping.behaviour.dynamics import Surroundings, dynamics
from galloping.behaviour.following import Following
from galloping.identification.findings import Code, Finding
from galloping.identification.identified_model import MIN_FORECAST_R2, IdentifiedModel
from galloping.identification.inputs import MIN_SAMPLES
from galloping.identification.likelihood.maximum_likelihood import maximum_likelihood
from galloping.identification.random_forces.several_modes import find_unmodelled_modes
from galloping.identification.random_forces.start import amplitude_fluctuates
from galloping.inspection.excerpts import excerpts
from galloping.model.intervals import NORMAL_95
from galloping.model.polynomial import polynomial_library, velocity_pairs
from galloping.recording.samples import Recording

# Without random forces, the motion of a stable line dies out. If it does not, it is forced (ambient
# vibration, buffeting). If the recorded motion dies out and that of the model does not, the model
# is not that of the line.
MAX_DECAY_RATIO = 1 / 3  # size of the last third of a decaying motion, relative to all of it
OUTLASTING_RATIO = 3.0  # size of the last third of a lasting motion, relative to that of the other
N_PARTS = 3  # number of parts of a recording that are compared
MIN_PERIODS = 15  # smallest length of a part, in periods
# A difference counts if the errors of the common model exceed both limits. Measured: the ratio is
# at most 1 for thirds of recordings in gusts of 5 %, and 5 if the winds differ by 4 %.
MIN_ERROR_SHARE = 0.03  # error of the common model, relative to the motion
MIN_ERROR_RATIO = 2.0  # error of the common model, relative to that of the models of the parts
SIGNIFICANT_DIFFERENCE = 3.5  # difference of halves, in standard errors: chance 1 in 500 sets of 4
ERROR_SHARE_PREFIX = "error_share_all_"  # prefix of a channel's diagnostic in approximate models

Identify = Callable[[Sequence[Recording]], IdentifiedModel]


def with_objections(
    identified: IdentifiedModel,
    recordings: Sequence[Recording],
    names: Sequence[str],
    period: float,
    identify: Identify,
    faults: Sequence[Finding] = (),
    are_one: bool = False,
) -> IdentifiedModel:
    """Refuse a model if its recordings are not free motions of one and the same system.

    If parts of a single recording are not of one system, this is a finding of an approximate model.
    are_one: whether the recordings are parts of a single one. names: of the recordings, for the
    text of the finding. period: s, the longest of the motion. identify: the method, with its
    library and known equations. faults: of the recordings, as `quality` finds them, which are added
    if there is no model.
    """
    inexact = identified.status in ("approximate", "refused") and not identified.is_forced
    modes = find_unmodelled_modes(list(recordings)) if inexact else []

    def refuse(objections: Iterable[Finding]) -> IdentifiedModel:
        model, findings = identified.model, (*faults, *objections)
        return IdentifiedModel.refused(model.states, model.terms, findings, model.inputs)

    if objections := _find_random_forces(identified, recordings, period):
        return refuse(modes or objections)
    may_differ = not are_one or identified.status == "refused"
    if may_differ and (difference := find_difference(identified, recordings, identify)):
        return refuse([difference.between(names)])
    if objections := _find_outlived(identified, recordings):
        return refuse(modes or objections)
    if identified.status == "refused":
        return refuse(identified.findings)
    if modes:
        return identified.with_findings(*modes)
    changes = []
    if len(recordings) == 1 or are_one:
        changes = _find_changes(identified, recordings, period, identify)
    if identified.is_forced and len(recordings) == 1 and not changes:
        changes = _find_changes_at_random(identified, recordings[0], period)
    return identified.with_findings(*changes)


def _find_random_forces(
    identified: IdentifiedModel, recordings: Sequence[Recording], period: float
) -> list[Finding]:
    """Find whether random forces sustain the motion, which no model follows then."""
    sustained = [Finding.of(Code.KEPT_UP)]
    if identified.is_forced:
        return []
    parts, has_model = excerpts(list(recordings)), identified.status != "refused"
    if has_model and (still := unaccelerated_coordinates(identified)):
        return [Finding.of(Code.NOT_ACCELERATED, name) for name in still]
    if identified.model.inputs:  # they sustain it; a model that comes to rest may lack terms
        return []
    if has_model and any(
        recording_outlasts_model(identified, used)
        for used in _list_identified_parts(identified, recordings)
    ):
        return sustained
    if not identified.lacks_useful_forecast or not amplitude_fluctuates(recordings, period):
        return []
    linear = maximum_likelihood(parts, polynomial_library(len(identified.model.states), 1))
    if any(each.has_finding(Code.LIMIT_OF_WORK) for each in (identified, linear)):
        return []  # a complete search may find a model
    r2 = float(linear.diagnostics.get("forecast_r2", 0.0))  # a model in random forces has none
    return sustained if r2 < MIN_FORECAST_R2 or recording_outlasts_model(linear, parts) else []


def _find_outlived(identified: IdentifiedModel, recordings: Sequence[Recording]) -> list[Finding]:
    """Find whether the model keeps moving when the recorded motion has died out."""
    inexact = identified.status == "approximate" and not identified.is_forced
    if inexact and not identified.model.inputs:
        for parts in _list_identified_parts(identified, recordings):
            if outlives_recording(identified, parts):
                return [Finding.of(Code.OUTLIVED)]
    return []


def _list_identified_parts(
    identified: IdentifiedModel, recordings: Sequence[Recording]
) -> list[Sequence[Recording]]:
    """List those of recordings and excerpts from which the model can have been identified."""
    candidates = (excerpts(list(recordings)), recordings)
    return [parts for parts in candidates if len(parts) == len(identified.initial_states)]


def _find_changes(
    identified: IdentifiedModel, parts: Sequence[Recording], period: float, identify: Identify
) -> list[Finding]:
    """Find differences between parts of one recording, as a gusty wind also causes.

    A recording without gaps is divided into thirds.
    """
    if identified.status != "approximate" or identified.envelope:
        return []
    if len(parts) == 1:
        (recording,), time = parts, parts[0].time
        if np.ptp(time) < N_PARTS * MIN_PERIODS * period:
            return []
        edges = first_from(time, np.linspace(time[0], time[-1], N_PARTS + 1))
        parts = [recording[a:b] for a, b in pairwise(edges)]
    difference = find_difference(identified, parts, identify)
    drifts = identified.has_finding(Code.DRIFTS, Code.RESIDUAL_DRIFTS)
    if not difference or (drifts and difference.own > 0.0):  # a drift affects each part as well
        return []
    return [difference.within(_list_spans(parts))]


def _list_spans(parts: Sequence[Recording]) -> str:
    digits = 2 - floor(log10(min(np.ptp(part.time) for part in parts)))
    ends = ((round(float(end), digits) for end in part.time[[0, -1]]) for part in parts)
    return ", ".join(f"{first:g} to {last:g} s" for first, last in ends)


def _find_changes_at_random(
    identified: IdentifiedModel, recording: Recording, period: float
) -> list[Finding]:
    """Find a frequency or damping that changes within a recording under random forces.

    Its halves then differ by more than SIGNIFICANT_DIFFERENCE standard errors.
    """
    is_short = np.ptp(recording.time) < 2 * MIN_PERIODS * period
    if identified.model.inputs or is_short or len(recording.time) < 2 * MIN_SAMPLES:
        return []
    middle, model = len(recording.time) // 2, identified.model
    halves = [recording[:middle], recording[middle:]]
    known_states, properties = tuple(model.states[i] for i in identified.known), []
    for half in halves:
        half_model = maximum_likelihood([half], model.terms, model, known_states, forced=())
        properties.append(dynamics(half_model, Surroundings.of([half]), np.random.default_rng(0)))
        if properties[-1] is None:
            return []
    for quantity, code, unit, factor in (
        ("frequencies", Code.FREQUENCY_CHANGES, "hz", 1.0),
        ("damping", Code.DAMPING_CHANGES, "percent", 100.0),
    ):
        by_name, others = (getattr(each, quantity) for each in properties)
        for name in (name for name in by_name if name in others):
            first, second = by_name[name], others[name]
            error = np.hypot(first.high - first.low, second.high - second.low) / (2.0 * NORMAL_95)
            if abs(first.value - second.value) > SIGNIFICANT_DIFFERENCE * error:
                values = {
                    f"first_{unit}": factor * first.value, f"second_{unit}": factor * second.value
                }  # fmt: skip
                return [Finding.of(code, name, spans=_list_spans(halves), **values)]
    return []


def unaccelerated_coordinates(identified: IdentifiedModel) -> list[str]:
    """List the coordinates whose acceleration has no terms in the model."""
    states = identified.model.states
    return [
        states[i]
        for i, velocity in velocity_pairs(states).items()
        if velocity not in identified.known and not np.any(identified.model.coefficients[velocity])
    ]


def recording_outlasts_model(identified: IdentifiedModel, recordings: Sequence[Recording]) -> bool:
    """Decide whether every recorded channel keeps moving while the motion of the model dies out.

    recordings: those of the identification, with an initial state of each in `initial_states`.
    """
    are_lasting = [
        recorded.last > MAX_DECAY_RATIO * recorded.whole
        and recorded.last > OUTLASTING_RATIO * simulated.last
        for recorded, simulated in _compare_sizes(identified, recordings)
    ]
    return bool(are_lasting) and all(are_lasting)


def outlives_recording(identified: IdentifiedModel, recordings: Sequence[Recording]) -> bool:
    """Decide whether the motion of a model lasts although the recorded motion dies out.

    A motion that diverges lasts too. recordings: as of `recording_outlasts_model`.
    """
    return any(
        recorded.last < MAX_DECAY_RATIO * recorded.whole
        and not (
            simulated.last <= MAX_DECAY_RATIO * simulated.whole
            or simulated.last <= OUTLASTING_RATIO * recorded.last
        )
        for recorded, simulated in _compare_sizes(identified, recordings)
    )


class _Size(NamedTuple):
    """Standard deviation of a motion, and of its last third."""

    whole: float
    last: float


def _compare_sizes(
    identified: IdentifiedModel, recordings: Sequence[Recording]
) -> Iterator[tuple[_Size, _Size]]:
    """Yield the sizes of each recorded channel and of the model's motion from its start.

    Those of the model are not finite if it diverges.
    """
    for recording, start in zip(recordings, identified.initial_states, strict=True):
        follow, time = Following(identified, recording), recording.time
        motion = follow.motion(identified.model, start, time)
        last = time > time[-1] - (time[-1] - time[0]) / 3
        for samples, values, noise in zip(follow.samples.T, motion.T, follow.sigma, strict=True):
            is_finite = np.isfinite(samples)
            if (is_finite & last).any():
                recorded = (
                    _size_above_noise(samples[rows], noise)
                    for rows in (is_finite, is_finite & last)
                )
                yield _Size(*recorded), _Size(np.std(values), np.std(values[last]))


def _size_above_noise(samples: np.ndarray, noise: float) -> float:
    """Compute the standard deviation of samples (n,), with that of the noise subtracted."""
    return float(np.sqrt(max(np.var(samples) - noise**2, 0.0)))


@dataclass(frozen=True)
class Difference:
    """Evidence that recordings differ: forecast errors of their common and of separate models.

    The recordings, or parts of a recording, were identified together. channel: where the difference
    is clearest. missed, own: share of the motion of the channel that forecasts miss, by the common
    model, infinite if there is none, and at the median by the models of the parts.
    """

    channel: str
    missed: float
    own: float

    def between(self, names: Sequence[str]) -> Finding:
        """Make the finding that recordings, given by name, are not of one system.

        No model of them can be trusted.
        """
        shares: dict[str, float | str] = {"names": ", ".join(names), "own": self.own}
        if np.isinf(self.missed):
            return Finding.of(Code.NO_COMMON_MODEL, self.channel, **shares)
        return Finding.of(Code.RECORDINGS_DIFFER, self.channel, missed=self.missed, **shares)

    def within(self, spans: str) -> Finding:
        """Make the finding that the parts of one recording, given as time spans, differ."""
        shares = {"missed": self.missed, "own": self.own}
        return Finding.of(Code.PARTS_DIFFER, self.channel, spans=spans, **shares)


def find_difference(
    together: IdentifiedModel, parts: Sequence[Recording], identify: Identify
) -> Difference | None:
    """Test whether recordings need different models; return the clearest difference, or None.

    The recordings, or parts of one recording, were identified together. An exact model has no
    errors: recordings that one model follows are of one system.
    """
    is_exact = together.status not in ("approximate", "refused")
    if is_exact or len(parts) < 2 or min(len(part.time) for part in parts) < MIN_SAMPLES:
        return None
    alone = [identify([part]) for part in parts]
    if any(each.status == "refused" for each in alone):
        return None
    keys = {
        key for each in (together, *alone) for key in each.diagnostics if ERROR_SHARE_PREFIX in key
    }
    differences = []
    for key in sorted(keys) or [ERROR_SHARE_PREFIX + together.model.states[0]]:
        name = key.removeprefix(ERROR_SHARE_PREFIX)
        missed = float(together.diagnostics.get(key, np.nan))
        missed_separately = float(np.median([each.diagnostics.get(key, 0.0) for each in alone]))
        if together.status == "refused" and missed_separately < MIN_ERROR_SHARE:
            differences.append(Difference(name, np.inf, missed_separately))
        elif missed > max(MIN_ERROR_SHARE, MIN_ERROR_RATIO * missed_separately):
            differences.append(Difference(name, missed, missed_separately))
    return max(differences, key=lambda each: each.missed, default=None)
