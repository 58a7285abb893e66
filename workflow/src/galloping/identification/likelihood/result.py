"""What every identification method returns."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from galloping.identification.likelihood.problem import Problem
from galloping.identification.likelihood.selection import added_deviation
from galloping.polynomial import PolynomialModel


@dataclass(frozen=True)
class Identified:
    """A model from recordings, with its uncertainty and a verdict.

    model: on the full library, zero where a term is absent; known equations included.
    support: (n_states, n_terms) boolean, the terms found in the unknown equations.
    covariance: (n_found, n_found) of their coefficients, in the order of np.argwhere(support).
    initial_states: (n_recordings, n_states), at the first sample of each recording.
    sigma: (n_recordings, n_states) noise of a sample of each channel, NaN where not measured; for
    recordings with derivatives, noise of the derivatives.
    chi2: misfit per degree of freedom against the noise measured within short windows.
    status: `ok`; `not identifiable` when the data leave open which terms there are, the model
    being one of those possible; `refused` when it must not be trusted. reason: one line, or ''.
    deviation: (n_states, n_terms) standard deviation of each coefficient: of the found ones as in
    `covariance`, of each absent one were it added; NaN in known equations.
    diagnostics: figures behind the verdict, by name.
    """

    model: PolynomialModel
    support: np.ndarray
    covariance: np.ndarray
    initial_states: np.ndarray
    sigma: np.ndarray
    chi2: float
    status: str
    reason: str
    deviation: np.ndarray
    diagnostics: dict[str, float] = field(default_factory=dict)


def assembled(
    problem: Problem,
    free: np.ndarray,
    support: np.ndarray,
    information: np.ndarray,
    covariance: np.ndarray,
    *,
    initial_states: np.ndarray,
    sigma: np.ndarray,
    chi2: float,
    status: str,
    reason: str,
    diagnostics: dict[str, float],
) -> Identified:
    """The result from a regression on the candidates.

    free, support: (n_candidates,). information: (n_candidates, n_candidates). covariance: of the
    supported coefficients, in the order of the candidates. The rest as in `Identified`.
    """
    rows, columns = problem.candidates.T
    of_candidates = added_deviation(information, support)
    of_candidates[support] = np.sqrt(np.diag(covariance))
    found = np.zeros(problem.known.shape, bool)
    deviation = np.full(problem.known.shape, np.nan)
    found[rows, columns] = support
    deviation[rows, columns] = of_candidates
    return Identified(
        model=PolynomialModel(problem.states, problem.terms, problem.coefficients(free)),
        support=found,
        covariance=covariance,
        initial_states=initial_states,
        sigma=sigma,
        chi2=chi2,
        status=status,
        reason=reason,
        deviation=deviation,
        diagnostics=diagnostics,
    )


def refused(problem: Problem, n_recordings: int, reason: str) -> Identified:
    """A result without a model, for `reason`."""
    shape = problem.known.shape
    return Identified(
        model=PolynomialModel(problem.states, problem.terms, problem.known),
        support=np.zeros(shape, bool),
        covariance=np.zeros((0, 0)),
        initial_states=np.full((n_recordings, shape[0]), np.nan),
        sigma=np.full((n_recordings, shape[0]), np.nan),
        chi2=np.nan,
        status="refused",
        reason=reason,
        deviation=np.full(shape, np.nan),
    )
