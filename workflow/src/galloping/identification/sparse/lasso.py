"""LASSO (Tibshirani 1996) along its exact path, with least squares on the support it selects."""

from __future__ import annotations

import numpy as np
from pysindy.optimizers import WrappedOptimizer
from sklearn.linear_model import LassoLars, lars_path

from galloping.identification.model import IdentifiedModel
from galloping.identification.sparse.reduction import Regression
from galloping.identification.sparse.selection import NEGLIGIBLE, compact, refit, scores


def lasso(problem: Regression, *, threshold: float | None) -> IdentifiedModel:
    """The l1 penalty of each equation is a kink of its path: the one that EBIC prefers.

    threshold: penalty alpha on unit columns and targets, or None to choose it. Terms whose
    refitted share is NEGLIGIBLE are dropped.
    """
    library, targets = compact(problem)
    scale, lengths = np.linalg.norm(targets, axis=0), np.linalg.norm(library, axis=0)
    library, targets = library / lengths, targets / scale
    rows, chosen = [], []
    for i in range(targets.shape[1]):
        target = targets[:, [i]]
        alpha = threshold
        if alpha is None:
            alphas, _, path = lars_path(library, target[:, 0], method="lasso")
            supports = _prune(library, target, (path.T != 0)[np.newaxis])
            judged = scores(library, target, supports, problem.observations[[i]])
            alpha = alphas[np.argmin(judged[0])]
        optimizer = WrappedOptimizer(LassoLars(alpha=alpha, fit_intercept=False))
        support = optimizer.fit(library, target).coef_ != 0
        support = _prune(library, target, support[np.newaxis])
        rows.append(refit(library, target, support)[0, 0])
        chosen.append(alpha)
    return problem.model(np.stack(rows) * scale[:, np.newaxis] / lengths, np.array(chosen))


def _prune(library: np.ndarray, target: np.ndarray, supports: np.ndarray) -> np.ndarray:
    """Supports without the terms that least squares finds negligible."""
    return supports & (np.abs(refit(library, target, supports)) >= NEGLIGIBLE)
