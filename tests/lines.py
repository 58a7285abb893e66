"""The two lines of the paper, simulated once a process."""

from copy import deepcopy
from functools import cache

import numpy as np

from galloping.configuration.load import load, plain
from galloping.line.galerkin import STATES, coefficients, make_model
from galloping.model.polynomial import polynomial_library
from galloping.recording.measurement import Motion, recordings_of
from galloping.trajectory.simulation import Simulator, time_grid

CASES = plain(load({}))["cases"]
RESONANT = CASES["internal_resonance"]
START = np.array([0.1, 0.1, 0, 0])


def edited(case=RESONANT, **keys):
    """A copy of a case with keys such as line__mode_shape replaced."""
    case = deepcopy(case)
    for key, value in keys.items():
        section, _, name = key.partition("__")
        assert name in case[section]
        case[section][name] = value
    return case


@cache
def simulate(name):
    """(model, trajectory of 300 s at 100 Hz) of a default case."""
    case = CASES[name]
    line = make_model(coefficients(case))
    start = np.array([case["initial_state"][state] for state in STATES])
    trajectory = Simulator(line.states, line.terms)(line, start, time_grid(300, 100))
    assert trajectory.status == "ok"
    return line, trajectory


@cache
def simulator():
    """Of any two-mode line on the whole library."""
    return Simulator(STATES, polynomial_library(4, 3))


def moved(line, trajectory, factor=1.0):
    """The motion of a model on a trajectory, which may be scaled."""
    states = factor * trajectory.states
    return Motion(line.states, trajectory.time, states, line(states))


def recorded(motion, *, protocol="state", level=0.05, samples=None, replicates=1, seed=3,
             name=("a_case", "state", "a_cell"), relative=True):  # fmt: skip
    """The recordings of a motion, one for each replicate."""
    measured = recordings_of(
        [motion], protocol=protocol, level=level, relative=relative, recordings=1,
        samples=samples or len(motion.time), replicates=replicates, seed=seed, name=name,
    )  # fmt: skip
    return [recording for (recording,) in measured]
