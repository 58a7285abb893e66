"""What many tests share."""

import os
import sys
from pathlib import Path

import hypothesis
import pytest
from lines import simulate
from threadpoolctl import threadpool_limits

pytest_plugins = ["browser", "studies"]
SLOW = (
    "Slow tests were not run, such as studies killed, damaged, grown, moved and published, and "
    "trials: `make test SLOW=yes` runs them."
)
ROOT = Path(__file__).parents[1]
os.environ["PYTHONPATH"] = str(ROOT / "workflow" / "src")  # for the processes that tests start
sys.path += [str(ROOT / "workflow" / "scripts"), str(ROOT / "docs")]  # scripts are in no package
hypothesis.settings.register_profile("study", deadline=None, derandomize=True)
hypothesis.settings.load_profile("study")


def pytest_unconfigure(config):
    if not hasattr(config, "workerinput") and "not slow" in config.option.markexpr:
        print(SLOW)


@pytest.fixture(scope="session", autouse=True)
def one_thread():
    """As in the jobs of a study."""
    with threadpool_limits(1):
        yield


@pytest.fixture
def resonant():
    """(model, trajectory of 300 s at 100 Hz) of the internally resonant line."""
    return simulate("internal_resonance")


@pytest.fixture(scope="session")
def root():
    """The repository."""
    return ROOT
