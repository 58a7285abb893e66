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
    score, chosen = np.full(channels, np.inf), np.zeros(channels, dtype=int)
    smoothed, derivative = np.empty_like(values), np.empty_like(values)
    effective, splines = np.zeros(channels, dtype=int), {}
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
        smoothed[:, better], splines[every] = fit[:, better], BSpline(knots, coefficients, DEGREE)
        score[better], effective[better], chosen[better] = gcv[better], p, every
        if np.all(gcv > ENOUGH * score):
            break
    if not np.all(effective):
        raise ValueError(f"recording: {n} samples are too few to differentiate")
    for every in np.unique(chosen):
        channels = chosen == every
        derivative[:, channels] = splines[every].derivative()(time)[:, channels]
    return smoothed, derivative, effective


def _knots(time: np.ndarray, every: int) -> np.ndarray:
    """Clamped knots at every m-th sample, so that each span holds data."""
    inner = time[every:-every:every]
    return np.r_[[time[0]] * (DEGREE + 1), inner, [time[-1]] * (DEGREE + 1)]


@lru_cache(maxsize=len(KNOT_EVERY))  # replicates mostly share their times
def _basis(time: bytes, every: int) -> tuple[csr_array, np.ndarray]:
    """B-splines at the times, (n, p), and the banded Cholesky factor of their normal equations."""
    instants = np.frombuffer(time)
    # no sample is outside, and to look for one costs as much as the matrix
    design = BSpline.design_matrix(instants, _knots(instants, every), DEGREE, extrapolate=True)
    values, columns = (each.reshape(-1, DEGREE + 1) for each in (design.data, design.indices))
    bands = np.zeros((DEGREE + 1, design.shape[1]))
    for offset in range(DEGREE + 1):
        products = values[:, offset:] * values[:, : DEGREE + 1 - offset]
        sums = np.bincount(columns[:, offset:].ravel(), products.ravel(), design.shape[1])
        bands[DEGREE - offset] = sums
    return design, cholesky_banded(bands)
