"""Low-pass filter of recordings, after which white noise is still white."""

from dataclasses import replace

import numpy as np

from galloping.arrays import TIME_ROUNDING
from galloping.identification.findings import Code
from galloping.identification.identified_model import IdentifiedModel
from galloping.identification.no_model import IdentificationError
from galloping.identification.preparation.smoothing import sampled_rates
from galloping.recording.samples import MAX_INTERPOLATED_STEPS, Recording

# Half width of the filter's edge, relative to the frequency in its middle. A wider edge separates
# close modes less; a narrower one needs more samples beside gaps and ends (FILTER_HALF_LENGTH).
# With half and twice this width no answer of `make exam` changes.
ROLL_OFF = 0.1
# Half length of the filter, in filtered steps. The filter is below a hundredth outside.
FILTER_HALF_LENGTH = 16.0
# Longest gap that is interpolated, in filtered steps. The error is below a hundredth as well.
MAX_BRIDGED_GAP = 0.5
# Highest frequency that the filter does not change, relative to `below`.
PASS_BAND_EDGE = (1.0 - ROLL_OFF) / (1.0 + ROLL_OFF)


def apply_model_filter(identified: IdentifiedModel, recordings: list[Recording]) -> list[Recording]:
    """Apply to recordings the low-pass filter with which a model was identified.

    Recordings are unchanged if there was no filter. Raises as `low_pass_recording`.
    """
    cutoff = float(identified.diagnostics.get("below", 0.0))
    if not cutoff:
        return recordings
    filtered_step = (1.0 - TIME_ROUNDING) * _filtered_step(cutoff)
    if all(each.step > filtered_step for each in recordings):
        return recordings
    return low_pass_recordings(recordings, cutoff)


def low_pass_recordings(recordings: list[Recording], below: float) -> list[Recording]:
    """Low-pass filter recordings, and omit those of which no samples remain.

    below: cut-off frequency, Hz. Raises IdentificationError if no recording remains.
    """
    filtered, errors = [], []
    for each in recordings:
        try:
            filtered.append(low_pass_recording(each, below))
        except IdentificationError as error:
            errors.append(error)
    if not filtered:
        raise errors[-1]
    return filtered


def _filtered_step(cutoff: float) -> float:
    """Compute the step between samples after the filter, s."""
    return (1.0 + ROLL_OFF) / (2.0 * cutoff)


def low_pass_recording(recording: Recording, below: float) -> Recording:
    """Low-pass filter a recording at the frequency `below`, Hz, and lower its sampling rate.

    Components below the share PASS_BAND_EDGE of this frequency are unchanged, and white noise stays
    white: the filter is a root raised cosine, and the new time step is half a period of the
    frequency in the middle of its edge (J. G. Proakis and M. Salehi, Digital Communications, 2008,
    section 9.2). No sample within FILTER_HALF_LENGTH steps of an end or a gap remains. Raises
    IdentificationError if nothing remains, the recorded steps are no shorter, or the values are
    exact.
    """
    step, recorded_step = _filtered_step(below), recording.step
    time = np.arange(
        recording.time[0] + FILTER_HALF_LENGTH * step,
        recording.time[-1] - FILTER_HALF_LENGTH * step,
        step,
    )
    channels = recording.values, sampled_rates(recording)
    filtered = np.full((len(time), 2, len(recording.states)), np.nan)
    steps = np.full(filtered.shape[1:], recorded_step)  # s, between samples of each channel
    if recorded_step < step and not recording.exact:
        for k, i in np.ndindex(steps.shape):
            column = channels[k][:, i]
            is_known = np.isfinite(column)
            if is_known.sum() > 1:
                samples = recording.time[is_known], column[is_known]
                steps[k, i] = given_step = float(np.median(np.diff(samples[0])))
                if given_step < step:
                    filtered[:, k, i] = _filter_channel(*samples, time, step, given_step)
    is_kept = np.isfinite(filtered).any(axis=(1, 2))
    if is_kept.sum() < 2:
        raise IdentificationError(
            Code.NOTHING_LEFT, below_hz=below, duration_s=np.ptp(recording.time),
            step_s=recorded_step, least_duration_s=2 * FILTER_HALF_LENGTH * step, most_step_s=step,
        )  # fmt: skip
    values = filtered[is_kept, 0]
    rates = None if recording.rates is None else filtered[is_kept, 1]
    noise = recording.known_noise
    noise = None if noise is None else noise * np.sqrt(steps / step)
    return replace(recording, time=time[is_kept], values=values, rates=rates, known_noise=noise)


def _filter_channel(
    given_time: np.ndarray, values: np.ndarray, time: np.ndarray, step: float, given_step: float
) -> np.ndarray:
    """Filter samples at `given_time` to `time`, every `step` s; NaN near gaps and ends."""
    grid = np.arange(given_time[0], given_time[-1] + given_step / 2.0, given_step)
    bridged, filtered = np.interp(grid, given_time, values), np.full(len(time), np.nan)
    gaps = np.flatnonzero(
        np.diff(given_time) > max(MAX_INTERPOLATED_STEPS * given_step, MAX_BRIDGED_GAP * step)
    )
    begins = np.append(given_time[gaps], given_time[-1])
    ends = np.append(given_time[gaps + 1], np.inf)
    first, last = time - FILTER_HALF_LENGTH * step, time + FILTER_HALF_LENGTH * step
    following = np.searchsorted(ends, first, side="right")  # first gap that ends later
    whole = np.flatnonzero((first >= given_time[0]) & (begins[following] >= last))
    width = int(2.0 * FILTER_HALF_LENGTH * step / given_step) + 2
    for rows in np.array_split(whole, len(whole) // 256 + 1):  # parts that fit in the cache
        sample_indices = np.searchsorted(grid, first[rows])[:, None] + np.arange(width)
        is_inside = sample_indices < np.searchsorted(grid, last[rows])[:, None]
        sample_indices = np.minimum(sample_indices, len(grid) - 1)
        weights = is_inside * _root_raised_cosine((grid[sample_indices] - time[rows, None]) / step)
        filtered[rows] = np.sum(weights * bridged[sample_indices], axis=1) / np.sum(weights, axis=1)
    return filtered


def _root_raised_cosine(x: np.ndarray) -> np.ndarray:
    """Evaluate the filter at times in steps, with its limits at three singular points."""
    x = np.where((x == 0.0) | (np.abs(4.0 * ROLL_OFF * x) == 1.0), x + 1e-6, x)
    edge = 4.0 * ROLL_OFF * x
    numerator = np.sin(np.pi * x * (1.0 - ROLL_OFF)) + edge * np.cos(np.pi * x * (1.0 + ROLL_OFF))
    return numerator / (np.pi * x * (1.0 - edge**2))
