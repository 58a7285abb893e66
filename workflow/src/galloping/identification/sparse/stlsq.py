"""Sequentially thresholded least squares (pysindy's STLSQ), normalised or as printed."""

from functools import lru_cache, partial

import numpy as np
import pysindy as ps
from sklearn import config_context

from galloping.identification.model import IdentifiedModel
from galloping.identification.options import IDENTIFIED, KNOWN
from galloping.identification.sparse.cross_validation import judge
from galloping.identification.sparse.evidence import Regressions
from galloping.identification.sparse.regression import Regression
from galloping.identification.sparse.supports import (
    best_threshold,
    compact,
    scores,
    solve,
    threshold_path,
    thresholded_supports,
)
from galloping.polynomial import velocity_pairs

# Of unit columns: a ridge keeps nearly collinear ones from large coefficients of opposite sign
# while thresholds act; the last step is least squares without it.
RIDGES = (0.0, 1e-4)


def normalised(
    evidence: Regressions, *, threshold: float | None, path_length: int
) -> IdentifiedModel:
    """Thresholds act on each term's share of the state derivative.

    threshold: share in (0, 1), or None to choose one for each equation out of `path_length`
    between NEGLIGIBLE and 1: by cross-validation, or where nothing is held out by EBIC.
    """
    problem = evidence.tuned
    library, targets = compact(problem)
    scale = np.linalg.norm(targets, axis=0)
    lengths = np.linalg.norm(library, axis=0)
    library, targets = library / lengths, targets / scale
    chosen, ridges = choose(problem, threshold, path_length)
    coefficients = np.zeros((len(scale), library.shape[1]))
    for ridge in np.unique(ridges):
        rows = ridges == ridge
        coefficients[rows] = fit(library, targets[:, rows], chosen[rows], ridge)
    return problem.model(coefficients * scale[:, np.newaxis] / lengths, chosen)


def raw(
    evidence: Regressions,
    *,
    threshold: float | None,
    path_length: int,
    kinematics: str = IDENTIFIED,
) -> IdentifiedModel:
    """Thresholds act on the coefficients as they are, in SI units, as the paper did.

    threshold: in the coefficients' units, or None to choose one for each equation by EBIC out
    of `path_length` from NEGLIGIBLE times the largest coefficient of least squares up to it.
    kinematics: KNOWN puts in place of an identified rate of a displacement its velocity.
    """
    library, targets = compact(evidence.plain)
    if threshold is None:
        largest = np.abs(np.linalg.lstsq(library, targets, rcond=None)[0]).max(axis=0)
        candidates = largest[:, np.newaxis] * threshold_path(path_length)
        chosen = _scan(library, targets, candidates, evidence.plain.observations)
    else:
        chosen = np.full(targets.shape[1], threshold)
    coefficients = fit(library, targets, chosen)
    if kinematics == KNOWN:
        units = np.eye(len(coefficients), dtype=int)
        for rate, velocity in velocity_pairs(evidence.plain.states).items():
            coefficients[rate] = 0.0
            coefficients[rate, evidence.plain.terms.index(tuple(units[velocity].tolist()))] = 1.0
    return evidence.plain.model(coefficients, chosen)


def models_along(path: np.ndarray, grams: np.ndarray, moments: np.ndarray) -> np.ndarray:
    """Models (f, m, k, p) of problems with unit columns, at all RIDGES and thresholds (path)."""
    ridges = np.multiply.outer(RIDGES, np.eye(grams.shape[1]))[:, np.newaxis]
    thresholds = np.tile(path, (moments.shape[1], 1))
    each = np.broadcast_to(moments, (len(RIDGES), *moments.shape))
    supports = thresholded_supports(grams + ridges, each, thresholds)
    return solve(grams, moments, np.concatenate(supports, axis=2))


@lru_cache(maxsize=1)  # ensembles ask again
def choose(
    problem: Regression, threshold: float | None, path_length: int
) -> tuple[np.ndarray, np.ndarray]:
    """The threshold and the ridge of each equation, as `normalised` has them."""
    path, ridges = threshold_path(path_length), np.zeros(len(problem.states))
    if threshold is not None:
        return np.full(len(ridges), threshold), ridges
    if problem.held_out is None:
        library, targets = (each / np.linalg.norm(each, axis=0) for each in compact(problem))
        candidates = np.tile(path, (len(ridges), 1))
        return _scan(library, targets, candidates, problem.observations), ridges
    judged = judge(problem, partial(models_along, path))
    ridges, places = np.divmod(judged.chosen(), len(path))
    supports = judged.supports.reshape(len(ridges), len(RIDGES), len(path), -1)
    supports = supports[np.arange(len(ridges)), ridges]
    thresholds = [best_threshold(path, *each) for each in zip(supports, places, strict=True)]
    return np.array(thresholds), np.array(RIDGES)[ridges]


def _scan(
    library: np.ndarray, targets: np.ndarray, candidates: np.ndarray, observations: np.ndarray
) -> np.ndarray:
    """The threshold of each equation, of (m, k) candidates, that EBIC prefers."""
    lengths = np.linalg.norm(library, axis=0)
    unit = library / lengths  # the same supports and fits, better conditioned
    supports = thresholded_supports(unit.T @ unit, targets.T @ unit, candidates, 1 / lengths)
    judged = scores(unit, targets, supports, observations).argmin(axis=1)
    return np.array(list(map(best_threshold, candidates, supports, judged)))


def fit(
    library: np.ndarray, targets: np.ndarray, thresholds: np.ndarray, ridge: float = 0
) -> np.ndarray:
    """pysindy's STLSQ of each target at its own threshold: (m, p) coefficients.

    Targets in units of their threshold let one threshold of 1 serve them all. Without a ridge
    STLSQ's last step is least squares already, there is no bias to remove.
    """
    optimizer = ps.STLSQ(threshold=1, alpha=ridge, unbias=ridge > 0)
    with config_context(assume_finite=True, skip_parameter_validation=True):
        scaled = optimizer.fit(library, targets / thresholds).coef_
    return scaled * thresholds[:, np.newaxis]
