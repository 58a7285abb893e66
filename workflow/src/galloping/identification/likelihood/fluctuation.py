"""Coefficients that fluctuate during a recording, as gusts vary the damping.

The coefficients of terms linear in a state whose equation is identified (of a line, the dampings)
vary about a mean, independently, with a correlation that falls exponentially in time. The variances
of these fluctuations, and the covariance of the remaining jumps between stretches, are estimated by
expectation maximisation.
"""

from dataclasses import replace

import numpy as np

from galloping.identification.likelihood.condense import WINDOWS_PER_PERIOD
from galloping.identification.likelihood.elimination import eliminate_with_jumps, jump_covariance
from galloping.identification.likelihood.shooting import Linearised, ShootingData
from galloping.identification.likelihood.weak_constraint import (
    STRETCH_PERIODS,
    StretchFit,
    shorten_until_integrable,
    white_misfit,
)
from galloping.identification.no_model import NoModelError
from galloping.identification.work import is_exhausted
from galloping.model.polynomial import exponent_matrix
from galloping.progress_reports import passing

# Number of parts of a stretch. Coefficients are constant in each part, which lasts a tenth of their
# correlation time. Measured: with ten parts, the slow mode seems to fluctuate as well.
PARTS = 24
# Correlation of a fluctuation with itself one part later. The correlation time is four periods.
# Measured: dampings and amplitudes in gusts are as accurate with 2 to 7 periods as with the true
# spectrum of the wind.
PART_CORRELATION = np.exp(-STRETCH_PERIODS / (PARTS * 4.0))


def fit_fluctuations(fit: StretchFit, penalty: float) -> tuple[StretchFit, np.ndarray]:
    """Fit a model whose coefficients fluctuate randomly in time: select terms, estimate means.

    fit: of the whole library. penalty: of a term in units of chi^2, if the model were exact.
    Returns the fit, and the covariance of the means (n_support, n_support). Raises NoModelError
    unless fluctuations explain most of the residual beyond the noise: they would also explain part
    of something else that the library lacks, such as further modes. Raises it, too, if segments are
    too short or too many to be divided, no term remains or the work is exhausted; and
    FloatingPointError, or numpy's LinAlgError, if the iteration diverges.
    """
    record, problem = fit.record, fit.record.problem
    equation, term = problem.candidates.T
    exponents = exponent_matrix(problem.terms, len(problem.names))[term]
    # terms linear in a state whose equation is identified, such as the dampings of a line
    of_rate = exponents[:, np.unique(equation)].sum(axis=1) == 1
    linear = (np.abs(exponents).sum(axis=1) == 1) & (problem.degrees == 1)
    rates = np.flatnonzero(linear & of_rate)
    misfit = white_misfit(record, fit.linearised.residual)
    excess = _log_excess(record, misfit)
    windows = np.diff(record.segments.first)
    divisible = windows.min() >= PARTS and len(windows) <= 200  # each part needs 50 kB or more
    if not (len(rates) and excess > 0.0 and divisible):
        raise NoModelError
    parts, jumping = _divide_segments(record)
    size = np.sqrt(np.mean(record.states**2, axis=0)) + np.finfo(float).tiny
    period = WINDOWS_PER_PERIOD * record.condensed.step
    # (n_rates,) coefficients with which a term alone would move its state as fast as the motion
    unit = 2.0 * np.pi / period * size[equation[rates]] / size[exponents[rates].argmax(axis=1)]
    # first and least variance of expectation maximisation: from zero it would never rise
    variance, least = (2e-3 * unit) ** 2, (1e-6 * unit) ** 2
    # The first and the last fit choose no terms. Each takes five passes for the slowly changing
    # variances. With three or six fits, or with three passes, one of ten answers of `make exam`
    # changes, by less than 0.2 standard errors.
    passes = 4
    fine = replace(fit, record=parts, starts=parts.starts, misfit=misfit, repeated=rates)
    for iteration in range(passes):
        if is_exhausted():
            raise NoModelError
        passing("try coefficients that fluctuate")
        misfit = white_misfit(parts, fine.linearised.residual)
        # Fluctuations explain 0.56 or more of the excess if the library lacks only gusts, and 0.06
        # or less without gusts. On a line with more modes in the same gusts they explain 0.32 to
        # 0.50, and the terms that are then chosen imitate these modes.
        if iteration and not excess - _log_excess(record, misfit) >= 0.53 * excess:
            raise NoModelError
        support, jump = fine.support, fine.jump
        for remaining in reversed(range(5)):
            wider = _add_fluctuations(parts, fine.linearised, rates, variance)
            roots = _change_roots(parts, jumping, jump, size, variance)
            solved = eliminate_with_jumps(wider, parts.segments, roots)
            if not remaining and 0 < iteration < passes - 1:
                support = solved.choose_terms(fine, penalty)
                support = problem.same_state_monomial(support)
            free, covariance = solved.best_coefficients(fine, support)
            change = free - fine.free
            jump = jump_covariance(parts, wider, solved, change, jumping)
            step = solved.move_states(change)
            squares = np.diagonal(solved.variance, axis1=1, axis2=2) + step**2
            variance = np.maximum(squares[:, len(size) :].mean(axis=0), least)
        starts = fine.starts + step[:, : len(size)]
        next_fit = replace(
            fine, free=free, support=support, starts=starts, misfit=misfit, jump=jump
        )
        fine = shorten_until_integrable(fine, next_fit)
    if not fine.support.any():
        raise NoModelError
    return replace(fit, free=fine.free, support=fine.support), covariance


def _log_excess(record: ShootingData, misfit: np.ndarray) -> float:
    """Sum the logarithm of a white misfit over the noise, over channels with a noise estimate."""
    condensed = record.condensed
    noise = np.maximum(condensed.noise_variance, record.floor**2)
    return float(np.sum(np.log(misfit[:, 0, :, 0] / noise)[condensed.has_noise_estimate]))


def _divide_segments(record: ShootingData) -> tuple[ShootingData, np.ndarray]:
    """Divide segments into PARTS; return the record, and the parts that end a followed segment."""
    segments = record.segments
    first = np.linspace(segments.first[:-1], segments.first[1:], PARTS, endpoint=False, axis=1)
    first = np.append(first.round().astype(np.int64), segments.first[-1])
    owner = np.repeat(segments.recording, PARTS)
    jumping = PARTS * (record.followed_segments + 1) - 1
    return replace(record, segments=replace(segments, first=first, recording=owner)), jumping


def _add_fluctuations(
    record: ShootingData, linear: Linearised, rates: np.ndarray, variance: np.ndarray
) -> Linearised:
    """Add fluctuations of the coefficients `rates` (n_rates,) to each segment's state.

    `linear` repeats the columns of these coefficients. variance: (n_rates,) of the fluctuations.
    """
    (count, n_states), n, extra = linear.starts.shape, linear.right.shape[1], len(variance)
    begin = np.zeros((count, extra, linear.rows.shape[2]))
    begin[record.first_segments, :, n + n_states : -1] = np.diag(variance**-0.5)
    padding = ((0, 0), (0, extra))
    slopes = np.pad(linear.end_derivatives, (*padding, (0, extra)))
    slopes[:, :n_states, n + n_states :] = linear.end_derivatives[:, :, rates]
    slopes[:, n_states:, n + n_states :] = PART_CORRELATION * np.eye(extra)
    return replace(
        linear, starts=np.pad(linear.starts, padding), ends=np.pad(linear.ends, padding),
        rows=np.concatenate([linear.rows, begin], axis=1), end_derivatives=slopes,
    )  # fmt: skip


def _change_roots(
    record: ShootingData,
    jumping: np.ndarray,
    jump: np.ndarray,
    size: np.ndarray,
    variance: np.ndarray,
) -> np.ndarray:
    """Compute roots of the inverse covariance of the change of state and fluctuations.

    Returns (n_segments, n_states + n_rates, n_states + n_rates). States jump after `jumping` alone.
    """
    states = record.jump_roots(np.diag((1e-4 * size) ** 2))  # practically continuous
    states[jumping] = record.jump_roots(jump)[jumping]
    n_states = len(size)
    roots = np.pad(states, ((0, 0), (0, len(variance)), (0, len(variance))))
    roots[:, n_states:, n_states:] = np.diag(((1.0 - PART_CORRELATION**2) * variance) ** -0.5)
    return roots
