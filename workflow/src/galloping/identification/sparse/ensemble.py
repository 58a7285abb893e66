"""Ensemble SINDy (Fasel et al. 2022): the median of STLSQ models of bootstrapped rows."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import pysindy as ps
from scipy.fft import dct
from sklearn import config_context

from galloping.identification.model import IdentifiedModel
from galloping.identification.sparse.reduction import BLOCKS, Regression
from galloping.identification.sparse.selection import NEGLIGIBLE, compact, refit
from galloping.identification.sparse.stlsq import normalised


def ensemble(
    problem: Regression,
    *,
    threshold: float | None,
    path_length: int,
    ensemble_models: int,
    rng: np.random.Generator,
) -> IdentifiedModel:
    """Bagging on the rows of the reduced regression, a term stays if most models have it.

    threshold: share, or None to take what STLSQ chooses for each equation. The rows of a
    block's factor are exchangeable once an orthogonal transform has mixed them.
    """
    compact(problem)  # refuses what cannot be scaled
    scale = np.linalg.norm(problem.targets, axis=0)
    lengths = np.linalg.norm(problem.library, axis=0)
    unit = replace(problem, library=problem.library / lengths, targets=problem.targets / scale)
    thresholds = normalised(unit, threshold=threshold, path_length=path_length).thresholds
    library, targets = _mixed(unit.library), _mixed(unit.targets)
    optimizer = ps.EnsembleOptimizer(
        ps.STLSQ(threshold=1, alpha=0, unbias=False), bagging=True, n_models=ensemble_models
    )
    with seeded(rng), config_context(assume_finite=True, skip_parameter_validation=True):
        # targets in units of their threshold, as in stlsq.fit
        medians = optimizer.fit(library, targets / thresholds).coef_ * thresholds[:, np.newaxis]
    support = (np.abs(medians) >= NEGLIGIBLE)[:, np.newaxis]
    coefficients = refit(unit.library, unit.targets, support)[:, 0]
    return problem.model(coefficients * scale[:, np.newaxis] / lengths, thresholds)


def _mixed(rows: np.ndarray) -> np.ndarray:
    """Rows of each block mixed by an orthogonal transform: (rows, columns) again."""
    blocks = rows.reshape(BLOCKS, -1, rows.shape[1])
    return dct(blocks, axis=1, norm="ortho").reshape(rows.shape)


@contextmanager
def seeded(rng: np.random.Generator) -> Iterator[None]:
    """pysindy draws its bootstrap from NumPy's global generator: seed it, then put it back."""
    state = np.random.get_state()
    np.random.seed(rng.integers(2**32))
    try:
        yield
    finally:
        np.random.set_state(state)
