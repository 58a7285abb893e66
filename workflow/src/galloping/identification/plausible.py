"""Supports that the data do not rule out, and errors of coefficients over all of them."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import gammaincinv, ndtri

from galloping.identification.problem import Problem
from galloping.identification.selection import Whitened, find_moves, make_tableau

# Rate at which an absent term as large as its detection limit is not selected. It is also the
# weight of plausible supports that may put any coefficient of a model farther off than four
# unconditional errors, divided among the coefficients. Of 314 `ok` models of one-minute recordings,
# 12 then have a coefficient that is farther off, and 20 with the undivided weight for each
# coefficient (seeds 27182 and 31415).
MISS_RATE = 0.01


@dataclass(frozen=True)
class Plausible:
    """Sets of terms (supports) that the data do not rule out, with weights and coefficients.

    The selected support is the first. supports: (n_supports, n) boolean. chi2, weight:
    (n_supports,), the weights of sum one. coefficients, variances: (n_supports, n), zero where
    absent.
    """

    supports: np.ndarray
    chi2: np.ndarray
    weight: np.ndarray
    coefficients: np.ndarray
    variances: np.ndarray


def plausible_supports(whitened: Whitened, support: np.ndarray) -> Plausible:
    """Search for sets of terms, near a selected set, that fit the data almost as well.

    The neighbours of a support (n,) are searched, and those of its best four neighbours. A
    support's weight is exp(-(chi^2 + penalty |support|)/2), as in the averaging of models by an
    information criterion (Burnham and Anderson 2002). The penalty of a term is not that of the
    selection, which would hide every rival with one more term, but the decrease of chi^2 that the
    best of all terms without effect exceeds with probability one tenth: beyond it a term is more
    plausible than not. Measured on 240 fits to random lines (seed 20261122): supports are right as
    often as their weights say; of 35 models whose rivals have a weight of 0.05 to 0.5, 10 have a
    false term, and 7 are expected.
    """
    absent = max(int(np.sum(whitened.is_usable & ~support)), 1)
    penalties = np.full(len(support), 2.0 * gammaincinv(0.5, 0.9 ** (1.0 / absent)))
    most = 150  # supports that are weighed; with 60, 1 % fewer intervals contain the truth
    entries = {support.tobytes(): (-np.inf, support)}
    visited: set[bytes] = set()
    for _ in range(1 + 4):
        unvisited = [(value, key) for key, (value, _) in entries.items() if key not in visited]
        if not unvisited:
            break
        _, key = min(unvisited)
        visited.add(key)
        centre = entries[key][1]
        fit = make_tableau(whitened, centre)
        rises, others = find_moves(fit, centre, penalties, most)
        values = fit.chi2 + penalties[fit.kept].sum() + rises
        for value, other in zip(values, others, strict=True):
            entries.setdefault(other.tobytes(), (value, other))
    ranked = sorted(entries.values(), key=lambda entry: entry[0])
    supports = np.array([other for _, other in ranked[:most]])
    chi2, coefficients, variances = _fit_supports(whitened, supports)
    criterion = chi2 + supports @ penalties
    weight = np.exp(-(criterion - criterion.min()) / 2.0)
    return Plausible(supports, chi2, weight / weight.sum(), coefficients, variances)


def weigh_by_prior(problem: Problem, plausible: Plausible) -> Plausible:
    """Multiply the weights of plausible sets of terms by the prior odds of their terms.

    The prior decides between equal fits, but is no argument against a support of fewer terms than
    the selected one, nor against one of more terms whose chi^2 is lower by 5: an imitation by low
    degrees with another number of terms is no equal fit.
    """
    if problem.prior is None:
        return plausible
    size = plausible.supports.sum(axis=1)
    penalties = plausible.supports @ problem.prior_penalties
    rise = penalties - penalties[0]
    clearly = plausible.chi2 < plausible.chi2[0] - 5.0
    is_no_tie = (size < size[0]) | (size > size[0]) & clearly
    rise = np.where(is_no_tie, np.minimum(rise, 0.0), rise)
    weight = plausible.weight * np.exp(-(rise - rise.min()) / 2.0)
    return replace(plausible, weight=weight / weight.sum())


def _fit_supports(
    whitened: Whitened, supports: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Compute chi^2 (m,), coefficients and variances (m, n), unscaled, of supports (m, n)."""
    chi2 = np.full(len(supports), whitened.target @ whitened.target)
    coefficients, variances = np.zeros((2, *supports.shape))
    sizes = supports.sum(axis=1)
    for size in np.unique(sizes[sizes > 0]):  # supports of one size are fitted in one call
        rows = np.flatnonzero(sizes == size)[:, None]
        term_indices = np.nonzero(supports[rows[:, 0]])[1].reshape(-1, size)
        q, r = np.linalg.qr(np.moveaxis(whitened.columns[:, term_indices], 1, 0))
        inverse = np.linalg.inv(r)
        projection = np.einsum("mij,i->mj", q, whitened.target)
        rest = whitened.target - np.einsum("mij,mj->mi", q, projection)
        chi2[rows[:, 0]] = np.sum(rest**2, axis=1)
        unit = whitened.unit[term_indices]
        coefficients[rows, term_indices] = np.einsum("mij,mj->mi", inverse, projection) * unit
        variances[rows, term_indices] = np.sum(inverse**2, axis=2) * unit**2
    return chi2, coefficients, variances


def unconditional_errors(plausible: Plausible, deviation: np.ndarray) -> np.ndarray:
    """Compute standard errors of coefficients that include doubt about which terms are present.

    Returns (n,). The error of a present term is over all plausible supports; that of an absent term
    over those that have the term, or, if none has, it is the term's `deviation` (n,) if it alone
    were added. An error is the root mean square distance from the selected coefficient. It is
    larger if the distance has a heavy tail: intervals of four errors contain all coefficients of a
    model together, except for a share of MISS_RATE.
    """
    selected = plausible.supports[0]
    distance = np.abs(plausible.coefficients - plausible.coefficients[0])
    weight = plausible.weight[:, None] * (plausible.supports | selected)
    weight = weight / np.maximum(weight.sum(axis=0), np.finfo(float).tiny)
    mean = np.sqrt(np.sum(weight * (plausible.variances + distance**2), axis=0))
    edge = distance + 2.0 * np.sqrt(plausible.variances)
    order = np.argsort(edge, axis=0, kind="stable")
    share = MISS_RATE / max(int(selected.sum()), 1)
    reached = np.cumsum(np.take_along_axis(weight, order, 0), axis=0) >= 1.0 - share
    tail = np.take_along_axis(edge, order, 0)[np.argmax(reached, axis=0), np.arange(len(selected))]
    error = np.maximum(mean, tail / 4.0)
    return np.where(selected, error, np.fmax(error, deviation))


def detection_limits(errors: np.ndarray, support: np.ndarray, penalty: float) -> np.ndarray:
    """Compute the coefficient size from which each absent term would have been selected.

    A term of this size, (n,), is missed at the rate MISS_RATE. errors: unconditional errors, which
    include the estimate of the absent term. NaN for the terms of the support.
    """
    return np.where(support, np.nan, (np.sqrt(penalty) - ndtri(MISS_RATE)) * errors)
