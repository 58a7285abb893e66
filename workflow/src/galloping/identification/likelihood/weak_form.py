"""The weak form of the equations, whitened by the covariance of the measurement noise.

Each equation, tested with bump functions phi, reads <phi', x_i> + <phi, f_i(x)> = 0. A known
equation, such as the identity between a displacement and its velocity, gives rows without free
coefficients; noise common to both kinds of rows makes them informative about the others.
"""

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.linalg import lapack

from galloping.identification.likelihood.problem import Problem
from galloping.identification.likelihood.smoothing import GRID_PER_PERIOD, Smooth
from galloping.polynomial import design_matrix

TEST_STRIDE = GRID_PER_PERIOD // 6  # of the grid between test functions, a third of their radius


def whitened_weak_form(
    problem: Problem, smooth: Smooth, coefficients: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray]:
    """Design and right-hand side of the weak form, with errors of unit variance.

    The test functions have a radius of half the shortest period and are TEST_STRIDE steps
    of the grid apart; those that reach into a gap give zero rows. coefficients: (n_states,
    n_terms), the linearisation of the errors; without them the rows are only scaled. Returns the
    design (n_rows, n_candidates) and the right-hand side (n_rows,).
    """
    phi, slope = _bump(smooth)
    n_states = len(problem.states)
    usable = np.all(sliding_window_view(smooth.valid, len(phi))[::TEST_STRIDE], axis=1)
    keep = [i for i in range(n_states) if smooth.derived[i] < 0 or i in problem.unknown]
    keep = [i for i in keep if not np.any(smooth.derived == i) or i in problem.unknown]
    moments = _tested(smooth.states, slope)
    tested = _tested(design_matrix(smooth.values, problem.terms), phi)
    # columns first, as LAPACK wants them: of a long recording a copy would be the largest array
    rows = np.zeros((len(problem.candidates) + 1, len(tested), len(keep)))
    for row, (equation, term) in zip(rows, problem.candidates, strict=False):
        row[:, keep.index(equation)] = tested[:, term]
    rows[-1] = -(moments + tested @ problem.known.T)[:, keep]
    rows[:, ~usable] = 0.0
    if coefficients is None:
        rows /= np.sqrt(np.mean(moments[:, keep] ** 2, axis=0)) + np.finfo(float).tiny
        white = rows.reshape(len(rows), -1).T.copy()
    else:
        bands = _covariance(problem, smooth, coefficients, usable, keep)
        factor, info = lapack.dpbtrf(bands, lower=1)
        if info:
            raise np.linalg.LinAlgError("the covariance of the weak form is not positive definite")
        flat = rows.reshape(len(rows), -1).T
        white, _ = lapack.dtbtrs(factor, flat, uplo="L", overwrite_b=1)
    return white[:, :-1], white[:, -1]


def _bump(smooth: Smooth) -> tuple[np.ndarray, np.ndarray]:
    """Test function and its derivative at the grid points inside the support, times their spacing.

    (1 - u^2)^5, of a radius of half a period, keeps 0.68 of a sine of that period and 0.18 of half.
    """
    spacing, radius = smooth.time[1] - smooth.time[0], GRID_PER_PERIOD // 2
    tau = np.arange(1 - radius, radius) / radius
    phi = (1.0 - tau**2) ** 5
    slope = -10.0 * tau * (1.0 - tau**2) ** 4
    return phi * spacing, slope / (radius * spacing) * spacing


def _tested(series: np.ndarray, phi: np.ndarray) -> np.ndarray:
    """(n_grid, m) -> (n_tests, m): integrals of the columns against every test function."""
    windows = sliding_window_view(series, len(phi), axis=0)[::TEST_STRIDE]
    return windows @ phi


def _covariance(
    problem: Problem, smooth: Smooth, coefficients: np.ndarray, usable: np.ndarray, keep: list[int]
) -> np.ndarray:
    """Covariance of the rows by test and by kept equation, as lower bands (width, n_rows).

    usable: (n_tests,); the rows of the other tests, all zero, get a variance of one.
    """
    n_tests, n_rows, width = len(usable), len(keep), len(_bump(smooth)[0])
    reach = (width - 1) // TEST_STRIDE
    bands = np.zeros((n_rows * (reach + 1), n_tests * n_rows))
    a, b = np.meshgrid(np.arange(n_rows), np.arange(n_rows), indexing="ij")
    batch = 4096  # whose errors are linearised at once: what they need is 3 kB each
    for begin in range(0, n_tests, batch):
        end = min(begin + batch, n_tests)
        last = min(end + reach, n_tests)
        points = slice(begin * TEST_STRIDE, (last - 1) * TEST_STRIDE + width)
        influence = _noise_influence(problem, smooth, points, coefficients)[:, keep]
        influence[~usable[begin:last]] = 0.0
        for lag in range(min(reach, n_tests - 1) + 1):
            shift, count = lag * TEST_STRIDE, min(end, n_tests - lag) - begin
            if count <= 0:
                break
            early = influence[:count, :, :, shift:].reshape(count, n_rows, -1)
            late = influence[lag : lag + count, :, :, : width - shift]
            block = late.reshape(count, n_rows, -1) @ early.transpose(0, 2, 1)
            below = lag * n_rows + a - b
            column = np.arange(begin, begin + count)[:, None, None] * n_rows + b
            use = np.broadcast_to(below >= 0, block.shape)
            bands[np.broadcast_to(below, block.shape)[use], column[use]] = block[use]
    bands[0] = bands[0] * (1.0 + 1e-9) + np.repeat(~usable, n_rows)
    return bands


def _noise_influence(
    problem: Problem, smooth: Smooth, points: slice, coefficients: np.ndarray
) -> np.ndarray:
    """(n_tests, n_states, n_states, n_points): derivative of each row by unit noise samples.

    points: those of the grid that the tests reach.
    """
    n_states, table, (phi, slope) = smooth.states.shape[1], problem.tables, _bump(smooth)
    signals = problem.signals(smooth.states[points], smooth.inputs[points])
    theta = design_matrix(signals, table.monomials)
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
