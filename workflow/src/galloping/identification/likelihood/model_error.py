"""Identification where no model of the library follows the data to the noise.

The equations hold up to a disturbance: from one segment to the next the state may jump, by an
amount proportional to the motion, whose covariance is estimated with the coefficients
(weak-constraint estimation; Y. Tremolet, Q. J. R. Meteorol. Soc. 132, 2006; expectation
maximisation of the covariance). What is missed within segments is noise with the spectrum that the
residuals have. Where the model is nearly right the jumps vanish and the record
counts as one; where it is not, each stretch counts for itself. How many terms the model deserves,
how sure they are and what the model predicts is judged on stretches that were left out of the fit.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.special import stdtrit

from galloping.identification.likelihood.condense import Condensed
from galloping.identification.likelihood.fluctuation import chosen, fluctuating
from galloping.identification.likelihood.further_modes import further_modes, in_words
from galloping.identification.likelihood.plausible import detection_limits
from galloping.identification.likelihood.problem import Problem
from galloping.identification.likelihood.selection import added_deviation, solve_support
from galloping.identification.likelihood.shooting import Segments
from galloping.identification.likelihood.verdict import by, refused
from galloping.identification.likelihood.weak_constraint import (
    Record,
    StretchFit,
    coloured_misfit,
    integrable,
    joint,
    jump_covariance,
    of_variance,
    predictions,
    white_misfit,
)
from galloping.identification.model import IdentifiedModel
from galloping.identification.work import is_spent
from galloping.intervals import NORMAL_95, QUANTILES_95
from galloping.passes import passing

# Times that of exact models: a wrong model needs stronger evidence. Measured: on each truth of the
# table of model errors one of about 7 chooses nearly the same terms of every recording; with 3 to 5
# some recordings keep five terms more, which change no number of interest.
PENALTIES = (7.0, 25.0)
WORTH = 0.25  # of a term: fall of the forecast error, in standard errors of the difference
CHOOSING_PASSES, SETTLING_PASSES = 6, 4  # in which terms are chosen, and in which they stay
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
    where no model can be integrated over a stretch.
    """
    record = Record(problem, condensed, segments, states, floor)
    try:
        made = _approximate(record, free, sigma, penalty)
    except (FloatingPointError, np.linalg.LinAlgError) as error:
        raise FloatingPointError(f"{objection}; {error}") from error
    if not made.skill > 0.0:
        return by(made.path, refused(problem, f"{objection}; what comes near it predicts nothing"))
    if made.fluctuates:
        objection += "; its linear coefficients fluctuate, as in gusts"
    stretch = np.median(np.diff(segments.first)) * condensed.step
    followed = predictions(record, made.free, made.starts)
    return stated(
        problem, condensed, segments, made, condensed.targets - followed,
        np.sqrt(condensed.noise_variance), penalty,
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
    noise: (n_recordings, n_observed) of a sample. reason: what the shares of the channels that are
    left end. The diagnostics are the R2 of the forecasts and these shares.
    """
    names = condensed.names(problem.states)
    shares = dict(zip(names, _error_shares(made, condensed), strict=True))
    left = ", ".join(f"{share:.1%} of {name}" for name, share in shares.items())
    sigma, of_rates = condensed.told(problem.states, noise)
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
        initial_states=made.starts[np.unique(segments.recording, return_index=True)[1]],
        sigma=sigma,
        chi2=float(np.sum(made.forecast[1]) / noise_power) if noise_power else np.inf,
        status="approximate",
        reason=f"{reason} {left}" + in_words(besides),
        further_modes=besides,
        diagnostics={
            "forecast_r2": made.skill,
            **of_rates,
            **{f"error_share_all_{name}": float(share) for name, share in shares.items()},
        },
    )  # fmt: skip
    return by(made.path, found)


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
    every, misfit = np.ones(len(free), bool), of_variance(record, sigma**2)
    start = StretchFit(record, free, every, record.starts, misfit, jump)
    for misfit_of in (coloured_misfit, white_misfit):
        try:
            whole = _iterate(start, misfit_of)
            made = _of_penalties(whole, misfit_of, penalty)
            if max(each.skill for each in made) > 0.0 or is_spent():
                break
        except (FloatingPointError, np.linalg.LinAlgError):
            if misfit_of is white_misfit:
                raise
    found = _varying(whole, penalty) or _smallest(made)
    misfit = "white misfit" if misfit_of is white_misfit else "coloured misfit"
    return replace(found, path=(misfit, *found.path))


def _of_penalties(whole: StretchFit, misfit_of: MisfitOf, penalty: float) -> list[Approximation]:
    """Of each of PENALTIES the model, before one with which none is found.

    whole: the fit of the whole library. Raises FloatingPointError or LinAlgError where the first of
    them finds none.
    """
    made: list[Approximation] = []
    fit = whole
    for times in PENALTIES:
        try:
            fit = _iterate(fit, misfit_of, times * penalty, whole.jump)
            if not fit.support.any():
                raise FloatingPointError("no term stands out of the noise")
            made.append(replace(_judged(fit), path=(f"penalty {times:g}",)))
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


def _varying(fit: StretchFit, penalty: float) -> Approximation | None:
    """Means of coefficients that fluctuate, judged as a fit is, where they predict anything."""
    try:
        varying = fluctuating(fit, penalty)
        if varying is None:
            return None
        means, covariance = varying
        judged = _judged(means)
    except (FloatingPointError, np.linalg.LinAlgError):
        return None
    if not judged.skill > 0.0:
        return None
    return replace(judged, covariance=covariance, fluctuates=True, path=("fluctuating",))


def _iterate(
    fit: StretchFit,
    misfit_of: MisfitOf,
    penalty: float | None = None,
    largest: np.ndarray | None = None,
) -> StretchFit:
    """Gauss-Newton, with covariances estimated on the way and, unless `penalty` is None, terms
    chosen. largest: covariance of jumps whose size those of the model may not exceed.
    """
    record, choosing = fit.record, 1 if penalty is None else CHOOSING_PASSES
    for passed in range(choosing + SETTLING_PASSES):
        passing("approximate in stretches")
        solved = joint(record, fit.linear, fit.starts, record.precision(fit.jump))
        solved = solved.with_prior(record.problem, fit.free)
        right, support = solved.right + solved.information @ fit.free, fit.support
        if penalty is not None and passed < choosing:
            support = chosen(record.problem, solved.information, right, support, penalty)
        free, _ = solve_support(solved.information, right, support)
        change = free - fit.free
        starts = fit.starts + solved.response[:, :, :-1] @ change + solved.response[:, :, -1]
        jump = jump_covariance(
            record, fit.linear, fit.starts, solved, 0.0 * change, record.followed
        )
        if largest is not None:
            share = np.minimum(1.0, np.sqrt(np.diag(largest) / np.diag(jump)))
            jump = jump * np.outer(share, share)
        same, misfit = np.array_equal(support, fit.support), misfit_of(record, fit.linear.residual)
        fit = integrable(fit, StretchFit(record, free, support, starts, misfit, jump))
        if same and passed and change @ solved.information @ change < ERROR_CONVERGED:
            break
    return fit


def _judged(fit: StretchFit) -> Approximation:
    """The fit with its covariance and its forecasts, both by leaving groups of segments out."""
    record, precision = fit.record, fit.record.precision(fit.jump)
    condensed, segments = record.condensed, record.segments
    count = len(fit.starts)
    groups = np.array_split(np.arange(count), min(count, MOST_GROUPS))
    changes = np.zeros((len(groups), int(fit.support.sum())))
    residual = np.full(condensed.targets.shape, np.inf)
    for k, group in enumerate(groups):
        passing("forecast stretches that are left out")
        solved = joint(record, fit.linear, fit.starts, precision, np.isin(np.arange(count), group))
        solved = solved.with_prior(record.problem, fit.free)
        change, _ = solve_support(solved.information, solved.right, fit.support)
        changes[k] = change[fit.support]
        at = slice(group[0], group[-1] + 1)
        own = slice(segments.first[at.start], segments.first[at.stop])
        predicted = predictions(record, fit.free + change, record.starts[at], at)
        residual[own] = condensed.targets[own] - predicted
    spread = changes - changes.mean(axis=0)
    freedom = max(len(groups) - 1, 1)
    covariance = SYSTEMATIC * of_few(len(groups)) * freedom / len(groups) * spread.T @ spread
    solved = joint(record, fit.linear, fit.starts, precision).with_prior(record.problem, fit.free)
    covariance += prior_covariance(record.problem, solved.information, fit.support)
    return Approximation(
        fit.free, fit.support, fit.starts, solved.information, covariance,
        mean_squares(condensed, segments, residual), residual[:, :, 0],
    )  # fmt: skip


def prior_covariance(problem: Problem, information: np.ndarray, support: np.ndarray) -> np.ndarray:
    """What the means of priors, which are as wrong as they say, add to a covariance."""
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


def _error_shares(made: Approximation, condensed: Condensed) -> np.ndarray:
    """(n_observed,) error of the forecasts, less the noise, as a share of the motion, each about
    its mean over a recording.
    """
    shares = np.zeros(len(condensed.observed))
    for o in range(len(shares)):
        motion = error = 0.0
        for (a, b), noise in zip(pairwise(condensed.first), condensed.noise_variance, strict=True):
            targets, residual = condensed.targets[a:b, o, 0], made.residual[a:b, o]
            motion += np.sum(np.abs(np.fft.rfft(targets)[1:]) ** 2)
            left = np.abs(np.fft.rfft(residual)[1:]) ** 2
            error += np.sum(left - noise[o] * np.count_nonzero(targets))
        shares[o] = np.sqrt(max(error, 0.0) / max(motion, np.finfo(float).tiny))
    return shares
