"""Right-hand sides as index tables, which compiled code reads as data.

A single compilation serves every library, support, number of states and model.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from galloping.model.functions import FUNCTIONS, KINKED_FUNCTIONS, Function, differentiate_term
from galloping.model.polynomial import Exponents, exponent_matrix, has_functions, split_functions
from galloping.recording.samples import Factor


@dataclass(frozen=True)
class Tables:
    """Index tables that build each monomial of a library from an earlier one times a factor.

    Signals are the states, then the functions of terms, and then known functions of time, the
    factors of terms from inputs, of which a monomial has one at most. monomials: the library's
    terms, their derivatives and the factors of these, by degree, the constant first; as terms, with
    exponents of the states and of the factors. position: (n_terms,) index of each library term
    among the monomials. parent, factor: (n_monomials,); monomial m = monomial parent[m] times
    signal factor[m]. exponents: (n_monomials, n_states + n_factors). slopes: (n_slopes, 3)
    monomial, state, and the monomial of its derivative by the state, times slope_factors
    (n_slopes,); of a sum each part. signs: (n_signs, 3) monomial with a factor sign(u), the
    argument u, and the monomial without it. factors: exponents of the inputs, of each signal that
    comes from them. functions: of states. arguments: of the functions, weights and offset, those
    with a kink first; n_kinks: the number of these.
    """

    monomials: tuple[Exponents, ...]
    position: np.ndarray
    parent: np.ndarray
    factor: np.ndarray
    exponents: np.ndarray
    slopes: np.ndarray
    slope_factors: np.ndarray
    signs: np.ndarray
    factors: tuple[Factor, ...]
    functions: tuple[Function, ...]
    arguments: tuple[tuple[tuple[float, ...], float], ...]
    n_kinks: int

    def on_monomials(self, coefficients: np.ndarray) -> np.ndarray:
        """Expand coefficients of the library's terms to coefficients of all monomials.

        From (n_states, n_terms) to (n_states, n_monomials).
        """
        expanded = np.zeros((len(coefficients), len(self.monomials)))
        expanded[:, self.position] = coefficients
        return expanded

    def jacobian(self, coefficients: np.ndarray) -> np.ndarray:
        """Return the coefficients of the Jacobian: each equation differentiated by each state.

        Returns (n_states, n_states, n_monomials). coefficients: (n_states, n_terms).
        """
        n_states, (monomial, state, lower) = len(coefficients), self.slopes.T
        jacobian = np.zeros((n_states, n_states, len(self.monomials)))
        parts = self.on_monomials(coefficients)[:, monomial] * self.slope_factors
        np.add.at(jacobian, (slice(None), state, lower), parts)  # type: ignore[arg-type]
        return jacobian


@lru_cache(maxsize=64)
def make_tables(terms: tuple[Exponents, ...], n_states: int) -> Tables:
    """Make the index tables by which compiled code evaluates a library of terms."""
    functions, plain = split_functions(terms)
    n_exponents = len(plain[0]) - len(functions)
    of_inputs = [term[n_states:n_exponents] for term in terms]
    factors = tuple(dict.fromkeys(factor for factor in of_inputs if any(factor)))
    n_signals = n_states + len(factors)
    units = dict(zip(factors, np.eye(len(factors), dtype=int).tolist(), strict=True))
    none = [0] * len(factors)
    terms = tuple(
        (*term[:n_states], *units.get(factor, none), *term[n_exponents:])
        for term, factor in zip(terms, of_inputs, strict=True)
    )
    slopes: list[tuple[Exponents, int, Exponents, float]] = [
        (term, k, lower, number)
        for term in terms
        for k in range(n_states)
        for number, lower in differentiate_term(term, k)
    ]
    signs = [(term, *part) for term in terms for part in _list_sign_factors(term)]
    zero = (0,) * n_signals
    closed, queue = {zero}, {*terms, *map(tuple, np.eye(n_states, n_signals, dtype=int).tolist())}
    queue |= {row[2] for row in slopes} | {row[2] for row in signs}
    while queue:
        closed |= queue
        queue = {need for term in queue for need in _list_needed(term, n_states)} - closed
    monomials = tuple(sorted(closed, key=lambda term: _monomial_order(term, n_signals)))
    functions, _ = split_functions(monomials)
    kinked = sorted(functions, key=lambda function: function.name not in KINKED_FUNCTIONS)
    arguments = tuple(dict.fromkeys(function[1:] for function in kinked))
    n_kinks = len({function[1:] for function in functions if function.name in KINKED_FUNCTIONS})
    index = {term: m for m, term in enumerate(monomials)}
    signal_rows: dict[int | Function, int] = {
        function: n_states + k for k, function in enumerate(functions)
    }
    signal_rows |= {k: k if k < n_states else k + len(functions) for k in range(n_signals)}
    splits = [(0, zero), *(_split_last_factor(term, n_states) for term in monomials[1:])]
    return Tables(
        monomials,
        np.array([index[term] for term in terms]),
        np.array([index[lower] for _, lower in splits], np.int64),
        np.array([signal_rows[factor] for factor, _ in splits], np.int64),
        exponent_matrix(monomials, n_signals),
        _as_rows((index[term], k, index[lower]) for term, k, lower, _ in slopes),
        np.array([number for *_, number in slopes], float),
        _as_rows(
            (index[term], arguments.index(function[1:]), index[remainder])
            for term, function, remainder in signs
        ),
        factors,
        functions,
        arguments,
        n_kinks,
    )


def _as_rows(rows: Iterator[tuple[int, int, int]]) -> np.ndarray:
    return np.array(list(rows), np.int64).reshape(-1, 3)


def _monomial_order(term: Exponents, n_signals: int) -> tuple:
    """Return the sort key of a monomial: its degree, then its exponents, highest first."""
    exponents, functions = term[:n_signals], term[n_signals:]
    return sum(exponents) + len(functions), [-e for e in exponents], functions


def _split_last_factor(term: Exponents, n_states: int) -> tuple[int | Function, Exponents]:
    """Split a monomial into its last factor and the rest.

    The factor is a function if there is any, else a state, else that of inputs.
    """
    if has_functions(term):
        return term[-1], term[:-1]
    present = [k for k, power in enumerate(term) if power]
    last = max((k for k in present if k < n_states), default=present[-1])
    return last, tuple(e - (k == last) for k, e in enumerate(term))


def _list_needed(term: Exponents, n_states: int) -> Iterator[Exponents]:
    """Yield a monomial without its last factor, its functions, and those in their derivatives."""
    if any(term):
        yield _split_last_factor(term, n_states)[1]
    exponents = [factor for factor in term if not isinstance(factor, Function)]
    for function in term[len(exponents) :]:
        if function.name not in KINKED_FUNCTIONS:
            _, others = function.derivative(0)
            yield from ((*[0] * len(exponents), each) for each in (function, *others))


def _list_sign_factors(term: Exponents) -> Iterator[tuple[Function, Exponents]]:
    """Yield each factor sign(u) of a term, and the term without it."""
    for k, factor in enumerate(term):
        if isinstance(factor, Function) and factor.name == "sign":
            yield factor, (*term[:k], *term[k + 1 :])


# --- what the compiled integrator reads ---

CODES = {name: code for code, name in enumerate(FUNCTIONS)}


class Signals(NamedTuple):
    """Functions of states in a model, as index arrays for the compiled integrator.

    kind: (n_functions,) of CODES. argument: (n_functions,) index. partner: (n_functions,) index of
    the cosine of a sine and conversely. weights: (n_arguments, n_states), offsets: (n_arguments,).
    n_kinks: the first arguments, whose zeros are kinks. sign: (n_kinks,) index of their functions
    sign(u), -1 if there is none. slides: (n_slides, 3) equation, kink and monomial, of each
    coefficient of a term with a sign(u), without that factor; slide_values: (n_slides,).
    """

    kind: np.ndarray
    argument: np.ndarray
    partner: np.ndarray
    weights: np.ndarray
    offsets: np.ndarray
    n_kinks: int
    sign: np.ndarray
    slides: np.ndarray
    slide_values: np.ndarray


class System(NamedTuple):
    """Model as index arrays for the compiled integrator, made by `compile_system`.

    rates: (n, 2) int, (equation, monomial) of each coefficient present; rate_values: (n,).
    jacobian: (n, 3) int, (equation, state, monomial); jacobian_values: (n,). columns: (n_free, 3)
    int, (equation, monomial, column) of each free coefficient, by column; weights: (n_free,) its
    derivative by the column's parameter. signals: functions of states, None without any.
    """

    parent: np.ndarray
    factor: np.ndarray
    rates: np.ndarray
    rate_values: np.ndarray
    jacobian: np.ndarray
    jacobian_values: np.ndarray
    columns: np.ndarray
    weights: np.ndarray
    signals: Signals | None

    @property
    def n_free(self) -> int:
        """Number of parameters, besides the initial state, whose sensitivities are computed."""
        return int(self.columns[-1, 2]) + 1 if len(self.columns) else 0


def compile_system(
    table: Tables, coefficients: np.ndarray, free: np.ndarray, together: np.ndarray | None = None
) -> System:
    """Convert the coefficients of a model to index arrays for the compiled integrator.

    coefficients: (n_states, n_terms). free: (n_free, 2) index pairs. A pair (equation, term) names
    a coefficient whose sensitivity is needed; its value may be zero. together: (n_free,) slopes of
    them all along one parameter, whose sensitivity is then computed.
    """
    present = np.argwhere(coefficients)
    monomial = table.position[present[:, 1]]
    values = coefficients[present[:, 0], present[:, 1]]
    by_states = table.jacobian(coefficients)
    jacobian = np.argwhere(by_states)
    column = np.arange(len(free)) if together is None else np.zeros(len(free))
    return System(
        table.parent,
        table.factor,
        np.column_stack([present[:, 0], monomial]).astype(np.int64).reshape(-1, 2),
        np.ascontiguousarray(values, dtype=float),
        np.ascontiguousarray(jacobian, np.int64),
        by_states[tuple(jacobian.T)],
        np.column_stack([free[:, 0], table.position[free[:, 1]], column]).astype(np.int64),
        np.ones(len(free)) if together is None else np.asarray(together, float),
        _compile_signals(table, coefficients) if table.functions else None,
    )


def _compile_signals(table: Tables, coefficients: np.ndarray) -> Signals:
    functions, index = table.functions, {function: k for k, function in enumerate(table.functions)}
    other = {"sin": "cos", "cos": "sin"}
    signs = [Function("sign", *table.arguments[k]) for k in range(table.n_kinks)]
    of_signs = table.on_monomials(coefficients)[:, table.signs[:, 0]]
    equation, row = np.nonzero(of_signs)
    return Signals(
        np.array([CODES[function.name] for function in functions]),
        np.array([table.arguments.index(function[1:]) for function in functions]),
        np.array(
            [
                index[function._replace(name=other.get(function.name, function.name))]
                for function in functions
            ]
        ),
        np.array([weights for weights, _ in table.arguments]),
        np.array([offset for _, offset in table.arguments]),
        table.n_kinks,
        np.array([index.get(function, -1) for function in signs], np.int64),
        np.column_stack([equation, table.signs[row, 1:]]).astype(np.int64).reshape(-1, 3),
        of_signs[equation, row],
    )


def without_idle_monomials(compiled: System, sensitive: bool) -> System:
    """Remove from a compiled model the monomials on which no result depends.

    sensitive: whether sensitivities are results.
    """
    is_used = np.zeros(len(compiled.parent), bool)
    is_used[0] = True
    is_used[compiled.rates[:, 1]] = True
    if sensitive:
        is_used[compiled.jacobian[:, 2]] = True
        is_used[compiled.columns[:, 1]] = True
    signals = compiled.signals
    if signals is not None:
        is_used[signals.slides[:, 2]] = True
    for m in range(len(is_used) - 1, 0, -1):
        is_used[compiled.parent[m]] |= is_used[m]
    new_indices = np.cumsum(is_used) - 1
    if signals is not None:
        slides = np.column_stack([signals.slides[:, :2], new_indices[signals.slides[:, 2]]])
        signals = signals._replace(slides=slides)
    return compiled._replace(
        parent=new_indices[compiled.parent[is_used]],
        factor=compiled.factor[is_used],
        signals=signals,
        **{
            name: np.column_stack(
                [table[:, :column], new_indices[table[:, column]], table[:, column + 1 :]]
            )
            for name, table, column in (
                ("rates", compiled.rates, 1),
                ("jacobian", compiled.jacobian, 2),
                ("columns", compiled.columns, 1),
            )
        },
    )


class Workspace(NamedTuple):
    """Arrays of Taylor coefficients that the compiled integrators fill at each step.

    x: (order + 1, n_states + n_functions) of the states and of functions of them. theta:
    (n_monomials + n_states + n_functions, order + 1) of the monomials, then of the same signals
    from the highest order down, so that products read both factors in the order of memory. jac:
    (order + 1, n_states, n_states) of the Jacobian. s: (order + 1, n_states, n_columns or more) of
    the sensitivities. kind: (n_states, n_states) 0 where the Jacobian is zero, 1 where it is
    constant, else 2. u: (order + 1, n_arguments) of the arguments of functions. modes: (n_kinks,)
    the sign of each argument with a kink, 0 for one that sticks at zero. fresh: (n_kinks,) number
    of its derivatives, from itself on, that are zero where the step begins.
    """

    x: np.ndarray
    theta: np.ndarray
    jac: np.ndarray
    s: np.ndarray
    kind: np.ndarray
    u: np.ndarray
    modes: np.ndarray
    fresh: np.ndarray


def make_workspace(compiled: System, order: int, n_states: int, sensitive: bool) -> Workspace:
    """Allocate the arrays of Taylor coefficients that the compiled integrators fill.

    Compiled code that makes them would compile for longer.
    """
    columns = compiled.n_free + n_states if sensitive else 0
    kind = np.zeros((n_states, n_states), np.int64)
    equation, state, monomial = compiled.jacobian.T
    np.maximum.at(kind, (equation, state), np.where(monomial == 0, 1, 2))
    signals = compiled.signals
    functions, arguments, kinks = (
        (0, 0, 0) if signals is None else (len(signals.kind), len(signals.offsets), signals.n_kinks)
    )
    return Workspace(
        np.zeros((order + 1, n_states + functions)),
        np.zeros((len(compiled.parent) + n_states + functions, order + 1)),
        np.zeros((order + 1, n_states, n_states)),
        np.zeros((order + 1, n_states, -(-columns // 16) * 16)),  # in whole vectors
        kind,
        np.zeros((order + 1, arguments)),
        np.zeros(kinks),
        np.zeros(kinks, np.int64),
    )
