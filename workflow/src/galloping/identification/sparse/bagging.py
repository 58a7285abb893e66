"""STLSQ on bootstrap samples of rows, all of them at once, as pysindy's EnsembleOptimizer does."""

from __future__ import annotations

import numpy as np

MOST_PASSES = 20  # as in pysindy


def bagged_medians(
    library: np.ndarray, targets: np.ndarray, models: int, rng: np.random.Generator
) -> np.ndarray:
    """(n_targets, n_terms) medians over models whose terms stay while |coefficient| >= 1.

    library: (rows, n_terms); targets: (rows, n_targets), in units of their threshold. The rows are
    those that pysindy draws with NumPy's global generator seeded by `rng`.
    """
    draws = np.random.RandomState(rng.integers(2**32))
    samples = [draws.choice(len(library), len(library)) for _ in range(models)]
    gram = np.stack([library[rows].T @ library[rows] for rows in samples])[:, np.newaxis]
    moment = np.stack([targets[rows].T @ library[rows] for rows in samples])
    support = np.ones(moment.shape, bool)
    diagonal = np.arange(library.shape[1])
    for _ in range(MOST_PASSES):
        masks = support.astype(float)
        systems = gram * masks[..., :, np.newaxis] * masks[..., np.newaxis, :]
        systems[..., diagonal, diagonal] += 1 - masks
        solved = _solved(systems, moment * masks)
        kept = support & (np.abs(solved) >= 1)
        if np.array_equal(kept, support):
            break
        support = kept
    return np.median(np.where(kept, solved, 0.0), axis=0)


def _solved(systems: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Solutions of (..., p, p) symmetric systems; the shortest where one is singular."""
    try:
        return np.linalg.solve(systems, right[..., np.newaxis])[..., 0]
    except np.linalg.LinAlgError:
        return (np.linalg.pinv(systems, hermitian=True) @ right[..., np.newaxis])[..., 0]
