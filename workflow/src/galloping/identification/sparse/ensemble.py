"""Ensemble SINDy (Fasel et al. 2022): the median of STLSQ models of bootstrapped rows."""

from __future__ import annotations

import numpy as np
from scipy.fft import dct

from galloping.identification.model import IdentifiedModel
from galloping.identification.sparse.bagging import bagged_medians
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
