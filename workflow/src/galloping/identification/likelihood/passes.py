"""The passes of maximum likelihood: from a rough start to segments that match, terms chosen."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from galloping.identification.likelihood.ambiguity import preferred
from galloping.identification.likelihood.condense import Condensed, condense
from galloping.identification.likelihood.constants import (
    CHAIN_GROWTH,
    CLOSE,
    CONVERGED,
    FIRST_CHAIN,
    FIRST_TRY,
    MATCHED,
    MOST_FREE_PASSES,
    MOST_HALVINGS,
    PATIENT_TRY,
    PERIODS_PER_SEGMENT,
    RAISED_PENALTIES,
    SHORT,
    SHORTER,
    SMALLEST_NOISE,
    SPARSE_TRY,
    TRUNCATION,
    WINDOWS_PER_PERIOD,
)
from galloping.identification.likelihood.problem import Problem
from galloping.identification.likelihood.rate_channels import (
    channel_noise,
    channel_values,
    channels,
    known_noise,
)
from galloping.identification.likelihood.selection import select, solve_support, whiten
from galloping.identification.likelihood.shooting import (
    Segments,
    chained,
    cut,
    eliminate,
    linearise,
    residuals,
)
from galloping.identification.likelihood.smoothing import Smooth
from galloping.identification.likelihood.weak_gls import WeakFit
from galloping.recording import Recording

DIVERGES = "no model found that follows the data: the iteration diverges"


@dataclass(frozen=True)
class Fit:
    """Where the iteration stands.

    free: (n_candidates,) coefficients; support: the same, boolean. starts: (n_segments,
    n_states). sigma: (n_recordings, n_observed) noise of the projections, not below `floor`.
    reference: the same as first estimated. cost: chi^2, by that, of the fit before this one.
    """

    free: np.ndarray
    support: np.ndarray
    starts: np.ndarray
    sigma: np.ndarray
    floor: np.ndarray
    reference: np.ndarray
    cost: float


@dataclass(frozen=True)
class Step:
    """A Gauss-Newton step from one `Fit`, `before`, to the next.

    information: of the regression on all candidates; right: half the fall of chi^2 with each, at
    the new fit. covariance: of the supported ones. misfit, cost: chi^2 before the step, by the
    noise of its fit and by a fixed one. decrement: squared length of the step, in units of its
    covariance. gap: largest mismatch of segments before the step. segments: in the chains that
    were matched. settled: False of the last step of an iteration that did not come to an end.
    """

    before: Fit
    fit: Fit
    information: np.ndarray
    right: np.ndarray
    covariance: np.ndarray
    misfit: float
    decrement: float
    gap: float
    segments: Segments
    settled: bool


def follow(
    problem: Problem,
    recordings: list[Recording],
    smoothed: list[Smooth],
    period: float,
    start: WeakFit,
    penalty: float,
    largest: np.ndarray,
    few_terms: tuple[int, ...],
) -> tuple[Condensed, Segments, Step]:
    """Condensed samples, and segments in which a fit with free first states follows the data.

    A start of more terms than the samples tell of moves faster than they do: it gives way to one of
    few terms, each as dear as `few_terms` says, that follows the data as well. From a rough start,
    that of a sensitive system above all, long segments lead astray: they are halved until the fit
    is close. Where none is, the segments are those to which halving halved the misfit: shorter ones
    hide what the recording may have wrong. A start that diverges even so is replaced by that of all
    terms, each held to its `largest` size. Raises FloatingPointError where that diverges too.
    """
    prepared = partial(prepare, problem, recordings, smoothed, period)
    best, improving = None, True
    periods, shortest = PERIODS_PER_SEGMENT, period / (2 * WINDOWS_PER_PERIOD)
    for halving in range(2 * SHORTER):
        if halving == SHORTER:
            if best is not None:
                return best
            scaled = start.information * largest * largest[:, None] + np.eye(len(largest))
            free = largest * np.linalg.solve(scaled, largest * start.right)
            start = replace(start, free=free, support=np.ones(len(free), bool))
            periods = PERIODS_PER_SEGMENT
        try:
            condensed, segments, fit = prepared(start, periods)
        except FloatingPointError:
            condensed = None
        if halving == 0 and (condensed is None or condensed.step < shortest):
            followed = _by_few_terms(
                problem, prepared, shortest, start, [raised * penalty for raised in few_terms]
            )
            if followed is not None:
                return followed
        if condensed is None:
            periods /= 2.0
            continue
        periods = np.median(np.diff(segments.first)) * condensed.step / period / 2.0
        try:
            step = _freely(problem, condensed, segments, fit)
        except FloatingPointError:
            continue
        if _is_close(condensed, step.fit):
            return condensed, segments, step
        improving = best is None or (improving and step.fit.cost <= best[2].fit.cost / 2.0)
        best = (condensed, segments, step) if improving else best
    if best is None:
        raise FloatingPointError(DIVERGES)
    return best


def _by_few_terms(
    problem: Problem, prepared: Callable, shortest: float, start: WeakFit, penalties: list[float]
) -> tuple[Condensed, Segments, Step] | None:
    """`follow` from a start of few terms, the slowest first, if a fit from one is close.

    penalties: what a term costs in each. prepared: `prepare` from a start, with segments of so many
    periods. shortest: window, s.
    """
    slow = []
    for penalty in penalties:
        support = select(start.information, start.right, [start.support], penalty)
        free, _ = solve_support(start.information, start.right, support)
        few = replace(start, free=free, support=support)
        try:
            slow.append(prepared(few, PERIODS_PER_SEGMENT))
        except FloatingPointError:
            continue
    for condensed, segments, fit in sorted(slow, key=lambda each: -each[0].step):
        if condensed.step < shortest:
            break
        try:
            step = _freely(problem, condensed, segments, fit)
        except FloatingPointError:
            continue
        if _is_close(condensed, step.fit):
            return condensed, segments, step
    return None


def _freely(problem: Problem, condensed: Condensed, segments: Segments, fit: Fit) -> Step:
    """Steps with free segments until the fit is close, at most MOST_FREE_PASSES."""
    previous = fit
    for _ in range(MOST_FREE_PASSES):
        step = _guarded(problem, condensed, segments, previous, fit, 1, None)
        previous, fit = step.before, step.fit
        if _is_close(condensed, fit):
            break
    return step


def prepare(
    problem: Problem,
    recordings: list[Recording],
    smoothed: list[Smooth],
    period: float,
    start: WeakFit,
    periods: float,
) -> tuple[Condensed, Segments, Fit]:
    """Condensed samples, segments of so many periods and first states to integrate them from.

    Windows are halved until the Taylor series is accurate over one, segments until the start
    does not diverge within one. Raises FloatingPointError where neither is enough.
    """
    observed, is_rate = channels(recordings)
    noise = np.array(
        [
            channel_noise(recording, one, observed, is_rate)
            for recording, one in zip(recordings, smoothed, strict=True)
        ]
    )
    size = np.array([np.std(one.states[:, observed], axis=0) for one in smoothed])
    floor = SMALLEST_NOISE * np.where(size > 0.0, size, 1.0)
    known = [known_noise(recording, observed, is_rate) for recording in recordings]
    known = np.array(known) if np.any(np.isfinite(known)) else None
    floor = floor if known is None else np.fmax(floor, known)
    noise = np.where(np.isfinite(noise), np.maximum(noise, floor), 1.0)
    windows = WINDOWS_PER_PERIOD
    length = max(round(windows * periods), 2)
    for _ in range(MOST_HALVINGS):
        condensed = condense(
            [recording.time for recording in recordings],
            [channel_values(recording, observed, is_rate) for recording in recordings],
            observed,
            period / windows,
            is_rate,
            known,
        )
        states, valid = window_states(condensed, recordings, smoothed)
        segments = cut(condensed, length, valid, chained=False)
        starts = states[segments.first[:-1]]
        fit = Fit(start.free, start.support, starts, noise, floor, noise, np.inf)
        try:
            truncation = residuals(problem, condensed, segments, fit.free, fit.starts)[1]
        except FloatingPointError:
            length = max(length // 2, 2)
            continue
        if truncation < TRUNCATION:
            return condensed, segments, fit
        windows, length = 2 * windows, 2 * length
    raise FloatingPointError("the start diverges, or its time scale is too short")


def window_states(
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


def unseen_mixtures(information: np.ndarray, largest: np.ndarray) -> int:
    """How many mixtures of terms, together as large as the motion, change the fit by no noise.

    information: of the coefficients. largest: (n_candidates,) each alone as large as the motion.
    """
    return int(np.sum(np.linalg.eigvalsh(information * largest * largest[:, None]) < 1.0))


def match(
    problem: Problem,
    condensed: Condensed,
    segments: Segments,
    step: Step,
    penalty: float,
    unseen: bool,
    largest: np.ndarray,
) -> tuple[Fit, Step]:
    """Gauss-Newton with segments matched in chains; terms chosen at every pass but the last ones.

    Chains grow from pass to pass until the terms stay the same: about a rough fit, that of too
    many terms above all, the solution over a long chain is far from linear in the coefficients,
    and the terms that seem best then lead astray. Where those of the start, `step`, are the best
    already, the chains are whole from the first. What does not settle, as a chaotic recording may
    not, is tried again with more passes at each length, and believed where it follows the data.
    unseen: whether a mixture of terms goes unseen (`unseen_mixtures`, with `largest` as there);
    then it is tried again from few terms, and believed where it follows the data and has more terms
    than mixtures go unseen: a limit cycle looks like one of fewer terms. What does not settle while
    terms are chosen never will: it ends with the last of the models that follow the data alike, or
    with the free segments that it began with where none follows the whole.
    Raises FloatingPointError where it diverges, or does not settle, on other recordings.
    """
    matched = partial(_matched, problem, condensed, segments, step, penalty, unseen)
    ends, objections = [], []
    try:
        fit, last = matched(*FIRST_TRY)
        if last.settled:
            return fit, last
        ends.append((fit, last))
    except FloatingPointError as error:
        objections.append(error)
    try:
        fit, last = matched(*SPARSE_TRY, RAISED_PENALTIES) if unseen else matched(*PATIENT_TRY)
        told = not unseen or unseen_mixtures(last.information, largest) < fit.support.sum()
        if last.settled and told and _is_close(condensed, fit):
            return fit, last
        if not last.settled:
            ends.append((fit, last))
    except FloatingPointError as error:
        objections.append(error)
    if ends:
        return ends[0]
    if unseen:
        free = _gauss_newton(problem, condensed, segments, step.fit, 1, None)
        if _is_close(condensed, free.fit):
            return step.fit, replace(free, settled=False)
    raise objections[0]


def _matched(
    problem: Problem,
    condensed: Condensed,
    segments: Segments,
    step: Step,
    penalty: float,
    unseen: bool,
    most: int,
    most_choosing: int,
    most_alike: int,
    raised: tuple[int, ...] = (),
) -> tuple[Fit, Step]:
    """A try of `match`; the numbers as in FIRST_TRY. raised: penalties of the first passes.

    Where it does not settle while terms are chosen, though the whole is followed, the last step.
    """
    previous, fit = step.before, step.fit
    every = np.ones(len(fit.support), bool)
    best = select(step.information, step.right, [every, fit.support], penalty, fit.free)
    longest = np.inf if np.array_equal(best, fit.support) else FIRST_CHAIN
    preferring, alike = False, 1
    for passed in range(most):
        choosing = passed < most_choosing and not preferring
        price = penalty * (raised[passed] if passed < len(raised) else 1)
        if unseen and not (choosing or preferring):
            break
        step = _guarded(
            problem, condensed, segments, previous, fit, longest, price if choosing else None
        )
        unchanged = np.array_equal(step.fit.support, step.before.support)
        previous, fit = step.before, step.fit
        whole = longest is None or longest >= len(segments.chains)
        settled = step.decrement < CONVERGED and step.gap < MATCHED and passed >= len(raised)
        if unchanged and whole and settled:
            whitened = whiten(step.information, step.right, fit.free)
            support = fit.support if preferring else preferred(whitened, fit.support, penalty)
            if np.array_equal(support, fit.support):
                return fit, step
            preferring = True
            fit = replace(fit, support=support)
        stays = not unchanged and alike < most_alike and step.decrement > SHORT
        alike = alike + 1 if stays else 1
        if unchanged and whole:
            segments, longest = step.segments, None  # chains that come and go would never settle
        elif unchanged:
            longest = np.inf
        else:
            longest = (longest or np.inf) * (1 if stays else CHAIN_GROWTH)
    if unseen and whole and _is_close(condensed, fit):
        return fit, replace(step, settled=False)
    misfit = fit.cost / float(np.sum(condensed.rows))
    what = "follows the data" if misfit > CLOSE else "is preferred by the data"
    raise FloatingPointError(f"no model found that {what}: chi2/n {misfit:.3g}")


def _is_close(condensed: Condensed, fit: Fit) -> bool:
    return fit.cost < CLOSE * float(np.sum(condensed.rows))


def _guarded(
    problem: Problem,
    condensed: Condensed,
    segments: Segments,
    previous: Fit,
    fit: Fit,
    longest: float | None,
    penalty: float | None,
) -> Step:
    """A step from `fit`, or, where that diverges or raises the misfit, from nearer to `previous`.

    The other arguments as in `_gauss_newton`. Raises FloatingPointError where halving the way
    does not help.
    """
    close = CLOSE * float(np.sum(condensed.rows))
    for _ in range(MOST_HALVINGS):
        try:
            step = _gauss_newton(problem, condensed, segments, fit, longest, penalty)
        except FloatingPointError:
            fit = _between(previous, fit)
            continue
        if step.fit.cost < max(1.5 * fit.cost, close):
            return step
        fit = _between(previous, fit)
    raise FloatingPointError(DIVERGES)


def _between(a: Fit, b: Fit) -> Fit:
    free, starts = (a.free + b.free) / 2.0, (a.starts + b.starts) / 2.0
    return replace(a, free=free, support=a.support | b.support, starts=starts)


def _gauss_newton(
    problem: Problem,
    condensed: Condensed,
    segments: Segments,
    fit: Fit,
    longest: float | None,
    penalty: float | None,
) -> Step:
    """Linearise, choose the terms (unless `penalty` is None), move, re-estimate the noise.

    The noise is that of the projections, which hold the information: where the noise is not
    white it differs from the noise between samples. longest: as in `chained`, None to keep the
    chains that there are.
    """
    linear = linearise(problem, condensed, fit.sigma, segments, fit.free, fit.starts)
    if longest is not None:
        segments = chained(linear, segments, longest)
    quadratic = eliminate(linear, segments, fit.starts)
    support = fit.support
    if penalty is not None:
        tried = [np.ones(len(support), bool), fit.support]
        support = select(quadratic.information, quadratic.right, tried, penalty, fit.free)
    # solved for the change: on a long chain, rounding of the coefficients outweighs their noise
    free = np.where(support, fit.free, 0.0)
    rest = quadratic.right + quadratic.information @ (fit.free - free)
    step, covariance = solve_support(quadratic.information, rest, support)
    free = free + step
    change = free - fit.free
    starts = fit.starts + quadratic.states[:, :, :-1] @ change + quadratic.states[:, :, -1]
    squares = linear.squares * fit.sigma**2
    chains = segments.chains[-1] + 1
    share = (support.sum() + chains * len(problem.states)) / max(np.count_nonzero(squares), 1)
    sigma = np.sqrt(squares / np.maximum(condensed.rows - share, 0.2 * condensed.rows + 1.0))
    return Step(
        fit,
        Fit(
            free,
            support,
            starts,
            np.maximum(sigma, fit.floor),
            fit.floor,
            fit.reference,
            cost=float(np.sum(squares / fit.reference**2)),
        ),
        quadratic.information,
        quadratic.right - quadratic.information @ change,
        covariance,
        float(np.sum(linear.squares)),
        float(change @ quadratic.information @ change),
        quadratic.gap,
        segments,
        settled=True,
    )
