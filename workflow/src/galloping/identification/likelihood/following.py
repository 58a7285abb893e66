"""From a rough start to free segments, short enough for a fit in them to follow the data."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from galloping.identification.likelihood.condense import Condensed, condense
from galloping.identification.likelihood.constants import MOST_HALVINGS, WINDOWS_PER_PERIOD
from galloping.identification.likelihood.gauss_newton import (
    DIVERGES,
    Fit,
    Step,
    guarded_step,
    is_close,
)
from galloping.identification.likelihood.problem import Problem
from galloping.identification.likelihood.rate_channels import (
    channel_noise,
    channel_values,
    channels,
    known_noise,
)
from galloping.identification.likelihood.selection import select, solve_support
from galloping.identification.likelihood.shooting import Segments, cut, residuals
from galloping.identification.likelihood.smoothing import Smooth
from galloping.identification.likelihood.weak_gls import WeakFit
from galloping.recording import Recording

TRUNCATION = 1e-7  # of the Taylor series, relative to each state: below the noise of any sensor
SMALLEST_NOISE = 1e-5  # of a channel, relative to its size: rounding is not weighed as noise
# Passes of the fit.
PERIODS_PER_SEGMENT = 6  # short enough for a rough start to converge from
# What a term costs, in penalties, in a start of few terms. Measured: of twenty recordings of the
# displacements of a line, three samples a second, starts of 25 to 70 terms left fourteen without a
# model; from 4 to 10 terms all are followed, at a quarter of the cost. So are twenty others, of
# which thirteen were left.
FEW_TERMS = (4, 16, 64)
SHORTER = 4  # lengths of segments that are tried, each half the one before
MOST_FREE_PASSES = 5  # with free segments, which are matched after them, however bad the fit

Prepared = tuple[Condensed, Segments, Fit]
Followed = tuple[Condensed, Segments, Step]


def follow(
    problem: Problem,
    recordings: list[Recording],
    smoothed: list[Smooth],
    period: float,
    start: WeakFit,
    penalty: float,
    largest: np.ndarray,
) -> Iterator[tuple[str, Followed]]:
    """Condensed samples, and segments in which a fit with free first states follows the data.

    One or two of them, each with the name of its start: the second is for where the first turns out
    to lead nowhere. A start of more terms than the samples tell of moves faster than they do:
    before it comes one of few terms that follows the data as well. One that diverges is replaced by
    that of all terms, each held to its `largest` size. Raises FloatingPointError where there is
    none.
    """

    def prepared(start: WeakFit, periods: float) -> Prepared | None:
        try:
            return prepare(problem, recordings, smoothed, period, start, periods)
        except FloatingPointError:
            return None

    first, shortest = prepared(start, PERIODS_PER_SEGMENT), period / (2 * WINDOWS_PER_PERIOD)
    few = None
    if first is None or first[0].step < shortest:
        fewer = [prepared(one, PERIODS_PER_SEGMENT) for one in _of_few_terms(start, penalty)]
        slow = [each for each in fewer if each is not None and each[0].step >= shortest]
        slow.sort(key=lambda each: -each[0].step)
        fits = (_freely(problem, *each) for each in slow)
        few = next((fit for fit in fits if fit is not None and is_close(fit[0], fit[2].fit)), None)
        if few is not None:
            yield "few terms", few
    name, best = "weak form", _shortened(problem, period, first, partial(prepared, start))
    if best is None:
        name = "all terms"
        anew = partial(prepared, _of_all_terms(start, largest))
        best = _shortened(problem, period, anew(PERIODS_PER_SEGMENT), anew)
    if best is not None:
        yield (name if few is None else f"{name} after few terms"), best
    elif few is None:
        raise FloatingPointError(DIVERGES)


def path_of(period: float, condensed: Condensed, segments: Segments, step: Step) -> Iterator[str]:
    """What `follow` made of the windows and segments, in words."""
    if (finer := round(period / WINDOWS_PER_PERIOD / condensed.step)) > 1:
        yield f"windows 1/{finer}"
    periods = np.median(np.diff(segments.first)) * condensed.step / period
    halvings = round(np.log2(PERIODS_PER_SEGMENT / periods))
    yield f"{PERIODS_PER_SEGMENT / 2**halvings:g} periods"
    if not is_close(condensed, step.fit):
        yield "not close"


def _of_few_terms(start: WeakFit, penalty: float) -> Iterator[WeakFit]:
    """The starts of which each term is as dear as FEW_TERMS says, in penalties."""
    for dear in FEW_TERMS:
        support = select(start.information, start.right, [start.support], dear * penalty)
        free, _ = solve_support(start.information, start.right, support)
        yield replace(start, free=free, support=support)


def _of_all_terms(start: WeakFit, largest: np.ndarray) -> WeakFit:
    """The start of all terms, each held to its `largest` size, (n_candidates,)."""
    scaled = start.information * largest * largest[:, None] + np.eye(len(largest))
    free = largest * np.linalg.solve(scaled, largest * start.right)
    return replace(start, free=free, support=np.ones(len(free), bool))


def _shortened(
    problem: Problem,
    period: float,
    first: Prepared | None,
    prepared: Callable[[float], Prepared | None],
) -> Followed | None:
    """The longest segments in which the fit is close, or else those to which halving halved it.

    From a rough start, that of a sensitive system above all, long segments lead astray; ones that
    are shorter than they need be hide what the recording may have wrong. first: of
    PERIODS_PER_SEGMENT. prepared: the same of so many periods. None where all diverge.
    """
    best, improving, periods = None, True, PERIODS_PER_SEGMENT
    for halving in range(SHORTER):
        begun = first if halving == 0 else prepared(periods)
        if begun is None:
            periods /= 2.0
            continue
        condensed, segments, _ = begun
        periods = np.median(np.diff(segments.first)) * condensed.step / period / 2.0
        followed = _freely(problem, *begun)
        if followed is None:
            continue
        fit = followed[2].fit
        if is_close(condensed, fit):
            return followed
        improving = best is None or (improving and fit.cost <= best[2].fit.cost / 2.0)
        best = followed if improving else best
    return best


def _freely(
    problem: Problem, condensed: Condensed, segments: Segments, fit: Fit
) -> Followed | None:
    """Steps with free segments until the fit is close; None where they diverge."""
    previous = fit
    for _ in range(MOST_FREE_PASSES):
        try:
            step = guarded_step(problem, condensed, segments, previous, fit, 1, None)
        except FloatingPointError:
            return None
        previous, fit = step.before, step.fit
        if is_close(condensed, fit):
            break
    return condensed, segments, step


def prepare(
    problem: Problem,
    recordings: list[Recording],
    smoothed: list[Smooth],
    period: float,
    start: WeakFit,
    periods: float,
) -> Prepared:
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
        if problem.inputs:
            inputs = problem.driven(recordings, condensed.first, condensed.step)
            condensed = replace(condensed, inputs=inputs)
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
