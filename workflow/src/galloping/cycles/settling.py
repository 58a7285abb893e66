"""Where a motion ends up: a limit cycle, rest, or a motion that never repeats."""

from dataclasses import dataclass

import numpy as np

from galloping.polynomial import PolynomialModel
from galloping.simulation import Simulator

DURATION, WINDOW, PIECE, RATE = 4000.0, 1000.0, 50.0, 20.0  # s, s, s, Hz
REST = 1e-3  # m: a smaller motion has died out
STEADY = 0.01  # relative spread over the pieces up to which a motion is a limit cycle


@dataclass(frozen=True)
class Settled:
    """half_range: (n_states,) half of the range over the window; lowest, highest: the least and
    greatest of those over its pieces of PIECE s. kind: `cycle`, `rest`, `irregular` (never
    repeating, or not yet settled), or why the simulation stopped. time: (n,) s, states:
    (n, n_states), the window.
    """

    half_range: np.ndarray
    lowest: np.ndarray
    highest: np.ndarray
    kind: str
    time: np.ndarray
    states: np.ndarray


def settle(
    simulator: Simulator,
    model: PolynomialModel,
    x0: np.ndarray,
    duration: float = DURATION,
    window: float = WINDOW,
) -> Settled:
    """The last `window` s of a motion of `duration` s from x0 (n_states,).

    On a limit cycle all pieces of the window, each of many periods, have one range.
    """
    count = round(window * RATE)
    grid = np.append(0.0, duration - window + np.arange(1, count + 1) / RATE)
    trajectory = simulator(model, np.asarray(x0, float), grid)
    time, states = trajectory.time[1:], trajectory.states[1:]
    pieces = np.array_split(states, max(1, round(window / PIECE)))
    ranges = np.array([np.ptp(piece, axis=0) / 2 for piece in pieces])
    lowest, highest = ranges.min(axis=0), ranges.max(axis=0)
    if trajectory.status != "ok":
        kind = trajectory.status
    elif np.max(highest) < REST:
        kind = "rest"
    elif np.all(highest - lowest <= STEADY * np.max(highest)):
        kind = "cycle"
    else:
        kind = "irregular"
    return Settled(np.ptp(states, axis=0) / 2, lowest, highest, kind, time, states)
