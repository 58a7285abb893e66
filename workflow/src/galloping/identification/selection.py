"""Selection of terms on a quadratic model of the misfit, by least chi^2 plus penalties."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cholesky, solve_triangular

from galloping.identification.work import count_work, is_exhausted

# Term added to the diagonal of an information matrix with unit diagonal, so that it can be
# factored: a few rounding errors. It changes chi^2 by 1e-15 |c|^2: by 0.1 if coefficients c are
# 1e7 in their units.
RIDGE = 1e-15
# Least share of information that is independent of other terms; less is rounding. For two added
# terms: determinant relative to the product of the diagonal entries. For a fault of the
# instrument: share of its information.
MIN_INDEPENDENT_SHARE = 1e-6


def solve_support(
    information: np.ndarray, right: np.ndarray, support: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Fit the coefficients of given terms by normal equations, all other coefficients zero.

    Minimises c H c / 2 - b c with c zero outside `support`. information: H, (n, n), right: b, (n,),
    in units of the noise: H^-1 is the covariance. support: (n,) boolean. Returns c (n,) and the
    covariance of the supported coefficients (n_support, n_support).
    """
    indices = np.flatnonzero(support)
    whitened = whiten(information[np.ix_(indices, indices)], right[indices])
    fit = make_tableau(whitened, whitened.is_usable)
    c, covariance = np.zeros(len(right)), np.zeros((len(indices), len(indices)))
    unit = whitened.unit[fit.kept]
    c[indices[fit.kept]] = fit.coefficients * unit
    covariance[np.ix_(fit.kept, fit.kept)] = fit.covariance * unit[:, None] * unit
    return c, covariance


def misfit_of_support(
    information: np.ndarray, right: np.ndarray, origin: np.ndarray, support: np.ndarray
) -> float:
    """Compute chi^2, relative to that at `origin`, with the best coefficients of a support.

    information, right: as in `solve_support`, at `origin` (n,). support: (n,) boolean.
    """
    removal = np.where(support, 0.0, -origin)
    residual_gradient = right - information @ removal
    change, _ = solve_support(information, residual_gradient, support)
    rise = removal @ information @ removal - 2.0 * right @ removal
    return float(rise - change @ residual_gradient)


@dataclass(frozen=True)
class Penalties:
    """Penalties of terms: the decrease of chi^2 that each term needs to be selected.

    least, most: (n,) bounds of the penalty of each term. width: (n,) coefficients c: if a term's
    standard error s is smaller, its penalty exceeds the least by 2 ln(c / s), the evidence of a
    prior so much wider, up to the most (see `Prior`).
    """

    least: np.ndarray
    most: np.ndarray
    width: np.ndarray

    def scale_by(self, factor: float) -> Penalties:
        """Return all penalties multiplied by a factor."""
        return Penalties(factor * self.least, factor * self.most, self.width)

    def of_terms(self, terms: np.ndarray) -> Penalties:
        """Return the penalties of some terms, given by their indices."""
        return Penalties(self.least[terms], self.most[terms], self.width[terms])

    def with_errors(self, errors: np.ndarray, terms: np.ndarray) -> np.ndarray:
        """Compute penalties of terms (m,), larger for terms with smaller standard errors (m,)."""
        wider = self.least[terms] + 2.0 * np.log(np.maximum(self.width[terms] / errors, 1.0))
        return np.minimum(wider, self.most[terms])


def select_support(
    information: np.ndarray,
    right: np.ndarray,
    starts: list[np.ndarray],
    penalties: Penalties | np.ndarray | float,
    origin: np.ndarray | None = None,
) -> np.ndarray:
    """Search for the set of terms with the least sum of chi^2 and penalties of its terms.

    From each of `starts`, (n,) boolean, the least useful term is removed while it does not reach
    its penalty; then, while the criterion falls, one or two terms are added, or one is exchanged
    for one or two, or two for one, as long as work is left. In this search the least penalties
    count, since a term beside a similar one has a large error, and so an incomparable penalty.
    Finally, from the best support terms are removed that do not reach their penalties with the
    errors they have there. penalties: of each term (n,), in units of chi^2, or one of all. Shapes
    as in `solve_support`; origin: as in `whiten`. Returns the (n,) boolean support.
    """
    whitened = whiten(information, right, origin)
    least_penalties = penalties.least if isinstance(penalties, Penalties) else penalties
    least = np.broadcast_to(least_penalties, len(right))
    ends: dict[bytes, tuple[float, np.ndarray]] = {}
    for start in starts:
        value, support = _descend_by_moves(whitened, start & whitened.is_usable, least, ends)
        ends[support.tobytes()] = (value, support)
    support = min(ends.values(), key=lambda end: end[0])[1]
    if not isinstance(penalties, Penalties):
        return support
    fit, refined = make_tableau(whitened, support), least.copy()
    errors = whitened.unit[fit.kept] * np.sqrt(np.diag(fit.covariance))
    refined[fit.kept] = penalties.with_errors(errors, fit.kept)
    return _remove_terms(whitened, support, refined)


@dataclass(frozen=True)
class Whitened:
    """Least-squares problem min |target - columns c|^2 for coefficients c of terms.

    It is equivalent to the normal equations of `solve_support`. columns: (n, n), target: (n,).
    unit: (n,), factor from c to the original coefficients, zero for terms without information. Sums
    of squares of the columns keep the digits that a product with an inverse loses if terms are
    similar.
    """

    columns: np.ndarray
    target: np.ndarray
    unit: np.ndarray

    @property
    def is_usable(self) -> np.ndarray:
        """Whether the data contain any information on each term, (n,) boolean."""
        return self.unit > 0.0


def whiten(
    information: np.ndarray, right: np.ndarray, origin: np.ndarray | None = None
) -> Whitened:
    """Convert normal equations to an equivalent least-squares problem by Cholesky factorisation.

    information: (n, n), right: (n,). Each term is in its own unit. origin: (n,) coefficients of a
    good fit, at which `right`, half the decrease of chi^2 with each coefficient, is measured. There
    it is small; measured at zero, it would lose its digits.
    """
    diagonal = np.diag(information)
    usable = diagonal > 0.0
    unit = np.where(usable, 1.0 / np.sqrt(np.where(usable, diagonal, 1.0)), 0.0)
    scaled = information * unit[:, None] * unit
    scaled[np.diag_indices_from(scaled)] += np.where(usable, RIDGE, 1.0)
    try:
        columns = cholesky(scaled, check_finite=False)
        target = solve_triangular(columns, right * unit, trans="T", check_finite=False)
    except np.linalg.LinAlgError:  # rounding leaves an eigenvalue below zero
        values, vectors = np.linalg.eigh(scaled)
        root = np.sqrt(np.maximum(values, RIDGE))
        columns, target = root[:, None] * vectors.T, (right * unit) @ vectors / root
    if origin is not None:
        target = target + columns @ (origin * np.sqrt(np.maximum(diagonal, 0.0)))
    return Whitened(columns, target, unit)


@dataclass(frozen=True)
class Tableau:
    """Fit of a set of terms, with the change of chi^2 if terms are added, removed or exchanged.

    kept, out: indices of the support and of the terms that could be added. coefficients (n_kept,)
    with their covariance. chi2: misfit of the support, above that of all terms. share: (n_kept,
    n_out), decrease of each coefficient per increase of one that is added. gradient (n_out,) and
    information (n_out, n_out) of the added ones, the support refitted.
    """

    kept: np.ndarray
    out: np.ndarray
    coefficients: np.ndarray
    covariance: np.ndarray
    chi2: float
    share: np.ndarray
    gradient: np.ndarray
    information: np.ndarray

    def rises(self, n_leave: int, n_enter: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Compute the rise of chi^2 if terms are removed, added or exchanged.

        n_leave, n_enter: number of present terms that are removed and of absent ones that are
        added, up to two each. Returns the rises (n_ways_to_leave, n_ways_to_enter), and the indices
        of the terms of each way, (n_ways, n_leave) and (n_ways, n_enter). Two added terms that
        differ only by rounding do not lower chi^2.
        """
        leave, enter = _choices(len(self.kept), n_leave), _choices(len(self.out), n_enter)
        weight = np.linalg.inv(self.covariance[leave[:, :, None], leave[:, None, :]])
        c, share = self.coefficients[leave], self.share[leave]
        pull = np.einsum("pij,pj->pi", weight, c)
        rise = np.sum(c * pull, axis=1)[:, None]
        # gradient and information of the absent terms, once those that leave are removed
        weighted = weight @ share
        gradient = self.gradient + np.einsum("pi,pio->po", pull, share)
        diagonal = np.diag(self.information) + np.einsum("pio,pio->po", share, weighted)
        if n_enter == 1:
            rise = rise - gradient**2 / diagonal
        elif n_enter == 2:
            i, j = enter.T
            overlap = np.tile(self.information[i, j], (len(leave), 1))
            for k in range(n_leave):
                overlap += share[:, k, i] * weighted[:, k, j]
            (g, h), (d, e) = ((values[:, i], values[:, j]) for values in (gradient, diagonal))
            determinant = d * e - overlap**2
            gain = g**2 * e + h**2 * d - 2.0 * (g * h) * overlap
            good = determinant > MIN_INDEPENDENT_SHARE * d * e
            rise = rise - np.divide(gain, determinant, out=np.zeros_like(gain), where=good)
        return rise, self.kept[leave], self.out[enter]


def _choices(n: int, count: int) -> np.ndarray:
    """Return all choices of none, one or two of n places, (n_choices, count)."""
    if count == 0:
        return np.zeros((1, 0), int)
    return np.arange(n)[:, None] if count == 1 else np.column_stack(np.triu_indices(n, 1))


def make_tableau(whitened: Whitened, support: np.ndarray) -> Tableau:
    """Fit a set of terms and prepare the changes of chi^2 if terms are added or removed.

    support: (n,) boolean. Linear combinations of its terms cannot be added.
    """
    present, absent = np.flatnonzero(support), np.flatnonzero(~support & whitened.is_usable)
    count_work(2e-4 + 1e-10 * len(support) ** 3)
    q, r = np.linalg.qr(whitened.columns[:, present])
    inverse = np.eye(len(present))
    if len(present):  # without terms LAPACK would print a message
        inverse = solve_triangular(r, inverse, check_finite=False)
    cross, projection = q.T @ whitened.columns[:, absent], q.T @ whitened.target
    remainders = whitened.columns[:, absent] - q @ cross
    rest = whitened.target - q @ projection
    # A term of length one cannot be added if the present terms leave less than 1e-11 of its squared
    # length: that is integration error. In chains of strong growth the end makes up most of any
    # term: with 1e-9, one exact line of twenty seemed to have terms that others imitate.
    good = np.einsum("ij,ij->j", remainders, remainders) > 1e-11
    remainders = remainders[:, good]
    return Tableau(
        present, absent[good], inverse @ projection, inverse @ inverse.T, float(rest @ rest),
        inverse @ cross[:, good], remainders.T @ rest, remainders.T @ remainders,
    )  # fmt: skip


def find_moves(
    fit: Tableau, support: np.ndarray, penalties: np.ndarray, most: int
) -> tuple[np.ndarray, np.ndarray]:
    """Find the best small changes of a set of terms, and how each changes chi^2 plus penalties.

    At most `most` changes of a support (n,) are returned. One term is removed, one or two are
    added, or one is exchanged for one or two, or two for one. Returns the rise of chi^2 plus
    `penalties` (n,) with each, (m,), increasing, and the supports that they lead to, (m, n).
    """
    n_present, n_absent = len(fit.kept), len(fit.out)
    count_work(6e-8 * n_present * n_absent * (n_absent + n_present))  # moves of three terms
    options = [fit.rises(*move) for move in ((1, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 1))]
    rises_with = [
        (rises + penalties[enter].sum(axis=1) - penalties[leave].sum(axis=1)[:, None]).ravel()
        for rises, leave, enter in options
    ]
    rise, ends = np.concatenate(rises_with), np.cumsum(list(map(len, rises_with)))
    edge = np.partition(rise, most - 1)[most - 1] if most < len(rise) else np.inf
    best = np.flatnonzero(rise <= edge)
    best = best[np.argsort(rise[best], kind="stable")][:most]
    others = np.tile(support, (len(best), 1))
    of_option = np.searchsorted(ends, best, "right")
    for other, index, option in zip(others, best, of_option, strict=True):
        _, leave, enter = options[option]
        row, column = divmod(index - ends[option], len(enter))  # negative: counted from the end
        other[leave[row]] = False
        other[enter[column]] = True
    return rise[best], others


def _descend_by_moves(
    whitened: Whitened, support: np.ndarray, penalties: np.ndarray, ends: dict[bytes, tuple]
) -> tuple[float, np.ndarray]:
    """Remove terms, then take the best small move while one lowers the criterion.

    ends: supports from which no move does. Returns the criterion and the support.
    """
    support = _remove_terms(whitened, support, penalties)
    while support.tobytes() not in ends:
        fit = make_tableau(whitened, support)
        value = fit.chi2 + penalties[fit.kept].sum()
        if is_exhausted():
            return value, support
        rise, others = find_moves(fit, support, penalties, 1)
        if not len(rise) or rise[0] > -1e-6:  # a smaller fall of chi^2 may be rounding
            return value, support
        support = _remove_terms(whitened, others[0], penalties)
    return ends[support.tobytes()]


def _remove_terms(whitened: Whitened, support: np.ndarray, penalties: np.ndarray) -> np.ndarray:
    """Eliminate terms backward; the inverse is updated at each removal, then recomputed."""
    while True:
        fit = make_tableau(whitened, support)
        c, inverse, least = fit.coefficients, fit.covariance, penalties[fit.kept]
        is_kept = np.ones(len(c), bool)
        while is_kept.any():
            variance = np.diag(inverse)  # zero by rounding beside a nearly equal term
            is_usable = is_kept & (variance > 0.0)
            excess = np.divide(c**2, variance, out=np.full(len(c), np.inf), where=is_usable) - least
            worst = int(np.argmin(excess))
            if excess[worst] >= 0.0:
                break
            column = inverse[:, worst] / inverse[worst, worst]
            c = c - column * c[worst]
            inverse = inverse - column[:, None] * inverse[worst]
            is_kept[worst] = False
        if is_kept.all():
            return support
        support = np.zeros_like(support)
        support[fit.kept[is_kept]] = True


def added_deviation(information: np.ndarray, support: np.ndarray) -> np.ndarray:
    """Compute the standard error that each absent term would have if it alone were added.

    Returns (n,). NaN within the support; infinite for a linear combination of the supported terms.
    """
    whitened = whiten(information, np.zeros(len(support)))
    fit = make_tableau(whitened, support)
    deviation = np.where(support, np.nan, np.inf)
    deviation[fit.out] = whitened.unit[fit.out] / np.sqrt(np.diag(fit.information))
    return deviation


def mixture_information(information: np.ndarray, largest: np.ndarray) -> np.ndarray:
    """Compute eigenvalues of the scaled Fisher information of all terms, in increasing order.

    They are the information on mixtures of terms, (n,). A mixture of unit length in these units is
    as large as the motion. If its eigenvalue is below one, noise hides it. information: (n, n) of
    the coefficients. largest: (n,) of `problem.largest_coefficients`.
    """
    return np.linalg.eigvalsh(information * largest * largest[:, None])


def n_unidentifiable_directions(information: np.ndarray, largest: np.ndarray) -> int:
    """Count combinations of terms as large as the motion that change the fit less than noise."""
    return int(np.sum(mixture_information(information, largest) < 1.0))
