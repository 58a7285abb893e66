"""Weighted linear least squares for exact states with noisy derivatives, by equation."""

from typing import Any

import numpy as np
from scipy.special import ndtri

from galloping.identification.findings import Code, Finding
from galloping.identification.identified_model import IdentifiedModel
from galloping.identification.likelihood.approximate_fit import prior_covariance
from galloping.identification.likelihood.condense import TRUNCATION_ERROR
from galloping.identification.likelihood.free_run import sandwich_covariance
from galloping.identification.likelihood.residual_tests import FALSE_OBJECTION_RATE
from galloping.identification.likelihood.verdict import Regression, assess_approximation, assess_fit
from galloping.identification.postprocessing import refused_model
from galloping.identification.problem import Problem, largest_coefficients
from galloping.model.polynomial import design_matrix
from galloping.recording.samples import Recording, inputs_at_times


def derivative_fit(problem: Problem, recordings: list[Recording]) -> IdentifiedModel:
    """Fit the unknown equations to measured derivatives by least squares, and select their terms.

    The noise of each recording's derivatives is estimated from the residuals of the whole library.
    Rows with a missing value are left out, and recordings with no more complete rows of an equation
    than the library has terms. The model is `refused` if no row remains, and `approximate` if its
    residuals are correlated from sample to sample; intervals are then those of
    `sandwich_covariance`. The penalty of a term counts the samples of its equation.
    """
    n = len(problem.candidates)
    information, right = problem.prior_equations()
    support = np.zeros(n, bool)
    sigma = np.full((len(recordings), len(problem.states)), np.nan)
    values = [
        np.hstack([one.values, inputs_at_times(list(one.inputs.values()), one.time)])
        for one in recordings
    ]
    thetas = [design_matrix(one, problem.terms) for one in values]
    all_rates = [one.rates for one in recordings if one.rates is not None]
    size = largest_coefficients(problem, np.concatenate(values), np.concatenate(all_rates))
    squares, count, parts = 0.0, 0, []
    for i in problem.unknown:
        block = np.flatnonzero(problem.candidates[:, 0] == i)
        columns = problem.candidates[block, 1]
        samples = 0
        for r, (theta, rates) in enumerate(zip(thetas, all_rates, strict=True)):
            rate = rates[:, i] - theta @ problem.known[i]
            is_complete = np.isfinite(rate) & np.all(np.isfinite(theta), axis=1)
            if is_complete.sum() <= len(problem.terms):
                continue  # too few rows to estimate their noise
            rows, rate = theta[np.ix_(is_complete, columns)], rate[is_complete]
            scale = np.maximum(np.linalg.norm(rows, axis=0), np.finfo(float).tiny)
            residual = rate - rows @ (np.linalg.lstsq(rows / scale, rate, rcond=None)[0] / scale)
            floor = TRUNCATION_ERROR * np.abs(rate).max() + np.finfo(float).tiny
            sigma[r, i] = max(np.sqrt(residual @ residual / (len(rate) - len(block))), floor)
            information[np.ix_(block, block)] += rows.T @ rows / sigma[r, i] ** 2
            right[block] += rate @ rows / sigma[r, i] ** 2
            squares += float(rate @ rate) / sigma[r, i] ** 2
            samples += len(rate)
            parts.append((block, rows / sigma[r, i], rate / sigma[r, i], sigma[r, i] > floor))
        if not samples:
            return refused_model(problem, [Finding.of(Code.SAMPLES_INCOMPLETE, problem.states[i])])
        penalties = problem.term_penalties(2.0 * np.log(samples), size).of_terms(block)
        support[block] = problem.select_terms(
            information[np.ix_(block, block)], right[block], [np.ones(len(block), bool)], penalties,
            indices=block,
        )  # fmt: skip
        count += samples
    penalty = 2.0 * np.log(count / len(problem.unknown))  # by the mean sample count of an equation
    free, covariance = problem.solve_within_bounds(information, right, support)
    of_data, right_of_data = map(np.subtract, (information, right), problem.prior_equations())
    misfit = squares + float(free @ (of_data @ free - 2.0 * right_of_data))
    fit_fields: dict[str, Any] = {
        "initial_states": np.array([recording.values[0] for recording in recordings]),
        "sigma": sigma,
        "chi2": misfit / max(count - int(support.sum()), 1),
    }
    residuals = [rate - rows @ free[block] for block, rows, rate, _ in parts]
    correlations = [
        float(one[1:] @ one[:-1] / np.sqrt(one[1:] @ one[1:] * (one[:-1] @ one[:-1]) / len(one)))
        for one, (*_, is_noisy) in zip(residuals, parts, strict=True)
        if is_noisy
    ]
    if max(correlations, default=0.0) < -ndtri(FALSE_OBJECTION_RATE / max(len(correlations), 1)):
        regression = Regression(information, right, support, penalty, size)
        return assess_fit(problem, regression, **fit_fields)
    gradients = []
    for one, (block, rows, *_) in zip(residuals, parts, strict=True):
        gradient = np.zeros((len(one), n))
        gradient[:, block] = one[:, None] * rows
        gradients.append(gradient[:, support])
    from_prior = prior_covariance(problem, covariance, support)
    covariance = sandwich_covariance(gradients, covariance) + from_prior
    findings = [Finding.of(Code.DERIVATIVES_CORRELATED)]
    return assess_approximation(
        problem, free, support, information, covariance, penalty, findings, **fit_fields
    )
