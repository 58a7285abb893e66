"""Choosing the terms on a quadratic model of the misfit: Wald removal and score-test re-entry."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import lapack

RIDGE = 1e-13
IMITATED = 1e-9


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
    starts: list[np.ndarray],
    penalty: float,
    about: np.ndarray | None = None,
) -> np.ndarray:
    """The best support found: least chi^2 plus `penalty` for each term.

    From each of `starts`, (n,) boolean: removes the term with the smallest Wald statistic
    c^2/var while that is below the penalty; adds the excluded term with the largest score
    statistic while that is above it, or the best pair of terms, removing again; then exchanges a
    term for an excluded one while that pays. Shapes as in `solve_support`; right: half the fall
    of chi^2 with each coefficient, at the coefficients `about` (n,), zero where not given. About
    a good fit these falls are small, and what they say is not lost in rounding. Returns the (n,)
    boolean support.
    """
    diagonal = np.diag(information)
    usable = diagonal > 0.0
    scale = np.where(usable, 1.0 / np.sqrt(np.where(usable, diagonal, 1.0)), 0.0)
    root = np.sqrt(np.maximum(diagonal, 0.0))
    about = np.zeros(len(right)) if about is None else about * root
    misfit = _Quadratic(information * scale[:, None] * scale, right * scale, about)
    found: dict[bytes, tuple[float, np.ndarray]] = {}
    for start in starts:
        support = _descend(misfit, start & usable, usable, penalty)
        found[support.tobytes()] = (_criterion(misfit, support, penalty), support)
    return min(found.values(), key=lambda entry: entry[0])[1]


@dataclass(frozen=True)
class _Quadratic:
    """chi^2 = d h d - 2 right d, d = c - about."""

    h: np.ndarray
    right: np.ndarray
    about: np.ndarray

    def without(self, support: np.ndarray) -> tuple[np.ndarray, float]:
        """`right` and chi^2 where the coefficients outside `support` are set to zero."""
        lost = np.where(support, 0.0, self.about)
        if not lost.any():
            return self.right, 0.0
        pull = self.h @ lost
        return self.right + pull, float(lost @ pull + 2.0 * self.right @ lost)


def _descend(
    misfit: _Quadratic, support: np.ndarray, usable: np.ndarray, penalty: float
) -> np.ndarray:
    """Removal, re-entry and exchange until none of them lowers the criterion."""
    best, lowest = support, np.inf
    while True:
        support = _remove(misfit, support, penalty)
        value = _criterion(misfit, support, penalty)
        if value >= lowest - 1e-6:
            return best
        best, lowest = support, value
        gradient, left = _conditional(misfit.h, misfit.without(support)[0], support, usable)
        score, pair_score = _scores(gradient, left), _pair_scores(gradient, left)
        if score.max() > penalty:
            support = support.copy()
            support[np.argmax(score)] = True
        elif pair_score.max() > 2.0 * penalty:
            support = support.copy()
            support[list(np.unravel_index(np.argmax(pair_score), pair_score.shape))] = True
        else:
            support = _exchanged(misfit, support, usable)


def _exchanged(misfit: _Quadratic, support: np.ndarray, usable: np.ndarray) -> np.ndarray:
    """The support after the most profitable exchange of one term for another, or unchanged."""
    best, gain = support, 0.0
    inverse = _inverse(misfit.h[np.ix_(support, support)])
    c = misfit.about[support] + inverse @ misfit.without(support)[0][support]
    wald = c**2 / np.diag(inverse)
    for loss, out in zip(wald, np.flatnonzero(support), strict=True):
        without = support.copy()
        without[out] = False
        score = _scores(*_conditional(misfit.h, misfit.without(without)[0], without, usable))
        score[out] = 0.0
        if score.max() - loss > gain:
            gain = score.max() - loss
            best = without
            best[np.argmax(score)] = True
    return best


def _criterion(misfit: _Quadratic, support: np.ndarray, penalty: float) -> float:
    """chi^2, less that at `about`, plus the penalty of every term."""
    right, raised = misfit.without(support)
    if not support.any():
        return raised
    right = right[support]
    fall = right @ _inverse(misfit.h[np.ix_(support, support)]) @ right
    return float(raised + penalty * len(right) - fall)


def added_deviation(information: np.ndarray, support: np.ndarray) -> np.ndarray:
    """(n,) standard deviation that each excluded coefficient would have, were it alone added.

    NaN within the support; infinite where the supported terms imitate the excluded one.
    """
    usable = np.diag(information) > 0.0
    left = np.diag(_conditional(information, np.zeros(len(support)), support, usable)[1])
    deviation = np.where(left > 0.0, 1.0 / np.sqrt(np.where(left > 0.0, left, 1.0)), np.inf)
    return np.where(support, np.nan, deviation)


def plausible_additions(
    information: np.ndarray, right: np.ndarray, support: np.ndarray, single: float, pair: float
) -> list[tuple[tuple[int, ...], float]]:
    """The best excluded term and the best excluded pair, where noise alone hardly explains them.

    single, pair: fall of chi^2 above which each is listed, with that fall.
    """
    usable = np.diag(information) > 0.0
    conditional = _conditional(information, right, support, usable)
    score, pair_score = _scores(*conditional), _pair_scores(*conditional)
    found = []
    if score.max() > single:
        found.append(((int(np.argmax(score)),), float(score.max())))
    if pair_score.max() > pair:
        best = np.unravel_index(np.argmax(pair_score), pair_score.shape)
        found.append((tuple(int(k) for k in best), float(pair_score.max())))
    return found


def alternatives(
    information: np.ndarray,
    right: np.ndarray,
    support: np.ndarray,
    rise: float,
    free: np.ndarray,
) -> list[tuple[int, int, float]]:
    """Exchanges the data cannot rule out: (term found, excluded term, rise of chi^2).

    Each found term is listed with the excluded term that replaces it best, where the exchange
    raises chi^2 by less than `rise`. free: (n,) the coefficients about which `right` is, best
    within the support. Shapes as in `solve_support`.
    """
    usable = np.diag(information) > 0.0
    covariance = _inverse(information[np.ix_(support, support)])
    wald = free[support] ** 2 / np.diag(covariance)
    misfit = _Quadratic(information, right, free)
    exchanges = []
    for loss, out in zip(wald, np.flatnonzero(support), strict=True):
        without = support.copy()
        without[out] = False
        score = _scores(*_conditional(information, misfit.without(without)[0], without, usable))
        score[out] = 0.0
        best = int(np.argmax(score))
        if loss - score[best] < rise:
            exchanges.append((int(out), best, float(loss - score[best])))
    return exchanges


def _remove(misfit: _Quadratic, support: np.ndarray, penalty: float) -> np.ndarray:
    """Backward elimination; the inverse is updated by one rank at each removal."""
    kept = np.flatnonzero(support)
    if not len(kept):
        return support
    inverse = _inverse(misfit.h[np.ix_(kept, kept)])
    c = misfit.about[kept] + inverse @ misfit.without(support)[0][kept]
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


def _conditional(
    h: np.ndarray, b: np.ndarray, support: np.ndarray, usable: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Gradient (n,) and information (n, n) of the excluded terms, the support at its best.

    Zero for the terms of the support and for those that it imitates.
    """
    gradient, left = np.zeros(len(b)), np.zeros_like(h)
    kept, out = np.flatnonzero(support), np.flatnonzero(~support & usable)
    block, rest = h[np.ix_(out, out)], b[out]
    if len(kept):
        cross, own = h[np.ix_(kept, out)], h[np.ix_(kept, kept)]
        inverse = _inverse(own)
        block = block - cross.T @ (inverse @ cross)
        c = inverse @ b[kept]
        c += inverse @ (b[kept] - own @ c)  # of a long recording b is huge, what it leaves small
        rest = rest - cross.T @ c
    good = np.diag(block) > IMITATED * np.diag(h)[out]
    out = out[good]
    left[np.ix_(out, out)] = block[np.ix_(good, good)]
    gradient[out] = rest[good]
    return gradient, left


def _scores(gradient: np.ndarray, left: np.ndarray) -> np.ndarray:
    """(n,) fall of chi^2 when one excluded term is added; arguments from `_conditional`."""
    diagonal = np.diag(left)
    return np.divide(gradient**2, diagonal, out=np.zeros(len(gradient)), where=diagonal > 0.0)


def _pair_scores(gradient: np.ndarray, left: np.ndarray) -> np.ndarray:
    """(n, n) fall of chi^2 when two excluded terms are added together, zero on the diagonal."""
    diagonal = np.diag(left)
    product = np.outer(diagonal, diagonal)
    determinant = product - left**2
    square = np.outer(gradient**2, diagonal)
    gain = square + square.T - 2.0 * np.outer(gradient, gradient) * left
    good = determinant > 1e-6 * product
    np.fill_diagonal(good, False)
    return np.divide(gain, determinant, out=np.zeros_like(left), where=good)


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
