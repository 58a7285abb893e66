"""Search for the number of damped sinusoids in a motion, and their poles.

Modes are added one by one, where an exponentially windowed periodogram of the residual, a filter
matched to a damped sinusoid, exceeds the noise.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from scipy.special import gammainccinv

from galloping.identification.free_motion.damped_modes import (
    ROUNDING_ERROR,
    DampedModes,
    Stretch,
    fit_poles,
)
from galloping.identification.no_model import IdentificationError
from galloping.identification.oscillations import MAX_DAMPING_RATIO
from galloping.identification.preparation.smoothing import MIN_CHANNEL_SAMPLES, without_means
from galloping.identification.work import count_work
from galloping.model.intervals import FALSE_ALARM_RATE

MAX_MODES = 8  # most sinusoids of a motion
# Most sinusoids close to the first one, including it. More of them are not modes, but parts of a
# motion that is not exponential.
MAX_CLOSE_MODES = 2
CLOSE_DISTANCE = 0.3  # largest distance of close frequencies, relative to the first one
# Largest share of a channel's power that MANY_MODES sinusoids, or more than MAX_CLOSE_MODES close
# ones, do not explain in a free motion.
MAX_UNEXPLAINED_SHARE = 0.2
MANY_MODES = 4  # number of sinusoids from which the unexplained power is limited
# Largest distance of a harmonic from a multiple of the first frequency, relative to this multiple.
HARMONIC_DISTANCE = 0.003
HARMONIC_SPREAD = 1.5  # addition to this distance, in relative spreads of the close frequencies
# Ratio of decay rates of successive windows. A mode between two keeps 97 % of its power.
WINDOW_RATIO = 2
MAX_DECAYS = 16  # longest window, in decays by a factor e: only rounding is left at its end
MIN_PERIODS = 2.0  # least periods of a mode in a stretch: slower motion is a drift
MIN_PART_SAMPLES = 24  # least number of samples in a part of a stretch
MAX_FREQUENCY = 0.98  # highest frequency of a mode, relative to half the sampling rate
NOISE_BINS = 129  # number of bins whose median is the noise level of a periodogram
DRIFT_BINS = 17  # number of these bins at low frequencies, where drifts are steep
# Least ratio of coloured noise to white noise, or white to coloured. White noise reaches it once
# in 1,000 cases.
COLOUR_RATIO = 1.6


def strongest_mode(
    stretches: Sequence[Stretch],
    residuals: Sequence[np.ndarray],
    poles: np.ndarray | None,
    excluded: np.ndarray | None = None,
    band: tuple[float, float] = (0.0, np.inf),
) -> complex | None:
    """Find the strongest damped sinusoid in the residuals of a fit.

    residuals: (n, n_channels) for each stretch, NaN where missing. poles: (n,) complex, of
    subtracted modes, the strongest first. With these, the noise spectrum is estimated from the
    residuals away from the modes; with None the noise counts as white. excluded: (n,) complex
    poles of a motion that is not exponential, of which the mode must not be a part. band: limits of
    the frequency, rad/s. Returns a first guess of the pole; None if no power of the matched filter,
    summed over channels and stretches, exceeds a threshold that noise exceeds at FALSE_ALARM_RATE.
    """
    step = min(one.step for one in stretches)
    longest = max(one.duration for one in stretches)
    size = 2 ** int(np.ceil(np.log2(2.0 * longest / step + 2.0)))
    omega = 2.0 * np.pi * np.fft.rfftfreq(size, step)
    most = np.log2(max(MAX_DAMPING_RATIO * omega[-1] * longest, 2.0))
    faster = WINDOW_RATIO ** np.arange(int(np.ceil(most)))  # decay rates, in units of the slowest
    parts = np.maximum(faster // MAX_DECAYS, 1)
    strides = np.concatenate([[1], parts, parts])  # steps in `omega` between bins of each window
    series, spans = [], []
    for stretch, residual in zip(stretches, residuals, strict=True):
        positions = np.round(stretch.time / step).astype(int)
        for column, motion in zip(residual.T, stretch.sizes, strict=True):
            is_known = np.isfinite(column)
            if np.count_nonzero(is_known) < MIN_CHANNEL_SAMPLES:
                continue
            if np.mean(column[is_known] ** 2) <= (ROUNDING_ERROR * motion) ** 2:
                continue
            time = stretch.time[is_known] / longest
            powers = _windowed_powers(time, column[is_known], positions[is_known], size, parts)
            series.append(powers)
            spans.append((stretch.duration, positions[-1] + 1))
            # above half the rate of its own samples a channel has mirror images
            channel_step = np.median(np.diff(stretch.time[is_known]))
            mirrored = omega * channel_step > np.pi * MAX_FREQUENCY
            for image, stride in zip(powers, strides, strict=True):
                image[mirrored[::stride]] = 0.0
    if not series:
        return None
    windows = np.concatenate([[0.0], faster, -faster]) / longest
    looks = len(windows) * longest / step / 2.0
    threshold = float(gammainccinv(len(series), FALSE_ALARM_RATE / looks))
    slowest, fastest = 2.0 * np.pi * MIN_PERIODS / longest, MAX_FREQUENCY * omega[-1]
    is_searched = (omega > max(slowest, band[0])) & (omega < min(fastest, band[1]))
    if excluded is not None:
        is_searched &= ~is_part_of(1j * omega, excluded)
    powers = [np.sum(spectra, axis=0) for spectra in zip(*series, strict=True)]
    for power, decay, stride in zip(powers, windows, strides, strict=True):
        power *= is_searched[::stride] & (abs(decay) < MAX_DAMPING_RATIO * omega[::stride])
    peaks = np.array([power.max() for power in powers])
    omitted = _near_modes(omega, poles, 2.0 * np.pi / longest)
    levels = np.ones((len(series), len(omega)))  # noise levels, at least those of white noise
    best, strongest = None, threshold
    for k, (decay, stride) in enumerate(zip(windows, strides, strict=True)):
        if peaks[k:].max() <= strongest:
            break
        if poles is not None:  # includes noise that short windows leak to far frequencies
            for level, spectra, (duration, places) in zip(levels, series, spans, strict=True):
                oversampled = (1.0 + abs(decay) * duration / np.pi) * size / stride / places
                local = noise_level(spectra[k], oversampled, omitted[::stride], k == 0)
                everywhere = np.interp(omega, omega[::stride], local)
                np.maximum(level, everywhere, out=level)
                count_work(3e-8 * len(omega))
        # leakage of a strong mode exceeds the noise at other frequencies, but not the mode itself
        bins = np.flatnonzero(powers[k] > strongest)
        excess = sum(
            spectra[k][bins] / level[stride * bins]
            for spectra, level in zip(series, levels, strict=True)
        )
        bins = bins[excess > threshold]
        if len(bins):
            highest = bins[np.argmax(powers[k][bins])]
            best, strongest = complex(-decay, omega[stride * highest]), powers[k][highest]
    return best


def _windowed_powers(
    time: np.ndarray, values: np.ndarray, positions: np.ndarray, size: int, parts: np.ndarray
) -> list[np.ndarray]:
    """Compute periodograms of a series in a flat window, and in windows that decay and that grow.

    Each decays or grows twice as fast as the one before. White noise has unit power. time, values:
    (n,); the unit of time is that in which the first window decays by a factor e. positions: (n,)
    integers, of the samples on a uniform grid. size: of the transform in the flat window. parts:
    (n_decays,) integer divisors of this size and of the unit of time, for shorter windows of each
    decay.
    """
    variance = np.mean(values**2)

    def power(weight: np.ndarray, part: int) -> np.ndarray:
        count_work(1.3e-8 * size / part)
        rows = len(weight)
        spectrum = np.fft.rfft(np.bincount(positions[:rows], weight * values[:rows], size // part))
        return (spectrum.real**2 + spectrum.imag**2) / (weight @ weight * variance)

    positions = positions - positions[0]
    powers = [power(np.ones(len(time)), 1)]
    for lag in (time - time[0], (time[-1] - time)[::-1]):
        weight = np.exp(-lag)
        for part in parts:
            weight = weight[: np.searchsorted(lag, 1.0 / part, side="right")]
            powers.append(power(weight, part))
            weight = weight**WINDOW_RATIO
        values, positions = values[::-1], (positions[-1] - positions)[::-1]
    return powers


def _near_modes(omega: np.ndarray, poles: np.ndarray | None, resolution: float) -> np.ndarray:
    """Find frequencies, (n,), rad/s, near modes, where residuals of these remain."""
    is_near = np.zeros(len(omega), bool)
    for k, pole in enumerate(() if poles is None else poles):
        least = CLOSE_DISTANCE * pole.imag if k == 0 else 0.0
        width = max(5.0 * abs(pole.real), 3.0 * resolution, least)
        is_near |= np.abs(omega - pole.imag) < width
    return is_near


def noise_level(
    power: np.ndarray, oversampled: float, omitted: np.ndarray, has_drifts: bool = True
) -> np.ndarray:
    """Estimate the noise power at each frequency of a periodogram from medians nearby.

    power: (n,). oversampled: bins of the periodogram per bin of its resolution. omitted: (n,)
    boolean, bins over which the level is interpolated. has_drifts: whether the level of slow bins
    is resolved more finely. Returns (n,), at least the level from the median over all frequencies.
    """
    first = int(oversampled) + 1  # slower bins are taken up by a constant
    indices = np.flatnonzero(~omitted)
    indices = indices[indices >= first]
    if not len(indices):
        return np.full(len(power), np.median(power) / np.log(2.0))
    selected_power = power[indices]
    white = np.median(selected_power) / np.log(2.0)
    places, levels, begin = [], [], 0
    slow = [(DRIFT_BINS, NOISE_BINS * oversampled)] if has_drifts else []
    for bins, until in (*slow, (NOISE_BINS, len(power))):
        width = max(int(bins * oversampled), 1)
        count = (int(np.searchsorted(indices, until)) - begin) // width
        if count > 0:
            rows = slice(begin, begin + count * width)
            places += indices[rows].reshape(count, width).mean(axis=1).tolist()
            levels += np.median(selected_power[rows].reshape(count, width), axis=1).tolist()
            begin = rows.stop
    if not levels:
        return np.full(len(power), white)
    level = np.interp(np.arange(len(power)), places, levels) / np.log(2.0)
    return np.maximum(level, white)


def fit_modes(
    stretches: Sequence[Stretch], may_continue: Callable[[DampedModes], bool] = lambda _: True
) -> tuple[DampedModes | None, bool]:
    """Fit damped sinusoids to free motion, adding the strongest until only noise remains.

    may_continue: whether to search for modes elsewhere if more than MAX_CLOSE_MODES are close to
    the first one. Returns the modes, None if nothing oscillates or the motion is clearly not free;
    and whether the residuals are noise.
    """
    modes: DampedModes | None = None
    residuals, excluded = [without_means(one.values) for one in stretches], None
    for count in range(MAX_MODES + 1):
        poles = modes.poles if modes else None
        best = strongest_mode(stretches, residuals, poles, excluded)
        if best is None:
            final = _with_local_noise(stretches, modes) if modes else None
            return final, excluded is None
        if count == MAX_MODES:
            break
        try:
            modes = fit_poles(stretches, np.append([] if poles is None else poles, best))
        except (IdentificationError, np.linalg.LinAlgError):
            break
        residuals = modes.residuals
        is_spread = np.count_nonzero(is_close(modes.poles, modes.poles[0])) > MAX_CLOSE_MODES
        is_doubtful = is_spread or count + 1 >= MANY_MODES
        if is_doubtful and unexplained_power_share(stretches, modes) > MAX_UNEXPLAINED_SHARE:
            return None, False
        if is_spread:
            excluded = modes.poles
            if not may_continue(modes):
                break
    return modes, False


def unexplained_power_share(stretches: Sequence[Stretch], modes: DampedModes) -> float:
    """Compute the largest share of the power of any channel that fitted modes do not explain."""
    shares = [0.0]
    for stretch, noise in zip(stretches, modes.noise, strict=True):
        varies = stretch.sizes > 0.0
        shares += (noise[varies] / stretch.sizes[varies]).tolist()
    return float(np.nanmax(shares)) ** 2


def is_close(poles: np.ndarray, pole: complex) -> np.ndarray:
    """Decide which poles have nearly the same frequency as a given pole.

    poles: (n,). Returns (n,) boolean.
    """
    return np.abs(poles.imag / pole.imag - 1.0) < CLOSE_DISTANCE


def is_part_of(poles: np.ndarray, motion: np.ndarray) -> np.ndarray:
    """Decide which modes may be components or harmonics of a motion that is not exponential.

    poles: (n,) complex. motion: (n_parts,) complex poles that approximate the motion, the strongest
    first. Returns (n,) boolean, whether a frequency is near that of the motion or a multiple of it.
    """
    main = motion[0]
    spread = np.abs(motion[is_close(motion, main)].imag / main.imag - 1.0).max()
    ratio = poles.imag / main.imag
    times = np.maximum(np.round(ratio), 1.0)
    within = np.where(times > 1.0, HARMONIC_DISTANCE + HARMONIC_SPREAD * spread, CLOSE_DISTANCE)
    return np.abs(ratio / times - 1.0) < within


def _with_local_noise(stretches: Sequence[Stretch], modes: DampedModes) -> DampedModes:
    """Recompute errors from the noise near the frequency of each mode, if it is coloured."""
    ratios, weights = np.zeros((2, len(modes.poles)))
    for r, (stretch, residual) in enumerate(zip(stretches, modes.residuals, strict=True)):
        size = 2 ** int(np.ceil(np.log2(2.0 * stretch.duration / stretch.step + 2.0)))
        positions = np.round(stretch.time / stretch.step).astype(int)
        for c in np.flatnonzero(np.isfinite(modes.noise[r])):
            column = np.nan_to_num(residual[:, c])
            mean = np.sum(column**2)
            if mean <= 0.0:
                continue
            power = np.abs(np.fft.rfft(np.bincount(positions, column, size), size)) ** 2
            omega = 2.0 * np.pi * np.fft.rfftfreq(size, stretch.step)
            omitted = _near_modes(omega, modes.poles, 2.0 * np.pi / stretch.duration)
            level = noise_level(power, size / (positions[-1] + 1), omitted) / mean
            turns = modes.poles.imag * stretch.step / (2.0 * np.pi)  # in a step
            bins = size * np.abs(turns - np.round(turns))  # other stretches may have shorter steps
            weight = np.abs(modes.amplitudes[r][:, c] / modes.noise[r, c]) ** 2
            ratios += weight * level[bins.astype(int)]
            weights += weight
    ratios = ratios / np.maximum(weights, np.finfo(float).tiny)
    ratios = np.where((ratios > COLOUR_RATIO) | (ratios < 1.0 / COLOUR_RATIO), ratios, 1.0)
    scale = np.tile(np.sqrt(ratios), 2)
    return replace(modes, covariance=modes.covariance * np.outer(scale, scale))
