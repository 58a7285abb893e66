"""The smoke study through Snakemake: what it writes, that it is as it was when run again, how its
numbers stand beside its reference, and what another reference runs again.
"""

import re
from dataclasses import replace

import pandas as pd
import pytest
from studies import hold_to_reference, script

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("study")]


def test_study_runs_to_the_end(study):
    assert study.first.returncode == 0, study.first.stdout


def test_every_job_leaves_a_log_and_a_benchmark(study):
    logs = {p.relative_to(study.results / "logs").with_suffix("")
            for p in (study.results / "logs").rglob("*.log")}  # fmt: skip
    benchmarks = {p.relative_to(study.results / "benchmarks").with_suffix("")
                  for p in (study.results / "benchmarks").rglob("*.tsv")}  # fmt: skip
    assert logs and logs == benchmarks


def test_second_run_has_nothing_to_do(study):
    before = study.files()
    run = study.snakemake()
    assert run.returncode == 0, run.stdout
    assert "Nothing to be done" in run.stdout
    assert study.files() == before


def test_a_bad_configuration_ends_in_one_line_and_writes_nothing(fresh, tmp_path):
    file = tmp_path / "edit.yaml"
    file.write_text("measurement: {subsets: {points: [30002]}}\n")
    before = fresh.files()
    run = fresh.snakemake(config=(str(file),))
    assert run.returncode != 0
    assert fresh.files() == before
    said = [text for text in run.stdout.splitlines() if not text.startswith(("Using ", "Config "))]
    assert said == [
        "measurement.subsets.points: 30002 is larger than the record (30001 samples)"
    ], run.stdout


# beside the reference


def test_the_numbers_of_the_reference_come_out_again(study, root):
    hold_to_reference(study.results / "tables", root / "results" / "reference" / "smoke")


@pytest.fixture(scope="module")
def edited(study, tmp_path_factory):
    """A copy of the finished study in which one column of the reference is another, run again."""
    edited = study.copied(tmp_path_factory.mktemp("reference") / "edited")
    file = edited.folder / "results/reference/smoke/efficiency.csv"
    numbers = pd.read_csv(file)
    numbers["weakest_t"] *= 1.01
    numbers.to_csv(file, index=False)
    return replace(edited, first=edited.snakemake())


def test_another_reference_runs_the_comparison_alone_and_shows(edited):
    run = edited.first
    assert run.returncode == 0, run.stdout
    assert "3 of 3 steps (100%) done" in run.stdout  # the comparison, the report, the rule of all
    summary = {row["table"]: row for row in edited.table("reference_summary")}
    rows = int(summary["efficiency"]["rows_compared"])
    assert int(summary["efficiency"]["values_beyond_tolerance"]) >= rows > 10
    found = [row for row in edited.table("reference_differences") if row["table"] == "efficiency"]
    found = [row for row in found if row["column"] == "weakest_t"]
    assert {row["verdict"] for row in found} == {"beyond tolerance"} and len(found) == rows
    for row in found:
        assert float(row["found"]) / float(row["reference"]) == pytest.approx(1 / 1.01, rel=1e-6)
    with pytest.raises(AssertionError):
        hold_to_reference(edited.results / "tables", edited.folder / "results/reference/smoke")


def take_reference(study):
    options = ("take_reference", "--configfile", "config/smoke.yaml")
    return script(study.folder, "keep_results", *options)


def test_only_a_finished_study_becomes_the_reference(edited, study):
    reference = edited.folder / "results/reference/smoke"
    lost = edited.results / "bounds/non_resonant/state/noise_0.05.npz"
    kept = lost.rename(lost.with_suffix(".kept"))
    before = {path.name: path.read_bytes() for path in reference.iterdir()}
    status, (said,) = take_reference(edited)
    assert status != 0
    assert re.fullmatch(
        r"results/smoke: \d+ files are not finished as configured, such as results/smoke/\S+; "
        r"the reference is left as it was",
        said,
    ), said
    assert {path.name: path.read_bytes() for path in reference.iterdir()} == before

    kept.rename(lost)
    (reference / "gone.csv").write_text("case\n")
    status, said = take_reference(edited)
    assert status == 0, said
    tables = {path.name for path in reference.iterdir()} - {"origin.json"}
    assert tables == before.keys() - {"origin.json"}
    for name in tables:
        assert (reference / name).read_bytes() == (study.results / "tables" / name).read_bytes()

    (reference / "origin.json").unlink()
    status, said = take_reference(edited)
    assert status != 0
    assert said[-1].endswith("holds tables of something else; must be a folder of its own")
    assert {path.name for path in reference.iterdir()} == tables
