"""Sequentially thresholded least squares (pysindy's STLSQ).

There are three variants: on normalised columns, in SI units, and on bootstrapped samples.
"""

from functools import lru_cache, partial

import numpy as np
import pysindy as ps
from scipy.fft import dct
from sklearn import config_context

from galloping.identification.identified_model import IdentifiedModel
from galloping.identification.sparse.evidence import Regressions
from galloping.identification.sparse.regression import ReducedRegression, Scaled, judge_path
from galloping.identification.sparse.supports import (
    MIN_TERM_SHARE,
    best_threshold,
    ebic_scores,
    refit,
    solve,
    threshold_path,
    thresholded_supports,
)
from galloping.model.polynomial import linear_term, velocity_pairs
from galloping.results import IDENTIFIED, KNOWN

# Ridges in order of trial, for columns of unit length. A ridge prevents large coefficients of
# opposite sign of nearly collinear columns during thresholding. The last step has no ridge.
RIDGES = (0.0, 1e-4)


def fit_normalised(
    evidence: Regressions, *, threshold: float | None, path_length: int
) -> IdentifiedModel:
    """Identify a model by thresholded least squares (STLSQ) on columns of unit length.

    The thresholds are on the share of each term in the state derivative. threshold: share in (0,
    1), or None to choose one for each equation out of `path_length` between MIN_TERM_SHARE and 1:
    by cross-validation, or by EBIC if nothing is held out.
    """
    problem = evidence.tuned
    scaled = Scaled(*problem.triangle)
    thresholds, ridges = choose_thresholds(problem, threshold, path_length)
    shares = np.zeros((len(scaled.scale), len(scaled.lengths)))
    for ridge in np.unique(ridges):
        rows = ridges == ridge
        shares[rows] = fit(scaled.library, scaled.targets[:, rows], thresholds[rows], ridge)
    return problem.model(scaled.unscale(shares), thresholds)


def fit_raw(
    problem: ReducedRegression,
    *,
    threshold: float | None,
    path_length: int,
    kinematics: str = IDENTIFIED,
) -> IdentifiedModel:
    """Identify a model by STLSQ with thresholds in SI units, as in the paper.

    threshold: in the coefficients' units, or None to choose one for each equation by EBIC out of
    `path_length`, from MIN_TERM_SHARE times the largest coefficient of least squares up to it.
    kinematics: KNOWN replaces an identified rate of a displacement by its velocity.
    """
    library, targets = problem.triangle
    if threshold is None:
        largest = np.abs(np.linalg.lstsq(library, targets, rcond=None)[0]).max(axis=0)
        candidates = largest[:, np.newaxis] * threshold_path(path_length)
        thresholds = _scan_thresholds(library, targets, candidates, problem.observations)
    else:
        thresholds = np.full(targets.shape[1], threshold)
    coefficients = fit(library, targets, thresholds)
    if kinematics == KNOWN:
        for rate, velocity in velocity_pairs(problem.states).items():
            coefficients[rate] = 0.0
            term = problem.terms.index(linear_term(velocity, len(coefficients)))
            coefficients[rate, term] = 1.0
    return problem.model(coefficients, thresholds)


def models_along(path: np.ndarray, grams: np.ndarray, moments: np.ndarray) -> np.ndarray:
    """Compute STLSQ models at all thresholds and ridges, for each target and training set.

    path: the thresholds. Returns (f, m, k, p). Columns have unit length.
    """
    ridges = np.multiply.outer(RIDGES, np.eye(grams.shape[1]))[:, np.newaxis]
    each = np.broadcast_to(moments, (len(RIDGES), *moments.shape))
    supports = thresholded_supports(grams + ridges, each, path)
    return solve(grams, moments, np.concatenate(supports, axis=2))


@lru_cache(maxsize=1)  # ensembles need the same choice again
def choose_thresholds(
    problem: ReducedRegression, threshold: float | None, path_length: int
) -> tuple[np.ndarray, np.ndarray]:
    """Choose the STLSQ threshold and ridge of each equation, as `fit_normalised` describes."""
    path, ridges = threshold_path(path_length), np.zeros(len(problem.states))
    if threshold is not None:
        return np.full(len(ridges), threshold), ridges
    if problem.held_out is None:
        scaled, candidates = Scaled(*problem.triangle), np.tile(path, (len(ridges), 1))
        observations = problem.observations
        chosen = _scan_thresholds(scaled.library, scaled.targets, candidates, observations)
        return chosen, ridges
    models = partial(models_along, path)
    judged = judge_path(problem.products, problem.held_out, len(problem.states), models)
    ridges, places = np.divmod(judged.choose_sparsest(), len(path))
    supports = judged.supports.reshape(len(ridges), len(RIDGES), len(path), -1)
    supports = supports[np.arange(len(ridges)), ridges]
    thresholds = [best_threshold(path, *each) for each in zip(supports, places, strict=True)]
    return np.array(thresholds), np.array(RIDGES)[ridges]


def _scan_thresholds(
    library: np.ndarray, targets: np.ndarray, candidates: np.ndarray, observations: np.ndarray
) -> np.ndarray:
    """Choose the threshold of each equation, of (m, k) candidates, by EBIC."""
    lengths = np.linalg.norm(library, axis=0)
    unit = library / lengths  # the same supports and fits, better conditioned
    supports = thresholded_supports(unit.T @ unit, targets.T @ unit, candidates, 1 / lengths)
    judged = ebic_scores(unit, targets, supports, observations).argmin(axis=1)
    return np.array(list(map(best_threshold, candidates, supports, judged)))


def fit(
    library: np.ndarray, targets: np.ndarray, thresholds: np.ndarray, ridge: float = 0
) -> np.ndarray:
    """Fit each target by pysindy's STLSQ with its own threshold; return the coefficients.

    Returns (m, p). Targets in units of their threshold allow a common threshold of 1. Without a
    ridge, the last step is least squares, which has no bias to remove.
    """
    unchecked = {"check_input": False}  # the checks take longer than the solution
    optimizer = ps.STLSQ(threshold=1, alpha=ridge, unbias=ridge > 0, ridge_kw=unchecked)
    with config_context(assume_finite=True, skip_parameter_validation=True):
        scaled = optimizer.fit(library, targets / thresholds).coef_
    return scaled * thresholds[:, np.newaxis]


def fit_ensemble(
    evidence: Regressions,
    *,
    threshold: float | None,
    path_length: int,
    models: int,
    rng: np.random.Generator,
) -> IdentifiedModel:
    """Identify a model by ensemble SINDy: the median of STLSQ fits to bootstrapped rows.

    The method is that of Fasel et al. 2022. The models are all fitted at once, as pysindy's
    EnsembleOptimizer does; a term stays if most of `models` have it. threshold: share, or None for
    the choice of STLSQ for each equation. The rows of a block's factor are exchangeable after an
    orthogonal transform has mixed them.
    """
    problem = evidence.tuned
    scaled = Scaled(problem.library, problem.targets)
    thresholds, _ = choose_thresholds(problem, threshold, path_length)
    size = len(scaled.lengths) + len(scaled.scale)  # rows of a block
    library = _mix_rows(scaled.library, size)
    targets = _mix_rows(scaled.targets, size) / thresholds  # in these units, as in `fit`
    medians = bagged_medians(library, targets, models, rng) * thresholds[:, np.newaxis]
    support = (np.abs(medians) >= MIN_TERM_SHARE)[:, np.newaxis]
    shares = refit(scaled.library, scaled.targets, support)[:, 0]
    return problem.model(scaled.unscale(shares), thresholds)


def _mix_rows(rows: np.ndarray, size: int) -> np.ndarray:
    """Mix the rows of each block of `size` by an orthogonal transform: (rows, columns) again."""
    blocks = rows.reshape(-1, size, rows.shape[1])
    return dct(blocks, axis=1, norm="ortho").reshape(rows.shape)


def bagged_medians(
    library: np.ndarray, targets: np.ndarray, models: int, rng: np.random.Generator
) -> np.ndarray:
    """Compute the median of each coefficient over STLSQ fits to bootstrapped rows.

    Terms stay while |coefficient| >= 1. Returns (n_targets, n_terms). library: (rows, n_terms);
    targets: (rows, n_targets), in units of their threshold. The rows are those that pysindy draws
    with NumPy's global generator seeded by `rng`.
    """
    draws = np.random.RandomState(rng.integers(2**32))
    samples = [draws.choice(len(library), len(library)) for _ in range(models)]
    grams = np.stack([library[rows].T @ library[rows] for rows in samples])
    moments = np.stack([targets[rows].T @ library[rows] for rows in samples])
    supports = thresholded_supports(grams, moments, np.ones(1))
    return np.median(solve(grams, moments, supports)[:, :, 0], axis=0)
