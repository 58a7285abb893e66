"""LASSO (Tibshirani 1996) along its exact path, with least squares on the support it selects."""

import numpy as np
from pysindy.optimizers import WrappedOptimizer
from sklearn.linear_model import LassoLars, lars_path, lars_path_gram

from galloping.identification.identified_model import IdentifiedModel
from galloping.identification.sparse.evidence import Regressions
from galloping.identification.sparse.regression import Scaled, judge_path
from galloping.identification.sparse.supports import MIN_TERM_SHARE, ebic_scores, refit, solve

# Penalties for columns and targets of unit length, with squares summed over rows.
PENALTIES = np.geomspace(1, 1e-6, 45)


def fit_lasso(evidence: Regressions, *, threshold: float | None) -> IdentifiedModel:
    """Identify a model by LASSO, with the penalty of each equation from validation or EBIC.

    Without held-out stretches the kink of the path with the best EBIC is chosen. threshold: penalty
    alpha on unit columns and targets, or None to choose it. Terms whose refitted share is
    below MIN_TERM_SHARE are dropped.
    """
    problem = evidence.tuned
    scaled = Scaled(*problem.triangle)
    library, targets = scaled.library, scaled.targets
    if threshold is not None:
        alphas = np.full(targets.shape[1], threshold)
    elif problem.held_out is None:
        alphas = _choose_by_ebic(library, targets, problem.observations)
    else:
        judged = judge_path(problem.products, problem.held_out, len(problem.states), models_along)
        alphas = PENALTIES[judged.choose_sparsest()] / len(library)
    rows = []
    for target, alpha in zip(targets.T[..., np.newaxis], alphas, strict=True):
        optimizer = WrappedOptimizer(LassoLars(alpha=alpha, fit_intercept=False))
        support = _prune(library, target, optimizer.fit(library, target).coef_[np.newaxis] != 0)
        rows.append(refit(library, target, support)[0, 0])
    return problem.model(scaled.unscale(np.stack(rows)), alphas)


def models_along(grams: np.ndarray, moments: np.ndarray) -> np.ndarray:
    """Compute LASSO models at each of PENALTIES for each target and training set.

    Returns (f, m, k, p). Columns and targets have unit length.
    """
    supports = np.zeros((*moments.shape[:2], len(PENALTIES), moments.shape[2]), dtype=bool)
    for f, m in np.ndindex(moments.shape[:2]):
        kinks, _, path = lars_path_gram(
            moments[f, m], grams[f], n_samples=1, method="lasso", alpha_min=PENALTIES[-1]
        )
        for index, penalty in enumerate(PENALTIES):
            # between two kinks, the nonzero coefficients are those at either kink
            after = np.searchsorted(-kinks, -penalty)
            supports[f, m, index] = np.any(path[:, max(after - 1, 0) : after + 1], axis=1)
            supports[f, m, index] &= penalty < kinks[0]
    shares = solve(grams, moments, supports)
    return solve(grams, moments, np.abs(shares) >= MIN_TERM_SHARE)


def _choose_by_ebic(
    library: np.ndarray, targets: np.ndarray, observations: np.ndarray
) -> np.ndarray:
    """Choose the kink of each target's path by EBIC."""
    alphas = []
    for i in range(targets.shape[1]):
        target = targets[:, [i]]
        kinks, _, path = lars_path(library, target[:, 0], method="lasso")
        supports = _prune(library, target, (path.T != 0)[np.newaxis])
        judged = ebic_scores(library, target, supports, observations[[i]])
        alphas.append(kinks[np.argmin(judged[0])])
    return np.array(alphas)


def _prune(library: np.ndarray, target: np.ndarray, supports: np.ndarray) -> np.ndarray:
    """Remove terms that least squares finds negligible from supports."""
    return supports & (np.abs(refit(library, target, supports)) >= MIN_TERM_SHARE)
