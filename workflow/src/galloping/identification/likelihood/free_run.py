"""The model that errs least when it runs freely over a recording that inputs drive.

The phase of such a motion is that of its inputs: what the model misses does not add up, as it does
in a limit cycle, and the whole recording is one stretch (simulation error, or output error).
"""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from galloping.identification.likelihood.condense import Condensed
from galloping.identification.likelihood.model_error import (
    SYSTEMATIC,
    Approximation,
    mean_squares,
    of_few,
    prior_covariance,
    stated,
)
from galloping.identification.likelihood.problem import Problem
from galloping.identification.likelihood.selection import solve_support
from galloping.identification.likelihood.shooting import (
    UNDETERMINED,
    Segments,
    linearise,
    residuals,
)
from galloping.identification.likelihood.trajectory_fit import (
    CONVERGED,
    MOST_PASSES,
    Fit,
    guarded_step,
)
from galloping.identification.model import IdentifiedModel
from galloping.taylor import system

FORGOTTEN = 0.1  # share of a first state's effect on the motion that is left where it is forgotten
MOST_PULLS = 40  # stretches of a recording, long enough to be independent of each other


def whole_approximation(
    problem: Problem,
    condensed: Condensed,
    segments: Segments,
    fit: Fit,
    information: np.ndarray,
    residual: np.ndarray,
    penalty: float,
    objection: str,
) -> IdentifiedModel:
    """The approximate model whose free runs are the chains of `segments`.

    fit: which matches the segments. information: of the candidates. residual: (n_windows,
    n_observed, n_rows) of the free runs. The rest as in `model_error.approximation`, as are the
    diagnostics, of the free runs in place of forecasts. Intervals hold for residuals of any
    spectrum: they are as wide as the pulls of MOST_PULLS stretches on the coefficients differ
    (sandwich; P. J. Huber, 1967), and a factor wider for what errs alike in all.
    """
    pulls = np.concatenate(
        [
            np.add.reduceat(pull, np.linspace(0, len(pull), count, endpoint=False).astype(int))
            for pull in _pulls(problem, condensed, segments, fit, residual)
            if (count := min(len(pull), MOST_PULLS))
        ]
    )
    _, covariance = solve_support(information, np.zeros(len(fit.free)), fit.support)
    moved = pulls @ covariance
    covariance = SYSTEMATIC * of_few(len(moved)) * moved.T @ moved
    covariance += prior_covariance(problem, information, fit.support)
    made = Approximation(
        fit.free, fit.support, fit.starts, information, covariance,
        mean_squares(condensed, segments, residual), residual[:, :, 0], path=("free runs",),
    )  # fmt: skip
    squares = condensed.squares(residual)
    left = np.sqrt((squares + condensed.remainder) / np.maximum(condensed.counts, 1))
    return stated(
        problem, condensed, segments, made, residual, left, penalty,
        f"{objection}; over the whole recording it leaves",
    )  # fmt: skip


def free_runs(
    problem: Problem,
    condensed: Condensed,
    near: IdentifiedModel,
    floor: np.ndarray,
    penalty: float,
    objection: str,
) -> IdentifiedModel | None:
    """The same terms as those of `near`, an approximate model, with the least error of free runs.

    None where the motion remembers how it began, or no such model is found. floor: as in `Fit`.
    """
    count = len(condensed.first) - 1
    each = Segments(condensed.first, np.arange(count), np.arange(count))
    free = problem.of_candidates(near.model.coefficients)
    starts = near.initial_states
    try:
        remaining, _ = residuals(problem, condensed, each, free, starts)
        squares = condensed.squares(remaining) / np.maximum(condensed.rows, 1)
        sigma = np.maximum(np.sqrt(squares), floor)
        fit = Fit(free, free != 0.0, starts, sigma, floor, sigma, np.inf)
        if not forgets_start(problem, condensed, each, fit):
            return None
        previous = fit
        for _ in range(MOST_PASSES):
            step = guarded_step(problem, condensed, each, previous, fit, None, None)
            previous, fit = step.before, step.fit
            if step.decrement < CONVERGED:
                break
        remaining, _ = residuals(problem, condensed, each, fit.free, fit.starts)
        information = linearise(
            problem, condensed, fit.sigma, each, fit.free, fit.starts
        ).information
        return whole_approximation(
            problem, condensed, each, fit, information, remaining, penalty, objection
        )
    except (FloatingPointError, np.linalg.LinAlgError):
        return None


def forgets_start(problem: Problem, condensed: Condensed, segments: Segments, fit: Fit) -> bool:
    """Whether the end of each chain depends FORGOTTEN as much on how it began as the beginning
    does: that of a damped system that is driven does not, the phase of a limit cycle stays.
    """
    for _, rows, _ in _slopes(problem, condensed, segments, fit, problem.candidates[:0]):
        tenth = max(len(rows) // 10, 1)
        if not np.linalg.norm(rows[-tenth:]) < FORGOTTEN * np.linalg.norm(rows[:tenth]):
            return False
    return True


def _pulls(
    problem: Problem, condensed: Condensed, segments: Segments, fit: Fit, residual: np.ndarray
) -> Iterator[np.ndarray]:
    """How each window of each chain pulls the coefficients of the fit, (n_windows, n_support).

    The gradient of chi^2 / 2 in runs from the first state of a chain, that state at its best.
    """
    pairs = problem.candidates[fit.support]
    n = len(pairs)
    for own, rows, weight in _slopes(problem, condensed, segments, fit, pairs):
        flat = rows.reshape(-1, rows.shape[3])
        by_start = np.linalg.lstsq(flat[:, n:], flat[:, :n], rcond=UNDETERMINED)[0]
        design = rows[..., :n] - rows[..., n:] @ by_start
        yield np.einsum("worp,wor->wp", design, residual[own] * weight)


def _slopes(
    problem: Problem, condensed: Condensed, segments: Segments, fit: Fit, pairs: np.ndarray
) -> Iterator[tuple[slice, np.ndarray, np.ndarray]]:
    """Of each chain its windows, the slopes (n_windows, n_observed, n_rows, n_pairs + n_states) of
    the solution from its first state, over the noise, and one over the noise (n_observed, 1).
    """
    compiled = system(problem.tables, problem.coefficients(fit.free), pairs)
    bounds = np.flatnonzero(np.diff(segments.chains, prepend=-1, append=-1))
    for begin, end in pairwise(bounds):
        first = segments.first[[begin, end]]
        rows = condensed.solution(compiled, first, fit.starts[begin : begin + 1], True)[1]
        weight = 1.0 / fit.sigma[segments.recording[begin]][:, None]
        rows *= weight[..., None]
        yield slice(*first), rows, weight
