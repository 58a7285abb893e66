"""Removal of faulty samples: stuck and saturated sensors, outliers.

Removed samples become NaN, which every later stage treats as missing.
"""

from contextlib import suppress
from dataclasses import replace

import numpy as np

from galloping.arrays import TIME_ROUNDING, finest_step, round_down
from galloping.identification.findings import Code
from galloping.identification.no_model import IdentificationError
from galloping.identification.preparation.smoothing import (
    GRID_PER_PERIOD,
    Smooth,
    distance_to,
    shortest_period,
    smooth,
    with_integrals,
    without_stuck_channels,
)
from galloping.identification.work import count_work
from galloping.progress_reports import passing
from galloping.recording.samples import Recording

# Standard deviation of Gaussian noise over the median of its absolute values.
MEDIAN_DEVIATION = 1.4826
# Least distance of an outlier, in robust standard deviations. Noise exceeds it once in 30 million.
OUTLIER_THRESHOLD = 5.5
MAX_OUTLIERS = 0.1  # largest share of a channel's samples that is removed as outliers


def prepare_recordings(
    recordings: list[Recording], share: float = 1.0
) -> tuple[list[Recording], list[Smooth], float]:
    """Remove sensor faults and outliers from recordings, and fit smooth curves to the states.

    share: factor on the shortest period that the spectra show; the product is used instead. Returns
    the recordings without faults and outliers; smooth curves for these, in which displacements that
    no channel measures are integrated (`with_integrals`); and the shortest period, s. Raises
    IdentificationError if no channel varies, or a state cannot be derived from the channels.
    """
    passing("smooth the recording")
    count_work(1e-6 * sum(recording.samples for recording in recordings))
    whole = [with_integrals(recording) for recording in recordings]
    period = share * shortest_period(whole)
    pairs = [smooth_without_outliers(without_faults(one, period), period) for one in whole]
    cleaned = [  # without values of channels that were not given
        replace(one, values=np.where(np.isfinite(given.values).any(axis=0), one.values, np.nan))
        for (one, _), given in zip(pairs, recordings, strict=True)
    ]
    return cleaned, [curve for _, curve in pairs], period


def without_faults(recording: Recording, period: float) -> Recording:
    """Remove the samples of stuck or saturated sensors from a recording.

    A channel of values is saturated where many samples equal its largest or its smallest value
    exactly; those samples are removed, with their neighbours within a grid step (period/24), whose
    noise the limit truncates too.
    """
    values, rates = recording.values.copy(), recording.rates
    if rates is not None:
        rates = without_stuck_channels(rates)
    for channel in values.T:
        good = np.isfinite(channel)
        least = max(5, 5e-4 * good.sum())  # a digital channel repeats some values by chance
        if np.all(channel[good] == channel[good][:1]):
            channel[:] = np.nan
            continue
        for extreme in find_saturated_values(channel[good]):
            indices = np.flatnonzero(channel == extreme)
            if len(indices) >= least:
                distance = distance_to(recording.time[indices], recording.time)
                channel[distance <= period / GRID_PER_PERIOD * (1.0 + TIME_ROUNDING)] = np.nan
    return replace(recording, values=values, rates=rates)


def find_saturated_values(values: np.ndarray) -> list[float]:
    """Find extreme values that a channel takes unusually often, as a saturated sensor does.

    values: (n,). An extreme counts if far more samples have it than the next value. With a coarse
    resolution many samples have each value.
    """
    saturated = []
    for extreme_of in (np.min, np.max):
        extreme = extreme_of(values)
        others = values[values != extreme]
        # four times as often: with a coarsely resolved sine it is 2.4 times
        if len(others) and len(values) - len(others) >= 4 * np.sum(others == extreme_of(others)):
            saturated.append(float(extreme))
    return saturated


def smooth_without_outliers(recording: Recording, period: float) -> tuple[Recording, Smooth]:
    """Smooth a recording, remove samples far from the smooth curves, and return both.

    Far is OUTLIER_THRESHOLD robust standard deviations, and well above the accuracy of the curve
    itself and the resolution of the channel; the curve is fitted again until none is left. The
    deviation is that of the channel and also that of the samples within some four periods, or an
    eighth of the recording, as noise may vary with the signal. Raises IdentificationError if more
    than MAX_OUTLIERS of the samples of a channel would be removed.
    """
    with suppress(IdentificationError):
        return _smooth_without_outliers(recording, period, 4.0 * period)
    return _smooth_without_outliers(recording, period, np.ptp(recording.time) / 8.0)


def _smooth_without_outliers(
    recording: Recording, period: float, length: float
) -> tuple[Recording, Smooth]:
    """Apply `smooth_without_outliers` with the noise of samples within some length, s."""
    n_given = np.isfinite(recording.values).sum(axis=0)
    smoothed = smooth(recording, period)
    floor = np.maximum(
        1e-3 * np.ptp(smoothed.states, axis=0),  # accuracy while outliers pull the curve
        [finest_step(channel) / np.sqrt(12.0) for channel in recording.values.T],
    )
    while True:
        far = np.zeros(recording.values.shape, bool)
        for k, gap in enumerate(np.abs(smoothed.residual.T)):
            good = np.isfinite(gap)
            if not good.any():
                continue
            usual = np.maximum(MEDIAN_DEVIATION * np.median(gap[good]), floor[k])
            far[good, k] = gap[good] > OUTLIER_THRESHOLD * usual
            if far[:, k].any():
                near = _local_median(recording.time[good], gap[good], length)
                far[good, k] &= gap[good] > OUTLIER_THRESHOLD * MEDIAN_DEVIATION * near
        if not far.any():
            return recording, smoothed
        recording = replace(recording, values=np.where(far, np.nan, recording.values))
        too_few = np.isfinite(recording.values).sum(axis=0) < (1.0 - MAX_OUTLIERS) * n_given
        if too_few.any():
            raise IdentificationError(Code.OUTLIERS, recording.states[np.argmax(too_few)])
        smoothed = smooth(recording, period)


def _local_median(time: np.ndarray, values: np.ndarray, length: float) -> np.ndarray:
    """Compute medians (n,) of stretches of about `length`, s, interpolated between these.

    All stretches have the same number of samples, since in few samples outliers look like noise.
    """
    count = max(round_down((time[-1] - time[0]) / length), 1)
    centres = [part.mean() for part in np.array_split(time, count)]
    return np.interp(time, centres, [np.median(part) for part in np.array_split(values, count)])
