"""Identification where no model of the library follows the data to the noise.

The equations hold up to a disturbance: from one segment to the next the state may jump, by an
amount proportional to the motion, whose covariance is estimated with the coefficients and the
noise (weak-constraint estimation; Y. Tremolet, Q. J. R. Meteorol. Soc. 132, 2006; expectation
maximisation of the covariances). Where the model is nearly right the jumps vanish and the record
counts as one; where it is not, each stretch counts for itself. How many terms the model deserves,
how sure they are and what the model predicts is judged on stretches that were left out of the fit.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.special import ndtri, stdtrit

from galloping.identification.likelihood.ambiguity import detection_limits
from galloping.identification.likelihood.condense import Condensed
from galloping.identification.likelihood.constants import (
    ERROR_CHOOSING_PASSES,
    ERROR_CONVERGED,
    ERROR_PASSES,
    FIRST_JUMP,
    FREE_PASSES,
    HUGE,
    MOST_GROUPS,
    MOST_HALVINGS,
    PENALTIES,
    QUIET,
    STATE_RIDGE,
    STRETCH_PERIODS,
    SYSTEMATIC,
    WORTH,
)
from galloping.identification.likelihood.problem import Problem
from galloping.identification.likelihood.result import refused
from galloping.identification.likelihood.selection import added_deviation, select, solve_support
from galloping.identification.likelihood.sensitivity import integrate
from galloping.identification.likelihood.shooting import Segments
from galloping.identification.likelihood.taylor import system
from galloping.identification.model import IdentifiedModel
from galloping.polynomial import PolynomialModel


@dataclass(frozen=True)
class _Record:
    """What is fitted. segments: of some periods each; their chains are not looked at. states:
    (n_windows, n_states) smoothed, from which the iteration and the forecasts start. floor:
    (n_recordings, n_observed) least noise of the projections.
    """

    problem: Problem
    condensed: Condensed
    segments: Segments
    states: np.ndarray
    floor: np.ndarray

    @cached_property
    def size(self) -> np.ndarray:
        """(n_segments,) root mean square of the motion in each, relative to the whole record."""
        mean = np.mean(self.states**2, axis=0) + np.finfo(float).tiny
        squares = np.mean(self.states**2 / mean, axis=1)
        first = self.segments.first
        return np.sqrt(np.add.reduceat(squares, first[:-1]) / np.diff(first) + QUIET**2)

    @property
    def starts(self) -> np.ndarray:
        """(n_segments, n_states) smoothed states at the beginning of each segment."""
        return self.states[self.segments.first[:-1]]

    @cached_property
    def followed(self) -> np.ndarray:
        """Indices of the segments that another one of the same recording follows."""
        return np.flatnonzero(np.diff(self.segments.recording) == 0)

    def part(self, segments: np.ndarray) -> tuple[slice, _Record]:
        """The windows of consecutive segments, and the record of them alone."""
        own = slice(self.segments.first[segments[0]], self.segments.first[segments[-1] + 1])
        first = self.segments.first[segments[0] : segments[-1] + 2] - own.start
        return own, replace(
            self,
            condensed=replace(self.condensed, functionals=self.condensed.functionals[own]),
            segments=replace(self.segments, first=first),
        )


@dataclass(frozen=True)
class Approximation:
    """A model that follows the data as well as a compact one can.

    free, support: (n_candidates,). starts: (n_segments, n_states). information, covariance: of
    the candidates with the disturbance accounted for, and of the supported ones by leaving
    stretches out (delete-a-group jackknife), widened for what errs alike in all stretches.
    forecast: per segment and channel the mean squares of data, of what is left of them by
    forecasts from its beginning, and of the noise, (3, n_segments, n_observed). residual:
    (n_windows, n_observed) of those forecasts, as the mean of a window's samples times the root
    of their number.
    """

    free: np.ndarray
    support: np.ndarray
    starts: np.ndarray
    information: np.ndarray
    covariance: np.ndarray
    forecast: np.ndarray
    residual: np.ndarray

    @property
    def skill(self) -> float:
        """R2 of the forecasts, averaged over the channels; minus infinity where one diverges."""
        data, left, _ = self.forecast.sum(axis=1)
        return float(np.mean(1.0 - left / data)) if np.all(np.isfinite(left)) else -np.inf


@dataclass(frozen=True)
class _Linear:
    """Normal equations of every segment in (coefficients, segment state), with its end."""

    information: np.ndarray
    right: np.ndarray
    squares: np.ndarray
    ends: np.ndarray
    by_coefficients: np.ndarray
    by_state: np.ndarray


@dataclass(frozen=True)
class _Joint:
    """Normal equations of the coefficients, the segments' states eliminated.

    response: (n_segments, n_states, n + 1), of the states to a change of the coefficients, and
    constant. variance, covariance: (n_segments, n_states, n_states), of each state, and of each
    with its successor, at given coefficients.
    """

    information: np.ndarray
    right: np.ndarray
    response: np.ndarray
    variance: np.ndarray
    covariance: np.ndarray


@dataclass(frozen=True)
class _Fit:
    free: np.ndarray
    support: np.ndarray
    starts: np.ndarray
    sigma: np.ndarray
    jump: np.ndarray


def approximation(
    problem: Problem,
    condensed: Condensed,
    segments: Segments,
    states: np.ndarray,
    free: np.ndarray,
    sigma: np.ndarray,
    floor: np.ndarray,
    penalty: float,
    objection: str,
) -> IdentifiedModel:
    """The most compact model whose forecasts are hardly worse than those of the best.

    segments: of some periods each. states: (n_windows, n_states) smoothed. free: (n_candidates,) a
    start. sigma, floor: (n_recordings, n_observed) noise of the projections and the least to
    assume. penalty: worth of a term in units of chi^2, were the model exact. objection: why no
    model of the library is right.
    Refused where no model can be integrated or its forecasts are no better than the mean of the
    data. The diagnostics are the R2 of the forecasts and the error of each channel as a share of
    its motion: in all, slow (below half of the frequency at which the channel mostly moves), near
    it, and fast (above one and a half).
    """
    record = _Record(problem, condensed, segments, states, floor)
    try:
        made = _approximate(record, free, sigma, penalty)
    except (FloatingPointError, np.linalg.LinAlgError) as error:
        return refused(problem, f"{objection}; {error}")
    if not made.skill > 0.0:
        return refused(problem, f"{objection}; what comes near it predicts nothing")
    shares = error_shares(made, condensed)
    names = condensed.names(problem.states)
    noise = np.full((len(condensed.counts), len(problem.states)), np.nan)
    inside = np.where(condensed.counts > 0, np.sqrt(condensed.noise_variance), np.nan)
    noise[:, condensed.observed[~condensed.is_rate]] = inside[:, ~condensed.is_rate]
    named = ", ".join(
        f"{share:.1%} of {name}" for name, share in zip(names, shares[:, 0], strict=True)
    )
    firsts = np.unique(segments.recording, return_index=True)[1]
    noise_power = np.sum(made.forecast[2])
    errors = added_deviation(made.information, made.support)
    errors[made.support] = np.sqrt(np.diag(made.covariance))
    return IdentifiedModel(
        model=PolynomialModel(problem.states, problem.terms, problem.coefficients(made.free)),
        standard_errors=problem.on_library(np.where(made.support, errors, np.nan)),
        detection_limits=problem.on_library(detection_limits(errors, made.support, penalty)),
        covariance=made.covariance,
        known=problem.known_equations,
        initial_states=made.starts[firsts],
        sigma=noise,
        chi2=float(np.sum(made.forecast[1]) / noise_power) if noise_power else np.inf,
        status="approximate",
        reason=f"{objection}; forecasts over {STRETCH_PERIODS} periods leave {named}",
        diagnostics={
            "forecast_r2": made.skill,
            **{
                f"error_share_{band}_{name}": float(share)
                for name, row in zip(names, shares, strict=True)
                for band, share in zip(("all", "slow", "near", "fast"), row, strict=True)
            },
        },
    )  # fmt: skip


def _approximate(
    record: _Record, free: np.ndarray, sigma: np.ndarray, penalty: float
) -> Approximation:
    """Of several supports the smallest whose squared forecast error exceeds the least by no more
    than a quarter of the standard error of the difference for every term saved.

    Raises FloatingPointError where no model is found that can be integrated over a segment.
    """
    scale = np.sqrt(np.mean(record.states**2, axis=0)) + np.finfo(float).tiny
    jump = np.diag((FIRST_JUMP * scale) ** 2)
    fit = _Fit(free, np.ones(len(free), bool), record.starts, sigma, jump)
    made: list[Approximation] = []
    for times in PENALTIES:
        fit = _iterate(record, fit, times * penalty)
        if not fit.support.any():
            break
        made.append(_judged(record, fit))
    if not made:
        raise FloatingPointError("no term stands out of the noise")
    errors = [np.mean(each.forecast[1] / each.forecast[0].mean(axis=0), axis=1) for each in made]
    best = int(np.argmin([np.mean(error) for error in errors]))
    for each, error in zip(reversed(made), reversed(errors), strict=True):
        worse = error - errors[best]
        saved = max(made[best].support.sum() - each.support.sum(), 0)
        if np.mean(worse) <= WORTH * saved * np.std(worse) / np.sqrt(len(worse)):
            return each
    return made[best]


def _iterate(record: _Record, fit: _Fit, penalty: float) -> _Fit:
    """Gauss-Newton, with terms chosen and covariances estimated on the way."""
    for passed in range(ERROR_PASSES):
        linear = _linearised(record, fit)
        solved = _joint(record, linear, fit)
        right = solved.right + solved.information @ fit.free
        support = fit.support
        if FREE_PASSES <= passed < ERROR_CHOOSING_PASSES:
            tried = [np.ones(len(right), bool), support]
            support = select(solved.information, right, tried, penalty)
        free, _ = solve_support(solved.information, right, support)
        change = free - fit.free
        starts = fit.starts + solved.response[:, :, :-1] @ change + solved.response[:, :, -1]
        sigma = np.sqrt(linear.squares * fit.sigma**2 / np.maximum(record.condensed.rows, 1))
        jump = _jump(record, linear, fit.starts, solved) if passed else fit.jump
        same = np.array_equal(support, fit.support)
        following = _Fit(free, support, starts, np.maximum(sigma, record.floor), jump)
        fit = _integrable(record, fit, following)
        if same and passed > FREE_PASSES and change @ solved.information @ change < ERROR_CONVERGED:
            break
    return fit


def _integrable(record: _Record, fit: _Fit, following: _Fit) -> _Fit:
    """`following`, or as much of the step to it as can be integrated over every segment."""
    for _ in range(MOST_HALVINGS):
        if np.all(np.isfinite(_predicted(record, following.free, following.starts))):
            return following
        following = replace(
            following,
            free=(fit.free + following.free) / 2.0,
            starts=(fit.starts + following.starts) / 2.0,
            support=fit.support | following.support,
        )
    raise FloatingPointError("no model found that can be integrated over a few periods")


def _predicted(record: _Record, free: np.ndarray, starts: np.ndarray) -> np.ndarray:
    """(n_windows, n_observed, n_rows) projections of the solution, not finite where it diverges."""
    problem, condensed = record.problem, record.condensed
    compiled = system(problem.tables, problem.coefficients(free), problem.candidates[:0])
    with np.errstate(all="ignore"):
        predicted = integrate(
            compiled, condensed.step, record.segments.first, starts, condensed.functionals,
            condensed.observed, sensitive=False,
        )[0]  # fmt: skip
    return np.where(np.abs(predicted) < HUGE, predicted, np.inf)


def _linearised(record: _Record, fit: _Fit) -> _Linear:
    """Misfit of every segment about a fit. Raises FloatingPointError where that diverges."""
    problem, condensed, segments = record.problem, record.condensed, record.segments
    compiled = system(problem.tables, problem.coefficients(fit.free), problem.candidates)
    count, n, m = len(fit.starts), len(fit.free), len(fit.free) + fit.starts.shape[1]
    information, right = np.empty((count, m, m)), np.empty((count, m))
    squares = np.zeros(fit.sigma.shape)
    ends, slopes = np.empty(fit.starts.shape), np.empty((*fit.starts.shape, m))
    for g in range(count):  # one by one: the rows of a long recording do not fit in memory
        own = slice(segments.first[g], segments.first[g + 1])
        predicted, rows, ends[g], slopes[g], _ = integrate(
            compiled, condensed.step, segments.first[g : g + 2] - own.start, fit.starts[g : g + 1],
            condensed.functionals[own], condensed.observed, sensitive=True,
        )  # fmt: skip
        if not (np.all(np.abs(ends[g]) < HUGE) and np.all(np.abs(slopes[g]) < HUGE)):
            raise FloatingPointError("the model diverges within a segment")
        weight = 1.0 / fit.sigma[segments.recording[g]][:, None]
        scaled = (condensed.targets[own] - predicted) * weight
        squares[segments.recording[g]] += np.sum(scaled**2, axis=(0, 2))
        rows = (rows * weight[..., None]).reshape(-1, m)
        information[g], right[g] = rows.T @ rows, scaled.ravel() @ rows
    return _Linear(information, right, squares, ends, slopes[:, :, :n], slopes[:, :, n:])


def _joint(
    record: _Record, linear: _Linear, fit: _Fit, left_out: np.ndarray | None = None
) -> _Joint:
    """Eliminate the states of segments, each of which follows the one before up to a jump.

    The covariance of a jump is that of the fit times the squared size of the motion. left_out:
    (n_segments,) whose data, and whose jumps to and from them, do not count.
    """
    starts = fit.starts
    count, n_states = starts.shape
    n = linear.right.shape[1] - n_states
    used = np.ones(count) if left_out is None else (~left_out).astype(float)
    whole = np.linalg.inv(fit.jump)
    information = np.einsum("g,gij->ij", used, linear.information[:, :n, :n])
    right = used @ linear.right[:, :n]
    own = used[:, None, None] * linear.information[:, n:, n:]
    own += STATE_RIDGE * np.diag(np.diag(linear.information[:, n:, n:].mean(axis=0)))
    cross = np.concatenate([linear.information[:, n:, :n], linear.right[:, n:, None]], axis=2)
    cross = used[:, None, None] * cross
    ahead = np.zeros((count, n_states, n_states))
    for g in record.followed:
        if not used[g] * used[g + 1]:
            continue
        precision = whole / record.size[g] ** 2
        slope, by_state = linear.by_coefficients[g], linear.by_state[g]
        aside = np.column_stack([slope, starts[g + 1] - linear.ends[g]])
        weighted = precision @ aside
        information += slope.T @ weighted[:, :n]
        right += slope.T @ weighted[:, n]
        own[g] += by_state.T @ precision @ by_state
        own[g + 1] += precision
        ahead[g] = -by_state.T @ precision
        cross[g] += by_state.T @ weighted
        cross[g + 1] -= weighted
    # block tridiagonal elimination, forward and back
    pivot, reduced = np.empty_like(own), cross.copy()
    for g in range(count):
        if g:
            factor = ahead[g - 1].T @ pivot[g - 1]
            own[g] -= factor @ ahead[g - 1]
            reduced[g] -= factor @ reduced[g - 1]
        pivot[g] = np.linalg.inv((own[g] + own[g].T) / 2.0)
    solved, variance, covariance = np.empty_like(cross), pivot.copy(), np.zeros_like(own)
    for g in range(count - 1, -1, -1):
        rest = reduced[g]
        if g + 1 < count:
            gain = pivot[g] @ ahead[g]
            rest = rest - ahead[g] @ solved[g + 1]
            covariance[g] = -gain @ variance[g + 1]
            variance[g] += gain @ variance[g + 1] @ gain.T
        solved[g] = pivot[g] @ rest
    flat, back = cross.reshape(-1, n + 1), solved.reshape(-1, n + 1)
    information = information - flat[:, :n].T @ back[:, :n]
    right = right - flat[:, :n].T @ back[:, n]
    response = np.concatenate([-solved[:, :, :n], solved[:, :, n:]], axis=2)
    return _Joint((information + information.T) / 2.0, right, response, variance, covariance)


def _jump(record: _Record, linear: _Linear, starts: np.ndarray, solved: _Joint) -> np.ndarray:
    """Expected covariance of the jumps at full motion, given the data."""
    total = np.zeros((starts.shape[1], starts.shape[1]))
    for g in record.followed:
        # the states after the step, linear in that of the segment
        constant, by_state = solved.response[:, :, -1], linear.by_state[g]
        gap = starts[g + 1] + constant[g + 1] - linear.ends[g] - by_state @ constant[g]
        mixed = by_state @ solved.covariance[g]
        spread = solved.variance[g + 1] + by_state @ solved.variance[g] @ by_state.T
        total += (np.outer(gap, gap) + spread - mixed - mixed.T) / record.size[g] ** 2
    floor = STATE_RIDGE * np.diag(np.mean(starts**2, axis=0) + np.finfo(float).tiny)
    return total / max(len(record.followed), 1) + floor


def _judged(record: _Record, fit: _Fit) -> Approximation:
    """The fit with its covariance and its forecasts, both by leaving groups of segments out."""
    condensed, segments = record.condensed, record.segments
    linear = _linearised(record, fit)
    count = len(fit.starts)
    groups = np.array_split(np.arange(count), min(count, MOST_GROUPS))
    changes = np.zeros((len(groups), int(fit.support.sum())))
    residual = np.full(condensed.targets.shape, np.inf)
    for k, group in enumerate(groups):
        solved = _joint(record, linear, fit, np.isin(np.arange(count), group))
        change, _ = solve_support(solved.information, solved.right, fit.support)
        changes[k] = change[fit.support]
        own, part = record.part(group)
        predicted = _predicted(part, fit.free + change, record.starts[group])
        residual[own] = condensed.targets[own] - predicted
    spread = changes - changes.mean(axis=0)
    freedom = max(len(groups) - 1, 1)
    few = (stdtrit(freedom, 0.975) / ndtri(0.975)) ** 2  # so that normal intervals hold
    covariance = SYSTEMATIC * few * freedom / len(groups) * spread.T @ spread
    windows = np.diff(segments.first)[:, None]
    squares = [
        np.add.reduceat(np.sum(values**2, axis=2), segments.first[:-1]) / windows
        for values in (condensed.targets, residual)
    ]
    noise = (condensed.noise_variance * condensed.rows / np.diff(condensed.first)[:, None])[
        segments.recording
    ]
    return Approximation(
        fit.free, fit.support, fit.starts, _joint(record, linear, fit).information, covariance,
        np.array([*squares, noise]), residual[:, :, 0],
    )  # fmt: skip


def error_shares(approximation: Approximation, condensed: Condensed) -> np.ndarray:
    """(n_observed, 4): error of the forecasts as a share of the motion, less the noise.

    In all, and of frequencies below half of, around, and above one and a half times that at which
    the channel mostly moves; of the root mean square of the channel, each recording as it is long.
    """
    shares = np.zeros((len(condensed.observed), 4))
    noise = condensed.noise_variance
    for o in range(len(condensed.observed)):
        motion, error = 0.0, np.zeros(4)
        for r, (a, b) in enumerate(zip(condensed.first[:-1], condensed.first[1:], strict=True)):
            data = np.abs(np.fft.rfft(condensed.targets[a:b, o, 0])[1:]) ** 2
            left = np.abs(np.fft.rfft(approximation.residual[a:b, o])[1:]) ** 2
            left = left - noise[r, o] * np.count_nonzero(condensed.targets[a:b, o, 0])
            place = np.arange(1, len(data) + 1) / (1 + np.argmax(data))
            bands = [place > 0.0, place < 0.5, (place >= 0.5) & (place <= 1.5), place > 1.5]
            motion += data.sum()
            error += [left[band].sum() for band in bands]
        shares[o] = np.sqrt(np.maximum(error, 0.0) / max(motion, np.finfo(float).tiny))
    return shares
