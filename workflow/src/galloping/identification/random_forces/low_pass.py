"""Low-pass filter of recordings, after which white noise is still white."""

from dataclasses import replace

import numpy as np

from galloping.arrays import TIME_ROUNDING
from galloping.identification.identified_model import IdentifiedModel
from galloping.identification.no_model import IdentificationError
from galloping.identification.observations import Code
from galloping.identification.preparation.smoothing import sampled_rates
from galloping.recording.samples import INTERPOLATED, Recording

# The edge of the filter is from 1 - ROLL_OFF to 1 + ROLL_OFF times the frequency in its middle. A
# wider edge separates close modes less; a narrower one needs more samples beside gaps and ends
# (REACH). With half and twice this width no answer of `make exam` changes.
ROLL_OFF = 0.1
REACH = 16.0  # half length of the filter, in filtered steps; the rest of it is below a hundredth
BRIDGED = 0.5  # gaps up to this share of such a step are interpolated; the error is as small
FLAT = (1.0 - ROLL_OFF) / (1.0 + ROLL_OFF)  # frequencies below this share of `below` are unchanged


def apply_model_filter(identified: IdentifiedModel, recordings: list[Recording]) -> list[Recording]:
    """Apply to recordings the low-pass filter with which a model was identified.

    Recordings are unchanged if there was no filter. Raises as `low_pass_recording`.
    """
    below = float(identified.diagnostics.get("below", 0.0))
    if not below:
        return recordings
    slowly = (1.0 - TIME_ROUNDING) * _filtered_step(below)
    if all(each.step > slowly for each in recordings):
        return recordings
    return low_pass_recordings(recordings, below)


def low_pass_recordings(recordings: list[Recording], below: float) -> list[Recording]:
    """Low-pass filter recordings, and omit those of which no samples remain.

    below: cut-off frequency, Hz. Raises IdentificationError if no recording remains.
    """
    left, errors = [], []
    for each in recordings:
        try:
            left.append(low_pass_recording(each, below))
        except IdentificationError as error:
            errors.append(error)
    if not left:
        raise errors[-1]
    return left


def _filtered_step(below: float) -> float:
    """Compute the step between samples after the filter, s."""
    return (1.0 + ROLL_OFF) / (2.0 * below)


def low_pass_recording(recording: Recording, below: float) -> Recording:
    """Low-pass filter a recording at the frequency `below`, Hz, and lower its sampling rate.

    Components slower than FLAT of it are unchanged, and white noise stays white: the filter is a
    root raised cosine, and a step is half a period of the frequency in the middle of its edge (J.
    G. Proakis and M. Salehi, Digital Communications, 2008, section 9.2). There are no samples
    within REACH steps of the ends and of gaps. Raises IdentificationError if nothing is left,
    the samples are no faster, or the values are exact.
    """
    step, recorded_step = _filtered_step(below), recording.step
    time = np.arange(recording.time[0] + REACH * step, recording.time[-1] - REACH * step, step)
    channels = recording.values, sampled_rates(recording)
    filtered = np.full((len(time), 2, len(recording.states)), np.nan)
    paces = np.full(filtered.shape[1:], recorded_step)  # s, between samples of each channel
    if recorded_step < step and not recording.exact:
        for k, i in np.ndindex(paces.shape):
            column = channels[k][:, i]
            known = np.isfinite(column)
            if known.sum() > 1:
                samples = recording.time[known], column[known]
                paces[k, i] = pace = float(np.median(np.diff(samples[0])))
                if pace < step:
                    filtered[:, k, i] = _filter_channel(*samples, time, step, pace)
    there = np.isfinite(filtered).any(axis=(1, 2))
    if there.sum() < 2:
        raise IdentificationError(
            Code.NOTHING_LEFT, below_hz=below, duration_s=np.ptp(recording.time),
            step_s=recorded_step, least_duration_s=2 * REACH * step, most_step_s=step,
        )  # fmt: skip
    values = filtered[there, 0]
    rates = None if recording.rates is None else filtered[there, 1]
    noise = recording.known_noise
    quieter = None if noise is None else noise * np.sqrt(paces / step)
    return replace(recording, time=time[there], values=values, rates=rates, known_noise=quieter)


def _filter_channel(
    at: np.ndarray, values: np.ndarray, time: np.ndarray, step: float, own: float
) -> np.ndarray:
    """Filter samples (n,) at `at`, about every `own` s, to the times `time`; NaN where missing."""
    grid = np.arange(at[0], at[-1] + own / 2.0, own)
    bridged, found = np.interp(grid, at, values), np.full(len(time), np.nan)
    gaps = np.flatnonzero(np.diff(at) > max(INTERPOLATED * own, BRIDGED * step))
    begins, ends = np.append(at[gaps], at[-1]), np.append(at[gaps + 1], np.inf)
    first, last = time - REACH * step, time + REACH * step
    following = np.searchsorted(ends, first, side="right")  # first gap that ends later
    whole = np.flatnonzero((first >= at[0]) & (begins[following] >= last))
    width = int(2.0 * REACH * step / own) + 2
    for some in np.array_split(whole, len(whole) // 256 + 1):  # parts that fit in the cache
        near = np.searchsorted(grid, first[some])[:, None] + np.arange(width)
        inside = near < np.searchsorted(grid, last[some])[:, None]
        near = np.minimum(near, len(grid) - 1)
        weights = inside * _root_raised_cosine((grid[near] - time[some, None]) / step)
        found[some] = np.sum(weights * bridged[near], axis=1) / np.sum(weights, axis=1)
    return found


def _root_raised_cosine(x: np.ndarray) -> np.ndarray:
    """Evaluate the filter at times in steps, with its limits at three singular points."""
    x = np.where((x == 0.0) | (np.abs(4.0 * ROLL_OFF * x) == 1.0), x + 1e-6, x)
    edge = 4.0 * ROLL_OFF * x
    swings = np.sin(np.pi * x * (1.0 - ROLL_OFF)) + edge * np.cos(np.pi * x * (1.0 + ROLL_OFF))
    return swings / (np.pi * x * (1.0 - edge**2))
