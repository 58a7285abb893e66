"""Ensemble SINDy (Fasel et al. 2022): the median of STLSQ models of bootstrapped rows."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
from scipy.fft import dct

from galloping.identification.model import IdentifiedModel
from galloping.identification.sparse.bagging import bagged_medians
from galloping.identification.sparse.reduction import BLOCKS, Regression
from galloping.identification.sparse.selection import NEGLIGIBLE, compact, refit
from galloping.identification.sparse.stlsq import normalised


def ensemble(
    problem: Regression,
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
    compact(problem)  # refuses what cannot be scaled
    scale = np.linalg.norm(problem.targets, axis=0)
    lengths = np.linalg.norm(problem.library, axis=0)
    unit = replace(problem, library=problem.library / lengths, targets=problem.targets / scale)
    thresholds = normalised(unit, threshold=threshold, path_length=path_length).thresholds
    library, targets = _mixed(unit.library), _mixed(unit.targets)
    # targets in units of their threshold, as in stlsq.fit
    medians = bagged_medians(library, targets / thresholds, models, rng)
    medians = medians * thresholds[:, np.newaxis]
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
