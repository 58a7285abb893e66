"""Spline estimates of the states on a uniform grid, from any sampling.

A state and its measured velocity are smoothed separately if samples are plenty, since the identity
between them is information; as one curve and its derivative if samples are few, or if one of them
is not measured or has gaps.
"""

from dataclasses import dataclass, replace
from functools import cache
from itertools import product
from math import factorial

import numpy as np
from numba import njit
from numpy.polynomial.legendre import legfit, legval
from scipy.interpolate import BSpline
from scipy.linalg import solveh_banded

from galloping.arrays import TIME_ROUNDING, round_up
from galloping.identification.findings import Code
from galloping.identification.no_model import IdentificationError
from galloping.model.polynomial import velocity_pairs
from galloping.recording.samples import Recording, inputs_on_grid

# Degree of the smooth curves: the acceleration of a displacement's quintic spline is still cubic.
SPLINE_DEGREE = 5
# Least number of knots in a period: five represent a sine to 2.5e-4 of its size. The most, one at
# every second point of the grid, represent its third harmonic to 1.4e-3.
MIN_KNOTS_PER_PERIOD = 5
MIN_SAMPLES_PER_KNOT = 3  # least samples for each knot, to distinguish noise from the curve
MIN_SIGNAL_RATIO = 20.0  # least power of a signal, relative to the median of its spectrum
MIN_CHANNEL_SAMPLES = 8  # least samples of a channel: fewer determine neither curve nor noise
GRID_PER_PERIOD = 24  # number of grid points in a shortest period: eight for its third harmonic
# Degree of the polynomial in time of the offset and slow drift of a rate channel in a recording.
DRIFT_DEGREE = 3
# Least degrees of freedom of residuals, relative to their number: many parameters may follow data
# exactly. With a tenth or two fifths no answer of `make exam` changes.
MIN_FREEDOM = 0.2


@cache
def _spline_basis() -> np.ndarray:
    """Compute the coefficient of u^k of the j-th B-spline that is nonzero on a span, (j, k)."""
    spline = BSpline.basis_element(np.arange(SPLINE_DEGREE + 2.0))
    spans = np.arange(SPLINE_DEGREE, -1.0, -1.0)  # the first nonzero spline is on its last span
    return np.column_stack(
        [spline.derivative(k)(spans) / factorial(k) for k in range(SPLINE_DEGREE + 1)]
    )


@dataclass(frozen=True)
class Smooth:
    """Smooth curves fitted to all states of a recording, evaluated on a uniform time grid.

    time: (n_grid,), s. states: (n_grid, n_states). sigma: (n_states,) standard deviation of white
    noise on the grid with the density of the measurement noise, at least the accuracy of a spline;
    NaN for derived states. derived: (n_states,) index of the state whose curve's derivative this
    state is, else -1. noise: (n_states,) standard deviation of a sample about the curve, NaN if not
    measured. residual: (n, n_states) samples less the curve, NaN where missing. valid: (n_grid,)
    whether samples of every curve are near, rather than in a gap. inputs: (n_grid, n_inputs) those
    of the recording, as of `inputs_on_grid`.
    """

    time: np.ndarray
    states: np.ndarray
    sigma: np.ndarray
    derived: np.ndarray
    noise: np.ndarray
    residual: np.ndarray
    valid: np.ndarray
    inputs: np.ndarray

    @property
    def values(self) -> np.ndarray:
        """Smoothed states and inputs side by side, (n_grid, n_states + n_inputs)."""
        return np.hstack([self.states, self.inputs]) if self.inputs.size else self.states


def shortest_period(recordings: list[Recording]) -> float:
    """Find the period, in s, above which every channel has at least 95 % of its power.

    Only power well above the noise floor (the median of the spectrum) counts. Raises
    IdentificationError if no channel varies.
    """
    highest = 0.0
    for recording, channel in product(recordings, range(len(recordings[0].states))):
        pieces = -(-len(recording.time) // 2**15)  # one grid is too coarse for more
        signals = (recording.time, recording.values[:, channel])
        for time, values in zip(*(np.array_split(one, pieces) for one in signals), strict=True):
            good = np.isfinite(values)
            if good.sum() < MIN_CHANNEL_SAMPLES:
                continue
            grid = np.linspace(time[0], time[-1], min(good.sum(), 2**13))
            signal = _until_settled(np.interp(grid, time[good], values[good]))
            duration = (time[-1] - time[0]) * (len(signal) - 1) / (len(grid) - 1)
            total = np.cumsum(_spectrum(signal))
            if total[-1] > 0.0:
                bin_ = 1 + int(np.searchsorted(total, 0.95 * total[-1]))
                highest = max(highest, bin_ / duration)
    if highest == 0.0:
        raise IdentificationError(Code.NO_MOTION)
    return 1.0 / highest


def _until_settled(signal: np.ndarray) -> np.ndarray:
    """Return the beginning of a signal, twice as long as the signal takes to settle.

    It has settled once 99 % of the squared motion has passed, if the last half is noise alone.
    Otherwise the signal is returned whole. A window over the whole signal would hide a motion that
    settles early.
    """
    late = signal[len(signal) // 2 :]
    noise = np.var(late)
    squares = np.cumsum((signal - late.mean()) ** 2 - noise)
    # sums of noise alone deviate by its variance times the root of twice their number
    moves = squares.max() > 10.0 * noise * np.sqrt(2.0 * len(signal))
    if not moves or _spectrum(late).any():
        return signal
    settled = int(np.argmax(squares >= 0.99 * squares.max()))
    return signal[: max(2 * settled, MIN_CHANNEL_SAMPLES)]


def _spectrum(signal: np.ndarray) -> np.ndarray:
    """Compute the power of a signal from the first frequency on, zero where it may be noise."""
    power = np.abs(np.fft.rfft((signal - signal.mean()) * np.hanning(len(signal)))) ** 2
    return np.where(power > MIN_SIGNAL_RATIO * np.median(power), power, 0.0)[1:]


def smooth(recording: Recording, period: float) -> Smooth:
    """Fit smoothing splines to all states of a recording, with knots by its shortest period.

    period: the shortest period, s. Raises IdentificationError if a state is neither measured nor
    the derivative of a measured one.
    """
    n_states = len(recording.states)
    counts = np.isfinite(recording.values).sum(axis=0)
    duration = recording.time[-1] - recording.time[0]
    n_grid = max(round_up(duration / period * GRID_PER_PERIOD) + 1, 16)
    time = np.linspace(recording.time[0], recording.time[-1], n_grid)
    curves, derived = _group_states(recording, period, time)
    states, valid = np.empty((n_grid, n_states)), np.ones(n_grid, bool)
    sigma, noise = np.full((2, n_states), np.nan)
    residual = np.full(recording.values.shape, np.nan)
    for curve in curves:
        supported = counts[curve].sum() / MIN_SAMPLES_PER_KNOT / (duration / period)
        knots = np.clip(supported, MIN_KNOTS_PER_PERIOD, GRID_PER_PERIOD // 2)
        pieces = max(round_up(duration / period * knots), 4)
        states[:, curve], residual[:, curve], noise[curve], density = _fit_curve(
            recording, curve, pieces, time, period
        )
        valid &= _is_near_samples(recording, curve, time, 0.4 * period)  # nearly half a period
        # without samples of its own, a state follows from its velocity for at most a period
        valid &= _is_near_samples(recording, curve[:1], time, period)
        valid &= _is_away_from_gaps(recording, curve, time, period)
        sigma[curve[0]] = density / np.sqrt(time[1] - time[0])
    inputs = inputs_on_grid(list(recording.inputs.values()), time)
    return Smooth(time, states, sigma, derived, noise, residual, valid, inputs)


def _group_states(
    recording: Recording, period: float, grid: np.ndarray
) -> tuple[list[list[int]], np.ndarray]:
    """Group states to smooth as one curve, [state] or [state, velocity], with `Smooth.derived`."""
    counts = np.isfinite(recording.values).sum(axis=0)
    duration = recording.time[-1] - recording.time[0]
    plenty = MIN_SAMPLES_PER_KNOT * MIN_KNOTS_PER_PERIOD * duration / period
    curves = []
    derived = np.full(len(recording.states), -1)
    for i, velocity in velocity_pairs(recording.states).items():
        few = counts[velocity] < plenty
        if counts[i] and counts[velocity]:
            near = [_is_near_samples(recording, [k], grid, 0.4 * period) for k in (i, velocity)]
            few = few or not np.array_equal(near[0], near[1])
        if counts[i] and few:
            curves.append([i, velocity])
            derived[velocity] = i
    for i in np.setdiff1d(np.arange(len(counts)), np.concatenate([[], *curves])):
        if counts[i] < MIN_CHANNEL_SAMPLES:
            raise IdentificationError(Code.NOT_MEASURED, recording.states[i])
        curves.append([i])
    return curves, derived


def _fit_curve(
    recording: Recording, curve: list[int], pieces: int, grid: np.ndarray, period: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """Fit one curve to one channel or to a channel and its derivative.

    Returns the curve and, with two channels, its derivative on the grid, (n_grid, n_channels);
    the residuals of the samples, (n, n_channels); their deviation, by channel; and the square
    root of the noise's spectral density.
    """
    start, duration = recording.time[0], recording.time[-1] - recording.time[0]
    spacing, channels = duration / pieces, np.arange(len(curve))
    positions = (recording.time - start) / spacing
    values = np.ascontiguousarray(recording.values[:, curve])
    good = np.isfinite(values)
    count = good.sum(axis=0)
    scale = np.array([np.nanstd(values[:, k]) if count[k] else 1.0 for k in channels])
    noise = np.where(scale > 0.0, scale, 1.0)
    deviation, residual = np.full(len(curve), np.nan), np.full(values.shape, np.nan)
    basis = _spline_basis()
    # Two channels are weighted by their sizes first, then twice by the noise of the last fit. With
    # one or four times no answer of `make exam` changes. The curve of a single channel does not
    # depend on its weight.
    for _ in range(1 if len(curve) == 1 else 3):
        bands = np.zeros((SPLINE_DEGREE + 1, pieces + SPLINE_DEGREE))
        right = np.zeros(pieces + SPLINE_DEGREE)
        _accumulate(positions, values, 1.0 / noise**2, spacing, basis, bands, right)
        stiffness = count / noise**2 / spacing ** (2 * channels)
        # this closes gaps without changing curves: with twice and half as much, three models change
        # by less than 1e-3 of their errors
        _add_roughness(bands, 5e-4 * float(np.sum(stiffness)) / pieces)
        try:
            coefficients = solveh_banded(bands, right, lower=True)
        except np.linalg.LinAlgError as error:
            raise IdentificationError(Code.GAPS, recording.states[curve[0]]) from error
        for k in np.flatnonzero(count):
            is_known = good[:, k]
            curve_there = _evaluate_spline(positions[is_known], coefficients, k, spacing, basis)
            gap = residual[is_known, k] = values[is_known, k] - curve_there
            share = (pieces + SPLINE_DEGREE) / (count > 0).sum()
            deviation[k] = np.sqrt(np.sum(gap**2) / max(count[k] - share, MIN_FREEDOM * count[k]))
            noise[k] = max(deviation[k], 1e-9 * scale[k], np.finfo(float).tiny)
    grid_place = (grid - start) / spacing
    fitted = [_evaluate_spline(grid_place, coefficients, k, spacing, basis) for k in channels]
    frequency = 2.0 * np.pi / period
    counted = np.maximum(noise, 3e-4 * scale)  # the accuracy with the fewest knots
    weight = np.sum(count / duration / counted**2 * frequency ** (2 * channels))
    return np.column_stack(fitted), residual, deviation, 1.0 / np.sqrt(weight)


def _is_near_samples(
    recording: Recording, curve: list[int], grid: np.ndarray, within: float
) -> np.ndarray:
    """Decide which grid points, (n_grid,), are within `within`, s, of the curve's samples."""
    sampled = recording.time[np.isfinite(recording.values[:, curve]).any(axis=1)]
    return distance_to(sampled, grid) <= within * (1.0 + TIME_ROUNDING)


def distance_to(others: np.ndarray, time: np.ndarray) -> np.ndarray:
    """Compute the distance from each time (n,) to the nearest of others (m,), increasing."""
    after = np.searchsorted(others, time)
    to_next = others[np.minimum(after, len(others) - 1)] - time
    return np.minimum(np.abs(to_next), np.abs(time - others[np.maximum(after - 1, 0)]))


def _is_away_from_gaps(
    recording: Recording, curve: list[int], grid: np.ndarray, period: float
) -> np.ndarray:
    """Decide which points are half a period or more from gaps longer than a period, (n_grid,).

    Near a gap a curve is as inaccurate as at its end.
    """
    sampled = recording.time[np.isfinite(recording.values[:, curve]).any(axis=1)]
    away = np.ones(len(grid), bool)
    for last in np.flatnonzero(np.diff(sampled) > period):
        before, after = sampled[last] - 0.5 * period, sampled[last + 1] + 0.5 * period
        away &= (grid < before) | (grid > after)
    return away


@njit(cache=True)
def _evaluate_alive(place, pieces, basis, derivative, spacing, out):
    """Evaluate the B-splines that are nonzero at `place` (in knot spans); return the first one."""
    span = min(max(int(place), 0), pieces - 1)
    u = place - span
    for j in range(basis.shape[0]):
        total = 0.0
        for k in range(basis.shape[1] - 1, derivative - 1, -1):
            total = total * u + basis[j, k] * (k if derivative else 1)
        out[j] = total / spacing if derivative else total
    return span


@njit(cache=True)
def _accumulate(place, values, weights, spacing, basis, bands, right):
    """Accumulate banded normal equations of the spline; channel k observes its k-th derivative."""
    n = basis.shape[0]
    pieces = len(right) - n + 1
    alive = np.empty(n)
    for k in range(values.shape[1]):
        for i in range(len(place)):
            if np.isfinite(values[i, k]):
                span = _evaluate_alive(place[i], pieces, basis, k, spacing, alive)
                for a in range(n):
                    right[span + a] += weights[k] * alive[a] * values[i, k]
                    for b in range(a, n):
                        bands[b - a, span + a] += weights[k] * alive[a] * alive[b]


@njit(cache=True)
def _evaluate_spline(place, coefficients, derivative, spacing, basis):
    """Evaluate the spline, or its first derivative, at `place` (n,), in knot spans."""
    n = basis.shape[0]
    alive = np.empty(n)
    result = np.zeros(len(place))
    for i in range(len(place)):
        span = _evaluate_alive(
            place[i], len(coefficients) - n + 1, basis, derivative, spacing, alive
        )
        for a in range(n):
            result[i] += alive[a] * coefficients[span + a]
    return result


def _add_roughness(bands: np.ndarray, weight: float) -> None:
    """Add `weight` times the squared third differences of the coefficients, in place."""
    n = bands.shape[1]
    stencil = np.array([-1.0, 3.0, -3.0, 1.0])
    for a in range(4):
        for b in range(a, 4):
            bands[b - a, a : a + n - 3] += weight * stencil[a] * stencil[b]


# The functions below compute displacements that no channel measures by integrating velocities or
# accelerations. Slow components are removed, since they cannot be distinguished from drift. The
# integrals are used only for the curves from which a fit starts: its likelihood is that of the
# channels themselves.


def sampled_rates(recording: Recording) -> np.ndarray:
    """Return the measured time derivatives of the states, (n, n_states), NaN if there are none."""
    return np.full(recording.values.shape, np.nan) if recording.rates is None else recording.rates


def stack_channels(recording: Recording) -> np.ndarray:
    """Stack the samples of states and then of their rates, (n, 2 n_states), NaN if none."""
    return np.hstack([recording.values, sampled_rates(recording)])


def unmeasured_displacements(recording: Recording) -> dict[int, int]:
    """Map the index of each displacement without samples to the index of its velocity."""
    measured = np.any(np.isfinite(recording.values), axis=0).tolist()
    return {x: v for x, v in velocity_pairs(recording.states).items() if not measured[x]}


def with_integrals(recording: Recording) -> Recording:
    """Fill in unmeasured displacements of a recording by integrating velocities or accelerations.

    A displacement X is the integral of dX, else of the rate of X, else the double integral of the
    rate of dX. The recording itself is returned if every state has values.
    """
    pairs = unmeasured_displacements(recording)
    if not pairs:
        return recording
    values, rates = recording.values.copy(), sampled_rates(recording)
    for x, v in pairs.items():
        for channel, times in ((values[:, v], 1), (rates[:, x], 1), (rates[:, v], 2)):
            if np.isfinite(channel).sum() >= MIN_CHANNEL_SAMPLES:
                values[:, x] = _integrate_channel(recording.time, channel, times)
                break
    return replace(recording, values=values)


def without_stuck_channels(values: np.ndarray) -> np.ndarray:
    """Return a copy of channels, (n, n_channels), with NaN for those that never vary."""
    return np.where(np.fmax.reduce(values) > np.fmin.reduce(values), values, np.nan)


def means_of(values: np.ndarray) -> np.ndarray:
    """Compute the mean of each channel, (n_channels,), zero without samples."""
    is_known = np.isfinite(values)
    return np.where(is_known, values, 0.0).sum(axis=0) / np.maximum(is_known.sum(axis=0), 1)


def without_means(values: np.ndarray) -> np.ndarray:
    """Subtract its mean from each channel, (n, n_channels), NaN where missing."""
    return values - means_of(values)


def deviations_of(values: np.ndarray) -> np.ndarray:
    """Compute the standard deviation of each channel, (n_channels,), zero without samples."""
    is_known = np.isfinite(values)
    squares = np.where(is_known, without_means(values), 0.0) ** 2
    return np.sqrt(squares.sum(axis=0) / np.maximum(is_known.sum(axis=0), 1))


def without_drift(time: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Subtract the offset and slow drift, a cubic polynomial in time, from samples.

    values: (n,), NaN where missing. The cubic is fitted with little weight at the ends, where
    incomplete periods would count as drift. The result is NaN if there are too few samples for it.
    """
    is_known = np.isfinite(values)
    if is_known.sum() <= DRIFT_DEGREE + 1:
        return np.full(len(values), np.nan)
    position = 2.0 * (time - time[0]) / (time[-1] - time[0]) - 1.0
    weight = np.cos(np.pi / 2.0 * position[is_known])
    drift = legfit(position[is_known], values[is_known], DRIFT_DEGREE, w=weight)
    return values - legval(position, drift)


def rate_without_offset(recording: Recording, state: int) -> np.ndarray:
    """Return the measured rates of a state, (n,), without their offset if that is unknown."""
    rates, offsets = sampled_rates(recording)[:, state], recording.unknown_offsets
    has_offset = offsets is not None and offsets[state]
    return without_drift(recording.time, rates) if has_offset else rates


def _integrate_channel(time: np.ndarray, values: np.ndarray, times: int) -> np.ndarray:
    """Integrate values over time, `times` times, without what is slower than the motion.

    The slowest frequency of the motion is that with a hundredth of the power, without noise, below
    it. Components below six tenths of it are removed by a steep filter: in displacements, white
    noise of accelerations grows as the square of the period. The gain of the filter is 0.998 at the
    slowest frequency, and 2e-4 at three tenths of it. The result is NaN where `values` (n,) are.
    """
    is_known = np.isfinite(values)
    sampled = time[is_known]
    grid = np.linspace(sampled[0], sampled[-1], len(sampled))
    signal = without_drift(grid, np.interp(grid, time[is_known], values[is_known]))
    omega = 2.0 * np.pi * np.fft.rfftfreq(len(grid), grid[1] - grid[0])[1:]
    power = np.abs(np.fft.rfft(signal * np.hanning(len(signal)))[1:]) ** 2
    power = np.cumsum(np.where(power > MIN_SIGNAL_RATIO * np.median(power), power, 0.0))
    slowest = omega[np.searchsorted(power, 0.01 * power[-1])]
    gain = 1.0 / (1.0 + (0.6 * slowest / omega) ** 12)
    spectrum = np.append(0.0, gain * np.fft.rfft(signal)[1:] / (1j * omega) ** times)
    integral = np.interp(time, grid, np.fft.irfft(spectrum, len(grid)))
    return np.where(is_known, integral, np.nan)
