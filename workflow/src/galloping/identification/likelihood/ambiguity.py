"""What the data leave open: exchangeable, plausible and hidden terms."""

from __future__ import annotations

import numpy as np

from galloping.identification.likelihood.problem import Problem
from galloping.identification.likelihood.selection import (
    added_deviation,
    alternatives,
    plausible_additions,
)
from galloping.polynomial import design_matrix, term_name

AMBIGUOUS = 6.0
PLAUSIBLE_TERM = 14.0
PLAUSIBLE_PAIR = 20.0
TOLERATED_SHARE = 1.0 / 60.0


def open_questions(
    problem: Problem,
    information: np.ndarray,
    right: np.ndarray,
    support: np.ndarray,
    free: np.ndarray,
    penalty: float,
    misfit: float,
    x: np.ndarray,
) -> str:
    """One line on why the terms are not settled by the data, '' where they are.

    They are not where one term can be exchanged for another at a rise of chi^2 below 6; where an
    excluded term, or a pair, improves the fit more than noise is likely to, yet less than
    selection asks; or where an excluded term could make up more than a sixtieth of a state
    derivative without being selected.

    information, right: whitened regression on the candidates about `free`, as in
    `selection.select`. support, free: (n_candidates,). penalty: that of the selection. misfit:
    chi^2 of the fit, which no term can lower by more. x: (n, n_states), states of the recordings.
    """
    pairs = [tuple(int(k) for k in pair) for pair in problem.candidates]
    names = [
        f"{term_name(problem.terms[j], problem.states)} in d{problem.states[i]}/dt"
        for i, j in pairs
    ]
    reasons = [
        f"the data cannot tell {names[found]} from {names[other]} (chi2 {rise:+.1f})"
        for found, other, rise in alternatives(information, right, support, AMBIGUOUS, free)
    ]
    for terms, fall in plausible_additions(
        information, right, support, PLAUSIBLE_TERM, PLAUSIBLE_PAIR
    ):
        if fall < misfit:
            added = " with ".join(names[k] for k in terms)
            reasons.append(
                f"{added} is plausible, below the limit of selection (chi2 {-fall:+.1f})"
            )
    theta = design_matrix(x, problem.terms)
    size = np.sqrt(np.mean(theta**2, axis=0))
    rate = np.sqrt(np.mean((theta @ problem.coefficients(free).T) ** 2, axis=0))
    limit = np.sqrt(penalty) * np.nan_to_num(added_deviation(information, support), posinf=np.inf)
    share = limit * size[problem.candidates[:, 1]] / rate[problem.candidates[:, 0]]
    largest = int(np.nanargmax(share))
    if share[largest] > TOLERATED_SHARE:
        reasons.append(f"{names[largest]} could make up {share[largest]:.1%} of it unseen")
    return "; ".join(reasons)
