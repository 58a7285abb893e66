"""What the data leave open: other supports that explain them, and what may hide."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtri, gammaincinv, ndtri

from galloping.identification.likelihood.problem import Problem
from galloping.identification.likelihood.selection import Tableau, Whitened, tableau
from galloping.polynomial import term_name

# Rate at which the best of all terms without effect is as plausible as its absence. Measured on 240
# fits to random lines (seed 20261122): with it, supports are right as often as their weights say;
# of models that others outweigh by 0.05 to 0.5, 10 of 35 hold a false term where 7 are expected.
CHANCE = 0.1
# Weight that the plausible supports without one of the terms found may have together: at most one
# in fifty of all models that are `ok` holds a false term. Measured on 982 fits to random lines
# (seed 314159): 11 of 692 hold a false term; with 0.3 it would be 17 of 711.
MOST_RIVAL_WEIGHT = 0.2
# Limit of a term as simple as the simplest of its equation, as a share of that equation, from which
# a model without the term is not `ok`. Measured (seed 777001), the prior always heard: of Lorenz in
# the settings of `trials.published` 140 of 178 models would be `ok` without it, of which 29 lack a
# term or have a false one; with 0.4, 107 and 2, with 0.25, 89 and none. Of a cubic oscillator with
# 40 % noise 5 of 6, all wrong; with 0.4 one, with 0.25 none. Of ten published systems 94 of 97
# sound ones stay, of random lines all 38.
SIZEABLE = 0.25
# Fall of chi^2 from which the prior does not speak against a plausible support of more terms.
# Measured (seed 777001) on 248 fits to random lines and 87 exact models of Lorenz whose every term
# is clear: 3 are `ok` and wrong, 57 are `ok`; were the prior always heard 9 and 74, never 2 and 24.
CLEARLY = 3.0
# Rate at which noise alone raises a doubt about a model that lacks no term, over all terms that
# could be added and over all pairs of them.
FALSE_DOUBT_RATE = 0.001  # with 0.005, 55 of 1,000 models were doubted for it alone, 5 wrong
# Rate at which an absent term of the size of its stated limit would not have been selected.
MISS_RATE = 0.01
# Share of the plausible supports that may put a coefficient beyond four unconditional errors.
TAIL = 0.01
# How many supports are weighed, and of how many beside the selected one all small changes are
# looked at. Measured: with 60 in place of 150, 1 % of the intervals fail that hold with 150.
CHANGES = 150
EXPANDED = 4


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

    @property
    def size(self) -> np.ndarray:
        """(n_supports,) number of terms."""
        return self.supports.sum(axis=1)


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


def with_prior(problem: Problem, plausible: Plausible) -> Plausible:
    """The same supports, weighed by the prior of higher degrees as well.

    It settles ties, but speaks neither against a support of fewer terms than the selected one nor
    against one of more terms whose chi^2 is lower by CLEARLY: what low degrees imitate with another
    number of terms is no tie.
    """
    if problem.prior is None:
        return plausible
    cost, size = plausible.supports @ problem.prior.of_degrees(problem.degrees), plausible.size
    clearly = plausible.chi2 < plausible.chi2[0] - CLEARLY
    is_no_tie = (size < size[0]) | (size > size[0]) & clearly
    dearer = np.where(is_no_tie, np.minimum(cost - cost[0], 0.0), cost - cost[0])
    weight = plausible.weight * np.exp(-(dearer - dearer.min()) / 2.0)
    return replace(plausible, weight=weight / weight.sum())


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


def costs(problem: Problem, penalty: float) -> np.ndarray:
    """(n_candidates,) what each term has to bring, in units of chi^2, to be among those chosen.

    penalty: 2 ln N, what it has to bring while terms are looked for. With a prior that of the
    evidence (see `prior`), without one the penalty.
    """
    if problem.prior is None:
        return np.full(len(problem.candidates), penalty)
    return penalty / 2.0 + problem.prior.of_terms(problem.degrees)


def preferred(whitened: Whitened, support: np.ndarray, cost: np.ndarray) -> np.ndarray:
    """The most probable of the plausible supports about a selected one, (n,); cost: of `costs`.

    A penalty that keeps out what noise makes up of many terms drops weak ones of which there is
    good evidence, and takes one false term for two true ones that it imitates.
    """
    plausible = plausible_supports(whitened, support)
    return plausible.supports[np.argmin(plausible.chi2 + plausible.supports @ cost)]


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


def open_questions(problem: Problem, whitened: Whitened, plausible: Plausible) -> str:
    """One line on why the terms found are not settled, '' where they are.

    They are not where the plausible supports without one of them weigh more than MOST_RIVAL_WEIGHT
    together, or where an absent term, or a pair, improves the fit more than
    noise does but for a rate of FALSE_DOUBT_RATE, yet less than selection asks.
    """
    names = _names(problem)
    reasons = []
    share, rival = _rival(plausible)
    if share > MOST_RIVAL_WEIGHT:
        reasons.append(
            f"the data cannot tell {_difference(names, plausible, rival)}; supports without a "
            f"term found weigh {share:.2g}"
        )
    here = tableau(whitened, plausible.supports[0])
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


def hidden_term(
    problem: Problem, support: np.ndarray, limits: np.ndarray, largest: np.ndarray
) -> str:
    """One line on the term that may be missing though it matters, '' where there is none.

    limits: (n,) of `detection_limits`, the prior counted. largest: (n,) as in `problem.largest`.
    Looked at are terms as simple as the simplest of their equation, or of the first degree: of
    those a reader of the equation would ask why they are not there.
    """
    degrees, equations = problem.degrees, problem.candidates[:, 0]
    simplest = [min(degrees[support & (equations == i)], default=1) for i in equations]
    asked = ~support & (degrees <= np.maximum(simplest, 1))
    share = np.where(asked, limits / np.maximum(largest, np.finfo(float).tiny), 0.0)
    k = int(np.argmax(share))
    if share[k] < SIZEABLE:
        return ""
    much = "all" if share[k] >= 1.0 else f"{100.0 * share[k]:.0f} %"
    return f"{_names(problem)[k]} may be missing: the data would not show {much} of its equation"


def told_by_prior(problem: Problem, plausible: Plausible) -> str:
    """One line on what the data do not tell without the prior, '' where they tell all.

    plausible: weighed by the data alone.
    """
    share, rival = _rival(plausible)
    if problem.prior is None or share <= MOST_RIVAL_WEIGHT:
        return ""
    return (
        f"the data alone cannot tell {_difference(_names(problem), plausible, rival)}; the prior "
        "prefers the terms of lower degree"
    )


def _names(problem: Problem) -> list[str]:
    return [
        f"{term_name(problem.terms[j], problem.names)} in d({problem.states[i]})/dt"
        for i, j in problem.candidates
    ]


def _rival(plausible: Plausible) -> tuple[float, int]:
    """What the supports without one of the terms found weigh together, and the heaviest of them."""
    whole = plausible.supports[:, plausible.supports[0]].all(axis=1)
    lacking = np.where(whole, 0.0, plausible.weight)
    return float(lacking.sum()), int(np.argmax(lacking))


def _difference(names: list[str], plausible: Plausible, rival: int) -> str:
    support, other = plausible.supports[0], plausible.supports[rival]
    gone = " with ".join(names[k] for k in np.flatnonzero(support & ~other))
    instead = " with ".join(names[k] for k in np.flatnonzero(other & ~support)) or "nothing"
    return f"{gone} from {instead} (chi2 {plausible.chi2[rival] - plausible.chi2[0]:+.1f})"
