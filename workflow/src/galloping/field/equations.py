"""Equations that a user knows, written as the command writes them."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from galloping.polynomial import Exponents, PolynomialModel

WHOLE = re.compile(r"d\((.*)\)/dt")
GRAMMAR = "must be such as dq_v=-3.5 q_v - 0.02*dq_v + 0.1 q_v q_w^2"
PART = re.compile(
    r"([+-]?)\s*(\d+\.?\d*(?:[eE][+-]?\d+)?|\.\d+)?\s*\*?\s*((?:[^\W\d][^\s*+-]*[\s*]*)*)"
)


def known_model(
    texts: Sequence[str], states: tuple[str, ...], terms: tuple[Exponents, ...]
) -> tuple[PolynomialModel, tuple[str, ...]]:
    """Equations such as `dq_v=-3.5 q_v - 0.02 dq_v + 0.1 q_v q_w^2`, and the states they are of.

    An equation is named by the state whose derivative it gives. SI units. Raises ValueError where
    one cannot be read or has a term outside the library.
    """
    coefficients = np.zeros((len(states), len(terms)))
    named = []
    for text in texts:
        state, _, right = text.partition("=")
        state = WHOLE.sub(r"\1", state.strip())
        if state not in states or state in named:
            raise ValueError(
                f"known equation {text!r}: must begin with one of {', '.join(states)}, each once"
            )
        named.append(state)
        row = coefficients[states.index(state)]
        place, right = 0, right.strip().replace("**", "^")
        while place < len(right):
            part = PART.match(right, place)
            sign, number, factors = part.groups()
            if part.end() == place or not (number or factors) or (place and not sign):
                raise ValueError(
                    f"known equation {text!r}: cannot be read from {right[place:]!r}; {GRAMMAR}"
                )
            term = _exponents(factors, states, text)
            if term not in terms:
                raise ValueError(
                    f"known equation {text!r}: {factors.strip()} is not in the library; --degree "
                    "says up to which power it goes"
                )
            row[terms.index(term)] += float(f"{sign}{number or 1}")
            place = part.end()
        if not np.all(np.isfinite(row)):
            raise ValueError(f"known equation {text!r}: a coefficient is not finite")
        if not right:
            raise ValueError(f"known equation {text!r}: says nothing of d({state})/dt; {GRAMMAR}")
    return PolynomialModel(states, terms, coefficients), tuple(named)


def _exponents(factors: str, states: tuple[str, ...], text: str) -> Exponents:
    powers = [0] * len(states)
    for factor in factors.replace("*", " ").split():
        name, raised, power = factor.partition("^")
        if name not in states or (raised and not power.isdigit()):
            raise ValueError(
                f"known equation {text!r}: {factor!r} is no power of a state; {GRAMMAR}"
            )
        powers[states.index(name)] += int(power or 1)
    return tuple(powers)
