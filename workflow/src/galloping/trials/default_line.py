"""Fits to recordings of the default line."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from scipy.interpolate import CubicSpline

from galloping.configuration.load import load, plain
from galloping.physics.equations import STATES, model
from galloping.physics.galerkin import coefficients
from galloping.polynomial import PolynomialModel
from galloping.simulation import Simulator, time_grid
from galloping.trials.attempts import at_the_bound, fits, measured

GROUP = "default line"
CASE = "internal_resonance"
DURATION, RATE = 300.0, 100.0  # s, Hz
MARGIN = 1.0  # s of motion after the recording, for sensors that are late or early


@dataclass(frozen=True)
class MovingLine:
    """Its case, its model, when it was recorded, and how it moved then."""

    case: dict
    model: PolynomialModel
    start: np.ndarray
    time: np.ndarray
    motion: CubicSpline

    @property
    def states(self) -> np.ndarray:
        return self.motion(self.time)


@cache
def default_line() -> MovingLine:
    case = plain(load({}))["cases"][CASE]
    line = model(coefficients(case))
    start = np.array([case["initial_state"][state] for state in STATES])
    long = time_grid(DURATION + MARGIN, RATE)
    states = Simulator(line.states, line.terms)(line, start, long).states
    return MovingLine(case, line, start, time_grid(DURATION, RATE), CubicSpline(long, states))


def trial(
    seed: int,
    case: str,
    replicates: Sequence[int],
    methods: Mapping[str, Mapping],
    *,
    protocols: Sequence[str],
    levels: Sequence[float],
) -> Iterator[dict[str, object]]:
    """A row for each fit to a recording of the line: see `attempts.fits`."""
    line = default_line()
    states = line.states
    for protocol in protocols:
        for level in levels:
            columns = {"group": GROUP, "case": case, "protocol": protocol, "level": level}
            made = [
                measured(columns | {"seed": seed, "replicate": r}, line.model, line.time, states)
                for r in replicates
            ]
            deviations = at_the_bound(made[0], states)
            yield from fits([replace(each, deviations=deviations) for each in made], methods)
