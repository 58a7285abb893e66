"""Channels that measure the rate of a state, such as accelerometers: offsets, scales, noise.

They count as samples of the solution's derivative. Their constant offset and slow drift, and the
unknown scale of a channel of values, are told from the other channels before the fit: what is slow
in the difference to the smooth curve's slope is offset, for the curve itself has no such slope.
"""

from dataclasses import replace

import numpy as np
from numpy.polynomial import Polynomial
from numpy.polynomial.legendre import legvander

from galloping.identification.likelihood.integrals import DRIFT_DEGREE, undisplaced
from galloping.identification.likelihood.smoothing import Smooth
from galloping.identification.likelihood.weak_gls import Start
from galloping.identification.model import Unusable
from galloping.polynomial import velocity_pairs
from galloping.recording import Recording

INTEGRAL_MARGIN = 3.0  # periods at the ends of stretches, where it errs (measured: 1 is too few)
FEWEST_INTEGRALS = 20  # that tell a scale to a few percent
RATE_OUTLIER = 8.0  # robust deviations about the slope of a curve, which is rougher than the curve
RATE_MARGIN = 1.0  # periods at the ends of stretches of samples, where that slope is rough


def channels(recordings: list[Recording]) -> tuple[np.ndarray, np.ndarray]:
    """(n_observed,) state of each channel that some recording has, and whether it is its rate."""
    values = np.any([np.isfinite(one.values).any(axis=0) for one in recordings], axis=0)
    rates = np.any([np.isfinite(_rates(one)).any(axis=0) for one in recordings], axis=0)
    states = np.concatenate([np.flatnonzero(values), np.flatnonzero(rates)])
    return states, np.arange(len(states)) >= values.sum()


def channel_values(recording: Recording, states: np.ndarray, is_rate: np.ndarray) -> np.ndarray:
    """(n, n_observed) samples of the `channels`."""
    return np.where(is_rate, _rates(recording)[:, states], recording.values[:, states])


def channel_noise(
    recording: Recording, smoothed: Smooth, states: np.ndarray, is_rate: np.ndarray
) -> np.ndarray:
    """(n_observed,) first estimate of the noise of a sample, NaN where not measured."""
    about = _rates(recording) - _slopes(recording, smoothed)
    return np.where(is_rate, _deviation(about)[states], smoothed.noise[states])


def known_noise(recording: Recording, states: np.ndarray, is_rate: np.ndarray) -> np.ndarray:
    """(n_observed,) noise of a sample where it is known beforehand, else NaN."""
    if recording.known_noise is None:
        return np.full(len(states), np.nan)
    return recording.known_noise[is_rate.astype(int), states]


def with_rates(start: Start, recordings: list[Recording]) -> Start:
    """The start, its recordings with the rates of the given ones, without offsets and outliers.

    Raises ValueError where an offset cannot be told.
    """
    pairs = zip(start.recordings, recordings, start.smoothed, strict=True)
    return replace(start, recordings=[_without_offsets(*each, start.period) for each in pairs])


def scaled(recordings: list[Recording], period: float) -> list[Recording]:
    """The recordings with values of unknown scale divided by it, told by the rates beside them.

    period: s, the shortest of the motion. Raises ValueError where no channel tells it.
    """
    return [_scaled(recording, period) for recording in recordings]


def scales_told(recordings: list[Recording], scaled: list[Recording]) -> dict[str, float]:
    """The unknown scales, by name, from recordings and those of `scaled`; means over them."""
    told: dict[str, list[float]] = {}
    for recording, own in zip(recordings, scaled, strict=True):
        if own is not recording:
            for k in np.flatnonzero(recording.unknown_scales):
                ratio = np.nanmedian(recording.values[:, k] / own.values[:, k])
                told.setdefault(f"scale_{recording.states[k]}", []).append(float(ratio))
    return {name: float(np.mean(values)) for name, values in told.items()}


def _rates(recording: Recording) -> np.ndarray:
    return np.full(recording.values.shape, np.nan) if recording.rates is None else recording.rates


def _slopes(recording: Recording, smoothed: Smooth) -> np.ndarray:
    slopes = np.gradient(smoothed.states, smoothed.time, axis=0)
    return np.column_stack([np.interp(recording.time, smoothed.time, one) for one in slopes.T])


def _deviation(values: np.ndarray) -> np.ndarray:
    """Robust standard deviation of each column, NaN of one without values."""
    known = np.isfinite(values).any(axis=0)
    deviation = np.full(values.shape[1], np.nan)
    deviation[known] = 1.4826 * np.nanmedian(
        np.abs(values[:, known] - np.nanmedian(values[:, known], axis=0)), axis=0
    )
    return deviation


def _inside(recording: Recording, smoothed: Smooth, margin: float) -> np.ndarray:
    """(n,) whether no gap and no end of the curve is nearer than `margin` s."""
    bad = np.flatnonzero(~smoothed.valid)
    ends = np.concatenate([smoothed.time[[0, -1]], smoothed.time[bad]])
    ends.sort()
    place = np.clip(np.searchsorted(ends, recording.time), 1, len(ends) - 1)
    distance = np.minimum(recording.time - ends[place - 1], ends[place] - recording.time)
    return distance > margin


def _without_offsets(
    recording: Recording, given: Recording, smoothed: Smooth, period: float
) -> Recording:
    if given.rates is None:
        return recording
    rates = given.rates.copy()
    difference = rates - _slopes(recording, smoothed)
    curves = _inside(recording, smoothed, RATE_MARGIN * period)
    integrals = _inside(recording, smoothed, INTEGRAL_MARGIN * period)
    of_integrals = {k for pair in undisplaced(given).items() for k in pair}
    span = recording.time[-1] - recording.time[0]
    slow = legvander(2.0 * (recording.time - recording.time[0]) / span - 1.0, DRIFT_DEGREE)
    unknown = given.unknown_offsets
    for k in np.flatnonzero(np.isfinite(rates).any(axis=0)):
        inside = integrals if k in of_integrals else curves
        if unknown is not None and unknown[k]:
            good = inside & np.isfinite(difference[:, k])
            if good.sum() <= 10 * (DRIFT_DEGREE + 1):
                raise Unusable(f"the offset of d{recording.states[k]} cannot be told")
            fitted = slow @ np.linalg.lstsq(slow[good], difference[good, k], rcond=None)[0]
            rates[:, k] -= fitted
            difference[:, k] -= fitted
        good = inside & np.isfinite(difference[:, k])
        limit = RATE_OUTLIER * _deviation(difference[good, k : k + 1])[0]
        rates[inside & (np.abs(difference[:, k]) > limit), k] = np.nan
    return replace(recording, rates=rates)


def _scaled(recording: Recording, period: float) -> Recording:
    if recording.unknown_scales is None or not recording.unknown_scales.any():
        return recording
    values, pairs = recording.values.copy(), velocity_pairs(recording.states)
    noise = None if recording.known_noise is None else recording.known_noise.copy()
    for k in np.flatnonzero(recording.unknown_scales):
        velocity, order = (pairs[int(k)], 2) if int(k) in pairs else (int(k), 1)
        own, other = _weak(
            recording.time, values[:, k], _rates(recording)[:, velocity], order, period
        )
        if len(own) < FEWEST_INTEGRALS:
            raise Unusable(
                f"the scale of {recording.states[k]} cannot be told: no channel of known scale "
                f"measures d{recording.states[velocity]}"
            )
        scale = np.polyfit(other, own, 1)[0]  # the constant is the offset of the rate
        values[:, k] /= scale
        if noise is not None:
            noise[0, k] /= abs(scale)
    return replace(recording, values=values, unknown_scales=None, known_noise=noise)


def _weak(
    time: np.ndarray, values: np.ndarray, rates: np.ndarray, order: int, length: float
) -> tuple[np.ndarray, np.ndarray]:
    """Integrals of values and of their derivative of some order, each against test functions.

    Integration by parts takes the derivatives to the test functions, bumps of two `length`, so
    that both are equal but for scale, offset and noise. Stretches with gaps are left out.
    """
    known = np.isfinite(values) & np.isfinite(rates)
    time, values, rates = time[known], values[known], rates[known]
    if len(time) < 2:
        return np.empty(0), np.empty(0)
    step = np.median(np.diff(time))
    test = Polynomial([1.0, 0.0, -1.0]) ** 5  # zero at -1 and 1, with four derivatives
    shape = test.deriv(order) * (-1.0) ** order / length**order
    pairs = []
    for centre in np.arange(time[0] + length, time[-1] - length, length / 2):
        inside = slice(*np.searchsorted(time, (centre - length, centre + length)))
        t = time[inside]
        if len(t) > 8 and np.max(np.diff(t, prepend=centre - length)) < 2.5 * step:
            u = (t - centre) / length
            pairs.append(
                [
                    np.trapezoid(shape(u) * values[inside], t),
                    np.trapezoid(test(u) * rates[inside], t),
                ]
            )
    return tuple(np.array(pairs).reshape(-1, 2).T)
