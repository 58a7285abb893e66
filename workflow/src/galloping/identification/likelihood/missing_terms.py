"""Kind of term that a library lacks, found from the residual of its best model.

A term that is no polynomial, such as dry friction, is a known force along the motion of a fit.
Score tests (C. R. Rao, 1948) compute by how much chi^2 falls with each of a few such forces besides
all terms of the library.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.polynomial.legendre import leggauss, legvander

from galloping.identification.findings import Code, Finding
from galloping.identification.likelihood.elimination import Eliminated, eliminate_chains
from galloping.identification.likelihood.instrument import add_inputs, score_test
from galloping.identification.likelihood.shooting import Linearised, ShootingFit
from galloping.identification.problem import Problem
from galloping.identification.selection import misfit_of_support, solve_support
from galloping.model.functions import Function
from galloping.model.polynomial import (
    Exponents,
    design_matrix,
    linear_term,
    term_name,
    velocity_pairs,
)
from galloping.recording.samples import powers_of_legendre

DEGREE = 5  # degree of the polynomial in time that is fitted to a force in a window
# Least share of the misfit of the library's best model, beyond the noise, that a reported force
# explains. With a larger share, other causes were reported instead.
MIN_EXPLAINED_SHARE = 0.5


def find_missing_kind(fit: ShootingFit, penalty: float) -> list[Finding]:
    """Find a non-polynomial term, such as friction, that would explain most of a fit's residual.

    The list is empty if no kind of term explains so much. fit: in its chains. penalty: 2 ln N of N
    samples. Raises FloatingPointError if the fit diverges.
    """
    record, problem = fit.record, fit.record.problem
    kinds = [kind for kind in _candidate_kinds(problem) if kind[2] not in problem.terms]
    if not kinds:
        return []
    n, extra = len(problem.candidates), len(kinds)
    linear, quadratic = _linearise_with(fit, kinds)
    information, right = quadratic.information, quadratic.right
    is_term = np.arange(n + extra) < n
    change, _ = solve_support(information, right, is_term)
    squares = record.condensed.sum_squares(linear.residual) / fit.reference**2
    chi2 = float(squares.sum()) - quadratic.fall - float(change @ right)
    falls = []
    for k in range(extra):
        kept = np.append(is_term[:n], np.arange(extra) == k)
        falls.append(score_test(information[np.ix_(kept, kept)], right[kept], np.ones(1)) ** 2)
    best = int(np.argmax(falls))
    excess = chi2 - float(np.sum(record.condensed.rows))
    if falls[best] < max(2.0 * penalty, MIN_EXPLAINED_SHARE * excess):
        return []
    same_force = [term for *place, term in kinds if place == list(kinds[best][:2])]
    names = " or ".join(term_name(term, problem.names) for term in same_force)
    return [Finding.of(Code.TERM_MISSING, problem.states[kinds[best][0]], term=names)]


def find_imitated_drag(fit: ShootingFit) -> list[Finding]:
    """Find drag |v| v that explains the motion of a velocity v better than v and v^3 together.

    A library without drag imitates it by these two terms, with the same sign. fit: in its chains.
    Raises FloatingPointError if the fit diverges.
    """
    problem, kinds, imitations = fit.record.problem, [], []
    places = {(i, problem.terms[j]): k for k, (i, j) in enumerate(problem.candidates.tolist())}
    velocities = set(velocity_pairs(problem.states).values())
    for equation, state, term in _candidate_kinds(problem):
        linear = linear_term(state, len(problem.names))
        powers = linear, tuple(3 * exponent for exponent in linear)
        imitation = [places[equation, each] for each in powers if (equation, each) in places]
        is_drag = equation == state and state in velocities and term[: len(linear)] == linear
        both = len(imitation) == 2 and fit.free[imitation].prod() > 0.0
        if is_drag and both and term not in problem.terms:
            kinds.append((equation, state, term))
            imitations.append(imitation)
    if not kinds:
        return []
    _, quadratic = _linearise_with(fit, kinds)
    origin, found = np.append(fit.free, np.zeros(len(kinds))), []
    misfit = partial(misfit_of_support, quadratic.information, quadratic.right, origin)
    support = np.append(fit.support, np.zeros(len(kinds), bool))
    for k, ((equation, _, term), imitation) in enumerate(zip(kinds, imitations, strict=True)):
        instead = support.copy()
        instead[imitation], instead[len(fit.free) + k] = False, True
        if misfit(instead) < misfit(support):
            name = term_name(term, problem.names)
            found.append(Finding.of(Code.DRAG_IMITATED, problem.states[equation], term=name))
    return found


def _linearise_with(
    fit: ShootingFit, kinds: Sequence[tuple[int, int, Exponents]]
) -> tuple[Linearised, Eliminated]:
    """Linearise a fit by the coefficients of all candidates, and of further terms after them."""
    record, problem = fit.record, fit.record.problem
    extra = len(kinds)
    forces = _forces_along_motion(fit, tuple(term for *_, term in kinds))
    factors = record.condensed.inputs
    factors = np.pad(factors, ((0, 0), (0, DEGREE + 1 - factors.shape[1]), (0, 0)))
    places = len(problem.names)
    terms = [(*term[:places], *[0] * extra, *term[places:]) for term in problem.terms]
    terms += [linear_term(places + k, places + extra) for k in range(extra)]
    wider = add_inputs(
        replace(fit, sigma=fit.reference), [f"force {k}" for k in range(extra)], terms,
        np.concatenate([factors, forces], axis=2),
    )  # fmt: skip
    entries = [(i, len(problem.terms) + k) for k, (i, *_) in enumerate(kinds)]
    linear = wider.linearise(np.vstack([problem.candidates, entries]))
    return linear, eliminate_chains(linear, record.segments)


def _candidate_kinds(problem: Problem) -> Iterator[tuple[int, int, Exponents]]:
    """Yield kinds of terms, such as drag and friction, each with its equation and state."""
    n, pairs = len(problem.states), velocity_pairs(problem.states)
    none = (0,) * len(problem.names)
    for equation in problem.unknown:
        for state in range(n):
            unit = tuple(float(k == state) for k in range(n))
            linear = linear_term(state, len(problem.names))
            yield equation, state, (*linear, Function("abs", unit))
            yield equation, state, (*none, Function("sin" if state in pairs else "sign", unit))


def _forces_along_motion(fit: ShootingFit, terms: tuple[Exponents, ...]) -> np.ndarray:
    """Fit polynomials in time to terms along a fit's motion, (n_windows, DEGREE + 1, n_terms)."""
    problem, n_states = fit.record.problem, fit.starts.shape[1]
    nodes, weights = leggauss(10)
    states = fit.states_at((nodes + 1.0) / 2.0)
    plain = tuple((*term[:n_states], *term[len(problem.names) :]) for term in terms)
    values = design_matrix(states.reshape(-1, n_states), plain).reshape(*states.shape[:2], -1)
    project = legvander(nodes, DEGREE) * weights[:, None] * (np.arange(DEGREE + 1) + 0.5)
    return np.einsum("pd,dk,wpt->wkt", project, powers_of_legendre(DEGREE), values)
