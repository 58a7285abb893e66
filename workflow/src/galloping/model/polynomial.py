"""First-order systems dx/dt = C theta(x, u): the form of every model in this project.

States x; inputs u, known functions of time, where a model has any. Terms are monomials of both, and
may have elementary functions of states as further factors (see `functions`).
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import chain, combinations_with_replacement, compress
from math import floor, isfinite, log10, prod
from numbers import Integral, Real
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from galloping.arrays import Immutable, Matrix, as_floats
from galloping.model.functions import FUNCTIONS, Function, differentiate_term, n_exponents
from galloping.model.modes import Modes

# Exponents of the states and then of the inputs (int), then the functions that multiply them
# (Function). No type of a tuple can express the two lengths.
Exponents: TypeAlias = tuple[Any, ...]
# equation and term of a coefficient, and its lower and upper bound
Bound: TypeAlias = tuple[int, Exponents, float, float]


def polynomial_library(n_states: int, degree: int) -> tuple[Exponents, ...]:
    """Return the exponents of all monomials up to a degree, in the order of pysindy.

    Parameters
    ----------
    n_states : int
        Number of states, and of inputs if there are any.
    degree : int

    Returns
    -------
    tuple of Exponents
        For each monomial the exponents of the states.

    Raises
    ------
    ValueError
        If `n_states` is not a whole number >= 1, or `degree` is not a whole number >= 0.
    """
    for name, value, least in (("n_states", n_states, 1), ("degree", degree, 0)):
        if not isinstance(value, Integral) or value < least:
            raise ValueError(f"{name}: {value!r:.60}; must be a whole number >= {least}")
    indices = chain.from_iterable(
        combinations_with_replacement(range(n_states), d) for d in range(degree + 1)
    )
    return tuple(tuple(index.count(k) for k in range(n_states)) for index in indices)


def linear_term(k: int, count: int) -> Exponents:
    """Return the exponents of the linear term in the k-th of `count` variables."""
    return tuple(int(i == k) for i in range(count))


def extend_library(terms: tuple[Exponents, ...], model: PolynomialModel) -> tuple[Exponents, ...]:
    """Append to a library of terms those terms of a model that the library lacks."""
    present = (t for t, used in zip(model.terms, model.has_term, strict=True) if used)
    return tuple(dict.fromkeys([*terms, *present]))


def velocity_pairs(states: tuple[str, ...]) -> dict[int, int]:
    """Map the index of each displacement X to the index of its velocity dX among the states."""
    index = {name: i for i, name in enumerate(states)}
    return {i: index[f"d{name}"] for i, name in enumerate(states) if f"d{name}" in index}


def exponent_matrix(terms: Sequence[Exponents], count: int) -> NDArray[np.int64]:
    """Return the exponents of terms, without their functions, as a matrix (n_terms, count)."""
    return np.array([term[:count] for term in terms], np.int64).reshape(-1, count)


def has_functions(term: Exponents) -> bool:
    """Decide whether a term contains a function, such as sin(q), besides powers."""
    return bool(term) and isinstance(term[-1], Function)


def term_name(exponents: Exponents, names: Sequence[str]) -> str:
    """Format a term as text, such as `q_v q_w^2` or `dq_v^3/U`.

    names: of the states and, if exponents are of inputs too, of those.
    """
    functions = Counter(exponents[len(names) :])
    powers = [(f.text(names), e) for f, e in functions.items() if f.name != "inverse"]
    powers += zip(names, exponents, strict=False)
    divisors = [(s, -e) for s, e in powers if e < 0]
    for f, e in functions.items():
        if f.name == "inverse":
            argument = f.argument_text(names)
            divisors.append((argument if f.state is not None else f"({argument})", e))
    factors = [f"{s}^{e}" if e > 1 else s for s, e in powers if e > 0]
    divided = "".join(f"/{s}^{e}" if e > 1 else f"/{s}" for s, e in divisors)
    return (" ".join(factors) or "1") + divided


def latex_factors(term: Exponents, names: Sequence[str], number: Callable[[str], str]) -> list[str]:
    """Format each factor of a term as LaTeX, given the names of states and inputs.

    names: of states and inputs, as LaTeX. number: converts a printed number to LaTeX.
    """
    powers = [(name, power) for name, power in zip(names, term, strict=False) if power]
    for function, power in Counter(term[len(names) :]).items():
        argument = function.argument_text(names, lambda value: number(f"{value:.6g}"))
        factor = FUNCTIONS[function.name].latex.format(argument)
        powers.append((factor if power == 1 else rf"\left({factor}\right)", power))
    return [factor if power == 1 else f"{factor}^{{{power}}}" for factor, power in powers]


def design_matrix(x: np.ndarray, terms: tuple[Exponents, ...]) -> np.ndarray:
    """Evaluate candidate terms at given states, as a matrix with one column per term.

    x: (n, n_states), or of states and inputs, whose exponents may be negative. Returns (n,
    n_terms). Each monomial needs one product, of a state with a monomial of one degree less if that
    is in the library.
    """
    functions, terms = split_functions(terms)
    if functions:
        x = np.column_stack([x, *(own(x) for own in functions)])
    theta = np.empty((len(x), len(terms)), order="F")
    for j, (last, lower) in enumerate(factor_monomials(terms)):
        if last is None:
            theta[:, j] = 1.0
        elif lower is None:
            theta[:, j] = np.prod(x ** np.array(terms[j], float), axis=1)
        elif lower < 0:
            theta[:, j] = x[:, last]
        else:
            np.multiply(theta[:, lower], x[:, last], out=theta[:, j])
    return theta


@cache
def split_functions(
    terms: tuple[Exponents, ...],
) -> tuple[tuple[Function, ...], tuple[tuple[int, ...], ...]]:
    """List the functions in terms, and convert terms to exponents that include these functions.

    The exponents of the functions come last.
    """
    functions = tuple(
        sorted({function for term in terms for function in term if isinstance(function, Function)})
    )
    if not functions:
        return (), terms
    count = n_exponents(terms[0])
    return functions, tuple(
        (*term[:count], *(term[count:].count(function) for function in functions)) for term in terms
    )


@cache
def factor_monomials(terms: tuple[Exponents, ...]) -> tuple[tuple[int | None, int | None], ...]:
    """Split each monomial into its last variable and the index of the monomial that remains.

    Returns pairs of the variable and the index of that monomial: -1 if it is a constant, None if it
    is not an earlier one of `terms`.
    """
    column = {term: j for j, term in enumerate(terms)}
    factors: list[tuple[int | None, int | None]] = []
    for j, term in enumerate(terms):
        last = max((k for k, e in enumerate(term) if e), default=None)
        lower = tuple(e - (k == last) for k, e in enumerate(term))
        index = -1 if last is not None and not any(lower) else column.get(lower, j)
        factors.append((last, index if index < j and min(term) >= 0 else None))
    return tuple(factors)


@cache
def differentiate_terms(terms: tuple[Exponents, ...], n_states: int) -> tuple[tuple, ...]:
    """Differentiate each term by each state; return the derivatives as numbers times terms.

    By state: indices of the terms that have a derivative, the numbers, and the terms of the
    derivatives. That of a power is its exponent times the power divided by the state; a term with
    functions may have several, one after the other.
    """
    by_state = []
    for k in range(n_states):
        rows = [(j, *part) for j, term in enumerate(terms) for part in differentiate_term(term, k)]
        columns, factors, lower = zip(*rows, strict=True) if rows else ((), (), ())
        by_state.append((np.array(columns, int), np.array(factors), lower))
    return tuple(by_state)


@dataclass(frozen=True, eq=False, repr=False)
class PolynomialModel(Immutable):
    """Model dx/dt = C theta(x, u) with states x, inputs u, terms theta and coefficients C.

    Models are immutable; those with equal contents are equal, and have the same hash.

    Parameters
    ----------
    states : tuple of str
        Names of the n_states states.
    terms : tuple of Exponents
        Exponents of each of the n_terms terms, in the states and then in the inputs, and its
        functions.
    coefficients : (n_states, n_terms) array
        In SI units.
    inputs : tuple of str
        Names of the n_inputs inputs.

    Raises
    ------
    ValueError
        If the shapes do not match, a name or a term occurs twice, or an exponent is not whole or,
        of a state, negative.
    """

    states: tuple[str, ...]
    terms: tuple[Exponents, ...]
    coefficients: NDArray[np.float64]
    inputs: tuple[str, ...] = ()

    if TYPE_CHECKING:  # arguments may be lists, which attributes are not

        def __init__(
            self,
            states: Sequence[str],
            terms: Sequence[Sequence[int | Function]],
            coefficients: Matrix,
            inputs: Sequence[str] = ...,
        ) -> None: ...

    def __post_init__(self) -> None:
        object.__setattr__(self, "states", tuple(self.states))
        object.__setattr__(self, "inputs", tuple(self.inputs))
        object.__setattr__(self, "terms", tuple(map(tuple, self.terms)))
        object.__setattr__(self, "coefficients", np.asarray(self.coefficients, float))
        super().__post_init__()
        if self.coefficients.shape != (len(self.states), len(self.terms)):
            raise ValueError(
                f"coefficients: shape {self.coefficients.shape}, expected "
                f"({len(self.states)}, {len(self.terms)})"
            )
        _check_terms(self.terms, self.states, self.inputs)

    def __repr__(self) -> str:
        driven = f" driven by {', '.join(self.inputs)}" if self.inputs else ""
        kind = f"PolynomialModel of {', '.join(self.states)}{driven}"
        return "\n".join([f"{kind}, {len(self.terms)} candidate terms", *self.equations()])

    def equations(self, standard_errors: ArrayLike | None = None) -> tuple[str, ...]:
        """Return the equation of each state as text.

        standard_errors: (n_states, n_terms), printed after the coefficients where finite.
        """
        errors = np.nan if standard_errors is None else standard_errors
        errors = np.broadcast_to(errors, self.coefficients.shape)
        names, lines = self.term_names, []
        for state, row, state_errors in zip(self.states, self.coefficients, errors, strict=True):
            parts = [
                f"{with_error(row[j], state_errors[j])} {names[j]}".removesuffix(" 1")
                for j in np.flatnonzero(row)
            ]
            lines.append(f"d({state})/dt = {' + '.join(parts) or '0'}")
        return tuple(lines)

    def latex(self, standard_errors: ArrayLike | None = None) -> str:
        """Return the equations as LaTeX text for amsmath.

        A velocity dX is written as X with a dot. standard_errors: as of `equations`.
        """
        errors = np.nan if standard_errors is None else standard_errors
        errors = np.broadcast_to(errors, self.coefficients.shape)
        lines, states = [], [_name_to_latex(state, self.states) for state in self.states]
        names = [*states, *(_name_to_latex(name, ()) for name in self.inputs)]
        for name, row, state_errors in zip(states, self.coefficients, errors, strict=True):
            parts = []
            for j in np.flatnonzero(row):
                number = _power_of_ten(with_error(row[j], state_errors[j]).replace("±", r"\pm"))
                factors = latex_factors(self.terms[j], names, _power_of_ten)
                parts.append(r" \, ".join([number, *factors]))
            right = " + ".join(parts) or "0"
            lines.append(rf"\frac{{\mathrm{{d}} {name}}}{{\mathrm{{d}} t}} &= {right}")
        body = " \\\\\n".join(lines)
        return f"\\begin{{aligned}}\n{body}\n\\end{{aligned}}"

    def _repr_latex_(self) -> str:
        """Format the equations for notebooks."""
        return f"$$\n{self.latex()}\n$$"

    @property
    def support(self) -> NDArray[np.bool_]:
        """Whether each term is present in each equation, (n_states, n_terms)."""
        return np.not_equal(self.coefficients, 0.0)

    @property
    def has_term(self) -> NDArray[np.bool_]:
        """Whether each term is present in any equation, (n_terms,)."""
        return np.logical_or.reduce(self.support, axis=0)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the states and then of the inputs, in the order of a term's exponents."""
        return self.states + self.inputs

    @property
    def term_names(self) -> tuple[str, ...]:
        """Names of the terms, (n_terms,), such as `q_v q_w^2`."""
        return tuple(term_name(term, self.names) for term in self.terms)

    def __call__(
        self, x: NDArray[np.float64], u: NDArray[np.float64] | None = None
    ) -> NDArray[np.float64]:
        """Evaluate the state derivatives at `x`: (n, n_states) -> (n, n_states).

        u: (n, n_inputs) of a model with inputs. Raises ValueError for arrays of another form.
        """
        return design_matrix(self._join(x, u), self.terms) @ self.coefficients.T

    def _join(self, x: NDArray[np.float64], u: NDArray[np.float64] | None) -> NDArray[np.float64]:
        """Concatenate the columns of states and inputs, (n, n_states + n_inputs)."""
        x = as_floats("x", x, (None, len(self.states)))
        if u is None:
            if self.inputs:
                driven = ", ".join(self.inputs)
                raise ValueError(f"u: not there; the model is driven by {driven}")
            return x
        return join_inputs(x, as_floats("u", u, (len(x), len(self.inputs))))

    def jacobian(
        self, x: NDArray[np.float64], u: NDArray[np.float64] | None = None
    ) -> NDArray[np.float64]:
        """Compute the Jacobian of the right-hand side by the states at each of n states.

        x: (n, n_states). u: (n, n_inputs). Returns (n, n_states, n_states). Raises ValueError for
        arrays of another form.
        """
        both = self._join(x, u)
        by_state = [
            design_matrix(both, lower) @ (self.coefficients[:, columns] * factors).T
            for columns, factors, lower in differentiate_terms(self.terms, len(self.states))
        ]
        return np.stack(by_state, axis=2)

    def small_motions(self, x: NDArray[np.float64]) -> Modes:
        """Compute the modes of the model linearised about a state, such as an equilibrium.

        x: (n_states,). The model must have no inputs.
        """
        return Modes.of(self.jacobian(x[np.newaxis])[0])

    def at(self, values: Mapping[str, float]) -> PolynomialModel:
        """Return the model with some inputs fixed at constant values.

        Terms that are equal then are merged.

        Parameters
        ----------
        values : mapping of str to float
            By input; other inputs remain.

        Returns
        -------
        PolynomialModel

        Raises
        ------
        ValueError
            For an unknown input, or a value at which a term is not finite.
        """
        if not values:
            return self
        terms, merge = merge_inputs(self, values)
        inputs = tuple(name for name in self.inputs if name not in values)
        return PolynomialModel(self.states, terms, self.coefficients @ merge, inputs)

    def without_absent_terms(self) -> PolynomialModel:
        """Return the same model without the terms whose coefficients are all zero.

        It is faster to simulate. If no term is present, the library is the first term.
        """
        present = compress(self.terms, self.has_term)
        return self.on_library(tuple(present) or self.terms[:1])

    def without_dry_friction(self) -> PolynomialModel:
        """Return the model without terms that contain the sign of a velocity.

        With such terms, a model can rest at any position near its equilibrium.
        """
        velocities = set(velocity_pairs(self.states).values())

        def is_friction(term: Exponents) -> bool:
            return any(
                function.name == "sign"
                and function.offset == 0.0
                and {k for k, weight in enumerate(function.weights) if weight} <= velocities
                for function in term[len(self.names) :]
            )

        friction = np.array([is_friction(term) for term in self.terms])
        if not friction.any():
            return self
        return replace(self, coefficients=np.where(friction, 0.0, self.coefficients))

    def on_library(self, terms: tuple[Exponents, ...]) -> PolynomialModel:
        """Return the same model expressed in another library of terms.

        Raises ValueError if `terms` lacks a term with a non-zero coefficient.
        """
        if terms == self.terms:
            return self
        index = {term: j for j, term in enumerate(terms)}
        coefficients = np.zeros((len(self.states), len(terms)))
        for j, term in enumerate(self.terms):
            if term in index:
                coefficients[:, index[term]] = self.coefficients[:, j]
            elif np.any(self.coefficients[:, j]):
                raise ValueError(f"term {term_name(term, self.names)} is not in the library")
        return PolynomialModel(self.states, terms, coefficients, self.inputs)

    def on_polynomials(self, degree: int) -> PolynomialModel:
        """Return the same model on all monomials up to a degree, then its other terms.

        The monomials are those of states and inputs.
        """
        return self.on_library(extend_library(polynomial_library(len(self.names), degree), self))


@cache
def _check_terms(
    terms: tuple[Exponents, ...], states: tuple[str, ...], inputs: tuple[str, ...]
) -> None:
    """Raise ValueError, in one line, if a model of these states and inputs cannot have terms."""
    names = states + inputs
    if len(set(names)) < len(names):
        raise ValueError(f"states, inputs: {', '.join(names):.60}; must be distinct")
    for term in terms:
        exponents = term[: n_exponents(term)]
        if len(exponents) != len(names):
            raise ValueError(f"terms: must have {len(names)} exponents, of states and inputs")
        whole = all(isinstance(e, Real) and float(e).is_integer() for e in exponents)
        if not whole or min(exponents[: len(states)], default=0) < 0:
            requirement = "exponents must be whole numbers, those of states >= 0"
            raise ValueError(f"terms: {exponents!r:.60}; {requirement}")
    if len(set(terms)) < len(terms):
        twice = next(term for term, count in Counter(terms).items() if count > 1)
        raise ValueError(f"terms: {term_name(twice, names)}: is there twice; must be distinct")
    functions, _ = split_functions(terms)
    if any(len(function.weights) != len(states) for function in functions):
        raise ValueError(f"terms: functions must have {len(states)} weights, of states")


def merge_inputs(
    model: PolynomialModel, values: Mapping[str, float]
) -> tuple[tuple[Exponents, ...], NDArray[np.float64]]:
    """Find which terms of a model coincide, up to a factor, if some inputs are constant.

    Returns the terms, without the exponents of those inputs, and the contribution of each old term
    to each new one, (n_terms, n_merged). Raises ValueError for an input that the model does not
    have, and for a value at which a term is not finite.
    """
    for name, value in values.items():
        if name not in model.inputs:
            has = f"has the inputs {', '.join(model.inputs)}" if model.inputs else "has no inputs"
            raise ValueError(f"{name}: no input; the model {has}")
        if not (isinstance(value, Real) and isfinite(value)):
            raise ValueError(f"{name}: {value!r:.60}; must be a finite number")
    held_columns = tuple(
        len(model.states) + k for k, name in enumerate(model.inputs) if name in values
    )
    constants = [float(values[name]) for name in model.inputs if name in values]
    terms, places = _drop_exponents(model.terms, held_columns)
    merge = np.zeros((len(places), len(terms)))
    for j, (term, column) in enumerate(zip(model.terms, places, strict=True)):
        for value, k in zip(constants, held_columns, strict=True):
            if value == 0.0 and term[k] < 0:
                name = model.names[k]
                raise ValueError(f"{name}: 0; {term_name(term, model.names)} is not finite there")
        merge[j, column] = prod(
            value ** term[k] for value, k in zip(constants, held_columns, strict=True)
        )
    return terms, merge


@cache
def _drop_exponents(
    terms: tuple[Exponents, ...], columns: tuple[int, ...]
) -> tuple[tuple[Exponents, ...], tuple[int, ...]]:
    """Remove exponents at `columns` from terms, and index the old terms in the distinct ones."""
    remainders = [tuple(e for k, e in enumerate(term) if k not in columns) for term in terms]
    new_indices = {term: j for j, term in enumerate(dict.fromkeys(remainders))}
    return tuple(new_indices), tuple(new_indices[term] for term in remainders)


def join_inputs(x: np.ndarray, u: np.ndarray | None) -> np.ndarray:
    """Concatenate the columns of states and inputs; return the states if inputs are None.

    x: (n, n_states). u: (n, n_inputs).
    """
    return x if u is None else np.concatenate([x, u], axis=1)


def _name_to_latex(state: str, states: tuple[str, ...]) -> str:
    """Format a state's name as LaTeX, with a dot for the velocity of one of `states`."""
    dotted = state[:1] == "d" and state[1:] in states
    stem, _, index = (state[1:] if dotted else state).partition("_")
    symbol = rf"\dot {stem}" if dotted else stem
    return f"{symbol}_{{{index}}}" if index else symbol


def _power_of_ten(number: str) -> str:
    """Convert the exponents of a printed number to LaTeX."""
    return re.sub(r"e([+-]?\d+)", lambda match: rf" \cdot 10^{{{int(match[1])}}}", number)


def with_error(value: float, error: float = np.nan) -> str:
    """Format a coefficient as text, followed by its standard error if that is known.

    The error has two digits.
    """
    if not (isfinite(error) and error > 0.0):
        return f"{value:.6g}"
    decimals = 1 - floor(log10(error))
    if not 0 <= decimals <= 9:
        return f"({value:.6g} ± {error:.2g})"
    return f"({value:.{decimals}f} ± {error:.{decimals}f})"
