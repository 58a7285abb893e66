"""Polynomial models that depend on one parameter, with the derivatives continuation needs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np

from galloping.polynomial import Exponents, PolynomialModel, design_matrix

DIFFERENCE = 1e-5  # of the parameter's scale: central differences are good to about 1e-10


@dataclass(frozen=True)
class Family:
    """Models along a parameter: dx/dt = C(parameter) theta(x) on one library.

    model: from a value of the parameter to the model; its states and terms must not change.
    parameter, unit: what varies, for reports.
    """

    model: Callable[[float], PolynomialModel]
    parameter: str = "parameter"
    unit: str = ""


class VectorField:
    """f(x, p) of a family with its derivatives, for many states at once.

    Raises ValueError where the models of the family differ in states or terms.
    """

    def __init__(self, family: Family, value: float) -> None:
        self.family = family
        first = family.model(value)
        self.states, self.terms = first.states, first.terms
        self.n_states = len(self.states)
        self.shape = (self.n_states, len(self.terms))
        self._monomials, self._place, self._derivatives = _derivative_tables(self.terms)

    def coefficients(self, value: float) -> np.ndarray:
        """(n_states, n_terms) at a value of the parameter."""
        model = self.family.model(value)
        if model.states != self.states or model.terms != self.terms:
            raise ValueError(
                f"family over {self.family.parameter}: states or terms change at {value:g}; "
                "all models must be written in one library"
            )
        return model.coefficients

    def slope(self, value: float, scale: float) -> np.ndarray:
        """dC/dp (n_states, n_terms) by central differences, `scale` being the parameter's size."""
        step = DIFFERENCE * scale
        return (self.coefficients(value + step) - self.coefficients(value - step)) / (2 * step)

    def __call__(
        self, x: np.ndarray, coefficients: np.ndarray, slope: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """f, df/dx and df/dp: (n, n_states), (n, n_states, n_states), (n, n_states).

        x: (n, n_states). coefficients, slope: (n_states, n_terms).
        """
        theta = design_matrix(x, self._monomials)
        own = theta[:, self._place]
        jacobian = theta @ np.tensordot(coefficients, self._derivatives, 1).reshape(
            -1, len(self._monomials)
        ).T  # fmt: skip
        return (
            own @ coefficients.T,
            jacobian.reshape(len(x), self.n_states, self.n_states),
            own @ slope.T,
        )


@cache
def _derivative_tables(
    terms: tuple[Exponents, ...],
) -> tuple[tuple[Exponents, ...], np.ndarray, np.ndarray]:
    """Monomials closed under differentiation, the terms' places, and d term_j / d x_k.

    The last is (n_terms, n_states, n_monomials): the factor of each monomial in the derivative.
    """
    closed, queue = set(), list(terms)
    while queue:
        term = queue.pop()
        if term not in closed:
            closed.add(term)
            queue += [_lower(term, k) for k, e in enumerate(term) if e]
    monomials = tuple(sorted(closed, key=lambda term: (sum(term), term)))
    index = {term: m for m, term in enumerate(monomials)}
    derivatives = np.zeros((len(terms), len(terms[0]), len(monomials)))
    for j, term in enumerate(terms):
        for k, e in enumerate(term):
            if e:
                derivatives[j, k, index[_lower(term, k)]] = e
    return monomials, np.array([index[term] for term in terms]), derivatives


def _lower(term: Exponents, state: int) -> Exponents:
    return tuple(e - (k == state) for k, e in enumerate(term))
