"""From a regression on the candidates to an identified model with its verdict."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from galloping.identification.likelihood.ambiguity import (
    detection_limits,
    hidden_term,
    open_questions,
    plausible_supports,
    told_by_prior,
    unconditional_errors,
    with_prior,
)
from galloping.identification.likelihood.problem import Problem
from galloping.identification.likelihood.selection import added_deviation, solve_support, whiten
from galloping.identification.model import IdentifiedModel


def judged(
    problem: Problem,
    information: np.ndarray,
    right: np.ndarray,
    support: np.ndarray,
    penalty: float,
    *,
    largest: np.ndarray,
    about: np.ndarray | None = None,
    objection: str = "",
    doubt: str = "",
    initial_states: np.ndarray,
    sigma: np.ndarray,
    chi2: float,
    diagnostics: dict[str, float] | None = None,
) -> IdentifiedModel:
    """The identified model and its status, the same for all methods.

    information, right, support, penalty, about: as in `selection`, `about` zero outside the
    support. largest: (n_candidates,) as in `problem.largest`. objection: why the fit must not be
    trusted, doubt: why its terms are not settled, '' where there is nothing to say. The rest as in
    `IdentifiedModel`.

    `ok` claims: the terms found are right, every absent one is smaller than its stated limit, and
    no simple one may hide that matters. Where the data alone would leave other terms open, and the
    prior did not, its reason says so. Intervals and limits are those of the data alone.
    """
    if objection:
        return refused(problem, objection)
    free, covariance = solve_support(information, right, support)
    if about is not None:
        free = free + about
    status, reason = "not identifiable", "no term stands out of the noise"
    alone = errors = added_deviation(information, support)
    if support.any():
        whitened = whiten(information, right, about)
        plausible = plausible_supports(whitened, support)
        errors = unconditional_errors(plausible, alone)
        believed = with_prior(problem, plausible)
        believed_errors = unconditional_errors(believed, alone)
        questions = open_questions(problem, whitened, believed)
        limits = detection_limits(believed_errors, support, penalty)
        hidden = hidden_term(problem, support, limits, largest)
        reason = "; ".join(filter(None, [doubt, questions, hidden]))
        status = "not identifiable" if reason else "ok"
        reason = reason or told_by_prior(problem, plausible)
    conditional = np.full(len(support), np.nan)
    conditional[support] = np.sqrt(np.diag(covariance))
    return IdentifiedModel(
        model=problem.model(free),
        status=status,
        reason=reason,
        standard_errors=problem.on_library(conditional),
        unconditional_errors=problem.on_library(errors),
        detection_limits=problem.on_library(detection_limits(errors, support, penalty)),
        covariance=covariance,
        initial_states=initial_states,
        sigma=sigma,
        chi2=chi2,
        known=problem.known_equations,
        diagnostics=diagnostics or {},
    )


def by(path: Iterable[str], identified: IdentifiedModel) -> IdentifiedModel:
    """The model with further stages before those of its path, by which it was found."""
    own = identified.diagnostics.get("path")
    stages = [*path, *([own] if own else [])]
    return replace(identified, diagnostics={**identified.diagnostics, "path": ", ".join(stages)})


def refused(problem: Problem, reason: str) -> IdentifiedModel:
    """No model, for `reason`."""
    return IdentifiedModel.refused(problem.states, problem.terms, reason, problem.inputs)
