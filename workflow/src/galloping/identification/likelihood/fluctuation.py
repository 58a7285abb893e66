"""Coefficients that fluctuate while a recording is made, as gusts vary the damping.

Those of terms linear in a state whose equation is sought, of a line the dampings, vary about a
mean, each by itself, with a correlation that falls exponentially in time. Their variances, and
those of the jumps that are left between stretches, are estimated by expectation maximisation.
"""

from dataclasses import replace

import numpy as np

from galloping.identification.likelihood.condense import WINDOWS_PER_PERIOD
from galloping.identification.likelihood.problem import Problem
from galloping.identification.likelihood.selection import select, solve_support
from galloping.identification.likelihood.weak_constraint import (
    STRETCH_PERIODS,
    Linear,
    Record,
    StretchFit,
    integrable,
    joint,
    jump_covariance,
    moved,
    white_misfit,
)
from galloping.passes import passing

# Coefficients that fluctuate. Parts of a stretch in which they are constant: a tenth of the
# correlation. Measured: with ten parts the slow mode seems to fluctuate as well.
FLUCTUATION_PARTS = 24
MOST_DIVIDED = 200  # stretches of a record, each part of which needs 50 kB and more
# Periods of correlation. Measured: dampings and amplitudes in gusts are as good with the true
# spectrum of the wind as with 2 to 7 periods.
FLUCTUATION_PERIODS = 4.0
FIRST_FLUCTUATION, LEAST_FLUCTUATION = 2e-3, 1e-6  # of a coefficient, relative to 2 pi a period
CONTINUOUS = 1e-4  # jump between parts of a stretch, relative to each state
FLUCTUATING_PASSES, VARIANCE_PASSES = 4, 5  # of the fit, and of the variances in each
# Share of the logarithm of misfit over noise, of the whole library, summed over the channels.
# Measured: fluctuations explain 0.56 or more of it where gusts are all that the library lacks, 0.32
# to 0.50 on a line with more modes in the same gusts, of which the terms that are then chosen
# imitate the modes, and 0.06 or less without gusts.
EXPLAINED = 0.53


def chosen(
    problem: Problem,
    information: np.ndarray,
    right: np.ndarray,
    support: np.ndarray,
    penalty: float,
) -> np.ndarray:
    """The terms that are worth their penalty, looked for from all and from those before.

    With a term comes what the library has of it with other powers of the inputs: a recording about
    one mean wind hardly tells them apart, and to leave one out would claim a law for other winds.
    """
    tried, about = [np.ones(len(right), bool), support], problem.chosen_about()
    return problem.alike(select(information, right, tried, penalty, about))


def fluctuating(fit: StretchFit, penalty: float) -> tuple[StretchFit, np.ndarray] | None:
    """The fit with means of coefficients that fluctuate, the terms chosen with them, and the
    covariance of the means (n_support, n_support).

    fit: of the whole library. None unless fluctuations explain EXPLAINED of what it leaves beyond
    the noise: where it lacks something else, such as modes that a sensor sees besides, they would
    take part of that for themselves. None, too, where segments are too short or too many to be
    divided, or no term is left. Raises FloatingPointError or LinAlgError where the iteration
    diverges.
    penalty: worth of a term in units of chi^2, were the model exact.
    """
    record, rates = fit.record, _rate_terms(fit.record.problem)
    misfit = white_misfit(record, fit.linear.residual)
    excess = _excess(record, misfit)
    windows = np.diff(record.segments.first)
    divisible = windows.min() >= FLUCTUATION_PARTS and len(windows) <= MOST_DIVIDED
    if not (len(rates) and excess > 0.0 and divisible):
        return None
    parts, jumping = _parts(record)
    size = np.sqrt(np.mean(record.states**2, axis=0)) + np.finfo(float).tiny
    unit = _units(record, size, rates)
    variance, least = (FIRST_FLUCTUATION * unit) ** 2, (LEAST_FLUCTUATION * unit) ** 2
    fine = replace(fit, record=parts, starts=parts.starts, misfit=misfit)
    for passed in range(FLUCTUATING_PASSES):
        passing("try coefficients that fluctuate")
        misfit = white_misfit(parts, fine.linear.residual)
        if passed and not excess - _excess(record, misfit) >= EXPLAINED * excess:
            return None
        wider = _with_fluctuations(fine.linear, rates)
        starts = np.pad(fine.starts, ((0, 0), (0, len(rates))))
        support, jump = fine.support, fine.jump
        for settling in reversed(range(VARIANCE_PASSES)):
            precision = _precision(parts, jumping, jump, size, variance)
            solved = joint(parts, _stationary(parts, wider, variance), starts, precision)
            solved = solved.with_prior(record.problem, fine.free)
            right = solved.right + solved.information @ fine.free
            if not settling and 0 < passed < FLUCTUATING_PASSES - 1:
                support = chosen(record.problem, solved.information, right, support, penalty)
            free, covariance = solve_support(solved.information, right, support)
            change = free - fine.free
            jump = jump_covariance(parts, wider, starts, solved, change, jumping)
            step = moved(solved, change)
            own = np.diagonal(solved.variance, axis1=1, axis2=2) + step**2
            variance = np.maximum(own[:, len(size) :].mean(axis=0), least)
        free, starts = fine.free + change, fine.starts + step[:, : len(size)]
        fine = integrable(fine, StretchFit(parts, free, support, starts, misfit, jump))
    if not fine.support.any():
        return None
    return replace(fit, free=fine.free, support=fine.support), covariance


def _excess(record: Record, misfit: np.ndarray) -> float:
    """Logarithm of a white misfit over noise, of the channels whose samples tell theirs, summed."""
    condensed = record.condensed
    noise = np.maximum(condensed.noise_variance, record.floor**2)
    return float(np.sum(np.log(misfit[:, 0, :, 0] / noise)[condensed.tells_noise]))


def _rate_terms(problem: Problem) -> np.ndarray:
    """Indices of the candidates that are linear in a state whose own equation is unknown."""
    terms = np.array(problem.terms)[problem.candidates[:, 1]]
    unknown = terms[:, np.unique(problem.candidates[:, 0])]
    linear = np.abs(terms).sum(axis=1) == 1
    return np.flatnonzero(linear & (unknown.sum(axis=1) == 1))


def _parts(record: Record) -> tuple[Record, np.ndarray]:
    """The record in parts of its segments, and those after which it may jump: the last ones of a
    segment that another one follows.
    """
    segments = record.segments
    first = np.linspace(
        segments.first[:-1], segments.first[1:], FLUCTUATION_PARTS, endpoint=False, axis=1
    )
    first = np.append(first.round().astype(np.int64), segments.first[-1])
    owner = np.repeat(segments.recording, FLUCTUATION_PARTS)
    jumping = FLUCTUATION_PARTS * (record.followed + 1) - 1
    return replace(record, segments=replace(segments, first=first, recording=owner)), jumping


def _units(record: Record, size: np.ndarray, rates: np.ndarray) -> np.ndarray:
    """Of each fluctuating coefficient: the rate of the motion, by the sizes of the states."""
    candidates = record.problem.candidates[rates]
    of = np.argmax(np.array(record.problem.terms)[candidates[:, 1]], axis=1)
    period = WINDOWS_PER_PERIOD * record.condensed.step
    return 2.0 * np.pi / period * size[candidates[:, 0]] / size[of]


def _memory() -> float:
    """Correlation of a fluctuation with itself one part later."""
    return np.exp(-STRETCH_PERIODS / (FLUCTUATION_PARTS * FLUCTUATION_PERIODS))


def _with_fluctuations(linear: Linear, rates: np.ndarray) -> Linear:
    """The normal equations with the fluctuations of each segment added to its state.

    In a segment a fluctuation acts as its coefficient does.
    """
    n, extra = linear.by_coefficients.shape[2], len(rates)
    n_states = linear.ends.shape[1]
    twice = np.append(np.arange(n + n_states), rates)
    by_state = np.zeros((len(linear.ends), n_states + extra, n_states + extra))
    by_state[:, :n_states, :n_states] = linear.by_state
    by_state[:, :n_states, n_states:] = linear.by_coefficients[:, :, rates]
    by_state[:, n_states:, n_states:] = _memory() * np.eye(extra)
    return Linear(
        linear.information[:, twice][:, :, twice],
        linear.right[:, twice],
        linear.residual,
        np.pad(linear.ends, ((0, 0), (0, extra))),
        np.pad(linear.by_coefficients, ((0, 0), (0, extra), (0, 0))),
        by_state,
    )


def _stationary(record: Record, linear: Linear, variance: np.ndarray) -> Linear:
    """The same with fluctuations of that variance where each recording begins."""
    information = linear.information.copy()
    begins = np.unique(record.segments.recording, return_index=True)[1]
    own = slice(information.shape[1] - len(variance), None)
    information[begins, own, own] += np.diag(1.0 / variance)
    return replace(linear, information=information)


def _precision(
    record: Record, jumping: np.ndarray, jump: np.ndarray, size: np.ndarray, variance: np.ndarray
) -> np.ndarray:
    """Of state and fluctuations from each segment to the next: states jump after `jumping` only."""
    n_states, extra = len(size), len(variance)
    precision = np.zeros((len(record.size), n_states + extra, n_states + extra))
    states = record.precision(np.diag((CONTINUOUS * size) ** 2))
    states[jumping] = record.precision(jump)[jumping]
    precision[:, :n_states, :n_states] = states
    precision[:, n_states:, n_states:] = np.diag(1.0 / ((1.0 - _memory() ** 2) * variance))
    return precision
