"""Exact states with noisy derivatives: weighted linear least squares, equation by equation."""

import numpy as np

from galloping.identification.likelihood.condense import TRUNCATION
from galloping.identification.likelihood.problem import Problem, largest
from galloping.identification.likelihood.selection import select, solve_support
from galloping.identification.likelihood.verdict import Regression, by, judged, refused
from galloping.identification.model import IdentifiedModel
from galloping.polynomial import design_matrix
from galloping.recording import Recording, at_times


def derivative_fit(problem: Problem, recordings: list[Recording]) -> IdentifiedModel:
    """Support and coefficients of the unknown equations from measured derivatives.

    The noise of each recording's derivatives is estimated from the residuals of the whole
    library. Rows with a missing value are left out. Refused where an unknown equation has no more
    complete rows than the library has terms.
    """
    n, n_terms = len(problem.candidates), len(problem.terms)
    information, right, support = np.zeros((n, n)), np.zeros(n), np.zeros(n, bool)
    sigma = np.full((len(recordings), len(problem.states)), np.nan)
    values = [
        np.hstack([one.values, at_times(list(one.inputs.values()), one.time)]) for one in recordings
    ]
    thetas = [design_matrix(one, problem.terms) for one in values]
    squares, count = 0.0, 0
    information, right = problem.with_prior(information, right)
    for i in problem.unknown:
        block = np.flatnonzero(problem.candidates[:, 0] == i)
        columns = problem.candidates[block, 1]
        samples = 0
        for r, (theta, recording) in enumerate(zip(thetas, recordings, strict=True)):
            rate = recording.derivatives[:, i] - theta @ problem.known[i]
            good = np.isfinite(rate) & np.all(np.isfinite(theta), axis=1)
            if good.sum() <= n_terms:
                few = f"too few complete samples for d({problem.states[i]})/dt"
                return by(["derivatives"], refused(problem, few))
            rows, rate = theta[np.ix_(good, columns)], rate[good]
            scale = np.maximum(np.linalg.norm(rows, axis=0), np.finfo(float).tiny)
            gap = rate - rows @ (np.linalg.lstsq(rows / scale, rate, rcond=None)[0] / scale)
            floor = TRUNCATION * np.abs(rate).max() + np.finfo(float).tiny
            sigma[r, i] = max(np.sqrt(gap @ gap / (len(rate) - len(block))), floor)
            information[np.ix_(block, block)] += rows.T @ rows / sigma[r, i] ** 2
            right[block] += rate @ rows / sigma[r, i] ** 2
            squares += float(rate @ rate) / sigma[r, i] ** 2
            samples += len(rate)
        penalty, whole = 2.0 * np.log(samples), np.ones(len(block), bool)
        about = problem.chosen_about()
        support[block] = select(
            information[np.ix_(block, block)], right[block], [whole], penalty, about[block]
        )
        count += samples
    free, _ = solve_support(information, right, support)
    misfit = max(squares - float(free @ right), 0.0)
    size = largest(
        problem,
        np.concatenate(values),
        np.concatenate([recording.derivatives for recording in recordings]),
    )
    found = judged(
        problem,
        Regression(information, right, support, penalty, size),
        initial_states=np.array([recording.values[0] for recording in recordings]),
        sigma=sigma,
        chi2=misfit / max(count - int(support.sum()), 1),
    )
    return by(["derivatives"], found)
