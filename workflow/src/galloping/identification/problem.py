"""Statement of an identification problem: library, known equations, free coefficients."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import compress
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import ArrayLike

from galloping.identification.prior_knowledge import Coefficient, Prior
from galloping.identification.selection import Penalties, select_support, solve_support
from galloping.model.polynomial import (
    Bound,
    Exponents,
    PolynomialModel,
    design_matrix,
    exponent_matrix,
    linear_term,
    n_exponents,
    term_name,
    velocity_pairs,
)
from galloping.recording.samples import Recording, fit_errors, fit_windows
from galloping.trajectory.right_hand_side import System, Tables, compile_system, make_tables

if TYPE_CHECKING:
    from galloping.identification.aliases import Alias


@dataclass(frozen=True)
class Problem:
    """Problem of finding coefficients C in dx/dt = C theta(x, u): states x, inputs u, terms theta.

    Some coefficients are known. states: names of the n_states states. terms: exponents of the
    n_terms candidates, in the states and then in the inputs, with their functions. known:
    (n_states, n_terms), the coefficients of the known equations and the single ones that are fixed,
    zero elsewhere. unknown: indices of the equations to identify, increasing. open: (n_states,
    n_terms) boolean, which coefficients of the unknown equations are candidates. expected,
    precision: (n_states, n_terms) means of Gaussian priors of candidates and 1/variance, zero of
    those without. prior: of the supports; None: a penalty of 2 ln N for each term. inputs: names of
    the n_inputs inputs. bounds: of coefficients. aliases: terms that are no candidates, since they
    equal simpler ones at the recorded inputs.
    """

    states: tuple[str, ...]
    terms: tuple[Exponents, ...]
    known: np.ndarray
    unknown: tuple[int, ...]
    open: np.ndarray
    expected: np.ndarray
    precision: np.ndarray
    prior: Prior | None
    inputs: tuple[str, ...]
    bounds: tuple[Bound, ...] = ()
    aliases: tuple["Alias", ...] = ()

    @cached_property
    def candidates(self) -> np.ndarray:
        """Index pairs (equation, term) of all coefficients to identify, (n_candidates, 2)."""
        is_unknown = np.isin(np.arange(len(self.states)), self.unknown)
        return np.argwhere(self.open & is_unknown[:, None])

    @cached_property
    def state_exponents(self) -> np.ndarray:
        """Exponent of each state in each term, (n_terms, n_states)."""
        return exponent_matrix(self.terms, len(self.states))

    @cached_property
    def degrees(self) -> np.ndarray:
        """Polynomial degree of each candidate term in the states, (n_candidates,).

        Each function counts as a state, and a term with any is of the second degree at least.
        """
        functions = np.array([len(term) - len(self.names) for term in self.terms])
        degree = self.state_exponents.sum(axis=1) + functions
        return np.where(functions > 0, np.maximum(degree, 2), degree)[self.candidates[:, 1]]

    @cached_property
    def is_velocity_equation(self) -> np.ndarray:
        """Whether each candidate term is in the equation of a velocity, (n_candidates,) boolean."""
        return np.isin(self.candidates[:, 0], list(velocity_pairs(self.states).values()))

    @cached_property
    def term_complexity(self) -> np.ndarray:
        """Complexity of each candidate term, for its prior odds, (n_candidates,).

        -1 for a constant, 0 for a linear term, 1 for a nonlinear one, 2 for a constant in the
        equation of a velocity, whose displacement is measured from the equilibrium. A function of
        inputs alone counts as a constant.
        """
        return np.where(
            self.degrees == 0, np.where(self.is_velocity_equation, 2, -1), self.degrees > 1
        )

    @property
    def prior_penalties(self) -> np.ndarray:
        """Penalty of each candidate term by its prior odds, as of `Prior.penalties`; else zero."""
        if self.prior is None:
            return np.zeros(len(self.candidates))
        powers = exponent_matrix(self.terms, len(self.names))[:, len(self.states) :]
        of_inputs = np.abs(powers).sum(axis=1)
        return self.prior.penalties(self.term_complexity, of_inputs[self.candidates[:, 1]])

    @cached_property
    def tables(self) -> Tables:
        """Index tables by which compiled code evaluates the terms of the library."""
        return make_tables(self.terms, len(self.states))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all states and then of all inputs, in the order of the exponents of a term."""
        return self.states + self.inputs

    @property
    def known_equations(self) -> tuple[int, ...]:
        """Indices of the states whose equations are known and not identified."""
        return tuple(i for i in range(len(self.states)) if i not in self.unknown)

    def change_terms(
        self, change: Callable[[np.ndarray], np.ndarray], terms: Sequence[Exponents]
    ) -> Self:
        """Return the problem with other terms, its (n_states, n_terms) arrays changed likewise."""
        by_term = ("known", "open", "expected", "precision")
        values: dict[str, Any] = {name: change(getattr(self, name)) for name in by_term}
        return replace(self, terms=tuple(terms), **values)

    def drop_terms(self, is_dropped: Callable[[Exponents], bool]) -> Self:
        """Return the problem without those terms for which a function returns True."""
        is_kept = np.array([not is_dropped(term) for term in self.terms])
        if is_kept.all():
            return self
        return self.change_terms(
            lambda values: values[:, is_kept], list(compress(self.terms, is_kept))
        )

    def candidate_names(self, candidates: Sequence[int] | np.ndarray) -> str:
        """Return the names of given candidates, with their equations, as one text; '' if none."""
        pairs = self.candidates[list(candidates)]
        return " with ".join(self.coefficient_name(i, j) for i, j in pairs)

    def coefficient_name(self, equation: int, term: int) -> str:
        """Return the name of a term in an equation as text, such as `x^2 in d(y)/dt`."""
        return f"{term_name(self.terms[term], self.names)} in d({self.states[equation]})/dt"

    def linear(self, state: int) -> int:
        """Return the index of the linear term that is a given state alone."""
        return self.terms.index(linear_term(state, len(self.names)))

    def same_state_monomial(self, support: np.ndarray) -> np.ndarray:
        """Find candidates that equal selected terms, or differ only in powers of inputs.

        A recording near one mean wind hardly distinguishes such terms, and to leave one of them out
        would claim a law for other winds.
        """
        n, m = len(self.states), len(self.names)
        names = [(i, *self.terms[j][:n], *self.terms[j][m:]) for i, j in self.candidates]
        selected = set(compress(names, support))
        return np.array([name in selected for name in names])

    def input_polynomials(
        self, recordings: Sequence[Recording], first: np.ndarray, step: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Fit polynomials in time to the monomials of inputs, in each window of `step` seconds.

        first: (n_recordings + 1,) first window of each recording. Returns the polynomials as of
        `fit_windows`, one recording after the other, and their largest `fit_errors`.
        """
        degree = 3  # in time; with 4 or more, jagged inputs need quarter-length windows
        powers, errors = [], []
        for one, count in zip(recordings, np.diff(first), strict=True):
            inputs = [one.inputs[name] for name in self.inputs]
            signals = inputs, self.tables.factors, one.time[0], step
            powers.append(fit_windows(*signals, count, degree))
            errors.append(fit_errors(*signals, powers[-1]))
        return np.concatenate(powers), np.max(errors, axis=0)

    def prior_equations(self, origin: np.ndarray | float = 0.0) -> tuple[np.ndarray, np.ndarray]:
        """Compute the part of Gaussian priors in the normal equations of a regression.

        Shapes (n, n) and (n,), of the candidates. origin: (n,) coefficients at which the right-hand
        side is measured, zero by default.
        """
        precision, mean = map(self.candidate_values, (self.precision, self.expected))
        return np.diag(precision), precision * (mean - origin)

    def candidate_values(self, values: np.ndarray, pairs: np.ndarray | None = None) -> np.ndarray:
        """Extract the entries of an (n_states, n_terms) array that belong to the candidates.

        With `pairs` (n, 2), the entries of these equations and terms.
        """
        return values[tuple((self.candidates if pairs is None else pairs).T)]

    @cached_property
    def coefficient_bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Bounds of the candidate coefficients, two (n_candidates,), infinite without a bound."""
        lower, upper = np.full((2, len(self.candidates)), [[-np.inf], [np.inf]])
        places = {(i, self.terms[j]): k for k, (i, j) in enumerate(self.candidates)}
        for equation, term, least, most in self.bounds:
            if (equation, term) in places:
                k = places[equation, term]
                lower[k], upper[k] = least, most
        return lower, upper

    def selection_offset(self, origin: np.ndarray | float = 0.0) -> np.ndarray:
        """Return offsets of coefficients that make a selection keep all terms with a prior.

        They are `origin` of `selection.whiten`, (n_candidates,). A selection keeps terms whose
        coefficients are far from zero. Those with a prior are therefore moved by 1e4 deviations of
        it.
        """
        root = np.sqrt(self.candidate_values(self.precision))
        return origin + np.divide(1e4, root, out=np.zeros(len(root)), where=root > 0.0)

    def select_terms(
        self,
        information: np.ndarray,
        right: np.ndarray,
        starts: list[np.ndarray],
        penalties: Penalties | np.ndarray | float,
        origin: np.ndarray | float = 0.0,
        indices: np.ndarray | slice = slice(None),
    ) -> np.ndarray:
        """Select the terms of a regression by least chi^2 plus penalties, within all bounds.

        Returns the support, (n,) boolean. The method is `selection.select_support`. origin: (n,)
        coefficients at which `right` is measured. indices: indices of the candidates. A term whose
        coefficient would be beyond its bounds is left out, unless the bounds exclude zero: then the
        term is always present.
        """
        offset = self.selection_offset()[indices]
        if not self.bounds:
            return select_support(information, right, starts, penalties, origin + offset)
        lower, upper = (ends[indices] for ends in self.coefficient_bounds)
        is_required, is_excluded = (lower > 0.0) | (upper < 0.0), np.zeros(len(right), bool)
        root = np.sqrt(np.where(is_required & (offset == 0.0), np.diag(information), 0.0))
        offset = offset + np.divide(1e4, root, out=np.zeros(len(root)), where=root > 0.0)
        origin = np.broadcast_to(origin, right.shape)
        while True:
            shifted = origin + np.where(is_excluded, 0.0, offset)
            allowed = [start & ~is_excluded for start in starts]
            support = select_support(information, right, allowed, penalties, shifted)
            change, _ = solve_support(information, right, support)
            k, _ = _farthest_out(origin + change, support & ~is_required, lower, upper)
            if k < 0:
                return support | is_required
            is_excluded[k] = True
            right = right + information[:, k] * origin[k]
            information, origin = information.copy(), origin.copy()
            information[k] = information[:, k] = right[k] = origin[k] = 0.0

    def solve_within_bounds(
        self,
        information: np.ndarray,
        right: np.ndarray,
        support: np.ndarray,
        origin: np.ndarray | float = 0.0,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Fit the coefficients of given terms by least squares within their bounds.

        As `selection.solve_support`. origin: (n,) coefficients at which `right` is measured.
        Returns how far the best coefficients are from these (n,), and their covariance (n_support,
        n_support) without bounds.
        """
        change, covariance = solve_support(information, right, support)
        free, fixed = support.copy(), np.zeros(len(right))
        while self.bounds:
            k, value = _farthest_out(origin + change, free, *self.coefficient_bounds)
            if k < 0:
                break
            free[k], fixed[k] = False, value - np.broadcast_to(origin, right.shape)[k]
            change, _ = solve_support(information, right - information @ fixed, free)
        return np.where(free, change, fixed), covariance

    def model_covariance(self, covariance: np.ndarray, support: np.ndarray) -> np.ndarray:
        """Extend the covariance of the supported candidates by fixed terms, of zero variance."""
        places = np.full(self.known.shape, -1)
        places[tuple(self.candidates[support].T)] = np.arange(len(covariance))
        rows = list(self.unknown)
        present = places[rows][(places[rows] >= 0) | (self.known[rows] != 0.0)]
        # the index -1 of fixed terms is the padding, zero
        return np.pad(covariance, ((0, 1), (0, 1)))[np.ix_(present, present)]

    def on_library(self, values: np.ndarray, fixed: float = np.nan) -> np.ndarray:
        """Arrange values of the candidates in an (n_states, n_terms) array, NaN elsewhere.

        values: (n_candidates,). The known equations are NaN. fixed: of single coefficients that are
        known and not zero.
        """
        full = np.where(self.known != 0.0, fixed, np.nan)
        full[list(self.known_equations)] = np.nan
        full[tuple(self.candidates.T)] = values
        return full

    def coefficients(self, free: np.ndarray) -> np.ndarray:
        """Combine coefficients of the candidates and known ones in C, (n_states, n_terms)."""
        full = self.known.copy()
        full[tuple(self.candidates.T)] = free
        return full

    def term_penalties(self, penalty: float, largest: np.ndarray) -> Penalties:
        """Compute the penalty of each candidate term from prior odds and the number of samples.

        penalty: 2 ln N of N samples. largest: (n_candidates,), of `largest_coefficients`.
        """
        least = self.least_penalties(penalty)
        if self.prior is None:
            return Penalties(least, least, largest)
        nonlinear = penalty / 2.0 - 2.0 * np.log(self.prior.term * self.prior.nonlinear)
        simple = (self.degrees < 2) & ~self.is_velocity_equation
        most = np.where(simple, nonlinear, least)
        return Penalties(least, most, largest / np.exp(penalty / 4.0))

    def least_penalties(self, penalty: float) -> np.ndarray:
        """Compute the smallest decrease of chi^2 for which each candidate term can be selected.

        Shape (n_candidates,). penalty: 2 ln N. Without a prior all of it, to exclude terms that fit
        only noise.
        """
        if self.prior is None:
            return np.full(len(self.candidates), penalty)
        return penalty / 2.0 - 2.0 * np.log(self.prior.term) + self.prior_penalties

    def compile_system(self, free: np.ndarray, pairs: np.ndarray) -> System:
        """Compile the equations and their derivatives by coefficients, for the integrator.

        free: (n_candidates,) coefficients. pairs: (n, 2) those (equation, term) of the derivatives.
        """
        return compile_system(self.tables, self.coefficients(free), pairs)

    def model(self, free: np.ndarray) -> PolynomialModel:
        """Make the model with given coefficients of the candidate terms, (n_candidates,)."""
        return PolynomialModel(self.states, self.terms, self.coefficients(free), self.inputs)


def _farthest_out(
    values: np.ndarray, is_free: np.ndarray, lower: np.ndarray, upper: np.ndarray
) -> tuple[int, float]:
    """Find which value is farthest beyond its bounds, relative to its size.

    is_free: (n,) boolean. Returns its index and the nearest number within; -1 if all are within.
    """
    nearest = np.clip(values, lower, upper)
    excess = np.where(is_free, np.abs(values - nearest), 0.0)
    k = int(np.argmax(excess / np.maximum(np.abs(values), np.finfo(float).tiny)))
    return (k, float(nearest[k])) if excess[k] > 0.0 else (-1, 0.0)


def make_problem(
    states: tuple[str, ...],
    terms: tuple[Exponents, ...],
    known: PolynomialModel | None = None,
    known_states: tuple[str, ...] = (),
    prior: Prior | None = None,
    inputs: Sequence[str] = (),
    coefficients: Sequence[Coefficient] = (),
    allowed: ArrayLike | None = None,
) -> Problem:
    """Make the identification problem of a term library, with known equations and priors.

    The equation of a state X is known, dX/dt = dX, if `dX` is a state too. Further equations are
    known through `known`, a model whose rows named in `known_states` are used unchanged. inputs:
    names of the recordings' inputs, unused by a library in the states alone. coefficients: priors
    and bounds of single coefficients of the other equations. allowed: (n_states, n_terms) boolean,
    equations in which each term is sought; all by default. Raises ValueError if known coefficients
    are outside of the library, or nothing is unknown.
    """
    rows = np.zeros((len(states), len(terms)))
    inputs = tuple(inputs)[: n_exponents(terms[0]) - len(states)]
    index = {term: j for j, term in enumerate(terms)}
    pairs = velocity_pairs(states)
    for i, velocity in pairs.items():
        unit = linear_term(velocity, len(states) + len(inputs))
        if unit not in index:
            raise ValueError(f"the library lacks {states[velocity]}, the derivative of {states[i]}")
        rows[i, index[unit]] = 1.0
    known_rows: list[int] = []
    if known is not None:
        known_rows = [states.index(name) for name in known_states]
        rows[known_rows] = known.on_library(terms).coefficients[known_rows]
    unknown = tuple(i for i in range(len(states)) if i not in {*pairs, *known_rows})
    if not unknown:
        every = ", ".join(states)
        raise ValueError(f"the equations of {every} are all known; none is left to find")
    is_allowed = np.ones(rows.shape, bool) if allowed is None else np.array(allowed, bool)
    is_open, constraints = is_allowed.copy(), set[tuple[int, int, str]]()
    expected, precision = np.zeros((2, *rows.shape))
    bounds: list[Bound] = []
    for one in coefficients:
        if one.state not in states or states.index(one.state) not in unknown:
            sought = ", ".join(states[i] for i in unknown)
            raise ValueError(f"coefficients: {one.state!r}; must be an unknown equation: {sought}")
        names = states + inputs
        has_name = n_exponents(one.term) == len(names)
        name = term_name(one.term, names) if has_name else one.term
        if one.term not in index:
            raise ValueError(f"coefficients: {name}: not in the library")
        entry = states.index(one.state), index[one.term]
        parts = {(*entry, "mean")} if one.mean is not None else set()
        parts |= {(*entry, "bounds")} if one.is_bounded else set()
        if not is_allowed[entry] or parts & constraints:
            raise ValueError(f"coefficients: {name} of {one.state}: said twice, or not allowed")
        constraints |= parts
        if one.is_bounded:
            bounds.append((entry[0], one.term, float(one.lower), float(one.upper)))
        if one.deviation:
            expected[entry], precision[entry] = one.mean, one.deviation**-2.0
        elif one.mean is not None:
            rows[entry], is_open[entry] = one.mean, False
    for i, term, least, most in bounds:
        entry = i, index[term]
        mean = expected[entry] if precision[entry] else rows[entry]
        if (precision[entry] or not is_open[entry]) and not least <= mean <= most:
            name = f"{term_name(term, states + inputs)} of {states[i]}"
            raise ValueError(f"coefficients: {name}: {mean:g} is out of its bounds")
    if not is_open[list(unknown)].any():
        raise ValueError("every coefficient is known; none is left to find")
    return Problem(
        tuple(states), tuple(terms), rows, unknown, is_open, expected, precision, prior, inputs,
        tuple(bounds),
    )  # fmt: skip


def largest_coefficients(problem: Problem, values: np.ndarray, rates: np.ndarray) -> np.ndarray:
    """Compute the coefficient with which each term alone would be as large as its state's rate.

    Returns (n_candidates,). The root mean squares of term and rate are then equal. values: (n,
    n_states + n_inputs), rates: (n, n_states), NaN where missing.
    """

    def root_mean_square(values: np.ndarray) -> np.ndarray:
        is_known = np.isfinite(values)
        squares = np.sum(np.where(is_known, values, 0.0) ** 2, axis=0)
        return np.sqrt(squares / np.maximum(is_known.sum(axis=0), 1))

    of_terms = root_mean_square(design_matrix(values, problem.terms)) + np.finfo(float).tiny
    return root_mean_square(rates)[problem.candidates[:, 0]] / of_terms[problem.candidates[:, 1]]
