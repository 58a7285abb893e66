"""Final motion of a simulation: a limit cycle, rest, or neither."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from galloping.model.polynomial import PolynomialModel, velocity_pairs
from galloping.trajectory.simulation import Simulator

SPREAD_TOLERANCE = 0.01  # largest spread of the sizes of the pieces of a limit cycle, relative


@dataclass(frozen=True)
class Watch:
    """Duration of a simulation, and how its last window is sampled and classified.

    duration: s, of which the last `window` s are examined, in pieces of `piece` s, each of many
    periods. rate: Hz, of the samples. rest: half range, of any state or (n_states,) of each, below
    which a motion has died out.
    """

    duration: float
    window: float
    piece: float
    rate: float
    rest: np.ndarray | float

    def during(self, duration: float, window: float | None = None) -> Self:
        """Return a copy with another duration and, optionally, another window, both in s."""
        return replace(self, duration=duration, window=window or self.window)


# Simulation of a span in SI units, which moves at 0.1 to 2 Hz. A millimetre counts as rest.
SPAN_WATCH = Watch(duration=4000.0, window=1000.0, piece=50.0, rate=20.0, rest=1e-3)


@dataclass(frozen=True)
class Settled:
    """Last part of a simulated motion, and its kind: limit cycle, rest or irregular.

    half_range: (n_states,) half of the range over the window; lowest, highest: the least and
    greatest of those over its pieces. kind: `cycle`, `rest`, `irregular` (never repeating, or not
    yet settled), or why the simulation stopped. time: (n,) s, states: (n, n_states), the window.
    """

    half_range: np.ndarray
    lowest: np.ndarray
    highest: np.ndarray
    kind: str
    time: np.ndarray
    states: np.ndarray


def settle(
    simulator: Simulator, model: PolynomialModel, x0: np.ndarray, watch: Watch = SPAN_WATCH
) -> Settled:
    """Simulate a model from an initial state and classify the end of its motion.

    x0: (n_states,) the initial state. On a limit cycle all pieces of the window have the same
    range.
    """
    count = round(watch.window * watch.rate)
    times = watch.duration - watch.window + np.arange(1, count + 1) / watch.rate
    trajectory = simulator(model, np.asarray(x0, float), np.append(0.0, times))
    return _judge_window(trajectory.time[1:], trajectory.states[1:], trajectory.status, watch)


def _judge_window(time: np.ndarray, states: np.ndarray, status: str, watch: Watch) -> Settled:
    """Classify the window of a motion. status: of its simulation."""
    pieces = np.array_split(states, max(1, round(watch.window / watch.piece)))
    ranges = np.array([np.ptp(piece, axis=0) / 2 for piece in pieces])
    lowest, highest = ranges.min(axis=0), ranges.max(axis=0)
    if status != "ok":
        kind = status
    elif np.all(highest < watch.rest):
        kind = "rest"
    elif np.all((highest - lowest) / watch.rest <= SPREAD_TOLERANCE * np.max(highest / watch.rest)):
        kind = "cycle"
    else:
        kind = "irregular"
    return Settled(np.ptp(states, axis=0) / 2, lowest, highest, kind, time, states)


# --- of any oscillator: in its own periods, and the size of its own motion ---


@dataclass(frozen=True)
class Pace:
    """Longest and shortest period of the small oscillations of a model, in s."""

    slow: float
    fast: float

    @classmethod
    def of(cls, model: PolynomialModel, state: np.ndarray) -> Self:
        """Compute the longest and shortest period of small oscillations about a state.

        The model has no inputs. state: (n_states,). If none oscillates, the times are those in
        which they grow or decay, each over a radian.
        """
        modes = model.small_motions(state)
        omega = modes.omega[modes.oscillating]
        omega = omega if len(omega) else modes.omega[modes.omega > 0.0]
        omega = omega if len(omega) else np.ones(1)  # there is no time scale: any value will do
        return cls(float(2.0 * np.pi / omega.min()), float(2.0 * np.pi / omega.max()))


def estimate_missing_sizes(
    sizes: np.ndarray, model: PolynomialModel, state: np.ndarray, rates: np.ndarray | float = 0.0
) -> np.ndarray:
    """Estimate the unknown amplitudes of states from known amplitudes and frequencies.

    The amplitude of a rate is that of its state times the lowest frequency of small motions, and
    conversely. If neither is known, an amplitude is equal to the largest of its kind, displacements
    or velocities, or 1. sizes: (n_states,) zero where unknown. model: without inputs. state:
    (n_states,) centre of the small motions. rates: (n_states,) sizes of the rates of the states,
    zero where unknown. Returns (n_states,), none of which is zero.
    """
    omega, pairs = 2.0 * np.pi / Pace.of(model, state).slow, velocity_pairs(model.states)
    sizes = np.where(sizes > 0.0, sizes, rates / omega)
    for i, velocity in pairs.items():
        sizes[i] = sizes[i] or sizes[velocity] / omega
        sizes[velocity] = sizes[velocity] or sizes[i] * omega
    velocities = np.isin(np.arange(len(sizes)), list(pairs.values()))
    for rows in (velocities, ~velocities):
        sizes[rows] = np.where(sizes[rows] > 0.0, sizes[rows], sizes[rows].max(initial=0.0) or 1.0)
    return sizes


WINDOW_PERIODS = 80  # length of a window, in periods of the slowest motion
PIECE_PERIODS = 20  # length of a piece of a window, in periods of the slowest motion
TRANSIENT_WINDOWS = 9  # number of the first windows, which are a transient
MAX_WINDOWS = 50  # largest number of windows if the size of the motion only grows or only falls
SAMPLES_PER_PERIOD = 50  # samples in a period of the fastest motion
MAX_WINDOW_SAMPLES = 100_000  # largest number of samples in a window
# Sizes of a motion, relative to its size at the start or in the recording.
MIN_SIZE = 1e-3  # smallest size of a motion that has not died out, unless it grows
ROUNDING_SIZE = 1e-9  # largest size of rounding errors, which are no growing motion
DIVERGENCE_SIZE = 1e3  # size above which a motion diverges if its simulation ends early
MAX_SIZE = 1e6  # size above which any simulation ends


def settle_in_periods(
    simulator: Simulator,
    model: PolynomialModel,
    x0: np.ndarray,
    pace: Pace,
    sizes: np.ndarray | float = 0.0,
) -> Settled:
    """Simulate an oscillator for many periods until its motion settles, and classify the motion.

    The duration is in periods of the oscillator. x0: (n_states,) initial state. pace: of the model.
    sizes: (n_states,) of the recorded motion, zero where unknown. If the motion has settled, or its
    size varies up and down, returns the first window after a transient. If it still changes after
    4,000 periods, returns the last window.
    """
    window = WINDOW_PERIODS * pace.slow
    rate = min(SAMPLES_PER_PERIOD / pace.fast, MAX_WINDOW_SAMPLES / window)
    count = round(window * rate)
    state = np.asarray(x0, float)
    begin = estimate_missing_sizes(np.maximum(sizes, np.abs(state)), model, state)
    limit, extents = MAX_SIZE * float(np.linalg.norm(begin)), []
    for number in range(MAX_WINDOWS):
        trajectory = simulator(model, state, np.arange(count + 1) / rate, limit=limit)
        states, status = trajectory.states[1:], trajectory.status
        if np.any(np.nan_to_num(np.abs(states)) > DIVERGENCE_SIZE * begin) and status != "ok":
            status = "diverged"
        pieces = np.array_split(states, WINDOW_PERIODS // PIECE_PERIODS)
        first, last = (np.ptp(piece, axis=0) / 2.0 for piece in (pieces[0], pieces[-1]))
        if number == 0:  # the start included, since dry friction may stop the motion at once
            half_range = np.ptp(trajectory.states[: len(pieces[0]) + 1], axis=0) / 2.0
            size = np.maximum(sizes, np.nan_to_num(half_range)) + np.finfo(float).tiny
        watch = Watch(window, window, PIECE_PERIODS * pace.slow, rate, MIN_SIZE * size)
        motion = _judge_window(trajectory.time[1:], states, status, watch)
        is_growing = bool(
            np.any(last > np.maximum((1.0 + SPREAD_TOLERANCE) * first, ROUNDING_SIZE * size))
        )
        is_settled = motion.kind == "cycle" and number >= TRANSIENT_WINDOWS
        if motion.kind == "rest" and is_growing:
            motion = replace(motion, kind="irregular")
        extents.append(float(np.linalg.norm(motion.half_range / size)))
        is_fluctuating = number >= TRANSIENT_WINDOWS and np.prod(np.diff(extents[-3:])) <= 0.0
        if is_settled or is_fluctuating or motion.kind not in ("cycle", "irregular"):
            return motion
        state = states[-1]
    return motion
