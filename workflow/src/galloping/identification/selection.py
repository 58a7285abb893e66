"""Choosing the terms on a quadratic model of the misfit: Wald removal and score-test re-entry."""

from __future__ import annotations

import numpy as np
from scipy.linalg import lapack

RIDGE = 1e-13


def solve_support(
    information: np.ndarray, right: np.ndarray, support: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Minimise c H c / 2 - b c with c zero outside `support`.

    information: H, (n, n), right: b, (n,), both whitened, so that H^-1 is the covariance.
    support: (n,) boolean. Returns c (n,) and the covariance of the supported coefficients
    (n_support, n_support). Raises numpy.linalg.LinAlgError where H is not positive definite.
    """
    c = np.zeros(len(right))
    kept = np.flatnonzero(support)
    if not len(kept):
        return c, np.zeros((0, 0))
    covariance = _inverse(information[np.ix_(kept, kept)])
    c[kept] = covariance @ right[kept]
    return c, covariance


def select(
    information: np.ndarray,
    right: np.ndarray,
    support: np.ndarray,
    penalty: float,
    reentry: bool = True,
) -> np.ndarray:
    """Terms worth `penalty` each, in units of chi^2, starting from `support`.

    Removes the term with the smallest Wald statistic c^2/var while that is below the penalty;
    then, with `reentry`, adds the excluded term with the largest score statistic while that is
    above the penalty, removing again after each addition. Shapes as in `solve_support`.
    Returns the (n,) boolean support.
    """
    diagonal = np.diag(information)
    usable = diagonal > RIDGE * max(diagonal.max(), np.finfo(float).tiny) * 1e-12
    scale = np.where(usable, 1.0 / np.sqrt(np.where(usable, diagonal, 1.0)), 0.0)
    h = information * scale[:, None] * scale
    b = right * scale
    support = support & usable
    seen = set()
    while True:
        support = _remove(h, b, support, penalty)
        key = support.tobytes()
        if not reentry or key in seen:
            return support
        seen.add(key)
        score = _scores(h, b, support & usable, usable)
        best = int(np.argmax(score))
        if score[best] <= penalty:
            return support
        support = support.copy()
        support[best] = True


def added_deviation(information: np.ndarray, support: np.ndarray) -> np.ndarray:
    """(n,) standard deviation that each excluded coefficient would have, were it alone added.

    NaN within the support; infinite where the supported terms imitate the excluded one.
    """
    kept, out = np.flatnonzero(support), np.flatnonzero(~support)
    deviation = np.full(len(support), np.nan)
    left = np.diag(information)[out].copy()
    if len(kept):
        cross = information[np.ix_(kept, out)]
        left -= np.einsum("ij,ij->j", cross, _inverse(information[np.ix_(kept, kept)]) @ cross)
    floor = 1e-10 * np.diag(information)[out]
    good = left > np.maximum(floor, 0.0)
    deviation[out] = np.where(good, 1.0 / np.sqrt(np.where(good, left, 1.0)), np.inf)
    return deviation


def _remove(h: np.ndarray, b: np.ndarray, support: np.ndarray, penalty: float) -> np.ndarray:
    """Backward elimination; the inverse is updated by one rank at each removal."""
    kept = np.flatnonzero(support)
    if not len(kept):
        return support
    inverse = _inverse(h[np.ix_(kept, kept)])
    c = inverse @ b[kept]
    while len(kept):
        wald = c**2 / np.diag(inverse)
        worst = int(np.argmin(wald))
        if wald[worst] >= penalty:
            break
        column = inverse[:, worst] / inverse[worst, worst]
        c = np.delete(c - column * c[worst], worst)
        inverse = inverse - np.outer(column, inverse[worst])
        inverse = np.delete(np.delete(inverse, worst, 0), worst, 1)
        kept = np.delete(kept, worst)
    result = np.zeros_like(support)
    result[kept] = True
    return result


def _scores(h: np.ndarray, b: np.ndarray, support: np.ndarray, usable: np.ndarray) -> np.ndarray:
    """Fall of chi^2 when one excluded term is added, zero for those in the support."""
    kept, out = np.flatnonzero(support), np.flatnonzero(~support & usable)
    score = np.zeros(len(b))
    gradient, left = b[out].copy(), np.diag(h)[out].copy()
    if len(kept):
        cross = h[np.ix_(kept, out)]
        solved = _inverse(h[np.ix_(kept, kept)]) @ np.column_stack([cross, b[kept]])
        left -= np.einsum("ij,ij->j", cross, solved[:, :-1])
        gradient -= cross.T @ solved[:, -1]
    good = left > 1e-9
    score[out[good]] = gradient[good] ** 2 / left[good]
    return score


def _inverse(matrix: np.ndarray) -> np.ndarray:
    """Inverse of a positive definite matrix by Cholesky, with unit scaling and a tiny ridge."""
    diagonal = np.diag(matrix)
    if not np.all(diagonal > 0):
        raise np.linalg.LinAlgError("information matrix with an empty column")
    scale = 1.0 / np.sqrt(diagonal)
    scaled = matrix * scale[:, None] * scale
    scaled[np.diag_indices_from(scaled)] += RIDGE
    factor, info = lapack.dpotrf(scaled, lower=1)
    if info:
        values, vectors = np.linalg.eigh(scaled)
        inverse = (vectors / np.maximum(values, RIDGE)) @ vectors.T
        return inverse * scale[:, None] * scale
    inverse, _ = lapack.dpotri(factor, lower=1)
    inverse = np.tril(inverse) + np.tril(inverse, -1).T
    return inverse * scale[:, None] * scale
