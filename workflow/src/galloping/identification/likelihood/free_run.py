"""Model with the least error in a free run over a recording that inputs drive.

Inputs determine the phase, so that errors do not accumulate (simulation error, or output error).
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from galloping.identification.findings import Code, Finding
from galloping.identification.identified_model import IdentifiedModel
from galloping.identification.likelihood.approximate_fit import (
    SYSTEMATIC_FACTOR,
    Approximation,
    as_identified,
    prior_covariance,
    small_sample_factor,
)
from galloping.identification.likelihood.elimination import RANK_TOLERANCE
from galloping.identification.likelihood.shooting import (
    Segments,
    ShootingData,
    ShootingFit,
    segment_residuals,
)
from galloping.identification.likelihood.trajectory_fit import (
    DECREMENT_TOLERANCE,
    take_step,
)
from galloping.identification.no_model import NoModelError
from galloping.identification.selection import solve_support


def approximate_free_runs(
    fit: ShootingFit,
    information: np.ndarray,
    residual: np.ndarray,
    penalty: float,
    objections: Sequence[Finding],
) -> IdentifiedModel:
    """Make an approximate model from a fit of uninterrupted simulations, with robust errors.

    The simulations, or free runs, are the chains of `fit`. information: (n_candidates,
    n_candidates). residual: (n_windows, n_observed, n_rows) of the free runs. The other arguments
    are as in `fit_approximation`, and so are the diagnostics, of free runs instead of
    forecasts. Intervals, of `sandwich_covariance`, are valid for residuals of any spectrum.
    """
    _, inverse = solve_support(information, np.zeros(len(fit.free)), fit.support)
    covariance = sandwich_covariance(_window_gradients(fit, residual), inverse)
    record, condensed = fit.record, fit.record.condensed
    covariance += prior_covariance(record.problem, inverse, fit.support)
    approximation = Approximation(fit, information, covariance, residual, penalty, ("free runs",))
    squares = condensed.sum_squares(residual)
    noise = np.sqrt((squares + condensed.remainder) / np.maximum(condensed.counts, 1))
    return as_identified(approximation, residual, noise, objections, Code.FREE_RUN_MISSES)


def sandwich_covariance(gradients: Iterable[np.ndarray], covariance: np.ndarray) -> np.ndarray:
    """Compute the sandwich covariance of coefficients (P. J. Huber, 1967), (n_support, n_support).

    gradients: (n, n_support) of chi^2 / 2 of each recording, in the order of time, which are summed
    over 40 stretches of it. covariance: that for white residuals. A factor allows for an error
    common to all stretches.

    Stretches must be so long that they are independent of each other, and so many that their
    covariance is known: of 40, `small_sample_factor` is 1.07. With 20 or 80 no answer of `make
    exam` changes.
    """
    sums = []
    for gradient in gradients:
        first = np.linspace(0, len(gradient), min(len(gradient), 40), endpoint=False).astype(int)
        sums.append(np.add.reduceat(gradient, first))
    influence = np.concatenate(sums) @ covariance
    return SYSTEMATIC_FACTOR * small_sample_factor(len(influence)) * influence.T @ influence


def fit_free_runs(
    record: ShootingData, identified: IdentifiedModel, penalty: float, objections: Sequence[Finding]
) -> IdentifiedModel:
    """Refit an approximate model, with its terms, to minimise the error of its free runs.

    Detection limits remain those of `identified`, with which the terms were chosen. Raises
    NoModelError if the motion depends on its initial state to the end, and FloatingPointError if
    the iteration diverges.
    """
    condensed, recordings = record.condensed, np.arange(len(record.condensed.first) - 1)
    record = replace(record, segments=Segments(condensed.first, recordings, recordings))
    free = record.problem.candidate_values(identified.model.coefficients)
    starts = identified.initial_states
    squares = condensed.sum_squares(segment_residuals(record, free, starts)[0])
    sigma = np.maximum(np.sqrt(squares / np.maximum(condensed.rows, 1)), record.floor)
    previous_fit = fit = ShootingFit(record, free, free != 0.0, starts, sigma, sigma)
    if not has_forgotten_start(fit):
        raise NoModelError
    for _ in range(20):  # passes, at most
        step = take_step(previous_fit, fit, None, None)
        previous_fit, fit = step.before, step.fit
        if step.decrement < DECREMENT_TOLERANCE:
            break
    residual, _ = segment_residuals(record, fit.free, fit.starts)
    information = fit.linearise().information.sum(axis=0)
    run = approximate_free_runs(fit, information, residual, penalty, objections)
    return replace(run, detection_limits=identified.detection_limits)


def has_forgotten_start(fit: ShootingFit) -> bool:
    """Decide whether the end of a fitted motion is independent of its initial state.

    The last tenth of each chain must depend at most a tenth as much on the first state as the first
    tenth does: far less for a damped system that is driven, as much for a limit cycle, whose phase
    persists. With a twentieth or a fifth no answer of `make exam` changes. Raises
    FloatingPointError if the model diverges over a chain.
    """
    for _, rows, _ in _chain_slopes(fit, fit.record.problem.candidates[:0]):
        tenth = max(len(rows) // 10, 1)
        if not np.linalg.norm(rows[-tenth:]) < 0.1 * np.linalg.norm(rows[:tenth]):
            return False
    return True


def _window_gradients(fit: ShootingFit, residual: np.ndarray) -> Iterator[np.ndarray]:
    """Yield gradients of chi^2 / 2 by coefficients, (n_windows, n_support), of each chain.

    They are those of a run from the chain's optimal first state.
    """
    pairs = fit.record.problem.candidates[fit.support]
    n = len(pairs)
    for windows, rows, weight in _chain_slopes(fit, pairs):
        flat = rows.reshape(-1, rows.shape[3])
        by_start = np.linalg.lstsq(flat[:, n:], flat[:, :n], rcond=RANK_TOLERANCE)[0]
        design = rows[..., :n] - rows[..., n:] @ by_start
        yield np.einsum("worp,wor->wp", design, residual[windows] * weight)


def _chain_slopes(
    fit: ShootingFit, pairs: np.ndarray
) -> Iterator[tuple[slice, np.ndarray, np.ndarray]]:
    """Yield each chain's windows, slopes by coefficients and first state, and one over the noise.

    The slopes, (n_windows, n_observed, n_rows, n_pairs + n_states), are in units of the noise.
    """
    whole = fit.whole_chains
    chains = whole.record.iterate_linearised(fit.free, whole.starts, pairs, at_once=1)
    for chain, windows, _, rows, *_ in chains:
        weight = 1.0 / fit.sigma[whole.record.segments.recording[chain.start]][:, None]
        yield windows, rows * weight[..., None], weight
