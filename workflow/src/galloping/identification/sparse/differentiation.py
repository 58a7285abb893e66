"""State derivatives from noisy states: least-squares splines, as smooth as the data ask for."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.interpolate import BSpline
from scipy.linalg import cho_solve_banded, cholesky_banded
from scipy.sparse import csr_array

DEGREE = 7  # its truncation error stays below rounding noise in 100 Hz records without noise
KNOT_EVERY = (128, 96, 64, 48, 32, 24, 16, 12, 8, 4, 2)  # samples between knots, smooth to rough
ENOUGH = 1.05  # the scan stops once every channel's score is this much above its best


def differentiate(
    time: np.ndarray, values: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Smoothed states, their derivatives, and the effective number of observations.

    time: (n,) s, increasing, regular or not; values: (n, n_channels). Least-squares splines of
    degree 7 with a knot at every m-th sample; m of each channel by generalised cross-validation
    (Craven and Wahba 1979). Returns two (n, n_channels) arrays and (n_channels,) counts of
    spline coefficients: that many independent values are left in a smoothed channel.
    """
    n, channels = values.shape
    score = np.full(channels, np.inf)
    smoothed, derivative = np.empty_like(values), np.empty_like(values)
    effective = np.zeros(channels, dtype=int)
    for every in KNOT_EVERY:
        knots = _knots(time, every)
        p = len(knots) - DEGREE - 1
        if p < DEGREE + 2 or p > 0.6 * n:
            continue
        design, bands = _basis(time.tobytes(), every)
        coefficients = cho_solve_banded((bands, False), design.T @ values)
        fit = design @ coefficients
        gcv = n * np.sum((values - fit) ** 2, axis=0) / (n - p) ** 2
        better = gcv < score
        if np.any(better):
            slope = BSpline(knots, coefficients[:, better], DEGREE).derivative()
            smoothed[:, better], derivative[:, better] = fit[:, better], slope(time)
            score[better], effective[better] = gcv[better], p
        if np.all(gcv > ENOUGH * score):
            break
    if not np.all(effective):
        raise ValueError(f"recording: {n} samples are too few to differentiate")
    return smoothed, derivative, effective


def _knots(time: np.ndarray, every: int) -> np.ndarray:
    """Clamped knots at every m-th sample, so that each span holds data."""
    inner = time[every:-every:every]
    return np.r_[[time[0]] * (DEGREE + 1), inner, [time[-1]] * (DEGREE + 1)]


@lru_cache(maxsize=len(KNOT_EVERY))  # replicates mostly share their times
def _basis(time: bytes, every: int) -> tuple[csr_array, np.ndarray]:
    """B-splines at the times, (n, p), and the banded Cholesky factor of their normal equations."""
    instants = np.frombuffer(time)
    design = BSpline.design_matrix(instants, _knots(instants, every), DEGREE)
    gram = (design.T @ design).todia()
    bands = np.zeros((DEGREE + 1, gram.shape[0]))
    for offset, diagonal in zip(gram.offsets, gram.data, strict=True):
        if 0 <= offset <= DEGREE:
            bands[DEGREE - offset] = diagonal
    return design, cholesky_banded(bands)
