"""Ensemble SINDy (Fasel et al. 2022): the median of STLSQ models of bootstrapped rows, all of them
fitted at once, as pysindy's EnsembleOptimizer does."""

import numpy as np
from scipy.fft import dct

from galloping.identification.model import IdentifiedModel
from galloping.identification.sparse.evidence import Regressions
from galloping.identification.sparse.stlsq import choose
from galloping.identification.sparse.supports import NEGLIGIBLE, compact, refit


def ensemble(
    evidence: Regressions,
    *,
    threshold: float | None,
    path_length: int,
    models: int,
    rng: np.random.Generator,
) -> IdentifiedModel:
    """Bagging on the rows of the reduced regression, a term stays if most models have it.

    threshold: share, or None to take what STLSQ chooses for each equation. The rows of a
    block's factor are exchangeable once an orthogonal transform has mixed them.
    """
    problem = evidence.tuned
    compact(problem)  # refuses what cannot be scaled
    scale = np.linalg.norm(problem.targets, axis=0)
    lengths = np.linalg.norm(problem.library, axis=0)
    library, targets = problem.library / lengths, problem.targets / scale
    thresholds, _ = choose(problem, threshold, path_length)
    size = library.shape[1] + targets.shape[1]  # rows of a block
    # targets in units of their threshold, as in stlsq.fit
    scaled = _mixed(targets, size) / thresholds
    medians = bagged_medians(_mixed(library, size), scaled, models, rng)
    medians = medians * thresholds[:, np.newaxis]
    support = (np.abs(medians) >= NEGLIGIBLE)[:, np.newaxis]
    coefficients = refit(library, targets, support)[:, 0]
    return problem.model(coefficients * scale[:, np.newaxis] / lengths, thresholds)


def _mixed(rows: np.ndarray, size: int) -> np.ndarray:
    """Rows of each block of `size` mixed by an orthogonal transform: (rows, columns) again."""
    blocks = rows.reshape(-1, size, rows.shape[1])
    return dct(blocks, axis=1, norm="ortho").reshape(rows.shape)


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
