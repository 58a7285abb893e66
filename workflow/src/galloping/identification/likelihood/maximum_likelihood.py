"""Maximum likelihood: coefficients, initial states and terms at the limit the data set.

The weak form gives the start; multiple shooting with matched segments, Gauss-Newton on the
coefficients of the whole library, and selection on the quadratic model do the rest. Intervals
come from the information at the solution, so they are those of the Cramer-Rao bound.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from galloping.identification.likelihood.ambiguity import open_questions
from galloping.identification.likelihood.condense import Condensed, condense
from galloping.identification.likelihood.derivative_fit import derivative_fit
from galloping.identification.likelihood.problem import Problem
from galloping.identification.likelihood.problem import problem as make_problem
from galloping.identification.likelihood.result import assembled, refused, verdict
from galloping.identification.likelihood.selection import select, solve_support
from galloping.identification.likelihood.shooting import (
    Segments,
    cut,
    eliminate,
    linearise,
    residuals,
)
from galloping.identification.likelihood.smoothing import Smooth
from galloping.identification.likelihood.verdict import MOST_COLOUR, Residue, residue
from galloping.identification.likelihood.weak_gls import WeakFit, prepared, weak_fit
from galloping.identification.model import IdentifiedModel
from galloping.polynomial import Exponents, PolynomialModel
from galloping.recording import Recording

WINDOWS_PER_PERIOD = 12  # of the shortest period; the projections of a window lose nothing
PERIODS_PER_SEGMENT = 6  # short enough for a rough start to converge from
PATIENCE = 5  # passes after which terms are chosen and segments matched, however bad the fit
MOST_PASSES = 20
MOST_HALVINGS = 6  # of the integrator's step, and of a Gauss-Newton step
CLOSE = 1.5  # chi^2 per row below which a fit is good enough to choose terms by
CONVERGED = 0.01  # squared length of a step, in standard deviations
MATCHED = 1e-3  # gap between segments, relative to each state
TRUNCATION = 1e-7  # of the Taylor series, relative to each state
SMALLEST_NOISE = 1e-5  # of a channel, relative to its size: rounding is not weighed as noise


@dataclass(frozen=True)
class Fit:
    """Where the iteration stands.

    free: (n_candidates,) coefficients; support: the same, boolean. starts: (n_segments,
    n_states). sigma: (n_recordings, n_observed) noise of the projections.
    """

    free: np.ndarray
    support: np.ndarray
    starts: np.ndarray
    sigma: np.ndarray
    floor: np.ndarray


@dataclass(frozen=True)
class Step:
    """A Gauss-Newton step from one `Fit` to the next.

    information, right: of the regression on all candidates. covariance: of the supported ones.
    misfit, cost: chi^2 before the step, by the noise of its fit and by a fixed one. decrement:
    squared length of the step, in units of its covariance. gap: largest mismatch of segments
    before the step.
    """

    fit: Fit
    information: np.ndarray
    right: np.ndarray
    covariance: np.ndarray
    misfit: float
    cost: float
    decrement: float
    gap: float


def maximum_likelihood(
    recordings: list[Recording],
    terms: tuple[Exponents, ...],
    known: PolynomialModel | None = None,
    known_states: tuple[str, ...] = (),
) -> IdentifiedModel:
    """Identify one polynomial model from one or several recordings of a system.

    recordings: sharing their states; any sampling, NaN where samples or channels are missing;
    the noise of each channel of each recording is unknown, white and Gaussian. Where they carry
    derivatives, the states are exact and the equations are fitted directly.
    terms: the library. known: model whose equations of `known_states` hold; the equation of a
    state X is known to be dX/dt = dX where a state has that name.
    The status is `ok`, `not identifiable` (other terms could be there as well), or `refused`.
    Raises ValueError where the recordings differ in their states.
    """
    states = recordings[0].states
    if any(recording.states != states for recording in recordings):
        raise ValueError("the recordings do not have the same states")
    problem = make_problem(states, terms, known, known_states)
    try:
        if all(recording.derivatives is not None for recording in recordings):
            return derivative_fit(problem, recordings)
        return _from_states(problem, recordings)
    except (ValueError, FloatingPointError, np.linalg.LinAlgError) as error:
        return refused(problem, str(error))


def _from_states(problem: Problem, recordings: list[Recording]) -> IdentifiedModel:
    samples = sum(int(np.isfinite(recording.values).sum()) for recording in recordings)
    recordings, smoothed, period = prepared(recordings)
    measured = [np.isfinite(recording.values) for recording in recordings]
    kept = sum(int(one.sum()) for one in measured)
    penalty = 2.0 * np.log(kept)
    start = weak_fit(problem, smoothed, penalty)
    observed = np.flatnonzero(np.any([one.any(axis=0) for one in measured], axis=0))
    condensed, segments, fit = _prepare(problem, recordings, smoothed, observed, period, start)
    fit, step = _iterate(problem, condensed, segments, fit, penalty)
    remaining, shown = _remaining(problem, condensed, fit, segments, period)
    if shown.coloured and shown.band < MOST_COLOUR:
        power = np.where(np.isfinite(shown.band_power), shown.band_power, fit.sigma**2)
        fit = replace(fit, sigma=np.sqrt(power), floor=np.sqrt(power))
        fit, step = _iterate(problem, condensed, segments, fit, penalty)
        remaining, shown = _remaining(problem, condensed, fit, segments, period)
    squares = np.add.reduceat((remaining**2).sum(axis=2), condensed.first[:-1], axis=0)
    sigma = np.full((len(recordings), len(problem.states)), np.nan)
    parameters = int(fit.support.sum()) + len(recordings) * len(problem.states)
    share = parameters / max(np.count_nonzero(condensed.counts), 1)
    total = (squares + condensed.remainder) / np.maximum(condensed.counts - share, 1.0)
    sigma[:, observed] = np.where(condensed.counts > 0, np.sqrt(total), np.nan)
    objection, questions = shown.objection([problem.states[k] for k in observed]), ""
    if fit.support.any() and not objection:
        x = np.concatenate([one.states[one.valid] for one in smoothed])
        questions = open_questions(
            problem, step.information, step.right, fit.support, fit.free, penalty, step.misfit, x
        )
    status, reason = verdict(fit.support, objection, questions)
    return assembled(
        problem, fit.free, fit.support, step.information, step.covariance, penalty,
        initial_states=fit.starts[_first_segments(segments)],
        sigma=sigma,
        chi2=shown.chi2,
        status=status,
        reason=reason,
        diagnostics={
            "chi2_allowed": shown.chi2_allowed,
            "residual_band": shown.band,
            "residual_band_allowed": shown.band_allowed,
            "residual_line": shown.line,
            "residual_line_allowed": shown.line_allowed,
            "removed_share": 1.0 - kept / samples,
        },
    )  # fmt: skip


def _remaining(
    problem: Problem, condensed: Condensed, fit: Fit, segments: Segments, period: float
) -> tuple[np.ndarray, Residue]:
    """Residuals of single shooting over every recording, and what they show.

    Raises FloatingPointError where the model diverges over a recording.
    """
    nowhere = np.zeros(condensed.first[-1], bool)
    whole = cut(condensed, int(condensed.first[-1]) + 1, nowhere, chained=True)
    firsts = fit.starts[_first_segments(segments)]
    remaining, _ = residuals(problem, condensed, whole, fit.free, firsts)
    return remaining, residue(condensed, remaining, int(fit.support.sum()) + firsts.size, period)


def _first_segments(segments: Segments) -> np.ndarray:
    """(n_recordings,) the first segment of each recording."""
    return np.unique(segments.recording, return_index=True)[1]


def _prepare(
    problem: Problem,
    recordings: list[Recording],
    smoothed: list[Smooth],
    observed: np.ndarray,
    period: float,
    start: WeakFit,
) -> tuple[Condensed, Segments, Fit]:
    """Condensed samples, segments and first states on which the start can be integrated.

    Windows are halved until the Taylor series is accurate over one, segments until the start
    does not diverge within one. Raises FloatingPointError where neither is enough.
    """
    noise = np.array([one.noise[observed] for one in smoothed])
    size = np.array([np.std(one.states[:, observed], axis=0) for one in smoothed])
    floor = SMALLEST_NOISE * np.where(size > 0.0, size, 1.0)
    noise = np.where(np.isfinite(noise), np.maximum(noise, floor), 1.0)
    windows, length = WINDOWS_PER_PERIOD, WINDOWS_PER_PERIOD * PERIODS_PER_SEGMENT
    for _ in range(MOST_HALVINGS):
        condensed = condense(
            [recording.time for recording in recordings],
            [recording.values[:, observed] for recording in recordings],
            observed,
            period / windows,
        )
        states, valid = _window_states(condensed, recordings, smoothed)
        segments = cut(condensed, length, valid, chained=False)
        starts = states[segments.first[:-1]]
        fit = Fit(start.free, start.support, starts, noise, floor)
        try:
            truncation = residuals(problem, condensed, segments, fit.free, fit.starts)[1]
        except FloatingPointError:
            length = max(length // 2, 2)
            continue
        if truncation < TRUNCATION:
            return condensed, segments, fit
        windows, length = 2 * windows, 2 * length
    raise FloatingPointError("the start diverges, or its time scale is too short")


def _window_states(
    condensed: Condensed, recordings: list[Recording], smoothed: list[Smooth]
) -> tuple[np.ndarray, np.ndarray]:
    """Smoothed states where the windows start, (n_windows, n_states), and whether data are near."""
    states, valid = [], []
    for r, (recording, one) in enumerate(zip(recordings, smoothed, strict=True)):
        windows = condensed.first[r + 1] - condensed.first[r]
        time = recording.time[0] + condensed.step * np.arange(windows)
        states.append(np.column_stack([np.interp(time, one.time, x) for x in one.states.T]))
        valid.append(np.interp(time, one.time, one.valid) == 1.0)
    return np.concatenate(states), np.concatenate(valid)


def _iterate(
    problem: Problem, condensed: Condensed, segments: Segments, fit: Fit, penalty: float
) -> tuple[Fit, Step]:
    """Gauss-Newton, first with free segments, then matched; terms chosen at every pass.

    Terms are chosen and segments matched once the misfit is close to the noise, where the
    quadratic model holds, or when patience ends; in the end they stay as they are. A step that
    diverges or raises the misfit is halved. Raises FloatingPointError where the iteration does
    not settle.
    """
    chained = replace(segments, chains=segments.recording)
    close = CLOSE * float(np.sum(condensed.rows))
    previous, reference, cost, matched = fit, fit.sigma, np.inf, False
    for passed in range(MOST_PASSES):
        frozen = passed >= MOST_PASSES // 2
        choosing = (cost < close or passed >= PATIENCE) and not frozen
        for _ in range(MOST_HALVINGS):
            try:
                step = _gauss_newton(
                    problem, condensed, chained if matched else segments, fit,
                    penalty if choosing else None, reference,
                )  # fmt: skip
            except FloatingPointError:
                fit = _between(previous, fit)
                continue
            if step.cost < max(1.5 * cost, close):
                break
            fit = _between(previous, fit)
        else:
            raise FloatingPointError("no model found that follows the data: the iteration diverges")
        settled = np.array_equal(step.fit.support, fit.support) and step.decrement < CONVERGED
        previous, fit, cost = fit, step.fit, step.cost
        if matched and (choosing or frozen) and settled and step.gap < MATCHED:
            return fit, step
        matched = matched or cost < close or passed >= PATIENCE
    misfit = cost / float(np.sum(condensed.rows))
    what = "follows the data" if misfit > CLOSE else "is preferred by the data"
    raise FloatingPointError(f"no model found that {what}: chi2/n {misfit:.3g}")


def _between(a: Fit, b: Fit) -> Fit:
    free, starts = (a.free + b.free) / 2.0, (a.starts + b.starts) / 2.0
    return replace(a, free=free, support=a.support | b.support, starts=starts)


def _gauss_newton(
    problem: Problem,
    condensed: Condensed,
    segments: Segments,
    fit: Fit,
    penalty: float | None,
    reference: np.ndarray,
) -> Step:
    """Linearise, choose the terms (unless `penalty` is None), move, re-estimate the noise.

    The noise is that of the projections, which hold the information: where the noise is not
    white it differs from the noise between samples. reference: the noise that measures the cost.
    """
    linear = linearise(problem, condensed, fit.sigma, segments, fit.free, fit.starts)
    quadratic = eliminate(linear, segments, fit.starts)
    right = quadratic.right + quadratic.information @ fit.free
    support = fit.support
    if penalty is not None:
        starts = [np.ones(len(right), bool), fit.support]
        support = select(quadratic.information, right, starts, penalty)
    free, covariance = solve_support(quadratic.information, right, support)
    change = free - fit.free
    starts = fit.starts + quadratic.states[:, :, :-1] @ change + quadratic.states[:, :, -1]
    squares = linear.squares * fit.sigma**2
    chains = segments.chains[-1] + 1
    share = (support.sum() + chains * len(problem.states)) / max(np.count_nonzero(squares), 1)
    sigma = np.sqrt(squares / np.maximum(condensed.rows - share, 0.2 * condensed.rows + 1.0))
    return Step(
        Fit(free, support, starts, np.maximum(sigma, fit.floor), fit.floor),
        quadratic.information,
        right,
        covariance,
        float(np.sum(linear.squares)),
        float(np.sum(squares / reference**2)),
        float(change @ quadratic.information @ change),
        quadratic.gap,
    )
