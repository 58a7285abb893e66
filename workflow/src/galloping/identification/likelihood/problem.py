"""What is asked of an identification: the library, what is known, the free coefficients."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from galloping.identification.likelihood.constants import INPUT_DEGREE
from galloping.identification.likelihood.prior import Prior
from galloping.inputs import windowed
from galloping.polynomial import Exponents, PolynomialModel, design_matrix, velocity_pairs
from galloping.recording import Recording
from galloping.taylor import Tables, tables


@dataclass(frozen=True)
class Problem:
    """dx/dt = C theta(x, u), with some rows of C known and the others to be identified.

    states: names of the n_states states. terms: exponents of the n_terms candidate monomials, in
    the states and then in the inputs. known: (n_states, n_terms), the coefficients of the known
    equations, zero elsewhere. unknown: indices of the equations to identify, increasing. prior: of
    the supports; None: all are as probable. inputs: names of the n_inputs inputs.
    """

    states: tuple[str, ...]
    terms: tuple[Exponents, ...]
    known: np.ndarray
    unknown: tuple[int, ...]
    prior: Prior | None = None
    inputs: tuple[str, ...] = ()

    @cached_property
    def candidates(self) -> np.ndarray:
        """(n_candidates, 2) pairs (equation, term), by equation and then by term."""
        n_terms = len(self.terms)
        return np.array([(i, j) for i in self.unknown for j in range(n_terms)], int).reshape(-1, 2)

    @cached_property
    def of_states(self) -> np.ndarray:
        """(n_terms, n_states) exponents of the states in each term."""
        return np.array(self.terms)[:, : len(self.states)]

    @cached_property
    def degrees(self) -> np.ndarray:
        """(n_candidates,) degree of each candidate's term, in the states."""
        return self.of_states.sum(axis=1)[self.candidates[:, 1]]

    @cached_property
    def tables(self) -> Tables:
        return tables(self.terms, len(self.states))

    @property
    def names(self) -> tuple[str, ...]:
        """Of the states and then of the inputs, in the order of a term's exponents."""
        return self.states + self.inputs

    @property
    def known_equations(self) -> tuple[int, ...]:
        return tuple(i for i in range(len(self.states)) if i not in self.unknown)

    def linear(self, state: int) -> int:
        """Index of the term that is this state alone."""
        return self.terms.index(tuple(int(k == state) for k in range(len(self.names))))

    def alike(self, support: np.ndarray) -> np.ndarray:
        """(n_candidates,) those of a support, and those that differ from one in the inputs alone."""
        names = [(i, *self.of_states[j]) for i, j in self.candidates]
        found = {name for name, present in zip(names, support, strict=True) if present}
        return np.array([name in found for name in names])

    def signals(self, states: np.ndarray, inputs: np.ndarray) -> np.ndarray:
        """(n, n_states + n_factors) what the integrator multiplies; inputs: (n, n_inputs)."""
        if not self.inputs:
            return states
        return np.hstack([states, design_matrix(inputs, self.tables.factors)])

    def driven(self, recordings: Sequence[Recording], first: np.ndarray, step: float) -> np.ndarray:
        """Factors of the recordings' inputs over windows of `step` s, of which each has as many as
        `first` (n_recordings + 1,) says; as `inputs.windowed`, one recording after the other.
        """
        return np.concatenate(
            [
                windowed(
                    [recording.inputs[name] for name in self.inputs],
                    self.tables.factors, recording.time[0], step, count, INPUT_DEGREE,
                )
                for recording, count in zip(recordings, np.diff(first), strict=True)
            ]
        )  # fmt: skip

    def on_library(self, values: np.ndarray) -> np.ndarray:
        """Values (n_candidates,) as (n_states, n_terms), NaN in the known equations."""
        full = np.full(self.known.shape, np.nan)
        full[self.candidates[:, 0], self.candidates[:, 1]] = values
        return full

    def coefficients(self, free: np.ndarray) -> np.ndarray:
        """All of C, (n_states, n_terms), from the candidates' coefficients `free`."""
        full = self.known.copy()
        full[self.candidates[:, 0], self.candidates[:, 1]] = free
        return full

    def model(self, free: np.ndarray) -> PolynomialModel:
        """The model with the candidates' coefficients `free`."""
        return PolynomialModel(self.states, self.terms, self.coefficients(free), self.inputs)


def posed(
    states: tuple[str, ...],
    terms: tuple[Exponents, ...],
    known: PolynomialModel | None = None,
    known_states: tuple[str, ...] = (),
    prior: Prior | None = None,
    inputs: Sequence[str] = (),
) -> Problem:
    """The identification problem of a library.

    The equation of a state X is known, dX/dt = dX, where `dX` is a state too. Further equations
    are known through `known`, a model whose rows named in `known_states` are taken as they are.
    inputs: names of those of the recordings, which a library of terms in the states alone leaves
    aside. Raises ValueError where a known equation needs a term outside the library, or all are
    known.
    """
    rows = np.zeros((len(states), len(terms)))
    given = set()
    inputs = tuple(inputs)[: len(terms[0]) - len(states)]
    index = {term: j for j, term in enumerate(terms)}
    for i, velocity in velocity_pairs(states).items():
        unit = tuple(int(k == velocity) for k in range(len(states) + len(inputs)))
        if unit not in index:
            raise ValueError(f"the library lacks {states[velocity]}, the derivative of {states[i]}")
        rows[i, index[unit]] = 1.0
        given.add(i)
    if known is not None:
        model = known.on_library(terms)
        for name in known_states:
            rows[states.index(name)] = model.coefficients[states.index(name)]
            given.add(states.index(name))
    unknown = tuple(i for i in range(len(states)) if i not in given)
    if not unknown:
        raise ValueError(
            f"the equations of {', '.join(states)} are all known; none is left to find"
        )
    return Problem(tuple(states), tuple(terms), rows, unknown, prior, inputs)


def largest(problem: Problem, values: np.ndarray, rates: np.ndarray) -> np.ndarray:
    """(n_candidates,) coefficients at which each term alone would make up its equation.

    values: (n, n_states + n_inputs), rates: (n, n_states), NaN where missing, by the root mean
    squares of terms and rates.
    """

    def size(values: np.ndarray) -> np.ndarray:
        there = np.isfinite(values)
        squares = np.sum(np.where(there, values, 0.0) ** 2, axis=0)
        return np.sqrt(squares / np.maximum(there.sum(axis=0), 1))

    of_terms = size(design_matrix(values, problem.terms)) + np.finfo(float).tiny
    return size(rates)[problem.candidates[:, 0]] / of_terms[problem.candidates[:, 1]]
