"""Steady amplitude and frequency of motions, and their agreement.

This module is separate from `score`, so that jobs that measure a motion need not run again after a
change of a score.
"""

import numpy as np


def steady_amplitude(states: np.ndarray) -> np.ndarray:
    """Compute the amplitude of each state, half of its peak-to-peak range.

    states: (n, n_states). Returns (n_states,).
    """
    return np.ptp(states, axis=0) / 2


def steady_frequency(states: np.ndarray, step: float) -> np.ndarray:
    """Estimate the frequency of the highest spectral peak of each state, Hz.

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
    """Compute the coefficient of determination R2 of a model's motion, for each state.

    It is eq. 18 of the paper. Returns (n_states,). -inf if the model's motion ended early: no value
    is worse than a failure.
    """
    residual = np.sum((true - model) ** 2, axis=0)
    total = np.sum((true - true.mean(axis=0)) ** 2, axis=0)
    return np.where(np.isfinite(residual), 1 - residual / total, -np.inf)
