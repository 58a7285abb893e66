"""Polynomial right-hand sides as index tables, which compiled code reads as data.

One compilation serves every library, support, number of states and model.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from galloping.polynomial import Exponents, slopes
from galloping.recording import Factor


@dataclass(frozen=True)
class Tables:
    """Index tables of one library: every monomial is an earlier monomial times a signal.

    Signals are the states and then known functions of time, the factors that inputs bring to terms,
    of which a monomial has one at most.
    monomials: the library's terms and all their divisors, by degree, the constant first.
    position: (n_terms,) where each library term stands among the monomials.
    parent, factor: (n_monomials,); monomial m = monomial parent[m] times signal factor[m].
    exponents: (n_monomials, n_signals). divisor: (n_monomials, n_states), the monomial divided by
    a state once, -1 where it does not contain that state. factors: exponents of the inputs, of each
    signal that is none of the states.
    """

    monomials: tuple[Exponents, ...]
    position: np.ndarray
    parent: np.ndarray
    factor: np.ndarray
    exponents: np.ndarray
    divisor: np.ndarray
    factors: tuple[Factor, ...]

    def jacobian(self, coefficients: np.ndarray) -> np.ndarray:
        """(n_states, n_states, n_monomials) on the monomials, the derivative of each equation by
        each state; coefficients: (n_states, n_terms).
        """
        n_states = len(coefficients)
        on_monomials = np.zeros((n_states, len(self.monomials)))
        on_monomials[:, self.position] = coefficients
        found = np.zeros((n_states, n_states, len(self.monomials)))
        for k in range(n_states):
            own = np.flatnonzero(self.divisor[:, k] >= 0)
            found[:, k, self.divisor[own, k]] = on_monomials[:, own] * self.exponents[own, k]
        return found


@lru_cache(maxsize=64)
def tables(terms: tuple[Exponents, ...], n_states: int) -> Tables:
    """Index tables of the library `terms` (n_terms exponents of states, and of inputs if any)."""
    of_inputs = [term[n_states:] for term in terms]
    factors = tuple(dict.fromkeys(factor for factor in of_inputs if any(factor)))
    units = dict(zip(factors, np.eye(len(factors), dtype=int).tolist(), strict=True))
    none = [0] * len(factors)
    terms = tuple(
        (*term[:n_states], *units.get(factor, none))
        for term, factor in zip(terms, of_inputs, strict=True)
    )
    n_signals = n_states + len(factors)
    zero = (0,) * n_signals
    units = np.eye(n_states, n_signals, dtype=int).tolist()
    closed, queue = {zero}, {*terms, *map(tuple, units)}
    while queue:
        closed |= queue
        lowered = (lower for *_, lower in slopes(tuple(queue), n_states))
        queue = set().union(*lowered) - closed
    monomials = tuple(sorted(closed, key=lambda term: (sum(term), [-e for e in term])))
    index = {term: m for m, term in enumerate(monomials)}
    parent = np.zeros(len(monomials), np.int64)
    factor = np.zeros(len(monomials), np.int64)
    divisor = np.full((len(monomials), n_states), -1)
    for m, term in enumerate(monomials[1:], start=1):
        factor[m] = np.flatnonzero(term)[-1]  # of the constant, unless a state is in it
    for k, (places, _, lower) in enumerate(slopes(monomials, n_states)):
        divisor[places, k] = [index[term] for term in lower]
        parent[places], factor[places] = divisor[places, k], k
    position = np.array([index[term] for term in terms])
    return Tables(monomials, position, parent, factor, np.array(monomials), divisor, factors)


class System(NamedTuple):
    """One model in the form the compiled integrator reads, built by `system`.

    rates: (n, 2) int, (equation, monomial) of each coefficient present; rate_values: (n,).
    jacobian: (n, 3) int, (equation, state, monomial); jacobian_values: (n,).
    columns: (n_free, 3) int, (equation, monomial, column) of each free coefficient, by column;
    weights: (n_free,) what it grows by as the column's parameter grows.
    """

    parent: np.ndarray
    factor: np.ndarray
    rates: np.ndarray
    rate_values: np.ndarray
    jacobian: np.ndarray
    jacobian_values: np.ndarray
    columns: np.ndarray
    weights: np.ndarray

    @property
    def n_free(self) -> int:
        """How many parameters the sensitivities are by, beside the start."""
        return int(self.columns[-1, 2]) + 1 if len(self.columns) else 0


def system(
    table: Tables, coefficients: np.ndarray, free: np.ndarray, together: np.ndarray | None = None
) -> System:
    """The model with `coefficients` (n_states, n_terms) and `free` (n_free, 2) index pairs.

    A pair (equation, term) names a coefficient whose sensitivity is wanted; its value may be zero.
    together: (n_free,) slopes of them all along one parameter, whose sensitivity is then wanted.
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
    )


def without_idle_monomials(compiled: System, sensitive: bool) -> System:
    """The system without the monomials of its library on which nothing wanted depends."""
    used = np.zeros(len(compiled.parent), bool)
    used[0] = True
    used[compiled.rates[:, 1]] = True
    if sensitive:
        used[compiled.jacobian[:, 2]] = True
        used[compiled.columns[:, 1]] = True
    for m in range(len(used) - 1, 0, -1):
        used[compiled.parent[m]] |= used[m]
    place = np.cumsum(used) - 1
    return compiled._replace(
        parent=place[compiled.parent[used]],
        factor=compiled.factor[used],
        **{
            name: np.column_stack([table[:, :at], place[table[:, at]], table[:, at + 1 :]])
            for name, table, at in (
                ("rates", compiled.rates, 1),
                ("jacobian", compiled.jacobian, 2),
                ("columns", compiled.columns, 1),
            )
        },
    )


class Workspace(NamedTuple):
    """Series of one step that the compiled integrators fill, built by `workspace`.

    x: (order + 1, n_states) of the states, theta: (order + 1, n_monomials), jac: (order + 1,
    n_states, n_states) of the Jacobian, s: (order + 1, n_states, n_columns or more) of the
    sensitivities. kind: (n_states, n_states) 0 where the Jacobian is zero, 1 where it is constant,
    else 2.
    """

    x: np.ndarray
    theta: np.ndarray
    jac: np.ndarray
    s: np.ndarray
    kind: np.ndarray


def workspace(compiled: System, order: int, n_states: int, sensitive: bool) -> Workspace:
    """Arrays for series of a system; compiled code that makes them would compile for longer."""
    columns = compiled.n_free + n_states if sensitive else 0
    kind = np.zeros((n_states, n_states), np.int64)
    equation, state, monomial = compiled.jacobian.T
    np.maximum.at(kind, (equation, state), np.where(monomial == 0, 1, 2))
    return Workspace(
        np.zeros((order + 1, n_states)),
        np.zeros((order + 1, len(compiled.parent))),
        np.zeros((order + 1, n_states, n_states)),
        np.zeros((order + 1, n_states, -(-columns // 16) * 16)),  # in whole vectors
        kind,
    )
