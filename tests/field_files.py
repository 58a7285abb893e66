"""Files as users hand them over, made anew each time from systems whose truth is known.

Each function writes one file, or several, of a motion by a sensor of known noise, the same bytes
each time, and harms it as loggers, cameras and hands do.
"""

import sys
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
from click.testing import CliRunner
from scipy.signal import StateSpace, lsim

from galloping import derive, simulate
from galloping.cli import main
from galloping.model.polynomial import PolynomialModel
from galloping.readers.mapping import validate_mapping
from galloping.summary.analysis import Field, read_field

STATES = ("q_v", "q_w", "dq_v", "dq_w")
RATE = 25.0  # Hz
NOISE = 0.02  # m, of a camera
RELEASE = (0.4, 0.3, 0.0, 0.0)
COMMAND = (sys.executable, "-c", "from galloping.cli import main; main()")
EXAMPLES = Path(__file__).parents[1] / "examples"
SPAN, MAP = EXAMPLES / "span.csv", ("--map", EXAMPLES / "span.yaml")


def run(*arguments: object, code: int = 0) -> str:
    """What the command prints; of an error, its line too."""
    result = CliRunner().invoke(main, [str(each) for each in arguments])
    assert result.exit_code == code, result.output
    return result.stdout if code == 0 else result.output


def read(*paths: Path, **mapping: object) -> Field:
    """What is read of files by the mapping of two cameras, with other keys."""
    channels = [{"column": state, "measures": state} for state in STATES[:2]]
    known = {"time": {"column": "t"}, "states": STATES, "channels": channels}
    return read_field(paths, validate_mapping(known | mapping))


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
    frame = pd.DataFrame(np.column_stack([time, values]), columns=header.split(","))
    frame.to_csv(path, index=False, float_format="%.5f")
    return path


def cameras(path: Path, seed: int = 1, *, wind: float = 12.0, duration: float = 300.0,
            noise: float = NOISE, rows: slice = slice(None), harm=np.asarray) -> Path:  # fmt: skip
    """Rows of the motion after a release, and what is done to the (n, 2) displacements, in m."""
    time, states = motion(wind, duration)
    kept = time[rows]
    return write(path, kept - kept[0], harm(seen(states[rows], seed, noise)))


def shifted(values: np.ndarray) -> np.ndarray:
    """The zero of a camera is not where the line rests."""
    return values + np.array([6.0, 0.0])


def clipped(values: np.ndarray) -> np.ndarray:
    """The range of a camera ends below the motion."""
    return np.maximum(values, [-0.3, -np.inf])


def cut_off(values: np.ndarray) -> np.ndarray:
    """The last cell lost all digits but the first."""
    values[-1, 1] = 0.0
    return values


def of_changing_wind(path: Path, *winds: float) -> Path:
    """One recording, through which the wind changes every 150 s."""
    start, parts = RELEASE, []
    for wind in winds:
        _, states = motion(wind, 150.0, start)
        parts.append(states[:-1])
        start = tuple(states[-1])
    states = np.concatenate(parts)
    return write(path, np.arange(len(states)) / RATE, seen(states, 3))


def two_events(path: Path, jump: float, each: float = 150.0) -> Path:
    """An event logger: two motions in one file, and `jump` s of the clock between them."""
    time, first = motion(12.0, each)
    _, second = motion(12.0, each, (-0.2, 0.6, 0.0, 0.0))
    times = np.concatenate([time, time + time[-1] + jump])
    return write(path, times, seen(np.concatenate([first, second]), 4))


def ambient(path: Path) -> Path:
    """Two decaying modes that random forces keep moving."""
    time, rng, columns = np.arange(7501) / RATE, np.random.default_rng(5), []
    for frequency, ratio in ((0.38, 0.01), (0.21, 0.02)):
        omega = 2.0 * np.pi * frequency
        system = StateSpace([[0, 1], [-(omega**2), -2 * ratio * omega]], [[0], [1]], [[1, 0]], 0)
        moved = lsim(system, rng.standard_normal(len(time)), time)[1]
        columns.append(0.3 * moved / moved.std())
    return write(path, time, seen(np.column_stack(columns), 6))


def accelerations(path: Path) -> Path:
    """Two accelerometers alone, of unknown offsets."""
    time, states = motion()
    rates = line()(states)[:, 2:]
    noise = 0.05 * rates.std(axis=0) * np.random.default_rng(9).standard_normal(rates.shape)
    values = (rates + noise + (0.3, -0.2)) / 9.80665
    return write(path, time, values, "t [s],acc vertical [g],acc horizontal [g]")
