"""Numbers of a summary, with their units: the content of `summary.json`.

`summary.md` is rendered from the same values.
"""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import inf, log, nan, pi
from typing import TYPE_CHECKING, Self

import numpy as np

from galloping.behaviour.dynamics import MIN_DAMPING_RATIO, Dynamics, Surroundings, Value
from galloping.behaviour.following import Sensed, without_outliers
from galloping.cycles.settling import Pace
from galloping.identification.findings import Code
from galloping.identification.identified_model import IdentifiedModel
from galloping.identification.random_forces.tracking import Forces
from galloping.inspection.excerpts import excerpts
from galloping.inspection.quality import dominant_frequencies
from galloping.model.polynomial import design_matrix, term_name, velocity_pairs
from galloping.readers.units import coefficient_unit, meaning, plain_unit
from galloping.recording.samples import Recording, mean_inputs
from galloping.summary.advice import input_units, shown_units

if TYPE_CHECKING:
    from galloping.behaviour.forecast import ScoredForecast
    from galloping.summary.further_recording import Advice
    from galloping.summary.summarise import Summary

MAX_ABSENT_TERMS = 3  # listed terms that may exist undetected
PERCENT = "% of critical"


@dataclass(frozen=True)
class Estimate:
    """Value with its unit and its 95 % interval, whose ends are NaN if the interval is unknown.

    unit: '' for a pure number.
    """

    value: float
    low: float = nan
    high: float = nan
    unit: str = ""

    @classmethod
    def from_value(cls, value: Value, unit: str, factor: float = 1.0) -> Self:
        """Make an estimate from a value with its interval, times a factor that may be negative."""
        ends = factor * value.low, factor * value.high
        return cls(factor * value.value, min(ends), max(ends), unit)


@dataclass(frozen=True)
class RecordedMotion:
    """Range and main frequency of the recorded values of a state or column, without outliers.

    name: of a state, its rate or a column. meaning: in words, '' for other systems than a span.
    file: that the column is in, '' for a state. below_hz: cut-off frequency, NaN without one.
    frequency_hz: of most of the motion, NaN without a peak.
    """

    name: str
    meaning: str
    low: float
    high: float
    unit: str
    frequency_hz: float = nan
    below_hz: float = nan
    file: str = ""


@dataclass(frozen=True)
class SmallMotionEstimates:
    """Frequency and damping of one mode of small motions about the equilibrium.

    name: of the coordinate that mostly moves, or of a mode besides those of the coordinates.
    doubling_time: of one that grows.
    """

    name: str
    natural_frequency: Estimate
    net_damping: Estimate
    doubling_time: Estimate | None


@dataclass(frozen=True)
class SystemEstimates:
    """Properties of a system computed from its model: equilibrium, modes and limit cycle.

    at: means of the inputs, for all other values. rest: equilibrium, by coordinate. small_motions:
    none if the recordings do not determine them. end: kind of the final motion: `cycle`, `rest`,
    `forced`, `irregular`, or why its simulation stopped. limit_cycle: half range, by coordinate,
    and period; none if the motion approaches none.
    """

    at: Mapping[str, Estimate]
    rest: Mapping[str, Estimate]
    small_motions: tuple[SmallMotionEstimates, ...]
    end: str
    limit_cycle: Mapping[str, Estimate]
    period: Estimate | None


@dataclass(frozen=True)
class HeldOutChannel:
    """Scores of the forecast of one channel over held-out samples.

    missed_percent: root mean square error, over the deviation of the whole recording, NaN for
    random forces, which are unpredictable. is_noise: whether the samples are noise alone; r2 is NaN
    then. band_factor: by which the band must be widened, infinite if the forecast is useless.
    """

    name: str
    missed_percent: float
    is_noise: bool
    r2: float
    inside_percent: float
    inside_by_chance_percent: float
    band_factor: float


@dataclass(frozen=True)
class HeldOutScores:
    """Scores of a forecast of the end of a recording that the identification did not use.

    until_s: the end of that recording, on its clock. is_longest: whether that is of the longest
    recording and not of the last. is_useful: whether the forecast is better than the mean in every
    channel.
    """

    duration_s: float
    until_s: float
    is_longest: bool
    is_useful: bool
    channels: tuple[HeldOutChannel, ...]


@dataclass(frozen=True)
class AbsentTerm:
    """Term that is absent from the model, with the coefficient from which it would be detected."""

    term: str
    equation: str
    limit: float
    unit: str


@dataclass(frozen=True)
class SummaryNumbers:
    """All numbers of the summary of an identified model, as written to summary.json.

    columns: of files that do not contain a state directly. random_forces: density of each, with its
    unit; force_durations_s: correlation times of slow ones. stretches: number used for the model, 0
    for the whole, and their share of the time. scales: unknown ones that were found. compared: a
    name, and the system's known properties by that name.
    """

    status: str
    reason: str
    findings: tuple[dict, ...]
    recorded: tuple[RecordedMotion, ...]
    columns: tuple[RecordedMotion, ...]
    system: SystemEstimates | None
    random_forces: Mapping[str, Estimate]
    force_durations_s: tuple[float, ...]
    forecast: HeldOutScores | None
    no_forecast: str
    stretches: int
    stretches_percent: float
    absent_terms: tuple[AbsentTerm, ...]
    scales: Mapping[str, float]
    further_recording: "Advice | None"
    compared: tuple[str, SystemEstimates] | None


def compute_numbers(
    summary: "Summary",
    reports: Sequence[dict] = (),
    beside: tuple[str, Dynamics | None] | None = None,
) -> SummaryNumbers:
    """Collect all numbers of the summary of an identified model.

    reports: of `quality`, if the recordings come from files. beside: a name, and the system's known
    properties by that name.
    """
    identified, dynamics, units = summary.found, summary.dynamics, input_units(reports)
    cutoff = float(identified.diagnostics.get("below", nan))
    placed_channels = {
        column["measures"]
        for report in reports
        for column in report["channels"].values()
        if column["position_m"] is not None
    }
    recorded = tuple(_describe_recorded(summary.recordings, cutoff, placed_channels))
    forced, held_out = identified.is_forced, summary.held_out
    strengths, lasting = _force_densities(identified, dynamics) if forced else ({}, ())
    count, share = _count_stretches(summary.recordings, identified)
    has_model = identified.status != "refused"
    absent = _list_absent(identified, summary.recordings, units) if has_model else ()
    compared = None
    if beside and beside[1]:
        compared = beside[0], _estimate_system(beside[1], None, units)
    return SummaryNumbers(
        status=identified.status,
        reason=identified.reason,
        findings=tuple(each.as_dict() for each in identified.findings),
        recorded=recorded,
        columns=tuple(_describe_columns(reports, recorded)),
        system=_estimate_system(dynamics, identified, units) if dynamics else None,
        random_forces=strengths,
        force_durations_s=lasting,
        forecast=_collect_scores(held_out, forced) if held_out else None,
        no_forecast=summary.untried,
        stretches=count,
        stretches_percent=share,
        absent_terms=tuple(absent),
        scales={
            name.removeprefix("scale_"): float(value)
            for name, value in identified.diagnostics.items()
            if name.startswith("scale_")
        },
        further_recording=summary.advice,
        compared=compared,
    )


def is_undamped(known: Dynamics) -> bool:
    """Decide whether every motion repeats with a constant amplitude."""
    repeats = known.kind == "cycle" and known.period is None
    return repeats and is_linearly_undamped(known)


def keeps_any_amplitude(known: Dynamics) -> bool:
    """Decide whether a motion repeats with the amplitude of its start, on no limit cycle."""
    repeats = known.kind == "cycle" and known.period is None
    values = [one.value for one in known.damping.values()]  # NaN of what does not oscillate
    is_kept = any(abs(value) < MIN_DAMPING_RATIO for value in values)
    return repeats and is_kept and not any(value <= -MIN_DAMPING_RATIO for value in values)


def is_linearly_undamped(known: Dynamics) -> bool:
    """Decide whether the damping of all small motions is zero."""
    return all(abs(value.value) < MIN_DAMPING_RATIO for value in known.damping.values())


def is_damping_undetermined(found: IdentifiedModel, known: Dynamics) -> bool:
    """Decide whether a model has no damping, while models with damping fit equally well.

    That is so if its status is `not identifiable`.
    """
    return is_undamped(known) and found.status == "not identifiable"


def _estimate_system(
    dynamics: Dynamics, identified: IdentifiedModel | None, units: Mapping[str, str]
) -> SystemEstimates:
    repeats = identified is not None and identified.has_finding(Code.MOTION_REPEATS)
    hidden = repeats or (identified is not None and is_damping_undetermined(identified, dynamics))
    oscillating = [name for name, value in dynamics.frequencies.items() if np.isfinite(value.value)]
    is_free = is_undamped(dynamics) or (keeps_any_amplitude(dynamics) and not repeats)
    half_range = {} if is_free else dynamics.half_range
    period, unit_texts = dynamics.period if half_range else None, shown_units(units)

    def in_own_units(values: Mapping[str, Value]) -> dict[str, Estimate]:
        return {name: Estimate.from_value(each, plain_unit(name)) for name, each in values.items()}

    return SystemEstimates(
        {name: Estimate(mean, unit=unit_texts.get(name, "")) for name, mean in dynamics.at.items()},
        in_own_units(dynamics.rest),
        () if hidden else tuple(_small_motion(dynamics, name) for name in oscillating),
        dynamics.kind,
        in_own_units(half_range),
        Estimate.from_value(period, "s") if period else None,
    )


def _small_motion(dynamics: Dynamics, name: str) -> SmallMotionEstimates:
    frequency, damping = dynamics.frequencies[name], dynamics.damping[name]
    # not if unknown
    grows = damping.value < -MIN_DAMPING_RATIO and damping.high <= MIN_DAMPING_RATIO
    return SmallMotionEstimates(
        name,
        Estimate.from_value(frequency, "Hz"),
        Estimate.from_value(damping, PERCENT, 100.0),
        _doubling_time(frequency, damping) if grows else None,
    )


def _doubling_time(frequency: Value, damping: Value) -> Estimate:
    """Compute the doubling time of a growing motion; infinite if it may not grow."""
    time, low, high = (
        log(2.0) / (2.0 * pi * frequency.value * -ratio) if ratio < 0.0 else inf
        for ratio in (damping.value, damping.low, damping.high)
    )
    return Estimate(time, low, high, unit="s")


def _describe_recorded(
    recordings: Sequence[Recording], cutoff: float, placed_channels: Collection[str]
) -> Iterator[RecordedMotion]:
    """Yield the extent and frequency of each channel of all recordings.

    cutoff: Hz, cut-off frequency. placed_channels: channels whose sensors have places along the
    span, from which the motion of its mode follows.
    """
    channels: dict[str, list[tuple[np.ndarray, np.ndarray]]] = {}
    for recording in recordings:
        sensed = Sensed.by(recording)
        samples = sensed.samples(without_outliers(recording))
        for name, values in zip(sensed.names, samples.T, strict=True):
            is_finite, parts = np.isfinite(values), channels.setdefault(name, [])
            if np.count_nonzero(is_finite) > 1:
                parts.append((recording.time[is_finite], values[is_finite]))
    for name, parts in channels.items():
        if parts:
            every = np.concatenate([values for _, values in parts])
            time, longest = max(parts, key=lambda part: len(part[0]))
            dominant = dominant_frequencies(time, longest, float(np.median(np.diff(time))))
            pace = float(dominant[0]) if len(dominant) else nan
            ends = float(every.min()), float(every.max())
            what = meaning(name) + " of the first mode" * (name in placed_channels)
            yield RecordedMotion(name, what, *ends, plain_unit(name), pace, cutoff)


def _describe_columns(
    reports: Sequence[dict], recorded: Sequence[RecordedMotion]
) -> Iterator[RecordedMotion]:
    """Yield the extremes of columns that differ from those of the state that they measure."""
    states = {one.name: one for one in recorded}
    columns: dict[tuple[str, str], list[tuple[str, float, float]]] = {}
    for report in reports:
        for name, column in report["channels"].items():
            extent = report["file"], column["lowest"], column["highest"]
            columns.setdefault((name, column["measures"]), []).append(extent)
    for (name, state), each in columns.items():
        files, lowest, highest = zip(*each, strict=True)
        low, high, one = min(lowest), max(highest), states.get(state)
        if one and np.allclose((low, high), (one.low, one.high), 0.0, 1e-3 * (high - low)):
            continue
        file = files[0] if len(files) == 1 else f"{len(files)} files"
        yield RecordedMotion(name, meaning(state), low, high, plain_unit(state), file=file)


def _force_densities(
    identified: IdentifiedModel, dynamics: Dynamics | None
) -> tuple[dict[str, Estimate], tuple[float, ...]]:
    """Compute roots of the one-sided spectra of the forces, and correlation times of slow ones, s.

    The spectra are at the frequency of the coordinate of each force.
    """
    states, forces, densities = identified.model.states, Forces.from_model(identified), {}
    for i, velocity in velocity_pairs(states).items():
        frequency = dynamics.frequencies[states[i]].value if dynamics else nan
        density = forces.density(2.0 * pi * frequency)[velocity, velocity]
        if density > 0.0:
            unit = f"{plain_unit('d' + states[velocity]).replace('^2', '²')} per √Hz".lstrip()
            densities[states[i]] = Estimate(float(np.sqrt(2.0 * density)), unit=unit)
    return densities, tuple(float(1.0 / forces.rates[i]) for i in forces.slow_equations)


def _collect_scores(scored: "ScoredForecast", is_forced: bool) -> HeldOutScores:
    ahead = scored.forecast
    channels = tuple(
        HeldOutChannel(
            ahead.names[k],
            nan if is_forced else float(100.0 * scored.missed[k]),
            bool(scored.is_noise[k]),
            nan if scored.is_noise[k] else float(scored.skill[k]),
            float(100.0 * scored.held[k]),
            float(100.0 * ahead.chance[k]),
            float(scored.factors[k]),
        )
        for k in np.flatnonzero(np.isfinite(scored.held))
    )
    first, last = float(ahead.time[0]), float(ahead.time[-1])
    return HeldOutScores(last - first, last, scored.index < -1, scored.useful, channels)


def _count_stretches(
    recordings: Sequence[Recording], identified: IdentifiedModel
) -> tuple[int, float]:
    """Count the parts of the recordings that were used, and their share of time; 0 if whole."""
    used_parts = recordings if identified.is_forced else excerpts(list(recordings))
    if list(map(id, used_parts)) == list(map(id, recordings)):
        return 0, 100.0
    lasting, whole = (sum(np.ptp(one.time) for one in each) for each in (used_parts, recordings))
    return len(used_parts), float(100.0 * lasting / whole)


def _list_absent(
    identified: IdentifiedModel, recordings: Sequence[Recording], units: Mapping[str, str]
) -> Iterator[AbsentTerm]:
    """Yield the absent terms that may be the largest undetected parts of their equations.

    units: of inputs, by name.
    """
    model = identified.model
    steady = model.at(mean_inputs(model.inputs, recordings))
    surroundings = Surroundings.of(recordings)
    sizes, time = surroundings.sizes(steady), Pace.of(steady, surroundings.middle).slow / (2.0 * pi)
    signals = [*sizes, *(_root_mean_square(name, recordings) for name in model.inputs)]
    largest = np.abs(design_matrix(np.array([signals]), model.terms)[0])
    shares = identified.detection_limits * largest * time / sizes[:, np.newaxis]
    shares = np.where(np.isfinite(shares), shares, -1.0)
    flat = np.argsort(-shares, axis=None, kind="stable")[:MAX_ABSENT_TERMS]
    inputs = {**dict.fromkeys(model.inputs, ""), **units}
    for i, j in zip(*np.unravel_index(flat, shares.shape), strict=True):
        if shares[i, j] > 0.0:
            yield AbsentTerm(
                term_name(model.terms[j], model.names),
                f"d({model.states[i]})/dt",
                float(identified.detection_limits[i, j]),
                coefficient_unit(model.states[i], model.terms[j], model.names, inputs),
            )


def _root_mean_square(name: str, recordings: Sequence[Recording]) -> float:
    values = np.concatenate([one.inputs[name].values for one in recordings])
    return float(np.sqrt(np.nanmean(values**2)))
