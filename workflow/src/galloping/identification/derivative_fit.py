"""Exact states with noisy derivatives: weighted linear least squares, equation by equation."""

from __future__ import annotations

import numpy as np

from galloping.identification.problem import Problem
from galloping.identification.result import Identified
from galloping.identification.selection import (
    added_deviation,
    alternatives,
    select,
    solve_support,
)
from galloping.identification.verdict import AMBIGUOUS, exchange_reason
from galloping.polynomial import PolynomialModel, design_matrix
from galloping.recording import Recording

SMALLEST_NOISE = 1e-7


def derivative_fit(problem: Problem, recordings: list[Recording]) -> Identified:
    """Support and coefficients of the unknown equations from measured derivatives.

    The noise of each recording's derivatives is estimated from the residuals of the whole
    library. Rows with a missing value are left out. Raises ValueError where an unknown equation
    has no more complete rows than the library has terms.
    """
    shape = problem.known.shape
    coefficients, deviation = problem.known.copy(), np.full(shape, np.nan)
    support = np.zeros(shape, bool)
    sigma = np.full((len(recordings), len(problem.states)), np.nan)
    covariances, exchanges = [], []
    squares, freedom = 0.0, 0
    thetas = [design_matrix(recording.values, problem.terms) for recording in recordings]
    n_terms = len(problem.terms)
    for i in problem.unknown:
        information, right, count = np.zeros((n_terms, n_terms)), np.zeros(n_terms), 0
        total = 0.0
        for r, (theta, recording) in enumerate(zip(thetas, recordings, strict=True)):
            rate = recording.derivatives[:, i]
            good = np.isfinite(rate) & np.all(np.isfinite(theta), axis=1)
            if good.sum() <= n_terms:
                raise ValueError(f"too few complete samples for d{problem.states[i]}/dt")
            rows, rate = theta[good], rate[good]
            scale = np.maximum(np.linalg.norm(rows, axis=0), np.finfo(float).tiny)
            gap = rate - rows @ (np.linalg.lstsq(rows / scale, rate, rcond=None)[0] / scale)
            floor = SMALLEST_NOISE * np.abs(rate).max() + np.finfo(float).tiny
            sigma[r, i] = max(np.sqrt(gap @ gap / (len(rate) - n_terms)), floor)
            rows, rate = rows / sigma[r, i], rate / sigma[r, i]
            information += rows.T @ rows
            right += rows.T @ rate
            total += float(rate @ rate)
            count += len(rate)
        penalty = 2.0 * np.log(count)
        found = select(information, right, [np.ones(n_terms, bool)], penalty)
        coefficients[i], covariance = solve_support(information, right, found)
        covariances.append(covariance)
        deviation[i] = added_deviation(information, found)
        deviation[i, found] = np.sqrt(np.diag(covariance))
        support[i] = found
        squares += total - float(coefficients[i] @ right)
        freedom += count - int(found.sum())
        for out, new, rise in alternatives(information, right, found, AMBIGUOUS):
            exchanges.append(((i, out), (i, new), rise))
    covariance = np.zeros((support.sum(), support.sum()))
    done = 0
    for block in covariances:
        covariance[done : done + len(block), done : done + len(block)] = block
        done += len(block)
    reason = exchange_reason(problem, exchanges)
    return Identified(
        model=PolynomialModel(problem.states, problem.terms, coefficients),
        support=support,
        covariance=covariance,
        initial_states=np.array([recording.values[0] for recording in recordings]),
        sigma=sigma,
        chi2=squares / max(freedom, 1),
        status="not identifiable" if reason else "ok",
        reason=reason,
        deviation=deviation,
    )
