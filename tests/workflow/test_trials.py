"""A study of trials alone: no line, a few fits of every kind but long ones."""

import pandas as pd
import pytest
import yaml
from studies import copy_repository, run

from galloping.configuration.yaml_file import read

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("trials")]

ONE = {"seed": 7, "replicates": 1}
TRIALS = {
    "results": "results/tried",
    "trials": {
        "default": {"kind": "default_line", **ONE, "levels": [0.05], "protocols": ["state"]},
        "random": {"kind": "random_lines", **ONE},
        "faults": {"kind": "sensor_faults", **ONE, "cases": ["clock"]},
        "steady": {"kind": "long_and_steady", **ONE, "cases": ["limit cycle"]},
        "published": {
            "kind": "systems", **ONE, "cases": ["van_der_pol"], "samples": [500], "levels": [0.01],
        },
        "beside": {
            "kind": "published_terms", **ONE, "cases": ["lorenz"], "durations": [4],
            "levels": [0.1],
        },
        "intervals": {
            "kind": "published_intervals", **ONE, "cases": ["gamma 0"], "samples": [200],
        },
        "reality": {"kind": "model_error", **ONE, "cases": ["two modes, gusts 2 %"]},
    },
    "figures": {"dpi": 50},
}  # fmt: skip


@pytest.fixture(scope="module")
def tried(root, tmp_path_factory):
    folder = tmp_path_factory.mktemp("tried")
    copy_repository(root, folder)
    without_lines = {"cases": read(root / "config/trust.yaml")["cases"]}
    (folder / "mine.yaml").write_text(yaml.safe_dump(TRIALS | without_lines), encoding="utf-8")
    done = run(folder, "-m", "snakemake", "--cores", "2", "--configfile", "mine.yaml")
    assert done.returncode == 0, done.stdout[-3000:]
    return folder / TRIALS["results"]


def test_only_what_belongs_to_trials_is_made(tried):
    made = {path.name for kind in ("tables", "figures") for path in (tried / kind).glob("[a-z]*")}
    assert made == {
        "columns.csv", "fits.csv", "trust.csv", "systems.csv", "reference_summary.csv",
        "reference_differences.csv", "trust.svg", "trust.png", "model_error.csv", "model_error.svg",
        "model_error.png", "paths.csv", "ablations.csv",
        "published_terms.csv", "published_terms.svg", "published_terms.png",
        "published_intervals.csv", "published_intervals.svg", "published_intervals.png",
    }  # fmt: skip
    report = (tried / "report.html").read_text(encoding="utf-8")
    assert "1 of 1 fits to default line were ok, 0 of these were wrong (0 % of all)" in report
    assert "how often each status is right" in report


def test_the_tables_have_a_row_for_each_group_and_system(tried):
    trust = pd.read_csv(tried / "tables" / "trust.csv")
    whole = trust[~trust["case"].str.startswith("every t")]
    assert dict(zip(whole["group"] + ", " + whole["case"], whole["fits"], strict=True)) == {
        "default line, internal_resonance": 1,
        "long and steady, limit cycle": 1,
        "random lines, all": 2,
        "sensor faults, clock": 1,
    }
    systems = pd.read_csv(tried / "tables" / "systems.csv")
    assert set(systems["method"]) == {"maximum_likelihood", "weak_gls", "weak"}
    paths = pd.read_csv(tried / "tables" / "paths.csv")
    assert paths["fits"].sum() == whole["fits"].sum() + systems["replicates"].sum() + 1
