"""Polynomial models that depend on one parameter, with the derivatives continuation needs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from galloping.polynomial import PolynomialModel, design_matrix

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
        model = PolynomialModel(self.states, self.terms, coefficients)
        return model(x), model.jacobian(x), design_matrix(x, self.terms) @ slope.T
