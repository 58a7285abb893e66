"""A study of lines that are not the paper's: one that diverges, one that never gallops."""

import pandas as pd
import pytest
from studies import run_configured

pytestmark = [pytest.mark.slow]

LINES = {
    "results": "results/own",
    "cases": {
        "internal_resonance": None,
        "non_resonant": None,
        "storm": {"wind": {"speed": 40}},
        "calm": {"wind": {"speed": 3}},
    },
    "simulation": {"duration": 100, "sampling_rate": 50, "steady_window": [60, 100]},
    "measurement": {
        "replicates": 1, "protocols": ["state"], "levels": [0.05], "subsets": {"points": [1000]},
    },
    "identification": {"degree": 2, "methods": ["stlsq", "maximum_likelihood"]},
    "sweeps": {
        "wind": {"values": [2, 6, 4]},
        "resonance": {"values": [4, 8, 4], "second_values": [24000, 26000, 2000]},
    },
    "assessment": {
        "winds": [4, 8], "design_wind": 3,
        "open_parameters": {
            "wind_speed": [], "damping_ratio": [], "bundle_dimension": [],
            "initial_displacement": [],
        },
    },
    "figures": {"dpi": 50},
}  # fmt: skip


@pytest.fixture(scope="module")
def own(root, tmp_path_factory):
    results = run_configured(root, tmp_path_factory.mktemp("own"), LINES)
    return lambda name: pd.read_csv(results / "tables" / f"{name}.csv")


def test_a_line_that_diverges_is_rows_with_their_reason(own):
    scores = own("scores")
    assert set(scores["case"]) == {"storm", "calm"}
    storm = scores[scores["case"] == "storm"]
    assert len(storm) and storm["status"].str.startswith("the line itself diverged").all()
    assert storm["r2_q_v"].isna().all()


def test_amplitudes_of_a_line_at_rest_are_undefined(own):
    calm = own("scores").query("case == 'calm'")
    assert calm["amplitude_error_q_v_percent"].isna().all()


def test_claims_of_the_paper_are_not_about_these_lines(own):
    assert own("claims").empty


def test_nothing_is_reported_of_limit_cycles_that_are_not_there(own):
    cycles = own("limit_cycles").query("case == 'calm' and branch == 'simulation'")
    assert set(cycles["kind"]) == {"rest", "cycle"} and len(cycles) == 2
