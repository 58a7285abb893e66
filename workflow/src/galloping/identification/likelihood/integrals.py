"""Displacements that no channel measures, but velocities or accelerations do.

Integrated over time without what is slow, which cannot be told from the drift of integration. Only
the smooth curves that a fit starts from are made of them: its likelihood is of the channels
themselves.
"""

from dataclasses import replace

import numpy as np
from numpy.polynomial.legendre import legfit, legval

from galloping.identification.likelihood.smoothing import ABOVE_NOISE, LEAST_SAMPLES
from galloping.polynomial import velocity_pairs
from galloping.recording import Recording

DRIFT_DEGREE = 3  # bias and slow drift of a channel of rates: a cubic over the recording


def sampled_rates(recording: Recording) -> np.ndarray:
    """(n, n_states) of a recording, NaN where it has none."""
    return np.full(recording.values.shape, np.nan) if recording.rates is None else recording.rates


def undisplaced(recording: Recording) -> dict[int, int]:
    """Index of each state X that has no values, with that of its velocity dX, a state too."""
    measured = np.isfinite(recording.values).any(axis=0)
    return {x: v for x, v in velocity_pairs(recording.states).items() if not measured[x]}


def with_integrals(recording: Recording) -> Recording:
    """The recording with values of each state X that has none: the integral of the values of dX,
    else of the rate of X, else that of dX twice. Itself where nothing is to be integrated.
    """
    missing = undisplaced(recording)
    if not missing:
        return recording
    values, rates = recording.values.copy(), sampled_rates(recording)
    for x, v in missing.items():
        sources = ((values[:, v], 1), (rates[:, x], 1), (rates[:, v], 2))
        told = [(one, times) for one, times in sources if np.isfinite(one).sum() >= LEAST_SAMPLES]
        if told:
            values[:, x] = _integral(recording.time, *told[0])
    return replace(recording, values=values)


def without_drift(time: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Samples (n,), NaN where missing, less their offset and slow drift.

    Told with little weight at the ends, where periods that are cut short would count as drift.
    """
    known = np.isfinite(values)
    place = 2.0 * (time - time[0]) / (time[-1] - time[0]) - 1.0
    weight = np.cos(np.pi / 2.0 * place[known])
    return values - legval(place, legfit(place[known], values[known], DRIFT_DEGREE, w=weight))


def _integral(time: np.ndarray, values: np.ndarray, times: int) -> np.ndarray:
    """The integral over time, `times` times, without what is slower than the motion.

    Of the motion's power, as far as it stands out of the noise, a hundredth is slower. Below six
    tenths of that frequency all is taken out, steeply: white noise of accelerations grows as the
    square of the period in displacements. NaN where `values` (n,) are.
    """
    known = np.isfinite(values)
    grid = np.linspace(time[0], time[-1], int(known.sum()))
    signal = without_drift(grid, np.interp(grid, time[known], values[known]))
    omega = 2.0 * np.pi * np.fft.rfftfreq(len(grid), grid[1] - grid[0])[1:]
    power = np.abs(np.fft.rfft(signal * np.hanning(len(signal)))[1:]) ** 2
    power = np.cumsum(np.where(power > ABOVE_NOISE * np.median(power), power, 0.0))
    slowest = omega[np.searchsorted(power, 0.01 * power[-1])]
    passed = 1.0 / (1.0 + (0.6 * slowest / omega) ** 12)
    spectrum = np.append(0.0, passed * np.fft.rfft(signal)[1:] / (1j * omega) ** times)
    integral = np.interp(time, grid, np.fft.irfft(spectrum, len(grid)))
    return np.where(known, integral, np.nan)
