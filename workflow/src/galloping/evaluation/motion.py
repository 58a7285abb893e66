"""Motions: steady amplitude and frequency, how well one follows another, those of a cell."""

from collections.abc import Sequence

import numpy as np

from galloping.intervals import QUANTILES_90
from galloping.polynomial import PolynomialModel
from galloping.results import Reconstruction


def gallops(model: PolynomialModel) -> bool:
    """Whether the line at rest is unstable in its wind, so that its motion has an amplitude.

    Some eigenvalue of the linearised equations has a positive real part (Den Hartog 1932, with
    damping). Where none has, motion decays, and what is left of it depends on when one looks.
    """
    values, _ = model.small_motions(np.zeros(len(model.states)))
    return bool(values.real.max() > 0)


def steady_amplitude(states: np.ndarray) -> np.ndarray:
    """Half peak to peak of each state: (n, n_states) -> (n_states,)."""
    return np.ptp(states, axis=0) / 2


def steady_frequency(states: np.ndarray, step: float) -> np.ndarray:
    """Frequency of the highest spectral peak of each state, Hz.

    states: (n, n_states) sampled every `step` s. Hann window, peak by a parabola through the
    logarithms of its three highest lines.
    """
    n = len(states)
    window = np.hanning(n)[:, np.newaxis]
    spectrum = np.abs(np.fft.rfft((states - states.mean(axis=0)) * window, axis=0))
    with np.errstate(divide="ignore"):
        logs = np.log(spectrum)
    peak = np.clip(np.argmax(spectrum, axis=0), 1, len(spectrum) - 2)
    columns = np.arange(states.shape[1])
    left, top, right = (logs[peak + k, columns] for k in (-1, 0, 1))
    curvature = left - 2 * top + right
    shift = np.where(curvature < 0, 0.5 * (left - right) / np.minimum(curvature, -1e-300), 0.0)
    return (peak + shift) / (n * step)


def r_squared(true: np.ndarray, model: np.ndarray) -> np.ndarray:
    """Coefficient of determination of each state (paper, eq. 18): (n_states,).

    -inf where the model's motion ended early: no value is worse than a failure.
    """
    residual = np.sum((true - model) ** 2, axis=0)
    total = np.sum((true - true.mean(axis=0)) ** 2, axis=0)
    return np.where(np.isfinite(residual), 1 - residual / total, -np.inf)


PLOT_RATE = 20.0  # Hz, an order of magnitude above the fastest harmonic that matters


def summarise(
    time: np.ndarray, states: Sequence[np.ndarray], quality: np.ndarray
) -> Reconstruction:
    """The motions of all replicates.

    time: (n,) s. states: (n, n_states) of each replicate. quality: (n_replicates,), the higher
    the better.
    """
    stride = max(1, round(1 / (PLOT_RATE * (time[1] - time[0]))))
    middle = np.argsort(quality, kind="stable")[len(quality) // 2]
    thinned = np.stack([each[::stride] for each in states])
    low, high = np.quantile(thinned, QUANTILES_90, axis=0)
    return Reconstruction(time[::stride], thinned[middle], low, high)
