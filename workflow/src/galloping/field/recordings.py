"""From the channels of files to recordings of states: delays, modes, gaps, inputs, excerpts."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.interpolate import CubicSpline

from galloping.identification.inputs import FEWEST, asked
from galloping.identification.likelihood.maximum_likelihood import maximum_likelihood
from galloping.identification.model import IdentifiedModel
from galloping.identification.preparation.smoothing import shortest_period, with_integrals
from galloping.identification.problem import PRIOR
from galloping.identification.random_forces.decision import if_moved_at_random
from galloping.identification.random_forces.start import wavers
from galloping.polynomial import PolynomialModel, velocity_pairs
from galloping.recording import INTERPOLATED, Input, Recording

if TYPE_CHECKING:
    from galloping.field.mapping import Channel, ColumnMapping
    from galloping.field.read import Series

# Longest periods of the motion.
LEAST = 3  # that a part of a recording holds at least
SILENT = 6  # that a sensor may be silent while others go on: longer, its curve is not told


def recording(series: "Series", mapping: "ColumnMapping") -> Recording:
    """The recording that identification sees.

    Sensors of one quantity at m places along the span are projected on its first m sine modes, of
    which the first is kept: q = sum_i P_1i y_i with P the inverse of sin(k pi s_i / l). A single
    sensor is divided by sin(pi s / l). Samples of a delayed channel are moved to the times when
    they were true. Raises ValueError where places do not tell the modes apart.
    """
    time, columns = series.time, list(series.values.T)
    if any(channel.delay for channel in mapping.channels):
        time, columns = _aligned(series, mapping)
    n = len(mapping.states)
    values, rates = np.full((2, len(time), n), np.nan)
    offsets, scales = np.zeros(n, bool), np.zeros(n, bool)
    noise = np.full((2, n), np.nan)
    for measures in dict.fromkeys(channel.measures for channel in mapping.channels):
        group = [k for k, channel in enumerate(mapping.channels) if channel.measures == measures]
        channels = [mapping.channels[k] for k in group]
        state, is_rate = mapping.target(channels[0])
        weights = _weights(channels, mapping.span)
        combined = np.column_stack(_together(time, [columns[k] for k in group])) @ weights
        (rates if is_rate else values)[:, state] = combined
        noise[int(is_rate), state] = np.linalg.norm(weights * series.noise[group])
        (offsets if is_rate else scales)[state] |= any(
            (channel.offset if is_rate else channel.scale) == "unknown" for channel in channels
        )
    return Recording(
        time, mapping.states, values,
        rates=rates if np.isfinite(rates).any() else None,
        unknown_offsets=offsets, unknown_scales=scales,
        known_noise=noise if np.isfinite(noise).any() else None,
        inputs=series.inputs,
    )  # fmt: skip


def parted(recording: Recording, period: float) -> list[Recording]:
    """The recording between gaps longer than a period of the motion, s, each part by itself.

    Over such a gap nothing tells how the motion went on, nor whether the clock did. A part ends as
    well where an input is not known, or a sensor that others outlast is silent for long. Parts of
    fewer than FEWEST samples or LEAST are left out, but where no part is longer and the inputs are
    known throughout. Raises ValueError where no part is left.
    """
    measured = np.isfinite(recording.values).any(axis=1)
    if recording.rates is not None:
        measured |= np.isfinite(recording.rates).any(axis=1)
    known = (one.covered(recording.time) for one in recording.inputs.values())
    driven = np.all([np.ones(len(measured), bool), *known], axis=0)
    told = driven & ~_silent(recording, SILENT * period)
    rows = np.flatnonzero(measured & told)
    apart = np.diff(recording.time[rows]) > period
    apart |= np.diff(np.cumsum(~told)[rows]) > 0
    parts = np.split(rows, np.flatnonzero(apart) + 1)
    long = [
        slice(int(part[0]), int(part[-1]) + 1)
        for part in parts
        if len(part) >= FEWEST and np.ptp(recording.time[part]) >= LEAST * period
    ]
    if driven.all() and ((told.all() and len(parts) == 1) or not long):
        return [recording]
    if not long:
        raise ValueError(
            f"inputs: {', '.join(recording.inputs)}: nowhere are all known for {LEAST} periods "
            f"of {period:.3g} s in which the motion is measured"
        )
    return [recording[own] for own in long]


def _silent(recording: Recording, longest: float) -> np.ndarray:
    """(n,) whether a coordinate that is measured at other times has no sample for `longest` s: of
    itself, nor of its velocity where that is a state, or, where neither ever is, of their rates.
    """
    time, silent = recording.time, np.zeros(len(recording.time), bool)
    pairs = velocity_pairs(recording.states)
    for i in set(range(len(recording.states))) - set(pairs.values()):
        own = [i, pairs[i]] if i in pairs else [i]
        sampled = np.isfinite(recording.values[:, own]).any(axis=1)
        if not sampled.any() and recording.rates is not None:
            sampled = np.isfinite(recording.rates[:, own]).any(axis=1)
        if sampled.any():
            ends = np.r_[time[0], time[sampled], time[-1]]
            before = np.clip(np.searchsorted(ends, time, side="right") - 1, 0, len(ends) - 2)
            silent |= ~sampled & (np.diff(ends)[before] > longest)
    return silent


def _weights(channels: "list[Channel]", span: float | None) -> np.ndarray:
    """(m,) what the sensors of one quantity are weighed with for its first mode."""
    if all(channel.position is None for channel in channels):
        return np.full(len(channels), 1.0 / len(channels))
    if any(channel.position is None for channel in channels):
        names = ", ".join(repr(channel.column) for channel in channels)
        raise ValueError(
            f"channels: {names} measure the same; give all of them a position, or none"
        )
    places = np.array([channel.position for channel in channels]) / span
    modes = np.sin(np.pi * np.outer(places, np.arange(1, len(places) + 1)))
    if np.linalg.cond(modes) > 1e3:
        at = ", ".join(f"{channel.position:g}" for channel in channels)
        raise ValueError(f"channels: sensors at {at} m do not tell {len(places)} modes apart")
    return np.linalg.inv(modes)[0]


def _together(time: np.ndarray, columns: list[np.ndarray]) -> list[np.ndarray]:
    """Columns with values at the times of the first one; interpolated where theirs differ."""
    times = [np.isfinite(column) for column in columns]
    if all(np.count_nonzero(times[0] & own) >= 0.5 * own.sum() for own in times[1:]):
        return columns
    step = np.median(np.diff(time[times[0]]))
    together = [columns[0]]
    for column, own in zip(columns[1:], times[1:], strict=True):
        known = time[own]
        between = CubicSpline(known, column[own], extrapolate=False)(time)
        after = np.minimum(np.searchsorted(known, time), len(known) - 1)
        apart = known[after] - known[np.maximum(after - 1, 0)]
        together.append(np.where(apart < 2.5 * step, between, np.nan))
    return together


def _aligned(series: "Series", mapping: "ColumnMapping") -> tuple[np.ndarray, list[np.ndarray]]:
    """The channels at their own times, on the union of these times."""
    tick = 1e-6 * np.median(np.diff(series.time))  # times that differ by rounding are the same
    moved = [tick * np.round((series.time - c.delay) / tick) for c in mapping.channels]
    time = np.unique(np.concatenate(moved))
    columns = []
    for own, values in zip(moved, series.values.T, strict=True):
        column = np.full(len(time), np.nan)
        column[np.searchsorted(time, own)] = values
        columns.append(column)
    return time, columns


STRETCHES = 8  # spread over a long recording
PERIODS = 64  # of the fastest motion, in each
PARTS = 8  # of a stretch, whose sizes are compared
TINY = 1e-9  # deviations of a channel


def excerpts(recordings: list[Recording]) -> list[Recording]:
    """The recordings, of long ones only stretches, so that what a model costs is bounded.

    They are at most STRETCHES of PERIODS in all, but one at least of every recording. A longer
    recording is cut into equal parts. From every other part comes the stretch in which the size of
    the motion varies most, for what grows and decays tells of damping; from the others that in
    which the motion is largest, for it tells of the cubic terms. Stretches without gaps go before
    others. Recordings of which no channel varies above its noise have no period, and stay whole.
    """
    try:
        period = shortest_period([with_integrals(recording) for recording in recordings])
    except ValueError:
        return recordings
    each = max(STRETCHES // len(recordings), 1)
    return [piece for recording in recordings for piece in _pieces(recording, each, period)]


def by_excerpts(
    method: Callable[..., IdentifiedModel],
    recordings: list[Recording],
    *question: object,
    **options: object,
) -> IdentifiedModel:
    """The model that a method finds in the excerpts of recordings; of motion that random forces
    keep up, of which every swing tells as much as another, in the whole of them.
    """
    if "forced" in options:
        return method(recordings, *question, **options)
    stretches = excerpts(recordings)
    whole = all(one is other for one, other in zip(stretches, recordings, strict=False))
    if method is not maximum_likelihood or recordings[0].inputs or whole:
        return method(stretches, *question, **options)
    if wavers(recordings, shortest_period([with_integrals(each) for each in recordings])):
        names = ("prior", "coefficients", "allowed")
        about = {"prior": PRIOR} | {name: options[name] for name in names if name in options}
        problem = asked(recordings, *question, **about)
        if found := if_moved_at_random(problem, recordings):
            return found
    found = method(stretches, *question, **options)
    if found.is_forced:
        every = method(recordings, *question, **options, forced=())
        return every if every.status == "ok" or found.status != "ok" else found
    return found


def _pieces(recording: Recording, count: int, period: float) -> list[Recording]:
    time, length = recording.time, PERIODS * period
    fitting = int((time[-1] - time[0]) / length)
    if fitting <= count:
        return [recording]
    edges = np.searchsorted(time, time[0] + length / PARTS * np.arange(fitting * PARTS + 1))
    sizes = _sizes(with_integrals(recording).values, edges).reshape(fitting, PARTS, -1)
    merits = np.array([np.log(sizes).std(axis=1).sum(axis=1), sizes.mean(axis=(1, 2))])
    gaps = np.searchsorted(edges[::PARTS], np.flatnonzero(np.diff(time) > period), "right") - 1
    broken = np.isin(np.arange(fitting), gaps) | np.any(sizes <= TINY, axis=(1, 2))
    merits[:, broken] = -1.0
    parts = np.array_split(np.arange(fitting), count)
    chosen = [part[np.argmax(merits[n % 2, part])] for n, part in enumerate(parts)]
    pieces = [slice(edges[PARTS * k], edges[PARTS * (k + 1)]) for k in chosen]
    return [recording[own] for own in pieces if own.stop - own.start > 2 * PARTS]


def _sizes(values: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """(n_parts, n_channels) size of the motion in the parts between `edges`, TINY without samples.

    values: (n, n_states). edges: (n_parts + 1,) samples. In units of the channel's deviation.
    """
    values = values[:, np.isfinite(values).any(axis=0)]
    known = np.isfinite(values)
    scaled = (values - np.nanmean(values, axis=0)) / np.nanstd(values, axis=0)
    scaled = np.where(known, scaled, 0.0)

    def total(of: np.ndarray) -> np.ndarray:
        sums = np.concatenate([np.zeros((1, of.shape[1])), np.cumsum(of, axis=0)])
        return np.diff(sums[edges], axis=0)

    share = np.maximum(total(known), 1)
    variance = total(scaled**2) / share - (total(scaled) / share) ** 2
    return np.sqrt(np.maximum(variance, TINY**2))


def input_notes(recording: Recording) -> list[str]:
    """A line for each input that is not known all through the motion."""
    time = recording.time
    steps = np.diff(time, append=time[-1])
    steps[steps > INTERPOLATED * np.median(steps)] = 0.0  # of the time with samples
    return [
        f"input {name} is not known for {steps[gone].sum():.1f} s, "
        f"{100 * gone.mean():.2g} % of the samples: left out"
        for name, one in recording.inputs.items()
        if (gone := ~one.covered(time)).any()
    ]


def known_ahead(
    model: PolynomialModel,
    recording: Recording,
    time: np.ndarray,
    ahead: Mapping[str, Input | float],
) -> Recording:
    """The recording with the inputs of a model known up to the end of `time`, s.

    ahead: by name, what they are after the recording: measured, or a constant. Raises ValueError
    where one is not known.
    """
    inputs = dict(recording.inputs)
    for name in model.inputs:
        if name not in inputs:
            raise ValueError(f"recording: has no input {name}, which drives the model")
        if name in ahead:
            inputs[name] = _continued(name, inputs[name], ahead[name], recording.time[-1], time[-1])
        elif not inputs[name].covered(time).all():
            held = np.nanmean(inputs[name].values)
            raise ValueError(
                f"the model is driven by {name}: say what it is after the recording, in a file "
                f"(--inputs FILE) or held (--at {name}={held:.3g})"
            )
    return replace(recording, inputs=inputs)


def _continued(name: str, past: Input, ahead: Input | float, end: float, until: float) -> Input:
    """An input up to `end`, s, and what it is from then on: its samples are as close as before."""
    kept = past.time <= end
    step = float(np.median(np.diff(past.time)))
    time = np.arange(past.time[kept][-1] + step, until + 2 * step, step)
    if isinstance(ahead, Input):
        values = ahead(time)
        known = np.isfinite(values)
        late = (time < ahead.stretches[0][0]) & (time < end + INTERPOLATED * step)
        beyond = time > until
        if not known.any() or not np.all(known | late | beyond):
            first, last = ahead.stretches[0][0], ahead.stretches[-1][1]
            raise ValueError(
                f"input {name} is known from {first:g} to {last:g} s after the recording, with "
                f"{len(ahead.stretches) - 1} gaps; it is needed from {end:g} to {until:g} s"
            )
        values = np.interp(time, time[known], values[known])
    else:
        values = np.full(len(time), float(ahead))
    return replace(
        past, time=np.append(past.time[kept], time), values=np.append(past.values[kept], values)
    )
