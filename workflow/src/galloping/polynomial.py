"""Polynomial first-order systems dx/dt = C theta(x): the form every model in this project has."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import chain, combinations_with_replacement
from math import floor, isfinite, log10
from numbers import Integral

import numpy as np
from numpy.typing import ArrayLike, NDArray

from galloping.immutable import Immutable

Exponents = tuple[int, ...]


def library(n_states: int, degree: int) -> tuple[Exponents, ...]:
    """Exponents of all monomials up to `degree`, in the order of pysindy's PolynomialLibrary.

    Raises ValueError where `n_states` is no whole number >= 1 or `degree` none >= 0.
    """
    for name, value, least in (("n_states", n_states, 1), ("degree", degree, 0)):
        if not isinstance(value, Integral) or value < least:
            raise ValueError(f"{name}: {value!r:.60}; must be a whole number >= {least}")
    indices = chain.from_iterable(
        combinations_with_replacement(range(n_states), d) for d in range(degree + 1)
    )
    return tuple(tuple(index.count(k) for k in range(n_states)) for index in indices)


def extended(terms: tuple[Exponents, ...], model: PolynomialModel) -> tuple[Exponents, ...]:
    """The library `terms`, followed by the terms present in `model` that it lacks."""
    present = (t for t, used in zip(model.terms, model.support.any(axis=0), strict=True) if used)
    return tuple(dict.fromkeys([*terms, *present]))


def velocity_pairs(states: tuple[str, ...]) -> dict[int, int]:
    """Index of each state X whose derivative is a state too, named `dX`, with that of dX."""
    index = {name: i for i, name in enumerate(states)}
    return {i: index[f"d{name}"] for i, name in enumerate(states) if f"d{name}" in index}


def term_name(exponents: Exponents, states: tuple[str, ...]) -> str:
    """Name of a monomial as pysindy prints it: `1`, `q_v`, `q_v q_w^2`."""
    factors = [f"{s}^{e}" if e > 1 else s for s, e in zip(states, exponents, strict=True) if e]
    return " ".join(factors) or "1"


def design_matrix(x: np.ndarray, terms: tuple[Exponents, ...]) -> np.ndarray:
    """Monomials `terms` at the states `x`.

    x: (n, n_states). Returns (n, n_terms). Each monomial costs one product, of a state with
    a monomial of one degree less where that one is in the library.
    """
    theta = np.empty((len(x), len(terms)), order="F")
    column = {term: j for j, term in enumerate(terms)}
    for j, term in enumerate(terms):
        last = max((k for k, e in enumerate(term) if e), default=None)
        if last is None:
            theta[:, j] = 1.0
            continue
        lower = tuple(e - (k == last) for k, e in enumerate(term))
        if not any(lower):
            theta[:, j] = x[:, last]
        elif column.get(lower, j) < j:
            np.multiply(theta[:, column[lower]], x[:, last], out=theta[:, j])
        else:
            theta[:, j] = np.prod(x ** np.asarray(term), axis=1)
    return theta


@dataclass(frozen=True, eq=False, repr=False)
class PolynomialModel(Immutable):
    """dx/dt = coefficients @ theta(x).

    states: names of the n_states states. terms: exponents of the n_terms monomials.
    coefficients: (n_states, n_terms), SI units. Raises ValueError where they have another shape.
    """

    states: tuple[str, ...]
    terms: tuple[Exponents, ...]
    coefficients: NDArray[np.float64]

    def __post_init__(self) -> None:
        object.__setattr__(self, "states", tuple(self.states))
        object.__setattr__(self, "terms", tuple(map(tuple, self.terms)))
        object.__setattr__(self, "coefficients", np.asarray(self.coefficients, float))
        super().__post_init__()
        if self.coefficients.shape != (len(self.states), len(self.terms)):
            raise ValueError(
                f"coefficients: shape {self.coefficients.shape}, expected "
                f"({len(self.states)}, {len(self.terms)})"
            )

    def __repr__(self) -> str:
        about = f"PolynomialModel of {', '.join(self.states)}, {len(self.terms)} candidate terms"
        return "\n".join([about, *self.equations()])

    def equations(self, standard_errors: ArrayLike | None = None) -> tuple[str, ...]:
        """The equation of each state as text.

        standard_errors: (n_states, n_terms), printed beside the coefficients where finite.
        """
        errors = np.nan if standard_errors is None else standard_errors
        errors = np.broadcast_to(errors, self.coefficients.shape)
        names, lines = self.term_names, []
        for state, row, own in zip(self.states, self.coefficients, errors, strict=True):
            parts = [
                f"{with_error(row[j], own[j])} {names[j]}".removesuffix(" 1")
                for j in np.flatnonzero(row)
            ]
            lines.append(f"d({state})/dt = {' + '.join(parts) or '0'}")
        return tuple(lines)

    @property
    def support(self) -> NDArray[np.bool_]:
        """(n_states, n_terms) boolean: which terms are present."""
        return self.coefficients != 0

    @property
    def term_names(self) -> tuple[str, ...]:
        return tuple(term_name(term, self.states) for term in self.terms)

    def __call__(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """State derivatives at `x`: (n, n_states) -> (n, n_states)."""
        return design_matrix(x, self.terms) @ self.coefficients.T

    def jacobian(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """How they depend on the states: (n, n_states) -> (n, n_states, n_states)."""
        exponents = np.array(self.terms)
        lower = [np.maximum(exponents - one, 0) for one in np.eye(len(self.states), dtype=int)]
        slopes = [
            design_matrix(x, tuple(map(tuple, terms.tolist()))) @ (self.coefficients * e).T
            for terms, e in zip(lower, exponents.T, strict=True)
        ]
        return np.stack(slopes, axis=2)

    def on_library(self, terms: tuple[Exponents, ...]) -> PolynomialModel:
        """The same model written in another library.

        Raises ValueError where a term with a non-zero coefficient is missing from `terms`.
        """
        index = {term: j for j, term in enumerate(terms)}
        coefficients = np.zeros((len(self.states), len(terms)))
        for j, term in enumerate(self.terms):
            if term in index:
                coefficients[:, index[term]] = self.coefficients[:, j]
            elif np.any(self.coefficients[:, j]):
                raise ValueError(f"term {term_name(term, self.states)} is not in the library")
        return PolynomialModel(self.states, terms, coefficients)


def with_error(value: float, error: float = np.nan) -> str:
    """A coefficient with its standard error to two digits, where it has one."""
    if not (isfinite(error) and error > 0.0):
        return f"{value:.6g}"
    decimals = 1 - floor(log10(error))
    if not 0 <= decimals <= 9:
        return f"({value:.6g} ± {error:.2g})"
    return f"({value:.{decimals}f} ± {error:.{decimals}f})"
