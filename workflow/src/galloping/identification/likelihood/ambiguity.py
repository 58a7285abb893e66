"""What the data leave open: other supports that explain them, and what may hide."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri, gammaincinv, ndtri

from galloping.identification.likelihood.constants import (
    CHANCE,
    CHANGES,
    EXPANDED,
    FALSE_DOUBT_RATE,
    MISS_RATE,
    TAIL,
)
from galloping.identification.likelihood.problem import Problem
from galloping.identification.likelihood.selection import Tableau, Whitened, tableau
from galloping.polynomial import term_name


@dataclass(frozen=True)
class Plausible:
    """Supports that the data do not rule out, the selected one first, each at its best.

    supports: (n_supports, n) boolean. chi2, weight: (n_supports,), the weights of sum one.
    coefficients, variances: (n_supports, n), zero where absent.
    """

    supports: np.ndarray
    chi2: np.ndarray
    weight: np.ndarray
    coefficients: np.ndarray
    variances: np.ndarray


def price(n: int) -> float:
    """chi^2 that the best of n terms without effect brings at a rate of CHANCE.

    What a term must bring to be more plausible than not, where selection asks for near certainty.
    """
    return float(2.0 * gammaincinv(0.5, (1.0 - CHANCE) ** (1.0 / max(n, 1))))


def plausible_supports(whitened: Whitened, support: np.ndarray) -> Plausible:
    """The neighbours of a support (n,), and those of its best neighbours.

    A support's weight is exp(-(chi^2 + price |support|)/2), as in the averaging of models by an
    information criterion (Burnham and Anderson 2002), with `price` for the penalty: that of the
    selection would hide every rival that has one more term.
    """
    cost = price(int(np.sum(whitened.usable & ~support)))
    known = {support.tobytes(): (-np.inf, support)}
    visited: set[bytes] = set()
    for _ in range(1 + EXPANDED):
        ranked = sorted(known.items(), key=lambda item: item[1][0])
        fresh = [(key, other) for key, (_, other) in ranked if key not in visited]
        if not fresh:
            break
        key, here = fresh[0]
        visited.add(key)
        for value, other in zip(*_changes(tableau(whitened, here), here, cost), strict=True):
            known.setdefault(other.tobytes(), (value, other))
    ranked = sorted(known.values(), key=lambda entry: entry[0])
    supports = np.array([other for _, other in ranked[:CHANGES]])
    chi2, coefficients, variances = _fits(whitened, supports)
    criterion = chi2 + cost * supports.sum(axis=1)
    weight = np.exp(-(criterion - criterion.min()) / 2.0)
    return Plausible(supports, chi2, weight / weight.sum(), coefficients, variances)


def _changes(here: Tableau, support: np.ndarray, cost: float) -> tuple[np.ndarray, np.ndarray]:
    """The best small changes: chi^2 plus the cost of every term, (m,), and the supports, (m, n)."""
    kept, out, nothing = here.kept, here.out, np.array([-1])
    i, j = np.triu_indices(len(out), 1)
    several = [
        (here.wald - cost, kept, nothing, nothing),
        (cost - here.additions(), nothing, out, nothing),
        (2.0 * cost - here.pairs()[i, j], nothing, out[i], out[j]),
        (here.exchanges(), kept[:, None], out, nothing),
        (here.exchanges_for_two()[:, i, j] + cost, kept[:, None], out[i], out[j]),
    ]
    rows = [np.stack([x.ravel() for x in np.broadcast_arrays(*change)]) for change in several]
    rise, *terms = np.concatenate(rows, axis=1)
    best = np.argsort(rise)[:CHANGES]
    others = np.zeros((len(best), len(support) + 1), bool)  # the last column takes `nothing`
    others[:, :-1] = support
    leaving, first, second = np.array(terms)[:, best].astype(int)
    row = np.arange(len(best))
    others[row, leaving] = False
    others[row, first] = others[row, second] = True
    return here.chi2 + cost * len(kept) + rise[best], others[:, :-1]


def _fits(whitened: Whitened, supports: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """chi^2 (m,), and coefficients and variances (m, n) in the original units; supports: (m, n)."""
    chi2 = np.full(len(supports), whitened.target @ whitened.target)
    coefficients, variances = np.zeros((2, *supports.shape))
    sizes = supports.sum(axis=1)
    for size in np.unique(sizes[sizes > 0]):  # those of one size in one call
        rows = np.flatnonzero(sizes == size)[:, None]
        kept = np.nonzero(supports[rows[:, 0]])[1].reshape(-1, size)
        q, r = np.linalg.qr(np.moveaxis(whitened.columns[:, kept], 1, 0))
        inverse = np.linalg.inv(r)
        along = np.einsum("mij,i->mj", q, whitened.target)
        rest = whitened.target - np.einsum("mij,mj->mi", q, along)
        chi2[rows[:, 0]] = np.sum(rest**2, axis=1)
        unit = whitened.unit[kept]
        coefficients[rows, kept] = np.einsum("mij,mj->mi", inverse, along) * unit
        variances[rows, kept] = np.sum(inverse**2, axis=2) * unit**2
    return chi2, coefficients, variances


def preferred(whitened: Whitened, support: np.ndarray, penalty: float) -> np.ndarray:
    """The support (n,) that the data prefer to a selected one, or that one itself.

    A penalty for each term keeps out what noise makes up, but between supports of which none
    contains the other it takes one false term for two true ones that it imitates. Where those
    without one of the selected terms outweigh all others, the heaviest of them is preferred, if
    it outweighs the selected one too and each of its terms is worth the penalty.
    """
    plausible = plausible_supports(whitened, support)
    weight = np.where(plausible.supports[:, support].all(axis=1), 0.0, plausible.weight)
    if weight.sum() < 0.5 or weight.max() <= plausible.weight[0]:
        return support
    rival = plausible.supports[np.argmax(weight)]
    return rival if tableau(whitened, rival).wald.min(initial=np.inf) >= penalty else support


def unconditional_errors(plausible: Plausible, deviation: np.ndarray) -> np.ndarray:
    """(n,) standard error of each coefficient about the selected one, the support not trusted.

    Of a term found: over all plausible supports. Of an absent one: over those that have it, or,
    where none has, its `deviation` (n,) were it alone added. It is the root mean square distance,
    or more where the distance has a heavy tail: four of it hold all but a share of TAIL.
    """
    selected = plausible.supports[0]
    distance = np.abs(plausible.coefficients - plausible.coefficients[0])
    weight = plausible.weight[:, None] * (plausible.supports | selected)
    weight = weight / np.maximum(weight.sum(axis=0), np.finfo(float).tiny)
    mean = np.sqrt(np.sum(weight * (plausible.variances + distance**2), axis=0))
    edge = distance + 2.0 * np.sqrt(plausible.variances)
    order = np.argsort(edge, axis=0, kind="stable")
    reached = np.cumsum(np.take_along_axis(weight, order, 0), axis=0) >= 1.0 - TAIL
    tail = np.take_along_axis(edge, order, 0)[np.argmax(reached, axis=0), np.arange(len(selected))]
    error = np.maximum(mean, tail / 4.0)
    return np.where(selected, error, np.fmax(error, deviation))


def detection_limits(errors: np.ndarray, support: np.ndarray, penalty: float) -> np.ndarray:
    """(n,) size that an absent term would have been selected from, but for a rate of MISS_RATE.

    errors: unconditional ones, which hold what is estimated of the absent term. NaN for the
    terms of the support.
    """
    return np.where(support, np.nan, (np.sqrt(penalty) - ndtri(MISS_RATE)) * errors)


def open_questions(
    problem: Problem, whitened: Whitened, plausible: Plausible, most_rival_weight: float
) -> str:
    """One line on why the terms found are not settled by the data, '' where they are.

    They are not where the plausible supports without one of them weigh more than that together,
    or where an absent term, or a pair, improves the fit more than noise does but for a rate of
    FALSE_DOUBT_RATE, yet less than selection asks.
    """
    names = [
        f"{term_name(problem.terms[j], problem.states)} in d{problem.states[i]}/dt"
        for i, j in problem.candidates
    ]
    support = plausible.supports[0]
    reasons = []
    lacking = ~plausible.supports[:, support].all(axis=1)
    share = float(plausible.weight[lacking].sum())
    if share > most_rival_weight:
        rival = np.flatnonzero(lacking)[np.argmax(plausible.weight[lacking])]
        other = plausible.supports[rival]
        gone = " with ".join(names[k] for k in np.flatnonzero(support & ~other))
        instead = " with ".join(names[k] for k in np.flatnonzero(other & ~support)) or "nothing"
        rise = plausible.chi2[rival] - plausible.chi2[0]
        reasons.append(
            f"the data cannot tell {gone} from {instead} (chi2 {rise:+.1f}); supports without a "
            f"term found weigh {share:.2g}"
        )
    here = tableau(whitened, support)
    n = len(here.out)
    for size, falls in ((1, here.additions()), (2, here.pairs())):
        several = n if size == 1 else n * (n - 1) / 2
        if several and falls.max() > chdtri(size, FALSE_DOUBT_RATE / several):
            places = np.unravel_index(np.argmax(falls), falls.shape)
            added = " with ".join(names[here.out[k]] for k in places)
            reasons.append(
                f"{added} is plausible, below the limit of selection (chi2 {-falls.max():+.1f})"
            )
    return "; ".join(reasons)
