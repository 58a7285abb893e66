"""What Snakemake plans of studies of every kind, and what their jobs read."""

import re
import shutil
import sys
from pathlib import Path
from pkgutil import resolve_name

import draw_rules
import pytest
from studies import script

from galloping.configuration.kinds import KINDS
from galloping.report.data_dictionary import captions, columns
from galloping.reproducibility.plan import PlannedJob

ROOT = Path(__file__).parents[2]
TRIALS = ", ".join(f"{kind}: {{kind: {kind}}}" for kind in KINDS)
LINES = "internal_resonance: null, non_resonant: null"
TRIALS_ALONE = f"{{cases: {{{LINES}}}, trials: {{{TRIALS}}}}}"
OTHERS = [
    "measurement: {protocols: [displacement], levels: [0.3], joint_levels: [0]}",
    "{identification: {methods: [weak]}, measurement: {protocols: [state]}}",
    f"{{cases: {{{LINES}, alone: {{}}}}, identification: {{methods: [stlsq]}}}}",
    TRIALS_ALONE,
    "cases: {non_resonant: {truth: {model: continuous, modes: 3}}}",
]
UNITS = {"m": "m", "s": "s", "percent": "%", "m_s": "m/s", "hz": "Hz"}
pytestmark = pytest.mark.xdist_group("plans")


@pytest.mark.parametrize("settings", ["{}", *OTHERS])
def test_a_study_of_any_kind_has_jobs_for_all_that_it_shows(jobs_of, settings):
    jobs = jobs_of(settings)
    assert "results/report.html" in jobs
    shown = [job["settings"] for job in jobs.values() if "function" in job["settings"]]
    assert shown and all(callable(resolve_name(s["function"]["function"])) for s in shown)
    least = "0.3" in settings  # its lowest noise level
    page = str(jobs["results/report.html"])
    assert ("4 motion at the lowest noise" in page) == least
    has_papers = not any(word in settings for word in ("displacement", "methods", "trials"))
    assert ("by the paper's method on the first line" in page) == has_papers
    assert ("by the method ``" in page) == (not has_papers and settings != TRIALS_ALONE)


@pytest.fixture
def folder(tmp_path):
    """With all that a plan needs, and no settings but the usual."""
    shutil.copytree(ROOT / "config", tmp_path / "config")
    for name in ("workflow", "examples"):
        (tmp_path / name).symlink_to(ROOT / name)
    return tmp_path


def test_the_graph_of_the_rules_is_that_of_the_workflow(folder, planned):
    (folder / "all.yaml").write_text(draw_rules.FULL_STUDY)
    reads = draw_rules.build_graph(PlannedJob(**job) for job in planned(folder, "all.yaml"))
    text = "".join(path.read_text("utf-8") for path in (ROOT / "workflow/rules").glob("*.smk"))
    assert reads.keys() | {"measure_motion"} == set(re.findall(r"(?m)^rule (\w+):", text))
    assert (ROOT / "docs/rules.svg").read_text("utf-8") == draw_rules.draw(reads)  # make docs


def test_a_recording_that_is_not_here_is_one_line(folder):
    (folder / "mine.yaml").write_text("recordings: {mine: {files: [none.csv, examples/span.csv]}}")
    status, said = script(folder, "run_study", "--configfile", "mine.yaml")
    assert status == 1
    assert said == ["mapping.yaml, none.csv: not here, and no job makes it"]


def test_an_unusable_home_is_one_line_that_does_not_blame_the_study(folder, monkeypatch):
    (folder / "home").touch()
    monkeypatch.setenv("HOME", str(folder / "home"))
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    status, (said,) = script(folder, "run_study")
    assert status == 1 and said.startswith(f"{folder / 'home'}") and ".snakemake" not in said


def test_a_path_from_which_snakemake_starts_no_jobs_is_one_line(folder, monkeypatch):
    for name, is_refused in (("my lines (2)", True), ("größe", False)):
        (folder / name).symlink_to(sys.prefix)
        monkeypatch.setattr(sys, "executable", str(folder / name / "bin" / "python"))
        status, (said,) = script(folder, "run_study", "--configfile", "none.yaml")
        assert status == 1 and ("special character" in said) == is_refused


def test_tables_and_figures_are_of_what_is_in_a_study(jobs_of):
    jobs = jobs_of(f"{{cases: {{{LINES}}}, trials: {{a: {{kind: systems}}}}}}")
    tables = {path for path in jobs if path.startswith("results/tables/")}
    names = ("columns", "systems", "paths", "reference_summary")
    assert tables == {f"results/tables/{name}.csv" for name in names}
    assert not any(path.startswith("results/figures/") for path in jobs)


def test_every_param_carries_its_key(jobs_of):
    """Else two numbers that swap would go unnoticed."""
    for job in jobs_of("{}").values():
        for name, param in job["settings"].items():
            assert isinstance(param, dict) and (name == "code" or len(param) == 1), (job, name)


@pytest.mark.parametrize("settings", ["{}", TRIALS_ALONE])
def test_the_data_dictionary_is_of_the_tables_there_are(jobs_of, settings):
    """Each column once, with the unit of its name."""
    jobs = jobs_of(settings)
    rows = columns(jobs["results/tables/columns.csv"]["settings"]["settings"]["settings"])
    tables = {Path(path).stem for job in jobs.values() for path in job["outputs"]}
    assert {"", "reference_summary"} <= set(rows["table"]) <= tables | {""}
    assert ("scores" in set(rows["table"])) == (settings == "{}")
    assert list(rows) == ["table", "column", "unit", "meaning"]
    assert not rows.duplicated(["table", "column"]).any()
    assert (rows["meaning"].str.len() > 3).all()
    shown = [path for path in jobs["results/report.html"]["inputs"] if path.endswith(".csv")]
    assert shown and {Path(path).stem for path in shown} <= captions().keys()
    for row in rows.to_dict("records"):
        stem = row["column"].removesuffix("_low").removesuffix("_high")
        ends = [unit for end, unit in UNITS.items() if stem.endswith(f"_{end}")]
        if ends and not stem.startswith("r2_"):
            assert row["unit"] in ends, row
