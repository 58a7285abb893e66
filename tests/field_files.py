"""Files as users hand them over, made anew each time from systems whose truth is known.

Each function writes one file, or several, of a motion by a sensor of known noise, the same bytes
each time, and harms it as loggers, cameras and hands do.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
from click.testing import CliRunner
from scipy.signal import StateSpace, lsim

from galloping import derive, simulate
from galloping.cli import main
from galloping.polynomial import PolynomialModel

STATES = ("q_v", "q_w", "dq_v", "dq_w")
RATE = 25.0  # Hz
NOISE = 0.02  # m, of a camera
RELEASE = (0.4, 0.3, 0.0, 0.0)


def run(*arguments: object, code: int = 0) -> str:
    """What the command prints; of an error, its line too."""
    result = CliRunner().invoke(main, [str(each) for each in arguments])
    assert result.exit_code == code, result.output
    return result.stdout if code == 0 else result.output


@cache
def line(wind: float = 12.0) -> PolynomialModel:
    return derive(wind={"speed": wind})


@cache
def motion(wind: float = 12.0, duration: float = 300.0, start: tuple[float, ...] = RELEASE):
    """Times (n,) and states (n, 4) of the two-mode line."""
    time = np.arange(round(duration * RATE) + 1) / RATE
    return time, simulate(line(wind), start, time).states


def seen(states: np.ndarray, seed: int, noise: float = NOISE) -> np.ndarray:
    """(n, 2) displacements as two cameras see them."""
    return states[:, :2] + noise * np.random.default_rng(seed).standard_normal((len(states), 2))


def write(path: Path, time: np.ndarray, values: np.ndarray, header: str = "t [s],q_v [m],q_w [m]"):
    """A CSV of times and columns; NaN is an empty cell."""
    rows = ["" if cell != cell else f"{cell:.5f}" for row in np.column_stack([time, values])
            for cell in row]  # fmt: skip
    width = 1 + np.shape(values)[1]
    lines = [",".join(rows[k : k + width]) for k in range(0, len(rows), width)]
    path.write_text("\n".join([header, *lines]) + "\n", encoding="utf-8")
    return path


def shifted(path: Path, by: tuple[float, float], seed: int = 1) -> Path:
    """A camera whose zero is not where the line rests, m."""
    time, states = motion()
    return write(path, time, seen(states, seed) + by)


def of_winds(folder: Path, winds: tuple[float, ...], seed: int = 2) -> list[Path]:
    """A recording in each wind."""
    made = []
    for k, wind in enumerate(winds):
        time, states = motion(wind)
        made.append(write(folder / f"wind_{wind:g}.csv", time, seen(states, seed + k)))
    return made


def of_changing_wind(path: Path, winds: tuple[float, ...], each: float = 150.0, seed: int = 3):
    """One recording, through which the wind changes from time to time."""
    time = np.arange(round(each * RATE) + 1) / RATE
    state, parts = np.array(RELEASE), []
    for wind in winds:
        states = simulate(line(wind), state, time).states
        parts.append(states[:-1])
        state = states[-1]
    states = np.concatenate(parts)
    return write(path, np.arange(len(states)) / RATE, seen(states, seed))


def two_events(path: Path, jump: float, each: float = 150.0, seed: int = 4) -> Path:
    """An event logger: two motions in one file, `jump` s of the clock between them."""
    time, first = motion(12.0, each)
    _, second = motion(12.0, each, (-0.2, 0.6, 0.0, 0.0))
    times = np.concatenate([time, time + time[-1] + jump])
    return write(path, times, seen(np.concatenate([first, second]), seed))


def ambient(path: Path, damping=(0.01, 0.02), duration: float = 600.0, seed: int = 5) -> Path:
    """Two decaying modes that random forces keep moving."""
    time = np.arange(round(duration * RATE) + 1) / RATE
    rng = np.random.default_rng(seed)
    columns = []
    for frequency, ratio in zip((0.38, 0.21), damping, strict=True):
        omega = 2.0 * np.pi * frequency
        system = StateSpace([[0, 1], [-(omega**2), -2 * ratio * omega]], [[0], [1]], [[1, 0]], 0)
        moved = lsim(system, rng.standard_normal(len(time)), time)[1]
        columns.append(0.3 * moved / moved.std())
    return write(path, time, seen(np.column_stack(columns), seed + 1))


def clipped(path: Path, at: float = -0.3, seed: int = 7) -> Path:
    """A sensor whose range ends below the motion."""
    time, states = motion()
    values = seen(states, seed)
    values[:, 0] = np.maximum(values[:, 0], at)
    return write(path, time, values)


def damaged(path: Path, seed: int = 2) -> Path:
    """Good cameras, and the last cell of the file cut off."""
    time, states = motion(duration=120.0)
    values = seen(states, seed, 0.002)
    values[-1, 1] = 0.0
    return write(path, time, values)


def restarted(path: Path, seed: int = 8) -> Path:
    """Two events in one file, each with a clock that begins at zero."""
    time, first = motion(12.0, 150.0)
    _, second = motion(12.0, 150.0, (-0.2, 0.6, 0.0, 0.0))
    values = seen(np.concatenate([first, second]), seed)
    return write(path, np.concatenate([time, time]), values)


def accelerations(path: Path, seed: int = 9, noise: float = 0.05) -> Path:
    """Two accelerometers alone, of unknown offsets."""
    time, states = motion()
    rates = line()(states)[:, 2:]
    rng = np.random.default_rng(seed)
    values = rates + noise * rates.std(axis=0) * rng.standard_normal(rates.shape) + (0.3, -0.2)
    return write(path, time, values / 9.80665, "t [s],acc vertical [g],acc horizontal [g]")


def below_onset(path: Path, seed: int = 10) -> Path:
    """A release in a wind in which the line does not gallop."""
    time, states = motion(5.0)
    return write(path, time, seen(states, seed, 0.005))


def settled(path: Path, seed: int = 11) -> Path:
    """The limit cycle alone, reached long before."""
    time, states = motion(12.0, 1500.0)
    return write(path, time[:7501], seen(states[-7501:], seed))


def short(path: Path, seed: int = 12) -> Path:
    """Eight periods."""
    time, states = motion(duration=20.0)
    return write(path, time, seen(states, seed))


def seldom(path: Path, seed: int = 13) -> Path:
    """Three samples a period."""
    time, states = motion()
    return write(path, time[::20], seen(states[::20], seed))


def noisy(path: Path, seed: int = 14) -> Path:
    """A camera that errs by more than the line moves."""
    time, states = motion()
    return write(path, time, seen(states, seed, 1.5))
