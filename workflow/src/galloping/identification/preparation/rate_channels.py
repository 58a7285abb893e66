"""Channels that measure the rate of a state, such as accelerometers: offsets, scales, noise.

A slow difference between such a channel and the smooth curve's slope is an offset, since the curve
itself has no slow slope.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import chain
from typing import Any

import numpy as np
from numpy.polynomial import Polynomial
from numpy.polynomial.legendre import legvander

from galloping.arrays import TIME_ROUNDING, first_from
from galloping.identification.findings import Code
from galloping.identification.no_model import IdentificationError
from galloping.identification.preparation.screening import MEDIAN_DEVIATION
from galloping.identification.preparation.smoothing import (
    DRIFT_DEGREE,
    MIN_CHANNEL_SAMPLES,
    Smooth,
    distance_to,
    sampled_rates,
    unmeasured_displacements,
    without_stuck_channels,
)
from galloping.model.intervals import MIN_SIGNIFICANCE
from galloping.model.polynomial import velocity_pairs
from galloping.recording.samples import Recording

OVERLAP = 4  # number of test functions that overlap at each time


def channel_noise(recording: Recording, smoothed: Smooth) -> tuple[np.ndarray, np.ndarray]:
    """Estimate the noise standard deviation of each channel, as a first guess.

    Returns the estimate, (2 n_states,), in the order of `stack_channels`, and the known noise, NaN
    if unknown.
    """
    of_rates = _robust_deviation(sampled_rates(recording) - _curve_slopes(recording, smoothed))
    estimate, known = np.append(smoothed.noise, of_rates), recording.known_noise
    return estimate, np.full(len(estimate), np.nan) if known is None else known.ravel()


def with_scales(
    recordings: list[Recording], period: float
) -> tuple[list[Recording], dict[str, float]]:
    """Divide channels of unknown scale by the scales that their measured derivatives determine.

    period: s, the shortest of the motion. Returns the recordings, unchanged if no scale is unknown,
    and the scales, such as `scale_X`, with their standard errors, such as `error_of_scale_X`, as
    means of the recordings. Raises IdentificationError if no channel determines a scale.
    """
    estimates = [_estimate_scales(one, period) for one in recordings]
    divided, diagnostics = [], {}
    for one, scales in zip(recordings, estimates, strict=True):
        scaled = divide_by_scales([one], {name: scale for name, (scale, _) in scales.items()})
        divided.append(replace(scaled[0], unknown_scales=None) if scales else one)
    for name in dict.fromkeys(chain.from_iterable(estimates)):
        values, errors = np.array([each[name] for each in estimates if name in each]).T
        diagnostics[name] = float(values.mean())
        diagnostics[f"error_of_{name}"] = float(np.linalg.norm(errors) / len(errors))
    return divided, diagnostics


def divide_by_scales(
    recordings: Sequence[Recording], diagnostics: Mapping[str, Any]
) -> list[Recording]:
    """Divide channels of recordings, and their known noise, by scales.

    diagnostics: of a model, with numbers such as `scale_X`. Channels without one are unchanged.
    """
    names = recordings[0].states
    scales = np.array([float(diagnostics.get(f"scale_{name}", 1.0)) for name in names])
    if np.all(scales == 1.0):
        return list(recordings)
    divided = []
    for one in recordings:
        noise = one.known_noise
        if noise is not None:
            noise = np.stack([noise[0] / np.abs(scales), noise[1]])
        divided.append(replace(one, values=one.values / scales, known_noise=noise))
    return divided


def _unknown_scales(recording: Recording) -> list[int]:
    """List the indices of the values of unknown scale."""
    if recording.unknown_scales is None:
        return []
    is_measured = np.isfinite(recording.values).any(axis=0)
    return np.flatnonzero(recording.unknown_scales & is_measured).tolist()


def _curve_slopes(recording: Recording, smoothed: Smooth) -> np.ndarray:
    """Interpolate slopes of the smooth curves at the samples, (n, n_states)."""
    slopes = np.gradient(smoothed.states, smoothed.time, axis=0)
    return np.column_stack([np.interp(recording.time, smoothed.time, one) for one in slopes.T])


def _robust_deviation(values: np.ndarray) -> np.ndarray:
    """Compute the robust standard deviation of each column, NaN for one without values."""
    is_known = np.isfinite(values).any(axis=0)
    distance = np.abs(values[:, is_known] - np.nanmedian(values[:, is_known], axis=0))
    deviation = np.full(values.shape[1], np.nan)
    deviation[is_known] = MEDIAN_DEVIATION * np.nanmedian(distance, axis=0)
    return deviation


def without_offsets(
    recording: Recording, given: Recording, smoothed: Smooth, period: float
) -> Recording:
    """Add measured time derivatives to a recording, with offsets and outliers removed.

    given: the recording with these rates. period: s, the shortest of the motion. Raises
    IdentificationError if an offset cannot be determined.
    """
    if given.rates is None:
        return recording
    rates = without_stuck_channels(given.rates)
    difference = rates - _curve_slopes(recording, smoothed)
    ends = np.sort(np.append(smoothed.time[[0, -1]], smoothed.time[~smoothed.valid]))
    from_ends = distance_to(ends, recording.time)
    integrated = {k for pair in unmeasured_displacements(given).items() for k in pair}
    span = recording.time[-1] - recording.time[0]
    slow = legvander(2.0 * (recording.time - recording.time[0]) / span - 1.0, DRIFT_DEGREE)
    unknown = given.unknown_offsets
    for k in np.flatnonzero(np.isfinite(rates).any(axis=0)):
        # near the ends of stretches, slopes are inaccurate for a period, integrals for three
        is_inner = from_ends > (3.0 if k in integrated else 1.0) * period * (1.0 + TIME_ROUNDING)
        if unknown is not None and unknown[k]:
            good = is_inner & np.isfinite(difference[:, k])
            if good.sum() <= 10 * (DRIFT_DEGREE + 1):
                raise IdentificationError(Code.OFFSET_UNDETERMINED, recording.states[k])
            drift = slow @ np.linalg.lstsq(slow[good], difference[good, k], rcond=None)[0]
            rates[:, k] -= drift
            difference[:, k] -= drift
        good = is_inner & np.isfinite(difference[:, k])
        # eight robust deviations, instead of 5.5 for samples: slopes are rougher than the curve
        limit = 8.0 * _robust_deviation(difference[good, k : k + 1])[0]
        rates[is_inner & (np.abs(difference[:, k]) > limit), k] = np.nan
    return replace(recording, rates=rates, unknown_offsets=None)


def check_rates(recording: Recording, smoothed: Smooth) -> None:
    """Raise IdentificationError for a measured rate that is a multiple of the rate of its state.

    recording: its measured rates without offsets. A channel counts if its rate would have to be
    multiplied by less than a half, more than two, or a negative number.
    """
    slopes = _curve_slopes(recording, smoothed)
    rates = np.hstack([sampled_rates(recording), recording.values])
    n = len(recording.states)
    pairs = [(x, n + v) for x, v in velocity_pairs(recording.states).items()]
    for state, channel in [*pairs, *((i, i) for i in range(n))]:
        least, most = _scale_limits(slopes[:, state], rates[:, channel])
        if most < 0.0 or least > 2.0 or 0.0 < most < 0.5:
            name = recording.states[state]
            times = np.sign(least) * np.sqrt(least * most)
            raise IdentificationError(Code.RATE_SCALED, f"d{name}", coordinate=name, times=times)


def _scale_limits(slopes: np.ndarray, rates: np.ndarray) -> tuple[float, float]:
    """Compute the least and the largest scale of rates (n,) relative to slopes (n,) of a curve.

    If both contain noise, a regression of either on the other gives a limit (R. Frisch, 1934).
    Returns (0, 0) if they are not clearly correlated.
    """
    is_known = np.isfinite(slopes) & np.isfinite(rates)
    if is_known.sum() < MIN_CHANNEL_SAMPLES:
        return 0.0, 0.0
    (of_slopes, of_both), (_, of_rates) = np.cov(slopes[is_known], rates[is_known])
    if of_both**2 < 0.25 * of_slopes * of_rates:
        return 0.0, 0.0
    least, most = sorted((of_both / of_slopes, of_rates / of_both))
    return float(least), float(most)


def _estimate_scales(recording: Recording, period: float) -> dict[str, tuple[float, float]]:
    """Estimate unknown scales and their standard errors, by names as of `with_scales`."""
    scales = {}
    pairs, rates = velocity_pairs(recording.states), sampled_rates(recording)
    for k in _unknown_scales(recording):
        velocity, order = (pairs[k], 2) if k in pairs else (k, 1)
        integrals = _weak_integrals(
            recording.time, recording.values[:, k], rates[:, velocity], order, period
        )
        scale, error = _fit_scale(*integrals) if len(integrals[0]) >= 20 else (0.0, np.inf)
        if not MIN_SIGNIFICANCE * error < abs(scale):
            rate = f"d{recording.states[velocity]}"
            raise IdentificationError(Code.SCALE_UNDETERMINED, recording.states[k], rate=rate)
        scales[f"scale_{recording.states[k]}"] = scale, error
    return scales


def _fit_scale(of_values: np.ndarray, of_rates: np.ndarray) -> tuple[float, float]:
    """Compute the ratio of integrals of values to those of rates, and its standard error.

    of_values, of_rates: as of `_weak_integrals`. The two integrals of rates are instruments of each
    other. Neighbouring test functions overlap, and so do their errors (W. K. Newey and K. D. West,
    1987).
    """
    of_values = of_values - of_values.mean()
    of_rates = of_rates - of_rates.mean(axis=0)  # the offset of the rate
    products, squares = of_values * of_rates.mean(axis=1), of_rates.prod(axis=1)
    scale = products.sum() / squares.sum()
    moments = products - scale * squares
    variance = moments @ moments
    for lag in range(1, OVERLAP):
        variance += 2.0 * (1.0 - lag / OVERLAP) * (moments[lag:] @ moments[:-lag])
    return float(scale), float(np.sqrt(variance) / abs(squares.sum()))


def _weak_integrals(
    time: np.ndarray, values: np.ndarray, rates: np.ndarray, order: int, length: float
) -> tuple[np.ndarray, np.ndarray]:
    """Integrate values (n,), and their derivative `rates` (n,), against test functions.

    Integration by parts moves the derivatives of the values to the test functions, bumps as wide as
    twice `length`, s, so that both integrals differ only in scale, offset and noise. Returns those
    of values, (n_tests,), and two of rates, (n_tests, 2), with independent noise: of every second
    sample, and of the others. Stretches with gaps are left out.
    """
    is_known = np.isfinite(values) & np.isfinite(rates)
    time, values, rates = time[is_known], values[is_known], rates[is_known]
    if len(time) < 2:
        return np.empty(0), np.empty((0, 2))
    step = np.median(np.diff(time))
    test = Polynomial([1.0, 0.0, -1.0]) ** 5  # zero at -1 and 1, with four derivatives
    shape = test.deriv(order) * (-1.0) ** order / length**order
    integrals = []
    for centre in np.arange(time[0] + length, time[-1] - length, 2.0 * length / OVERLAP):
        window = slice(*first_from(time, (centre - length, centre + length)))
        t = time[window]
        if len(t) > 8 and np.max(np.diff([centre - length, *t, centre + length])) < 2.5 * step:
            u = (t - centre) / length
            of_rates = test(u) * rates[window]
            halves = [np.trapezoid(of_rates[k::2], t[k::2]) for k in (0, 1)]
            integrals.append([np.trapezoid(shape(u) * values[window], t), *halves])
    of_tests = np.array(integrals).reshape(-1, 3)
    return of_tests[:, 0], of_tests[:, 1:]
