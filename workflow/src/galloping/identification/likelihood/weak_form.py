"""The weak form of the equations, whitened by the covariance of the measurement noise.

Each equation, tested with bump functions phi, reads <phi', x_i> + <phi, f_i(x)> = 0. A known
equation, such as the identity between a displacement and its velocity, gives rows without free
coefficients; noise common to both kinds of rows makes them informative about the others.
"""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.linalg import lapack

from galloping.identification.likelihood.constants import (
    TEST_RADIUS,
    TEST_SHARPNESS,
    TEST_STRIDE,
)
from galloping.identification.likelihood.problem import Problem
from galloping.identification.likelihood.smoothing import Smooth
from galloping.identification.likelihood.taylor import Tables
from galloping.polynomial import design_matrix


def whitened_weak_form(
    problem: Problem, smooth: Smooth, coefficients: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray]:
    """Design and right-hand side of the weak form, with errors of unit variance.

    The test functions have a radius of half the shortest period (TEST_RADIUS grid steps) and are
    TEST_STRIDE steps apart; those that reach into a gap give zero rows. coefficients: (n_states,
    n_terms), the linearisation of the errors; without them the rows are only scaled. Returns the
    design (n_rows, n_candidates) and the right-hand side (n_rows,).
    """
    phi, slope = _bump(smooth.time[1] - smooth.time[0])
    n_states = len(problem.states)
    theta = design_matrix(smooth.states, problem.terms)
    tested = _tested(theta, phi)
    moments = _tested(smooth.states, slope)
    n_tests = len(tested)
    right = -(moments + tested @ problem.known.T)
    design = np.zeros((n_tests, n_states, len(problem.candidates)))
    n_terms = len(problem.terms)
    for block, equation in enumerate(problem.unknown):
        design[:, equation, block * n_terms : (block + 1) * n_terms] = tested
    usable = np.all(sliding_window_view(smooth.valid, len(phi))[::TEST_STRIDE], axis=1)
    design[~usable], right[~usable] = 0.0, 0.0
    keep = [i for i in range(n_states) if smooth.derived[i] < 0 or i in problem.unknown]
    keep = [i for i in keep if not np.any(smooth.derived == i) or i in problem.unknown]
    design, right = design[:, keep], right[:, keep]
    if coefficients is None:
        scale = np.sqrt(np.mean(moments[:, keep] ** 2, axis=0)) + np.finfo(float).tiny
        design, right = design / scale[:, None], right / scale
        return design.reshape(-1, design.shape[2]), right.ravel()
    influence = _noise_influence(problem.tables, smooth, coefficients, phi, slope)[:, keep]
    influence[~usable] = 0.0
    stacked = np.concatenate([design, right[:, :, None]], axis=2)
    white = _whiten(influence, usable, stacked.reshape(-1, stacked.shape[2]))
    return white[:, :-1], white[:, -1]


def _bump(spacing: float) -> tuple[np.ndarray, np.ndarray]:
    """Test function and its derivative at the grid points inside the support, times `spacing`."""
    tau = np.arange(-TEST_RADIUS + 1, TEST_RADIUS) / TEST_RADIUS
    phi = (1.0 - tau**2) ** TEST_SHARPNESS
    slope = (
        -2.0
        * TEST_SHARPNESS
        * tau
        * (1.0 - tau**2) ** (TEST_SHARPNESS - 1)
        / (TEST_RADIUS * spacing)
    )
    return phi * spacing, slope * spacing


def _tested(series: np.ndarray, phi: np.ndarray) -> np.ndarray:
    """(n_grid, m) -> (n_tests, m): integrals of the columns against every test function."""
    windows = sliding_window_view(series, len(phi), axis=0)[::TEST_STRIDE]
    return windows @ phi


def _noise_influence(
    table: Tables, smooth: Smooth, coefficients: np.ndarray, phi: np.ndarray, slope: np.ndarray
) -> np.ndarray:
    """(n_tests, n_states, n_points * n_states): derivative of each row by unit noise samples."""
    n_states = smooth.states.shape[1]
    theta = design_matrix(smooth.states, table.monomials)
    jacobian = np.empty((len(theta), n_states, n_states))
    for state in range(n_states):
        lowered = np.zeros((n_states, len(table.monomials)))
        for column, m in enumerate(table.position):
            if table.divisor[m, state] >= 0:
                weight = table.exponents[m, state] * coefficients[:, column]
                lowered[:, table.divisor[m, state]] += weight
        jacobian[:, :, state] = theta @ lowered.T
    windows = sliding_window_view(jacobian, len(phi), axis=0)[::TEST_STRIDE]
    influence = windows * phi
    diagonal = np.arange(n_states)
    influence[:, diagonal, diagonal] += slope
    spacing = smooth.time[1] - smooth.time[0]
    for state, source in enumerate(smooth.derived):
        if source >= 0:
            padded = np.pad(influence[:, :, state], ((0, 0), (0, 0), (1, 1)))
            influence[:, :, source] -= (padded[..., 2:] - padded[..., :-2]) / (2.0 * spacing)
            influence[:, :, state] = 0.0
    sigma = np.where(smooth.derived >= 0, 0.0, smooth.sigma)
    return influence * sigma[:, None]


def _whiten(influence: np.ndarray, usable: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Multiply `rows` by the inverse Cholesky factor of the rows' (banded) covariance.

    usable: (n_tests,); the rows of the other tests, all zero, get a variance of one.
    """
    n_tests, n_rows, _, n_points = influence.shape
    reach = (n_points - 1) // TEST_STRIDE
    width = n_rows * (reach + 1)
    bands = np.zeros((width, n_tests * n_rows))
    a, b = np.meshgrid(np.arange(n_rows), np.arange(n_rows), indexing="ij")
    for lag in range(min(reach, n_tests - 1) + 1):
        shift = lag * TEST_STRIDE
        early = influence[: n_tests - lag, :, :, shift:].reshape(n_tests - lag, n_rows, -1)
        late = influence[lag:, :, :, : n_points - shift].reshape(n_tests - lag, n_rows, -1)
        block = late @ early.transpose(0, 2, 1)
        below = lag * n_rows + a - b
        column = np.arange(n_tests - lag)[:, None, None] * n_rows + b
        use = np.broadcast_to(below >= 0, block.shape)
        bands[np.broadcast_to(below, block.shape)[use], column[use]] = block[use]
    bands[0] = bands[0] * (1.0 + 1e-9) + np.repeat(~usable, n_rows)
    factor, info = lapack.dpbtrf(bands, lower=1)
    if info:
        raise np.linalg.LinAlgError("the covariance of the weak form is not positive definite")
    white, info = lapack.dtbtrs(factor, rows, uplo="L")
    return white
