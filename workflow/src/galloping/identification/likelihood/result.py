"""From a regression on the candidates to an identified model with its verdict."""

from __future__ import annotations

import numpy as np

from galloping.identification.likelihood.ambiguity import (
    detection_limits,
    open_questions,
    plausible_supports,
    unconditional_errors,
)
from galloping.identification.likelihood.constants import (
    MOST_RIVAL_WEIGHT,
    MOST_RIVAL_WEIGHT_SEEN,
)
from galloping.identification.likelihood.problem import Problem
from galloping.identification.likelihood.selection import added_deviation, solve_support, whiten
from galloping.identification.model import IdentifiedModel
from galloping.polynomial import PolynomialModel

# What ends an identification without a model.
NO_MODEL = (ValueError, FloatingPointError, np.linalg.LinAlgError)


def judged(
    problem: Problem,
    information: np.ndarray,
    right: np.ndarray,
    support: np.ndarray,
    penalty: float,
    *,
    about: np.ndarray | None = None,
    seen: bool = False,
    objection: str = "",
    doubt: str = "",
    initial_states: np.ndarray,
    sigma: np.ndarray,
    chi2: float,
    diagnostics: dict[str, float] | None = None,
) -> IdentifiedModel:
    """The identified model and its status, the same for all methods.

    information, right, support, penalty, about: as in `selection`, `about` zero outside the
    support. seen: whether every mixture of terms as large as the motion would leave a trace.
    objection: why the fit must not be trusted, doubt: why its terms are not settled, ''
    where there is nothing to say. The rest as in `IdentifiedModel`.

    `ok` claims: the terms found are right, and every absent one is smaller than its stated limit.
    """
    if objection:
        return refused(problem, objection)
    free, covariance = solve_support(information, right, support)
    if about is not None:
        free = free + about
    status, reason = "not identifiable", "no term stands out of the noise"
    errors = added_deviation(information, support)
    if support.any():
        rivals = MOST_RIVAL_WEIGHT_SEEN if seen else MOST_RIVAL_WEIGHT
        whitened = whiten(information, right, about)
        plausible = plausible_supports(whitened, support)
        errors = unconditional_errors(plausible, errors)
        questions = open_questions(problem, whitened, plausible, rivals)
        reason = "; ".join(filter(None, [doubt, questions]))
        status = "not identifiable" if reason else "ok"
    conditional = np.full(len(support), np.nan)
    conditional[support] = np.sqrt(np.diag(covariance))
    return IdentifiedModel(
        model=PolynomialModel(problem.states, problem.terms, problem.coefficients(free)),
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


def refused(problem: Problem, reason: str) -> IdentifiedModel:
    """No model, for `reason`."""
    return IdentifiedModel.refused(problem.states, problem.terms, reason)
