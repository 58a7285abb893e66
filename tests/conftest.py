"""What many tests share."""

import os
from pathlib import Path

import hypothesis
import pandas as pd
import pytest
from lines import simulate
from threadpoolctl import threadpool_limits

from galloping.configuration.load import load, plain

pytest_plugins = ["browser", "studies"]
SLOW = (
    "Slow tests were not run, such as studies killed, damaged, grown, moved and published, and "
    "trials: `make test SLOW=yes` runs them."
)
ROOT = Path(__file__).parents[1]
os.environ["PYTHONPATH"] = str(ROOT / "workflow" / "src")  # for the processes that tests start
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
def cases():
    """The default cases as plain dicts."""
    return plain(load({}))["cases"]


@pytest.fixture
def case(cases):
    """The internally resonant line as a plain dict."""
    return cases["internal_resonance"]


@pytest.fixture(params=["internal_resonance", "non_resonant"])
def simulated(request):
    """(model, trajectory of 300 s at 100 Hz) of each case."""
    return simulate(request.param)


@pytest.fixture
def resonant():
    """(model, trajectory of 300 s at 100 Hz) of the internally resonant line."""
    return simulate("internal_resonance")


@pytest.fixture(scope="session")
def root():
    """The repository."""
    return ROOT


@pytest.fixture(scope="session")
def hold_to_reference():
    """Asserts that a study's tables have the numbers of its reference.

    Where they should not have them any more, `make reference` takes the new ones.
    """

    def hold(tables, reference):
        summary = pd.read_csv(tables / "reference_summary.csv").set_index("table")
        differences = pd.read_csv(tables / "reference_differences.csv")
        names = {path.stem for path in reference.glob("*.csv")}
        assert names | {"settings", "processor"} == set(summary.index)
        assert (summary["values_compared"] > 0).all()
        verdicts = summary["verdict"]
        assert verdicts["settings"] == "agrees"
        if verdicts["processor"] == "agrees":
            assert verdicts[verdicts != "agrees"].to_dict() == {}
            assert differences.empty
            assert summary["largest_difference_in_tolerances"].max() < 0.1
        # Another processor rounds otherwise, which decides where the data cannot tell models apart,
        # and the whole of motion that never repeats: the resonant line's from 12 m/s on.
        assert not differences["verdict"].str.startswith("only").any()
        chaotic = differences["row"].str.contains(r"\bcase=internal_resonance(?:,|$)")
        chaotic &= differences["table"].isin(("resonance_map", "clearance", "measures"))
        tables = differences.loc[~chaotic & (differences["table"] != "processor"), "table"]
        share = tables.value_counts() / summary["values_compared"]
        assert share[share > 0.05].to_dict() == {}

    return hold
