"""From a regression on the candidates to an identified model."""

from __future__ import annotations

import numpy as np

from galloping.identification.likelihood.problem import Problem
from galloping.identification.likelihood.selection import added_deviation
from galloping.identification.model import IdentifiedModel
from galloping.polynomial import PolynomialModel


def verdict(support: np.ndarray, objection: str, questions: str) -> tuple[str, str]:
    """Status and reason of a fit.

    support: of the candidates, boolean. objection: why the fit must not be trusted. questions:
    what the data leave open. Both are '' where there is nothing to say.
    """
    if objection:
        return "refused", objection
    if not support.any():
        return "not identifiable", "no term stands out of the noise"
    return ("not identifiable", questions) if questions else ("ok", "")


def assembled(
    problem: Problem,
    free: np.ndarray,
    support: np.ndarray,
    information: np.ndarray,
    covariance: np.ndarray,
    penalty: float,
    *,
    initial_states: np.ndarray,
    sigma: np.ndarray,
    chi2: float,
    status: str,
    reason: str,
    diagnostics: dict[str, float],
) -> IdentifiedModel:
    """The identified model from a regression on the candidates.

    free, support: (n_candidates,). information: (n_candidates, n_candidates). covariance: of the
    supported coefficients, in the order of the candidates. penalty: that of the selection. The
    rest as in `IdentifiedModel`.
    """
    if status == "refused":
        return refused(problem, reason)
    errors = np.full(len(support), np.nan)
    errors[support] = np.sqrt(np.diag(covariance))
    limits = np.sqrt(penalty) * added_deviation(information, support)
    return IdentifiedModel(
        model=PolynomialModel(problem.states, problem.terms, problem.coefficients(free)),
        status=status,
        reason=reason,
        standard_errors=problem.on_library(errors),
        detection_limits=problem.on_library(limits),
        covariance=covariance,
        initial_states=initial_states,
        sigma=sigma,
        chi2=chi2,
        known=problem.known_equations,
        diagnostics=diagnostics,
    )


def refused(problem: Problem, reason: str) -> IdentifiedModel:
    """No model, for `reason`."""
    return IdentifiedModel.refused(problem.states, problem.terms, reason)
