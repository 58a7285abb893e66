"""From a rough start to a fit with free segments, short enough for it to follow the data."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from galloping.identification.likelihood.condense import Condensed, condense
from galloping.identification.likelihood.constants import MOST_HALVINGS, WINDOWS_PER_PERIOD
from galloping.identification.likelihood.gauss_newton import Fit, Step, guarded_step, is_close
from galloping.identification.likelihood.problem import Problem
from galloping.identification.likelihood.rate_channels import (
    channel_noise,
    channel_values,
    channels,
    known_noise,
)
from galloping.identification.likelihood.shooting import Segments, cut, residuals
from galloping.identification.likelihood.smoothing import Smooth
from galloping.identification.likelihood.weak_gls import Start, WeakFit
from galloping.recording import Recording

TRUNCATION = 1e-7  # of the Taylor series, relative to each state: below the noise of any sensor
SMALLEST_NOISE = 1e-5  # of a channel, relative to its size: rounding is not weighed as noise
PERIODS_PER_SEGMENT = 6  # short enough for a rough start to converge from
SHORTER = 4  # lengths of segments that are tried, each half the one before
MOST_FREE_PASSES = 5  # with free segments, which are joined after them, however bad the fit


@dataclass(frozen=True)
class FreeFit:
    """The last step of a fit in which each of `segments` has a first state of its own."""

    condensed: Condensed
    segments: Segments
    step: Step

    @property
    def is_close(self) -> bool:
        return is_close(self.condensed, self.step.fit)

    def path(self, period: float) -> Iterator[str]:
        """Of which windows and segments, in words. period: the shortest of the motion, s."""
        if (finer := round(period / WINDOWS_PER_PERIOD / self.condensed.step)) > 1:
            yield f"windows 1/{finer}"
        periods = np.median(np.diff(self.segments.first)) * self.condensed.step / period
        halvings = round(np.log2(PERIODS_PER_SEGMENT / periods))
        yield f"{PERIODS_PER_SEGMENT / 2**halvings:g} periods"
        if not self.is_close:
            yield "not close"


def free_fit(problem: Problem, begun: Start, start: WeakFit) -> FreeFit | None:
    """The fit in the longest segments in which it is close, or else in those to which halving
    halved the misfit; None where all diverge.

    From a rough start, that of a sensitive system above all, long segments lead astray; ones that
    are shorter than they need be hide what the recording may have wrong.
    """
    best, improving, periods = None, True, float(PERIODS_PER_SEGMENT)
    for _ in range(SHORTER):
        try:
            condensed, segments, fit = prepare(problem, begun, start, periods)
            periods = np.median(np.diff(segments.first)) * condensed.step / begun.period
            step = _free_steps(problem, condensed, segments, fit)
        except FloatingPointError:
            continue
        finally:
            periods /= 2.0
        found = FreeFit(condensed, segments, step)
        if found.is_close:
            return found
        improving = best is None or (improving and step.fit.chi2 <= best.step.fit.chi2 / 2.0)
        best = found if improving else best
    return best


def _free_steps(problem: Problem, condensed: Condensed, segments: Segments, fit: Fit) -> Step:
    """Steps until the fit is close. Raises FloatingPointError where they diverge."""
    previous = fit
    for _ in range(MOST_FREE_PASSES):
        step = guarded_step(problem, condensed, segments, previous, fit, 1, None)
        previous, fit = step.before, step.fit
        if is_close(condensed, fit):
            break
    return step


def prepare(
    problem: Problem, begun: Start, start: WeakFit, periods: float
) -> tuple[Condensed, Segments, Fit]:
    """Condensed samples, segments of so many periods and first states to integrate them from.

    Windows are halved until the Taylor series is accurate over one, segments until the start
    does not diverge within one. Raises FloatingPointError where neither is enough.
    """
    recordings, smoothed, period = begun.recordings, begun.smoothed, begun.period
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
