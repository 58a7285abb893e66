"""Forward regression by orthogonal least squares (Billings 2013; pysindy's FROLS).

This module is separate from `stlsq`, so that an edit of an unused method reruns none of a study's
jobs.
"""

import numpy as np

from galloping.identification.identified_model import IdentifiedModel
from galloping.identification.sparse.evidence import Regressions
from galloping.identification.sparse.regression import Scaled, judge_path
from galloping.identification.sparse.supports import (
    MIN_TERM_SHARE,
    ebic_scores,
    forward_models,
    refit,
    solve,
)

MAX_TERMS = 20  # most terms of an equation


def fit_frols(evidence: Regressions) -> IdentifiedModel:
    """Identify a model by greedy forward regression (FROLS), stopped by validation or EBIC.

    The most explanatory terms are added as long as held-out stretches, or EBIC, require more. Terms
    whose share their successors have reduced below MIN_TERM_SHARE are dropped.
    """
    problem = evidence.tuned
    scaled = Scaled(*problem.triangle)
    library, targets = scaled.library, scaled.targets
    if problem.held_out is None:
        products = library.T @ library, targets.T @ library
        supports = models_along(*(each[np.newaxis] for each in products))[0] != 0
        places = ebic_scores(library, targets, supports, problem.observations).argmin(axis=1)
    else:
        judged = judge_path(problem.products, problem.held_out, len(problem.states), models_along)
        supports, places = judged.supports, judged.choose_sparsest()
    support = supports[np.arange(len(places)), places]
    return problem.model(scaled.unscale(refit(library, targets, support[:, np.newaxis])[:, 0]))


def models_along(grams: np.ndarray, moments: np.ndarray) -> np.ndarray:
    """Compute greedy models of 0 to MAX_TERMS terms for each target and training set.

    Returns (f, m, k, p). Columns and targets have unit length.
    """
    shares = forward_models(grams, moments, min(MAX_TERMS, grams.shape[1]))
    return solve(grams, moments, np.abs(shares) >= MIN_TERM_SHARE)
