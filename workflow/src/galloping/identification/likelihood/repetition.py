"""Decide whether a recorded motion only repeats: then other equations have the same orbit."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize_scalar

from galloping.model.polynomial import PolynomialModel
from galloping.trajectory.taylor import Ending, solve

# Number of samples in a period, which may take at most 64 integration steps. A cubic spline through
# them errs by 2e-5 of a third harmonic, 1e-4 of a fifth.
SAMPLES_PER_PERIOD = 60


class FollowedRecording(NamedTuple):
    """States of a fitted model at the beginning of each segment of a recording.

    times: (n_segments,) s, beginning of each, the first at zero. states: (n_segments, n_states) of
    the model there. duration: s, of the recording.
    """

    times: np.ndarray
    states: np.ndarray
    duration: float


def is_periodic(
    model: PolynomialModel, followed: Sequence[FollowedRecording], period: float
) -> bool:
    """Decide whether the model's motion is periodic in every recording.

    The motion is that in segments: a free run would leave an unstable orbit by rounding. A motion
    that inputs drive is no orbit, nor is one that diverges. period: the shortest of the motion, s.
    """
    return not model.inputs and all(_has_period(model, one, period) for one in followed)


def _has_period(model: PolynomialModel, followed: FollowedRecording, period: float) -> bool:
    """Decide whether standardised states return to themselves over two thirds of the time.

    The delay, up to a third of the time, after which the states differ least is sought; short
    delays are skipped, up to where the difference first falls. A delay of whole samples must leave
    a fifth of the states' size at most: half a sample leaves 0.05 of the shortest period's
    oscillation and 0.16 of a third harmonic. Refined, and multiplied as often as it fits into two
    thirds of the time, since two tones without a common period return once, it must leave less than
    a hundredth. period: s; a motion that repeats over 500 periods is periodic.
    """
    time = np.arange(0.0, min(followed.duration, 500 * period), period / SAMPLES_PER_PERIOD)
    try:
        states = _segment_motion(model, followed, time)
    except FloatingPointError:
        return False
    states = (states - states.mean(axis=0)) / np.fmax(states.std(axis=0), np.finfo(float).tiny)
    distances = _lag_distances(states)
    falling = np.flatnonzero(np.diff(distances) < 0.0)
    if not len(falling):
        return False
    nearest = falling[0] + np.argmin(distances[falling[0] :])
    if distances[nearest] > 0.2:
        return False
    step, last = time[1] - time[0], time[-1]
    best = step * float(nearest)
    curve = CubicSpline(time, states)

    def lag_distance(delay: float) -> float:
        kept = time[time <= last - delay]
        return float(np.sqrt(np.mean((curve(kept + delay) - states[: len(kept)]) ** 2)))

    for count in (1, int(last * 2 / 3 // best)):
        width = count * step
        best = minimize_scalar(
            lag_distance, bounds=(count * best - width, count * best + width), method="bounded",
            options={"xatol": 1e-4 * step},
        ).x  # fmt: skip
    return lag_distance(best) < 0.01


def _segment_motion(
    model: PolynomialModel, followed: FollowedRecording, time: np.ndarray
) -> np.ndarray:
    """Simulate states, (n, n_states), at `time` (n,), s, each segment from its first state."""
    owner = np.searchsorted(followed.times, time, side="right") - 1
    parts = []
    for k in np.unique(owner):
        of_segment = np.append(followed.times[k], time[owner == k])
        most = 64 * (len(of_segment) // SAMPLES_PER_PERIOD + 1)
        solution = solve(model, followed.states[k], of_segment, most)
        if solution.ending is not Ending.COMPLETE:
            raise FloatingPointError(solution.ending.name)
        parts.append(solution.states[1:])
    return np.concatenate(parts)


def _lag_distances(states: np.ndarray) -> np.ndarray:
    """Compute the root mean square change of states (n, n_states) after 0, 1, ... n/3 samples."""
    count, size = len(states), 2 * len(states)
    spectrum = np.fft.rfft(states, size, axis=0)
    products = np.fft.irfft(np.abs(spectrum) ** 2, size, axis=0)[: count // 3].sum(axis=1)
    squares = np.concatenate([[0.0], np.cumsum(np.sum(states**2, axis=1))])
    later = np.arange(count // 3)
    sums = squares[count - later] + squares[count] - squares[later] - 2.0 * products
    return np.sqrt(np.maximum(sums, 0.0) / (count - later) / states.shape[1])
