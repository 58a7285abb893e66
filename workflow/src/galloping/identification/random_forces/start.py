"""Where a fit in random forces begins: modes from correlations, then forces and noise.

The correlations of stationary motion decay as free motion does. Stochastic subspace identification
finds its modes (P. Van Overschee and B. De Moor, 1996; B. Peeters and G. De Roeck, MSSP 13, 1999);
as shapes of the displacements they are the stiffness and damping of the named equations.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.linalg import solve_continuous_lyapunov
from scipy.optimize import nnls

from galloping.identification.model import Unusable
from galloping.identification.random_forces.channels import Channels

SPANS = (3.0, 8.0, 20.0)  # shortest periods, of the correlations that modes are told from
PER_PERIOD, MOST_LAGS = 8, 120  # lags a shortest period, and in all: more say nothing more
LEAST_DAMPING = 1e-3  # ratio: a motion that lasts is stable
FLOOR = 0.75  # of the frequencies to Nyquist, above which a spectrum is mostly noise
FEWEST = 3  # lags that modes are told from, beyond twice their number


def on_grid(time: np.ndarray, samples: np.ndarray) -> tuple[float, np.ndarray]:
    """The median step, s, and the samples (n, n_channels) of the steps nearest to them, NaN where
    there is none.
    """
    step = float(np.median(np.diff(time)))
    place = np.round((time - time[0]) / step).astype(np.int64)
    grid = np.full((place[-1] + 1, samples.shape[1]), np.nan)
    grid[place] = samples
    return step, grid


def correlations(grids: list[np.ndarray], lags: int) -> np.ndarray:
    """(lags + 1, n_channels, n_channels) mean of y(t + lag) y(t)' of the samples that there are."""
    total, count = 0.0, 0.0
    for grid in grids:
        known = np.isfinite(grid)
        size = 2 ** int(np.ceil(np.log2(len(grid) + lags + 1)))
        value = np.fft.rfft(np.where(known, grid, 0.0), size, axis=0)
        there = np.fft.rfft(known.astype(float), size, axis=0)
        for of, adds in ((value, "value"), (there, "count")):
            product = np.fft.irfft(of[:, :, None] * of[:, None].conj(), size, axis=0)[: lags + 1]
            if adds == "value":
                total = total + product
            else:
                count = count + product
    return total / np.maximum(count, 1.0)


def modes(
    correlation: np.ndarray, step: float, stride: int, count: int
) -> tuple[np.ndarray, np.ndarray]:
    """Eigenvalues (count,), 1/s, and shapes (n_channels, count) of that many oscillations.

    correlation: (n_lags, n_channels, n_channels), the first at lag zero. Raises Unusable where it
    holds fewer.
    """
    taken = correlation[stride::stride]
    channels, rows = taken.shape[1], (len(taken) + 1) // 2
    if rows * channels < 2 * count + FEWEST:
        raise Unusable("too short to tell its modes")
    place = np.arange(rows)
    hankel = taken[place[:, None] + place].transpose(0, 2, 1, 3)
    left, size, _ = np.linalg.svd(hankel.reshape(rows * channels, rows * channels))
    observed = left[:, : 2 * count] * np.sqrt(size[: 2 * count])
    moved = np.linalg.lstsq(observed[:-channels], observed[channels:], rcond=None)[0]
    values, vectors = np.linalg.eig(moved)
    rates = np.log(values.astype(complex)) / (stride * step)
    own = np.flatnonzero(rates.imag > 0)
    if len(own) < count:
        raise Unusable("not every coordinate oscillates")
    own = own[np.argsort(rates.imag[own])]
    return rates[own], observed[:channels] @ vectors[:, own]


def systems(channels: Channels, grids: list[np.ndarray], step: float, period: float) -> Iterator:
    """Linear systems (n_states, n_states) that may have moved so, by SPANS.

    grids: samples on uniform steps, s, without their means. period: s, the shortest of the motion.
    """
    pairs = channels.pairs
    stride = max(int(period / PER_PERIOD / step), 1)
    for span in SPANS:
        lags = min(int(span * period / step / stride), MOST_LAGS) * stride
        lags = min(lags, max(len(grid) for grid in grids) // 3)
        try:
            rates, seen = modes(correlations(grids, lags), step, stride, len(pairs))
        except (Unusable, np.linalg.LinAlgError):
            continue
        damping = np.maximum(-rates.real, LEAST_DAMPING * np.abs(rates))
        rates = 1j * rates.imag - damping
        shapes = np.array([channels.displacement(i, rates, seen) for i in pairs])
        both, shapes = np.append(rates, rates.conj()), np.hstack([shapes, shapes.conj()])
        basis = np.vstack([shapes, shapes * both])
        if np.linalg.cond(basis / np.linalg.norm(basis, axis=0)) > 1e8:
            continue
        system = np.zeros((2 * len(pairs), 2 * len(pairs)))
        order = [*pairs, *pairs.values()]
        system[np.ix_(order, order)] = (basis * both @ np.linalg.inv(basis)).real
        system[list(pairs)] = 0.0
        system[list(pairs), list(pairs.values())] = 1.0
        yield system


def noise_of(grids: list[np.ndarray]) -> np.ndarray:
    """(n_channels,) variance of white noise, from the highest frequencies of the samples."""
    floors = []
    for grid in grids:
        filled = np.where(np.isfinite(grid), grid, 0.0)
        share = np.maximum(np.isfinite(grid).mean(axis=0), 1e-3)
        power = np.abs(np.fft.rfft(filled, axis=0)) ** 2 / len(grid) / share
        floors.append(np.median(power[int(FLOOR * len(power)) :], axis=0) / np.log(2.0))
    return np.mean(floors, axis=0)


def strengths(
    system: np.ndarray, forced: list[int], sensing: np.ndarray, power: np.ndarray
) -> np.ndarray:
    """(n_forced,) of forces on the equations `forced`: their motion has the variances `power`."""
    unit = np.eye(len(system))
    columns = []
    for i in forced:
        covariance = solve_continuous_lyapunov(system, -np.outer(unit[i], unit[i]))
        columns.append(np.einsum("ci,ij,cj->c", sensing, covariance, sensing) / power)
    found, _ = nnls(np.array(columns).T, np.ones(len(power)))
    return np.maximum(found, 0.05 / np.sum(columns, axis=1))
