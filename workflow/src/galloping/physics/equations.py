"""The galloping equations: which terms they have, and what the paper calls their coefficients."""

from collections.abc import Mapping

import numpy as np

from galloping.polynomial import PolynomialModel, term_name

STATES = ("q_v", "q_w", "dq_v", "dq_w")

# symbol -> (row of the state derivative, exponents of q_v, q_w, dq_v, dq_w)
TERMS = {
    "gamma_1": (2, (0, 0, 1, 0)),
    "gamma_2": (2, (1, 0, 0, 0)),
    "gamma_3": (2, (2, 0, 0, 0)),
    "gamma_4": (2, (0, 2, 0, 0)),
    "gamma_5": (2, (0, 0, 2, 0)),
    "gamma_6": (2, (0, 0, 3, 0)),
    "gamma_7": (2, (3, 0, 0, 0)),
    "gamma_8": (2, (1, 2, 0, 0)),
    "kappa_1": (3, (0, 0, 0, 1)),
    "kappa_2": (3, (0, 1, 0, 0)),
    "kappa_3": (3, (1, 1, 0, 0)),
    "kappa_4": (3, (2, 1, 0, 0)),
    "kappa_5": (3, (0, 3, 0, 0)),
    "kappa_6": (3, (0, 0, 2, 0)),
    "kappa_7": (3, (0, 0, 1, 0)),
    "kappa_8": (3, (1, 0, 0, 0)),
    "kappa_9": (3, (0, 0, 3, 0)),
    "kappa_10": (3, (1, 2, 0, 0)),
}
EQUATIONS = {2: "vertical", 3: "horizontal"}


def model(values: Mapping[str, float]) -> PolynomialModel:
    """The galloping equations with the left-hand-side coefficients `values`.

    Raises ValueError for a symbol that the derivation does not produce.
    """
    unknown = sorted(set(values) - set(TERMS))
    if unknown:
        raise ValueError(
            f"{unknown[0]}: the derivation has no such term; it has {', '.join(TERMS)}"
        )
    present = {symbol: value for symbol, value in values.items() if value != 0}
    kinematic = ((0, 0, 1, 0), (0, 0, 0, 1))
    terms = tuple(dict.fromkeys([*kinematic, *(TERMS[symbol][1] for symbol in present)]))
    matrix = np.zeros((len(STATES), len(terms)))
    for row, term in enumerate(kinematic):
        matrix[row, terms.index(term)] = 1.0
    for symbol, value in present.items():
        row, term = TERMS[symbol]
        matrix[row, terms.index(term)] = -value
    return PolynomialModel(STATES, terms, matrix)


def symbol_of(row: int, exponents: tuple[int, ...]) -> str:
    """gamma_i or kappa_i of a term, or its name where the paper has no symbol for it."""
    for symbol, place in TERMS.items():
        if place == (row, exponents):
            return symbol
    return term_name(exponents, STATES)
