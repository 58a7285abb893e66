"""Sequentially thresholded least squares (pysindy's STLSQ), normalised or as printed."""

from __future__ import annotations

import numpy as np
import pysindy as ps
from sklearn import config_context

from galloping.identification.model import IdentifiedModel
from galloping.identification.sparse.reduction import Regression
from galloping.identification.sparse.selection import (
    NEGLIGIBLE,
    best_threshold,
    compact,
    scores,
    thresholded_supports,
)


def normalised(
    problem: Regression, *, threshold: float | None, path_length: int
) -> IdentifiedModel:
    """Thresholds act on each term's share of the state derivative.

    threshold: share in (0, 1), or None to choose one for each equation by EBIC out of
    `path_length` between NEGLIGIBLE and 1.
    """
    library, targets = compact(problem)
    scale = np.linalg.norm(targets, axis=0)
    lengths = np.linalg.norm(library, axis=0)
    unit_library, unit_targets = library / lengths, targets / scale
    if threshold is None:
        candidates = np.tile(np.geomspace(NEGLIGIBLE, 1, path_length), (targets.shape[1], 1))
        chosen = _scan(unit_library, unit_targets, candidates, problem.observations)
    else:
        chosen = np.full(targets.shape[1], threshold)
    coefficients = fit(unit_library, unit_targets, chosen)
    return problem.model(coefficients * scale[:, np.newaxis] / lengths, chosen)


def raw(problem: Regression, *, threshold: float | None, path_length: int) -> IdentifiedModel:
    """Thresholds act on the coefficients as they are, in SI units, as the paper most likely did.

    threshold: in the coefficients' units, or None to choose one for each equation by EBIC out
    of `path_length` from NEGLIGIBLE times the largest coefficient of least squares up to it.
    """
    library, targets = compact(problem)
    if threshold is None:
        largest = np.abs(np.linalg.lstsq(library, targets, rcond=None)[0]).max(axis=0)
        candidates = largest[:, np.newaxis] * np.geomspace(NEGLIGIBLE, 1, path_length)
        chosen = _scan(library, targets, candidates, problem.observations)
    else:
        chosen = np.full(targets.shape[1], threshold)
    return problem.model(fit(library, targets, chosen), chosen)


def _scan(
    library: np.ndarray, targets: np.ndarray, candidates: np.ndarray, observations: np.ndarray
) -> np.ndarray:
    """The threshold of each equation, of (m, k) candidates, that EBIC prefers."""
    lengths = np.linalg.norm(library, axis=0)
    unit = library / lengths  # the same supports and fits, better conditioned
    supports = thresholded_supports(unit, targets, candidates, 1 / lengths)
    judged = scores(unit, targets, supports, observations)
    return np.array(list(map(best_threshold, candidates, supports, judged)))


def fit(library: np.ndarray, targets: np.ndarray, thresholds: np.ndarray) -> np.ndarray:
    """pysindy's STLSQ of each target at its own threshold: (m, p) coefficients.

    Targets in units of their threshold let one threshold of 1 serve them all. Without a ridge
    STLSQ's last step is least squares already, there is no bias to remove.
    """
    optimizer = ps.STLSQ(threshold=1, alpha=0, unbias=False)
    with config_context(assume_finite=True, skip_parameter_validation=True):
        scaled = optimizer.fit(library, targets / thresholds).coef_
    return scaled * thresholds[:, np.newaxis]
