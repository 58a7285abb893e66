"""Find where motion begins from rest, and where it has come to rest.

A channel is at rest where it varies, over a period of the motion, much less than over the following
period, or where nothing exceeds the noise until the end. Rest contains no information on viscous
damping, but place and time of sticking depend on dry friction.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np
from scipy.ndimage import minimum_filter1d

from galloping.arrays import finest_step, one_thread
from galloping.identification.findings import Code, Finding, Severity
from galloping.identification.free_motion.damped_modes import Stretch
from galloping.identification.free_motion.mode_search import strongest_mode
from galloping.identification.preparation.smoothing import stack_channels
from galloping.model.functions import Function
from galloping.model.polynomial import Exponents, velocity_pairs
from galloping.recording.samples import Recording

# Largest variation of a stretch at rest, relative to the motion that follows. Motion that grows at
# 3 % of critical damping is 0.8 times as large one period before.
MAX_REST = 0.2
MAX_OSCILLATING_REST = 0.05  # the same for a stretch that itself oscillates
MIN_WINDOW = 8  # least samples of a window in which the size of a motion is computed
WINDOW_PERIODS = (1.0, 0.25)  # lengths of the windows before and after a release, in periods
MIN_REST = 2.0  # least length of a rest between two motions, or after the last one, in periods
MIN_MOTION = 1.5  # least length of a motion between two rests, in periods
MIN_DEPARTURE = 5.0  # distance from rest at which motion begins, in standard deviations of rest
# Least ratio of samples that show the acceleration of an impact to the expected size of the first
# period of motion, which is extrapolated from the two periods after it.
SPIKE_RATIO = 1.25
MAX_PERIOD_DECAY = 3.0  # largest factor of decay in a period for this extrapolation
MIN_FLOAT = np.finfo(float).tiny  # least positive divisor
MIN_RESOLUTION_STEPS = 5.0  # least range of a moving sensor, in steps of its resolution


@dataclass(frozen=True)
class MovingPart:
    """Part of a recording in which the system moves, and the rest before and after it.

    rested_from: first sample of the rest before, None if there is none. rests_until: last sample of
    the rest after, None if there is none.
    """

    rows: slice
    rested_from: int | None = None
    rests_until: int | None = None


@one_thread
def moving_parts(time: np.ndarray, values: np.ndarray) -> list[MovingPart]:
    """Find the parts of a recording in which the system moves, between periods of rest.

    time: (n,) s, increasing. values: (n, n_channels), NaN where missing. Returns the whole
    recording if it never rests, or if all of it does.
    """
    whole = [MovingPart(slice(0, len(time)))]
    samples = np.flatnonzero(np.isfinite(values).any(axis=1))
    if len(samples) and samples[-1] - samples[0] + 1 < len(time):  # missing samples are no rest
        inner = slice(samples[0], samples[-1] + 1)
        return [_shift_part(part, inner.start) for part in moving_parts(time[inner], values[inner])]
    columns, resolution = _fill_gaps(time, values)
    period = _dominant_period(columns)
    if len(time) < 4 * max(period, MIN_WINDOW):
        return whole
    onsets = _find_onsets(columns, period, resolution)
    edges = [*(onset for onset, _ in onsets), len(time)]
    parts = []
    first = onsets[0][1] if onsets else len(time)
    if first > 0:
        part = MovingPart(slice(0, first))
        parts.append(_without_tail(columns, part, period, edges[0], resolution))
    for (onset, rested_from), end in zip(onsets, edges[1:], strict=True):
        begin = onset + _spike_length(columns[:, onset:end], period)
        part = MovingPart(slice(begin, end), rested_from)
        parts.append(_without_tail(columns, part, period, end, resolution))
    long = [part for part in parts if part.rows.stop - part.rows.start >= MIN_MOTION * period]
    return long or whole


def _shift_part(part: MovingPart, rows: int) -> MovingPart:
    def later(row: int | None) -> int | None:
        return None if row is None else int(row + rows)

    shifted = slice(int(part.rows.start + rows), int(part.rows.stop + rows))
    return MovingPart(shifted, later(part.rested_from), later(part.rests_until))


def moving_samples(time: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, list[Finding]]:
    """Mark the samples at which the system moves, and report where motion begins and ends.

    time: (n,) s, increasing. values: (n, n_channels), NaN where missing. Returns the marks, (n,)
    boolean, and the findings.
    """
    moves = np.zeros(len(time), bool)
    findings: list[Finding] = []
    for part in moving_parts(time, values):
        moves[part.rows] = True
        findings += _rest_findings(time, part, 0)
    return moves, findings


@dataclass(frozen=True)
class MovingRecordings:
    """Parts of recordings in which the system moves, without the rest before and after.

    recordings: one for each stretch of motion, with the rest after it if the motion may stick.
    until_rest: the same without the rest after them. origins: index of the recording that each of
    them comes from. findings: where motion begins and ends, if rest is left out there.
    """

    recordings: list[Recording]
    until_rest: list[Recording]
    origins: list[int]
    findings: tuple[Finding, ...]


def moving_recordings(
    recordings: Sequence[Recording], terms: Sequence[Exponents] = ()
) -> MovingRecordings:
    """Remove the rest before and after the motion from recordings.

    Recordings of systems without a velocity, those with inputs and those of exact states are
    unchanged. A recording in which no channel varies is left out if another one varies. terms: the
    library. With a function sign(u), the motion may stick, and includes the rest after it.
    """
    may_stick = any(isinstance(part, Function) and part.name == "sign" for part in chain(*terms))
    with_rest: list[Recording] = []
    until_rest: list[Recording] = []
    origins: list[int] = []
    findings: list[Finding] = []
    may_rest = [
        not (each.inputs or each.exact) and bool(velocity_pairs(each.states)) for each in recordings
    ]
    is_still = [rests and not _varies(one) for rests, one in zip(may_rest, recordings, strict=True)]
    for index, recording in enumerate(recordings):
        if is_still[index] and not all(is_still):
            rest = MovingPart(slice(0, 1), rests_until=len(recording.time) - 1)
            findings += _rest_findings(recording.time, rest, index)
            continue
        parts = [MovingPart(slice(0, len(recording.time)))]
        if may_rest[index]:
            parts = moving_parts(recording.time, stack_channels(recording))
        for part in parts:
            until_rest.append(_select_rows(recording, part.rows))
            if may_stick and part.rests_until is not None:
                rows = slice(part.rows.start, part.rests_until + 1)
                part = replace(part, rows=rows, rests_until=None)
            with_rest.append(_select_rows(recording, part.rows))
            origins.append(index)
            findings += _rest_findings(recording.time, part, index)
    return MovingRecordings(with_rest, until_rest, origins, tuple(findings))


def _varies(recording: Recording) -> bool:
    return any(finest_step(channel) > 0.0 for channel in stack_channels(recording).T)


def _select_rows(recording: Recording, rows: slice) -> Recording:
    is_whole = rows.stop - rows.start == len(recording.time)
    return recording if is_whole else recording[rows]


def _rest_findings(time: np.ndarray, part: MovingPart, index: int) -> Iterator[Finding]:
    begin, end = float(time[part.rows.start]), float(time[part.rows.stop - 1])
    if part.rested_from is not None:
        data = {"from_s": float(time[part.rested_from]), "time_s": begin}
        yield Finding(Code.RELEASED, Severity.NOTE, data=data, recording=index)
    if part.rests_until is not None:
        data = {"time_s": end, "until_s": float(time[part.rests_until])}
        yield Finding(Code.CAME_TO_REST, Severity.NOTE, data=data, recording=index)


def _fill_gaps(time: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Interpolate the missing samples of channels that vary, (n_varying, n), linearly.

    Returns the smallest difference between two samples of each as well, (n_varying, 1).
    """
    columns, resolutions = [], []
    for column in values.T:
        is_known = np.isfinite(column)
        if np.count_nonzero(is_known) >= MIN_WINDOW and np.ptp(column[is_known]) > 0.0:
            columns.append(np.interp(time, time[is_known], column[is_known]))
            resolutions.append(finest_step(column))
    return np.array(columns).reshape(-1, len(time)), np.array(resolutions)[:, np.newaxis]


def _dominant_period(columns: np.ndarray) -> float:
    """Find the period of the largest velocity, in samples, infinite without one."""
    power = np.zeros(columns.shape[1] // 2)
    for column in columns:
        spectrum = np.abs(np.fft.rfft(np.diff(column)))[: len(power)] ** 2
        power += spectrum / max(spectrum.sum(), MIN_FLOAT)
    if len(power) <= 2 or not power[2:].any():
        return np.inf
    return columns.shape[1] / (2.0 + np.argmax(power[2:]))


def _window_deviations(columns: np.ndarray, length: int) -> tuple[np.ndarray, np.ndarray]:
    """Compute the standard deviation in the window from each sample on, and whether it is smooth.

    Both are (n_channels, n - length + 1). A channel is smooth where its mean squared differences
    are below its variance; those of white noise are twice as large.
    """
    centred = columns - columns.mean(axis=1, keepdims=True)
    mean = _window_sums(centred, length) / length
    deviation = np.sqrt(np.maximum(_window_sums(centred**2, length) / length - mean**2, 0.0))
    squares = _window_sums(np.diff(columns, axis=1) ** 2, length - 1) / (length - 1)
    return deviation, squares < deviation**2


def _window_sums(columns: np.ndarray, length: int) -> np.ndarray:
    """Compute sums over the window from each sample on, (n_channels, n - length + 1)."""
    total = np.pad(np.cumsum(columns, axis=1), ((0, 0), (1, 0)))
    return total[:, length:] - total[:, :-length]


def _find_onsets(
    columns: np.ndarray, period: float, resolution: np.ndarray
) -> list[tuple[int, int]]:
    """Find pairs of the first samples of a motion and of the rest before it."""
    onsets: list[tuple[int, int]] = []
    for length in sorted({max(int(share * period), MIN_WINDOW) for share in WINDOW_PERIODS})[::-1]:
        deviation, is_smooth = _window_deviations(columns, length)
        span = int(MIN_MOTION * period)
        if deviation.shape[1] <= length + span:
            continue
        following = minimum_filter1d(deviation, span, axis=1, origin=-(span // 2))
        following = following[:, length : deviation.shape[1] - span + 1]
        window_deviation = deviation[:, : following.shape[1]]
        starts = np.maximum(window_deviation, resolution) <= MAX_REST * following
        low, usual, high = np.quantile(deviation, (0.01, 0.9, 0.99), axis=1)[:, :, np.newaxis]
        moves = is_smooth[:, : following.shape[1]] | (low < MAX_REST * high)  # not only noise
        moves &= window_deviation > MAX_REST * usual
        is_onset = np.any(starts, axis=0) & ~np.any(moves & ~starts, axis=0)
        if length < int(period):  # the few samples of a short window may agree by chance
            is_onset[int(period) :] = False
        ends = np.flatnonzero(is_onset & ~np.append(is_onset[1:], False))
        for last in map(int, ends):
            least = 2.0 * deviation[:, last]
            still_from = _rest_begin(deviation, last, least, length)
            least = np.maximum(least, MAX_REST / 2.0 * deviation.max(axis=1))
            rested_from = _rest_begin(deviation, last, least, length)
            if rested_from and last - still_from < MIN_REST * period:
                continue  # a node of beats
            rest = slice(rested_from, last + max(length // 2, 4))
            level = deviation[:, last] / np.maximum(following[:, last], MIN_FLOAT)
            oscillates = np.all(level[starts[:, last]] > MAX_OSCILLATING_REST)
            if oscillates and not _is_still(columns[:, rest]):
                continue  # a smaller motion
            onset = _find_departure(columns[starts[:, last]], rest, length)
            if all(abs(onset - earlier_onset) > span for earlier_onset, _ in onsets):
                onsets.append((onset, rested_from))
    return sorted(onsets)


def _find_departure(columns: np.ndarray, rest: slice, length: int) -> int:
    """Find the first sample out of a rest, whose end may be up to `length` samples later."""
    still = columns[:, rest]
    middle = still.mean(axis=1, keepdims=True)
    least = np.maximum(MIN_DEPARTURE * still.std(axis=1), 1.5 * np.abs(still - middle).max(axis=1))
    away = np.abs(columns - middle)[:, rest.stop : rest.stop + 2 * length]
    out = np.any(away > least[:, np.newaxis], axis=0)
    return rest.stop + int(np.argmax(out)) if out.any() else rest.stop + length // 2


def _rest_begin(deviation: np.ndarray, last: int, least: np.ndarray, length: int) -> int:
    """Find the first sample of the windows before `last` that vary by `least` at most."""
    moves = np.any(deviation[:, :last] > least[:, np.newaxis], axis=0)
    return int(np.flatnonzero(moves)[-1]) + length if moves.any() else 0


def _spike_length(columns: np.ndarray, period: float) -> int:
    """Count samples at the beginning of motion that show the acceleration of an impact."""
    length = int(period)
    if columns.shape[1] < 4 * length:
        return 0
    middle = columns[:, length : 4 * length].mean(axis=1, keepdims=True)
    away = np.abs(columns - middle)
    later = [away[:, n * length : (n + 1) * length].max(axis=1, keepdims=True) for n in (1, 2)]
    expected = later[0] * np.clip(later[0] / np.maximum(later[1], MIN_FLOAT), 1.0, MAX_PERIOD_DECAY)
    high = np.flatnonzero(np.any(away[:, :length] > SPIKE_RATIO * expected, axis=0))
    return min(2 * (int(high[-1]) + 1), length) if len(high) else 0


def _without_tail(
    columns: np.ndarray, part: MovingPart, period: float, end: int, resolution: np.ndarray
) -> MovingPart:
    """Remove the rest at the end of a part. end: sample at which the next motion begins."""
    begin, stop = part.rows.start, part.rows.stop
    length = max(int(period), MIN_WINDOW)
    samples = columns[:, begin:stop]
    if samples.shape[1] < (MIN_MOTION + MIN_REST) * length:
        return part
    deviation, _ = _window_deviations(samples, length)
    last = samples[:, -max(length, samples.shape[1] // 20) :].std(axis=1, keepdims=True)
    last = np.maximum(last, resolution)
    if np.any(deviation.max(axis=1, keepdims=True) * MAX_REST < last):
        return part
    moves = np.flatnonzero(np.any(deviation > 1.5 * last, axis=0))
    still_from = int(moves[-1]) + length // 4 if len(moves) else samples.shape[1]
    possible = samples.shape[1] - still_from
    for share in (1.0, 0.8, 0.6, 0.4, 0.2):
        tail = int(share * possible)
        if tail < MIN_REST * length:
            break
        rest = samples[:, -tail:]
        is_resolved = np.ptp(rest, axis=1) > MIN_RESOLUTION_STEPS * resolution[:, 0]
        if _is_still(rest[is_resolved]):
            return replace(part, rows=slice(begin, stop - tail), rests_until=end - 1)
    return part


def _is_still(columns: np.ndarray) -> bool:
    """Decide whether nothing oscillates in channels (n_channels, n), uniformly sampled."""
    if not len(columns) or columns.shape[1] < 2 * MIN_WINDOW:
        return True
    values = columns.T - columns.mean(axis=1)
    time = np.arange(len(values), dtype=float)
    stretch = Stretch(time, values, (0,) * len(columns))
    return strongest_mode([stretch], [values], np.empty(0)) is None
