"""What many tests share: the two lines of the paper, simulated once a process."""

import os

# One thread, as in the jobs of a study; before NumPy is imported.
for library in ("OMP", "OPENBLAS", "MKL", "VECLIB_MAXIMUM"):
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")

from functools import cache
from pathlib import Path

import hypothesis
import numpy as np
import pytest

from galloping.configuration.load import load, plain
from galloping.equations import STATES, model
from galloping.galerkin import coefficients
from galloping.simulation import Simulator, time_grid

ROOT = Path(__file__).parents[1]
hypothesis.settings.register_profile("study", deadline=None, derandomize=True)
hypothesis.settings.load_profile("study")


@cache
def _cases():
    return plain(load({}))["cases"]


@cache
def _simulated(name):
    case = _cases()[name]
    line = model(coefficients(case))
    start = np.array([case["initial_state"][state] for state in STATES])
    trajectory = Simulator(line.states, line.terms)(line, start, time_grid(300, 100))
    assert trajectory.status == "ok"
    return line, trajectory


@pytest.fixture
def cases():
    """The default cases as plain dicts."""
    return plain(load({}))["cases"]


@pytest.fixture(params=["internal_resonance", "non_resonant"])
def simulated(request):
    """(model, trajectory of 300 s at 100 Hz) of each case."""
    return _simulated(request.param)


@pytest.fixture
def resonant():
    """(model, trajectory of 300 s at 100 Hz) of the internally resonant line."""
    return _simulated("internal_resonance")


@pytest.fixture(scope="session")
def root():
    """The repository."""
    return ROOT
