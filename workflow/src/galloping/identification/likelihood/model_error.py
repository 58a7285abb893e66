"""Identification where no model of the library follows the data to the noise.

The equations hold up to a disturbance: from one segment to the next the state may jump, by an
amount proportional to the motion, whose covariance is estimated with the coefficients
(weak-constraint estimation; Y. Tremolet, Q. J. R. Meteorol. Soc. 132, 2006; expectation
maximisation of the covariance). What is missed within segments is noise with the spectrum that the
residuals have. Where the model is nearly right the jumps vanish and the record
counts as one; where it is not, each stretch counts for itself. How many terms the model deserves,
how sure they are and what the model predicts is judged on stretches that were left out of the fit.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.special import stdtrit

from galloping.identification.likelihood.condense import Condensed
from galloping.identification.likelihood.fluctuation import fluctuating
from galloping.identification.likelihood.further_modes import further_modes
from galloping.identification.likelihood.plausible import detection_limits
from galloping.identification.likelihood.problem import Problem
from galloping.identification.likelihood.selection import added_deviation, select, solve_support
from galloping.identification.likelihood.shooting import Segments
from galloping.identification.likelihood.verdict import by, refused
from galloping.identification.likelihood.weak_constraint import (
    Joint,
    Linear,
    Record,
    StretchFit,
    coloured_misfit,
    integrable,
    joint,
    jump_covariance,
    linearised,
    of_variance,
    predictions,
    white_misfit,
)
from galloping.identification.model import FurtherMode, IdentifiedModel
from galloping.intervals import NORMAL_95, QUANTILES_95
from galloping.passes import passing

# Times that of exact models: a wrong model needs stronger evidence. Measured: on each truth of the
# table of model errors one of about 7 chooses nearly the same terms of every recording; with 3 to 5
# some recordings keep five terms more, which change no number of interest.
PENALTIES = (7.0, 25.0)
WORTH = 0.25  # of a term: fall of the forecast error, in standard errors of the difference
# Passes: with all terms, in which terms are chosen, and after either with terms that stay.
WHOLE_PASSES, CHOOSING_PASSES, SETTLING_PASSES = 1, 6, 4
ERROR_CONVERGED = 0.05  # squared length of a step, in standard deviations
MOST_GROUPS = 12  # of stretches left out together
# Total variance over that between stretches: what errs alike in all may be as large.
SYSTEMATIC = 2.0
FIRST_JUMP = 0.05  # relative to each state

MisfitOf = Callable[[Record, np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Approximation:
    """A model that follows the data as well as a compact one can.

    free, support: (n_candidates,). starts: (n_segments, n_states). information, covariance: of
    the candidates with the disturbance accounted for, and of the supported ones by leaving
    stretches out (delete-a-group jackknife), widened for what errs alike in all stretches, or,
    where the coefficients fluctuate, that of their means. path: how it was found, in words.
    forecast: per segment and channel the mean squares of data, of what is left of them by
    forecasts from its beginning, and of the noise, (3, n_segments, n_observed). residual:
    (n_windows, n_observed) of those forecasts, as the mean of a window's samples times the root
    of their number. fluctuates: whether the coefficients are means of what varies.
    """

    free: np.ndarray
    support: np.ndarray
    starts: np.ndarray
    information: np.ndarray
    covariance: np.ndarray
    forecast: np.ndarray
    residual: np.ndarray
    fluctuates: bool = False
    path: tuple[str, ...] = ()

    @property
    def skill(self) -> float:
        """R2 of the forecasts, averaged over the channels; minus infinity where one diverges."""
        data, left, _ = self.forecast.sum(axis=1)
        return float(np.mean(1.0 - left / data)) if np.all(np.isfinite(left)) else -np.inf


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

    segments: of some periods each, or fewer where the start diverges sooner. states: (n_windows,
    n_states) smoothed. free: (n_candidates,) a start. sigma, floor: (n_recordings, n_observed)
    noise of the projections and the least to assume. penalty: worth of a term in units of chi^2,
    were the model exact. objection: why no model of the library is right.
    Refused where its forecasts are no better than the mean of the data. Raises FloatingPointError
    where no model can be integrated over a stretch. The diagnostics are the R2 of the forecasts and
    the error of each channel as a share of its motion: in all, slow (below half of the frequency at
    which the channel mostly moves), near it, and fast (above one and a half).
    """
    record = Record(problem, condensed, segments, states, floor)
    try:
        made = _approximate(record, free, sigma, penalty)
    except (FloatingPointError, np.linalg.LinAlgError) as error:
        raise FloatingPointError(f"{objection}; {error}") from error
    if not made.skill > 0.0:
        return by(made.path, refused(problem, f"{objection}; what comes near it predicts nothing"))
    noise = np.full((len(condensed.counts), len(problem.states)), np.nan)
    inside = np.where(condensed.counts > 0, np.sqrt(condensed.noise_variance), np.nan)
    noise[:, condensed.observed[~condensed.is_rate]] = inside[:, ~condensed.is_rate]
    if made.fluctuates:
        objection += "; its linear coefficients fluctuate, as in gusts"
    stretch = np.median(np.diff(segments.first)) * condensed.step
    followed = predictions(record, made.free, made.starts)
    return stated(
        problem, condensed, segments, made, condensed.targets - followed, noise, penalty,
        f"{objection}; forecasts over {stretch:.2g} s leave",
    )  # fmt: skip


def stated(
    problem: Problem,
    condensed: Condensed,
    segments: Segments,
    made: Approximation,
    residual: np.ndarray,
    noise: np.ndarray,
    penalty: float,
    reason: str,
) -> IdentifiedModel:
    """The approximation as an identified model.

    residual: (n_windows, n_observed, n_rows) of its motion, in which further modes are looked for.
    noise: (n_recordings, n_states). reason: what the shares of the channels that are left end.
    """
    shares = error_shares(made, condensed)
    names = condensed.names(problem.states)
    named = ", ".join(
        f"{share:.1%} of {name}" for name, share in zip(names, shares[:, 0], strict=True)
    )
    firsts = np.unique(segments.recording, return_index=True)[1]
    besides = further_modes(problem.states, condensed, residual)
    noise_power = np.sum(made.forecast[2])
    errors = added_deviation(made.information, made.support)
    errors[made.support] = np.sqrt(np.diag(made.covariance))
    found = IdentifiedModel(
        model=problem.model(made.free),
        standard_errors=problem.on_library(np.where(made.support, errors, np.nan), fixed=0.0),
        detection_limits=problem.on_library(detection_limits(errors, made.support, penalty)),
        covariance=problem.of_model(made.covariance, made.support),
        known=problem.known_equations,
        initial_states=made.starts[firsts],
        sigma=noise,
        chi2=float(np.sum(made.forecast[1]) / noise_power) if noise_power else np.inf,
        status="approximate",
        reason=f"{reason} {named}" + _in_words(besides),
        further_modes=besides,
        diagnostics={
            "forecast_r2": made.skill,
            **{
                f"noise_{names[o]}": float(np.sqrt(condensed.noise_variance[-1, o]))
                for o in np.flatnonzero(condensed.is_rate)
            },
            **{
                f"error_share_{band}_{name}": float(share)
                for name, row in zip(names, shares, strict=True)
                for band, share in zip(("all", "slow", "near", "fast"), row, strict=True)
            },
        },
    )  # fmt: skip
    return by(made.path, found)


def _in_words(modes: tuple[FurtherMode, ...]) -> str:
    """Further modes as the end of a reason, '' where there are none."""
    lines: dict[str, set[str]] = {}
    for mode in modes:
        lines.setdefault(mode.state, set()).add(f"{mode.frequency / (2.0 * np.pi):.3g}")
    parts = [f"{state} at {', '.join(sorted(hz, key=float))} Hz" for state, hz in lines.items()]
    return f"; besides it there oscillates {', and '.join(parts)}" if parts else ""


def _approximate(
    record: Record, free: np.ndarray, sigma: np.ndarray, penalty: float
) -> Approximation:
    """The smallest of several models that forecast, or, where coefficients fluctuate, their means.

    What is missed is taken for noise of its own spectrum and, where no model so found predicts
    stretches that were left out, for white noise: of a motion that grows, and of
    few stretches, the spectrum is told badly. None may jump more than the whole library: what a
    term that was left out would do is no disturbance. Raises FloatingPointError or LinAlgError
    where no model is found that can be integrated over a segment.
    """
    scale = np.sqrt(np.mean(record.states**2, axis=0)) + np.finfo(float).tiny
    jump = np.diag((FIRST_JUMP * scale) ** 2)
    start = StretchFit(
        free, np.ones(len(free), bool), record.starts, of_variance(record, sigma**2), jump
    )
    for misfit_of in (coloured_misfit, white_misfit):
        try:
            whole = _iterate(record, start, misfit_of, WHOLE_PASSES, _as_before)
            made = _of_penalties(record, whole, misfit_of, penalty)
            if max(each.skill for each in made) > 0.0:
                break
        except (FloatingPointError, np.linalg.LinAlgError):
            if misfit_of is white_misfit:
                raise
    found = _varying(record, whole, penalty) or _smallest(made)
    misfit = "white misfit" if misfit_of is white_misfit else "coloured misfit"
    return replace(found, path=(misfit, *found.path))


def _of_penalties(
    record: Record, whole: StretchFit, misfit_of: MisfitOf, penalty: float
) -> list[Approximation]:
    """Of each of PENALTIES the model, before one with which none is found.

    whole: the fit of the whole library. Raises FloatingPointError or LinAlgError where the first of
    them finds none.
    """
    made: list[Approximation] = []
    fit = whole
    for times in PENALTIES:
        choose = partial(_chosen, record.problem, penalty=times * penalty)
        try:
            fit = _iterate(record, fit, misfit_of, CHOOSING_PASSES, choose, whole.jump)
            if not fit.support.any():
                raise FloatingPointError("no term stands out of the noise")
            made.append(replace(_judged(record, fit), path=(f"penalty {times:g}",)))
        except (FloatingPointError, np.linalg.LinAlgError):
            if not made:
                raise
            break
    return made


def _smallest(made: list[Approximation]) -> Approximation:
    """The one of fewest terms whose squared forecast error exceeds the least by no more than a
    quarter of the standard error of the difference for every term saved, and by no more than one.
    """
    errors = [np.mean(each.forecast[1] / each.forecast[0].mean(axis=0), axis=1) for each in made]
    best = chosen = int(np.argmin([np.mean(error) for error in errors]))
    for k, error in enumerate(errors):
        with np.errstate(invalid="ignore"):  # infinite where forecasts diverge
            worse = error - errors[best]
            doubt = np.std(worse) / np.sqrt(len(worse))
        saved = max(made[best].support.sum() - made[k].support.sum(), 0)
        if np.mean(worse) <= min(WORTH * saved, 1.0) * doubt:
            chosen = k
    return made[chosen]


def _varying(record: Record, fit: StretchFit, penalty: float) -> Approximation | None:
    """Means of coefficients that fluctuate, judged as a fit is, where they predict anything."""
    try:
        varying = fluctuating(record, fit, penalty)
        if varying is None:
            return None
        means, covariance = varying
        judged = _judged(record, means)
    except (FloatingPointError, np.linalg.LinAlgError):
        return None
    if not judged.skill > 0.0:
        return None
    return replace(judged, covariance=covariance, fluctuates=True, path=("fluctuating",))


def _iterate(
    record: Record,
    fit: StretchFit,
    misfit_of: MisfitOf,
    choosing: int,
    choose: Callable[[Joint, np.ndarray, np.ndarray], np.ndarray],
    largest: np.ndarray | None = None,
) -> StretchFit:
    """Gauss-Newton, with terms chosen and covariances estimated on the way.

    choosing: passes in which terms are chosen, of the normal equations and the terms before.
    largest: covariance of jumps whose size those of the model may not exceed.
    """
    for passed in range(choosing + SETTLING_PASSES):
        passing("approximate in stretches")
        linear = linearised(record, fit)
        solved = joint(record, linear, fit.starts, record.precision(fit.jump))
        solved = solved.with_prior(record.problem, fit.free)
        right = solved.right + solved.information @ fit.free
        support = choose(solved, right, fit.support) if passed < choosing else fit.support
        free, _ = solve_support(solved.information, right, support)
        change = free - fit.free
        starts = fit.starts + solved.response[:, :, :-1] @ change + solved.response[:, :, -1]
        jump = _jump(record, linear, fit.starts, solved)
        if largest is not None:
            jump = _no_larger(jump, largest)
        same = np.array_equal(support, fit.support)
        misfit = misfit_of(record, linear.residual)
        following = StretchFit(free, support, starts, misfit, jump)
        fit = integrable(record, fit, following)
        if same and passed and change @ solved.information @ change < ERROR_CONVERGED:
            break
    return fit


def _jump(record: Record, linear: Linear, starts: np.ndarray, solved: Joint) -> np.ndarray:
    """Expected covariance of the jumps at full motion, given the data and the coefficients."""
    at = record.followed
    moved = solved.response[:, :, -1]
    by_state = linear.by_state[at]
    ends = linear.ends[at] + np.einsum("gij,gj->gi", by_state, moved[at])
    return jump_covariance(record, at, starts[at + 1] + moved[at + 1] - ends, by_state, solved)


def _no_larger(jump: np.ndarray, largest: np.ndarray) -> np.ndarray:
    """A covariance whose standard deviations are at most those of another."""
    share = np.minimum(1.0, np.sqrt(np.diag(largest) / np.diag(jump)))
    return jump * np.outer(share, share)


def _as_before(solved: Joint, right: np.ndarray, support: np.ndarray) -> np.ndarray:
    """No term is chosen."""
    return support


def _chosen(
    problem: Problem, solved: Joint, right: np.ndarray, support: np.ndarray, penalty: float
) -> np.ndarray:
    """The terms that are worth their penalty, looked for from all and from those before.

    With a term comes what the library has of it with other powers of the inputs: a recording about
    one mean wind hardly tells them apart, and to leave one out would claim a law for other winds.
    """
    tried, about = [np.ones(len(right), bool), support], problem.chosen_about()
    return problem.alike(select(solved.information, right, tried, penalty, about))


def _judged(record: Record, fit: StretchFit) -> Approximation:
    """The fit with its covariance and its forecasts, both by leaving groups of segments out."""
    condensed, segments = record.condensed, record.segments
    linear = linearised(record, fit)
    precision = record.precision(fit.jump)
    count = len(fit.starts)
    groups = np.array_split(np.arange(count), min(count, MOST_GROUPS))
    changes = np.zeros((len(groups), int(fit.support.sum())))
    residual = np.full(condensed.targets.shape, np.inf)
    for k, group in enumerate(groups):
        passing("forecast stretches that are left out")
        solved = joint(record, linear, fit.starts, precision, np.isin(np.arange(count), group))
        solved = solved.with_prior(record.problem, fit.free)
        change, _ = solve_support(solved.information, solved.right, fit.support)
        changes[k] = change[fit.support]
        own, part = record.part(group)
        predicted = predictions(part, fit.free + change, record.starts[group])
        residual[own] = condensed.targets[own] - predicted
    spread = changes - changes.mean(axis=0)
    freedom = max(len(groups) - 1, 1)
    covariance = SYSTEMATIC * of_few(len(groups)) * freedom / len(groups) * spread.T @ spread
    solved = joint(record, linear, fit.starts, precision).with_prior(record.problem, fit.free)
    covariance += prior_covariance(record.problem, solved.information, fit.support)
    return Approximation(
        fit.free, fit.support, fit.starts, solved.information, covariance,
        mean_squares(condensed, segments, residual), residual[:, :, 0],
    )  # fmt: skip


def prior_covariance(problem: Problem, information: np.ndarray, support: np.ndarray) -> np.ndarray:
    """What the means of priors, which are as wrong as they say, add to a covariance."""
    if problem.precision is None:
        return np.zeros((support.sum(), support.sum()))
    _, covariance = solve_support(information, np.zeros(len(support)), support)
    return covariance * problem.of_candidates(problem.precision)[support] @ covariance


def of_few(groups: int) -> float:
    """By how much a variance from so few groups is to be larger for normal intervals to hold."""
    return float((stdtrit(max(groups - 1, 1), QUANTILES_95[1]) / NORMAL_95) ** 2)


def mean_squares(condensed: Condensed, segments: Segments, residual: np.ndarray) -> np.ndarray:
    """(3, n_segments, n_observed) as in `Approximation`, by the residual of the forecasts."""
    windows = np.diff(segments.first)[:, None]
    squares = [
        np.add.reduceat(np.sum(values**2, axis=2), segments.first[:-1]) / windows
        for values in (condensed.targets, residual)
    ]
    noise = (condensed.noise_variance * condensed.rows / np.diff(condensed.first)[:, None])[
        segments.recording
    ]
    return np.array([*squares, noise])


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
