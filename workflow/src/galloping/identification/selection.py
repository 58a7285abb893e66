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
    information: np.ndarray, right: np.ndarray, starts: list[np.ndarray], penalty: float
) -> np.ndarray:
    """The best support found: least chi^2 plus `penalty` for each term.

    From each of `starts`, (n,) boolean: removes the term with the smallest Wald statistic
    c^2/var while that is below the penalty; adds the excluded term with the largest score
    statistic while that is above it, removing again; then exchanges a term for an excluded one
    while that pays. Shapes as in `solve_support`. Returns the (n,) boolean support.
    """
    diagonal = np.diag(information)
    usable = diagonal > 0.0
    scale = np.where(usable, 1.0 / np.sqrt(np.where(usable, diagonal, 1.0)), 0.0)
    h = information * scale[:, None] * scale
    b = right * scale
    found: dict[bytes, tuple[float, np.ndarray]] = {}
    for start in starts:
        support = _descend(h, b, start & usable, usable, penalty)
        found[support.tobytes()] = (_criterion(h, b, support, penalty), support)
    return min(found.values(), key=lambda entry: entry[0])[1]


def _descend(
    h: np.ndarray, b: np.ndarray, support: np.ndarray, usable: np.ndarray, penalty: float
) -> np.ndarray:
    """Removal, re-entry and exchange until none of them lowers the criterion."""
    best, lowest = support, np.inf
    while True:
        support = _remove(h, b, support, penalty)
        value = _criterion(h, b, support, penalty)
        if value >= lowest - 1e-6:
            return best
        best, lowest = support, value
        score = _scores(h, b, support, usable)
        if score.max() > penalty:
            support = support.copy()
            support[np.argmax(score)] = True
        else:
            support = _exchanged(h, b, support, usable)


def _exchanged(
    h: np.ndarray, b: np.ndarray, support: np.ndarray, usable: np.ndarray
) -> np.ndarray:
    """The support after the most profitable exchange of one term for another, or unchanged."""
    best, gain = support, 0.0
    inverse = _inverse(h[np.ix_(support, support)])
    wald = (inverse @ b[support]) ** 2 / np.diag(inverse)
    for loss, out in zip(wald, np.flatnonzero(support), strict=True):
        without = support.copy()
        without[out] = False
        score = _scores(h, b, without, usable)
        score[out] = 0.0
        if score.max() - loss > gain:
            gain = score.max() - loss
            best = without
            best[np.argmax(score)] = True
    return best


def _criterion(h: np.ndarray, b: np.ndarray, support: np.ndarray, penalty: float) -> float:
    """chi^2 less that of no terms, plus the penalty of every term."""
    if not support.any():
        return 0.0
    right = b[support]
    return float(penalty * len(right) - right @ _inverse(h[np.ix_(support, support)]) @ right)


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


def alternatives(
    information: np.ndarray, right: np.ndarray, support: np.ndarray, rise: float
) -> list[tuple[int, int, float]]:
    """Exchanges the data cannot rule out: (term found, excluded term, rise of chi^2).

    Each found term is listed with the excluded term that replaces it best, where the exchange
    raises chi^2 by less than `rise`. Shapes as in `solve_support`.
    """
    usable = np.diag(information) > 0.0
    covariance = _inverse(information[np.ix_(support, support)])
    wald = (covariance @ right[support]) ** 2 / np.diag(covariance)
    exchanges = []
    for loss, out in zip(wald, np.flatnonzero(support), strict=True):
        without = support.copy()
        without[out] = False
        score = _scores(information, right, without, usable)
        score[out] = 0.0
        best = int(np.argmax(score))
        if loss - score[best] < rise:
            exchanges.append((int(out), best, float(loss - score[best])))
    return exchanges


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
    good = left > 1e-9 * np.diag(h)[out]
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
