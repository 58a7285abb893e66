"""Fits to long recordings, to motions that have settled, and to lines that forget their start.

Long: the default line from its release on. Steady: 300 s of the limit cycle of the default line,
or of a random line that has one. Sensitive: 300 s of a random line where neighbouring motions part
more than SENSITIVE times.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from galloping.cycles.motion import settle
from galloping.physics.equations import STATES
from galloping.polynomial import PolynomialModel
from galloping.seeds import generator
from galloping.simulation import Simulator, time_grid
from galloping.trials.attempts import Attempt, fits, measured
from galloping.trials.default_line import DURATION, RATE, default_line
from galloping.trials.random_lines import TERMS, lines

GROUP = "long and steady"
LONG = {"2000 s": (2e3, 100.0), "10000 s": (1e4, 100.0), "100000 s": (1e5, 20.0)}  # s, Hz
APART, SENSITIVE = 1e-6, 1e3  # m, times within a recording


def trial(
    seed: int,
    case: str,
    replicates: Sequence[int],
    methods: Mapping[str, Mapping],
    *,
    levels: Sequence[float],
) -> Iterator[dict[str, object]]:
    """A row for each fit to a recording by the protocol `state`: see `attempts.fits`."""
    for level in levels:
        attempts = (_attempt(seed, case, replicate, level) for replicate in replicates)
        yield from fits(attempts, methods)


def _attempt(seed: int, case: str, replicate: int, level: float) -> Attempt:
    rng = generator(seed, GROUP, case, replicate)
    time = time_grid(*LONG.get(case, (DURATION, RATE)))
    simulator = Simulator(STATES, TERMS)
    if case == "limit cycle, random lines":
        true, states = _settled_line(rng, simulator, time)
    elif case == "sensitive lines":
        true, states = _sensitive_line(rng, simulator, time)
    else:
        line = default_line()
        true, start = line.model.on_library(TERMS), line.start
        if case == "limit cycle":
            start = settle(simulator, true, start).states[-1]
        states = simulator(true, start, time).states
    columns = {
        "group": GROUP, "case": case, "protocol": "state", "level": level,
        "seed": seed, "replicate": replicate,
    }  # fmt: skip
    return measured(columns, true, time, states)


def _settled_line(
    rng: np.random.Generator, simulator: Simulator, time: np.ndarray
) -> tuple[PolynomialModel, np.ndarray]:
    """The first line drawn that has a limit cycle, and its motion there."""
    for true, motions in lines(rng, simulator, time):
        settled = settle(simulator, true, motions[0][-1])
        if settled.kind == "cycle":
            return true, simulator(true, settled.states[-1], time).states
    raise AssertionError("lines are drawn without end")


def _sensitive_line(
    rng: np.random.Generator, simulator: Simulator, time: np.ndarray
) -> tuple[PolynomialModel, np.ndarray]:
    """The first line drawn that forgets its start, and its motion."""
    for true, motions in lines(rng, simulator, time):
        beside = simulator(true, motions[0][0] + [APART, 0.0, 0.0, 0.0], time).states
        if np.max(np.abs(beside - motions[0])) > SENSITIVE * APART:
            return true, motions[0]
    raise AssertionError("lines are drawn without end")
