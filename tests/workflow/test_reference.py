"""The smoke study beside its published numbers, and what another reference runs again."""

import csv
import shutil

import pandas as pd
import pytest

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("study")]


def table(study, name):
    with (study.results / "tables" / f"{name}.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def test_published_numbers_come_out_again(study, root, hold_to_reference):
    hold_to_reference(study.results / "tables", root / "results" / "reference" / "smoke")


@pytest.fixture
def edited(study, tmp_path):
    """A copy of the finished study in which one column of the published numbers is another."""
    edited = type(study)(tmp_path / "edited")
    shutil.copytree(study.folder, edited.folder)
    file = edited.folder / "results/reference/smoke/efficiency.csv"
    published = pd.read_csv(file)
    published["efficiency"] *= 1.01
    published.to_csv(file, index=False)
    return edited


def test_another_reference_runs_the_comparison_alone_and_shows(edited, hold_to_reference):
    run = edited.snakemake()
    assert run.returncode == 0, run.stdout
    assert "2 of 2 steps (100%) done" in run.stdout  # the comparison, and the rule of all
    summary = {row["table"]: row for row in table(edited, "reference_summary")}
    rows = int(summary["efficiency"]["rows_compared"])
    assert int(summary["efficiency"]["values_beyond_tolerance"]) >= rows > 10
    found = [row for row in table(edited, "reference_differences") if row["table"] == "efficiency"]
    found = [row for row in found if row["column"] == "efficiency"]
    assert {row["verdict"] for row in found} == {"beyond tolerance"} and len(found) == rows
    for row in found:
        assert float(row["found"]) / float(row["reference"]) == pytest.approx(1 / 1.01, rel=2e-3)
    with pytest.raises(AssertionError):
        hold_to_reference(edited.results / "tables", edited.folder / "results/reference/smoke")
