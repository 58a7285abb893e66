"""Recordings from the channels of a file: places, delays, gaps, and availability of inputs."""

import numpy as np
from scipy.interpolate import CubicSpline

from galloping.identification.inputs import MIN_SAMPLES
from galloping.identification.preparation.smoothing import stack_channels
from galloping.model.polynomial import velocity_pairs
from galloping.readers.mapping import Channel, ColumnMapping
from galloping.readers.series import Series
from galloping.recording.samples import MAX_INTERPOLATED_STEPS, Recording

# shortest part of a recording, in longest periods of the motion
MIN_PART_PERIODS = 3
# longest gap of one sensor over which its motion can be inferred, in longest periods
MAX_SILENT_PERIODS = 6


def make_recording(series: Series, mapping: ColumnMapping) -> Recording:
    """Make a recording of states from the channels of a file.

    Sensors of one quantity at m places along the span are projected on its first m sine modes, of
    which the first is kept: q = sum_i P_1i y_i with P the inverse of sin(k pi s_i / l). A single
    sensor is divided by sin(pi s / l). Samples of a delayed channel are moved to their true times.
    Raises ValueError if the places do not distinguish the modes.
    """
    time, columns = series.time, list(series.values.T)
    if any(channel.delay for channel in mapping.channels):
        time, columns = _align_channels(series, mapping)
    n = len(mapping.states)
    # of the states, then of their rates
    motion, noise = np.full((2, len(time), n), np.nan), np.full((2, n), np.nan)
    unknown = np.zeros((2, n), bool)
    for measures in dict.fromkeys(channel.measures for channel in mapping.channels):
        group = [k for k, channel in enumerate(mapping.channels) if channel.measures == measures]
        channels = [mapping.channels[k] for k in group]
        state, is_rate = mapping.target(channels[0])
        weights = _mode_weights(channels, mapping.span)
        together = np.column_stack(_interpolate_together(time, [columns[k] for k in group]))
        motion[int(is_rate), :, state] = together @ weights
        noise[int(is_rate), state] = np.linalg.norm(weights * series.noise[group])
        unknown[int(is_rate), state] = any(
            (channel.offset if is_rate else channel.scale) == "unknown" for channel in channels
        )
    (values, rates), (scales, offsets) = motion, unknown
    return Recording(
        time, mapping.states, values,
        rates=rates if np.isfinite(rates).any() else None,
        unknown_offsets=offsets, unknown_scales=scales,
        known_noise=noise if np.isfinite(noise).any() else None,
        inputs=series.inputs,
    )  # fmt: skip


def split_recording(recording: Recording, period: float) -> list[Recording]:
    """Split a recording at gaps that are longer than the period of the motion.

    Neither the motion nor the clock is known over such a gap. A part also ends where an input is
    unknown, or where a sensor is silent for long while others are not. Parts with fewer than
    MIN_SAMPLES samples or shorter than MIN_PART_PERIODS are left out, unless no part is longer and
    the inputs are known throughout. Raises ValueError if no part is left.
    """
    is_measured = np.isfinite(stack_channels(recording)).any(axis=1)
    driven = np.full(len(recording.time), True)
    for driving in recording.inputs.values():
        driven = driven & driving.covered(recording.time)
    is_known = driven & ~_find_silent_samples(recording, MAX_SILENT_PERIODS * period)
    rows = np.flatnonzero(is_measured & is_known)
    is_apart = np.diff(recording.time[rows]) > period
    is_apart |= np.diff(np.cumsum(~is_known)[rows]) > 0
    parts = np.split(rows, np.flatnonzero(is_apart) + 1)
    long = [
        slice(int(part[0]), int(part[-1]) + 1)
        for part in parts
        if len(part) >= MIN_SAMPLES and np.ptp(recording.time[part]) >= MIN_PART_PERIODS * period
    ]
    if driven.all() and ((is_known.all() and len(parts) == 1) or not long):
        is_whole = not len(rows) or rows[-1] - rows[0] + 1 == len(recording.time)
        return [recording if is_whole else recording[rows[0] : rows[-1] + 1]]
    if not long:
        raise ValueError(
            f"inputs: {', '.join(recording.inputs)}: nowhere are all known for {MIN_PART_PERIODS} "
            f"periods of {period:.3g} s in which the motion is measured"
        )
    return [recording[part] for part in long]


def _find_silent_samples(recording: Recording, longest: float) -> np.ndarray:
    """Find samples, (n,), at which a coordinate measured at other times is silent for `longest` s.

    It is silent if there is no sample of itself, nor of its velocity if that is a state, or, if
    neither is ever measured, of their rates.
    """
    time, silent = recording.time, np.zeros(len(recording.time), bool)
    pairs = velocity_pairs(recording.states)
    for i in set(range(len(recording.states))) - set(pairs.values()):
        indices = [i, pairs[i]] if i in pairs else [i]
        sampled = np.isfinite(recording.values[:, indices]).any(axis=1)
        if not sampled.any() and recording.rates is not None:
            sampled = np.isfinite(recording.rates[:, indices]).any(axis=1)
        if sampled.any():
            ends = np.r_[time[0], time[sampled], time[-1]]
            before = np.clip(np.searchsorted(ends, time, side="right") - 1, 0, len(ends) - 2)
            silent |= ~sampled & (np.diff(ends)[before] > longest)
    return silent


def _mode_weights(channels: list[Channel], span: float | None) -> np.ndarray:
    """Compute the weights, (m,), of the sensors of one quantity for its first mode."""
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
        raise ValueError(f"channels: sensors at {at} m cannot separate {len(places)} modes")
    return np.linalg.inv(modes)[0]


def _interpolate_together(time: np.ndarray, columns: list[np.ndarray]) -> list[np.ndarray]:
    """Interpolate columns with other times to the times of the first one."""
    first, *others = [np.isfinite(column) for column in columns]
    if all(np.count_nonzero(first & is_finite) >= 0.5 * is_finite.sum() for is_finite in others):
        return columns
    step = np.median(np.diff(time[first]))
    interpolated = [columns[0]]
    for column, is_finite in zip(columns[1:], others, strict=True):
        knots = time[is_finite]
        values = CubicSpline(knots, column[is_finite], extrapolate=False)(time)
        next_knot = np.minimum(np.searchsorted(knots, time), len(knots) - 1)
        gaps = knots[next_knot] - knots[np.maximum(next_knot - 1, 0)]
        interpolated.append(np.where(gaps < 2.5 * step, values, np.nan))
    return interpolated


def _align_channels(series: Series, mapping: ColumnMapping) -> tuple[np.ndarray, list[np.ndarray]]:
    tick = 1e-6 * np.median(np.diff(series.time))  # times that differ by rounding are the same
    true_times = [tick * np.round((series.time - c.delay) / tick) for c in mapping.channels]
    time = np.unique(np.concatenate(true_times))
    columns = []
    for moments, values in zip(true_times, series.values.T, strict=True):
        column = np.full(len(time), np.nan)
        column[np.searchsorted(time, moments)] = values
        columns.append(column)
    return time, columns


def note_missing_inputs(recording: Recording) -> list[str]:
    """List a note for each input that is missing during part of a recording."""
    time = recording.time
    steps = np.diff(time, append=time[-1])
    steps[steps > MAX_INTERPOLATED_STEPS * np.median(steps)] = 0.0  # of the time with samples
    return [
        f"input {name} is not known for {steps[is_missing].sum():.4g} s, "
        f"{100 * is_missing.mean():.2g} % of the samples: left out"
        for name, one in recording.inputs.items()
        if (is_missing := ~one.covered(time)).any()
    ]
