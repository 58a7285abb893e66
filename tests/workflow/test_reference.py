"""The smoke study beside its published numbers, and what another reference runs again."""

import csv
import shutil

import pytest

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("study")]


def table(study, name):
    with (study.results / "tables" / f"{name}.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def verdicts(study):
    return {row["table"]: row["verdict"] for row in table(study, "reference_summary")}


def test_published_numbers_come_out_again(study, root):
    """Where they should not any more, `make reference` publishes the new ones."""
    published = {path.stem for path in (root / "results/reference/smoke").glob("*.csv")}
    assert verdicts(study) == dict.fromkeys({*published, "settings"}, "agrees")
    assert table(study, "reference_differences") == []
    assert all(int(row["values_compared"]) > 0 for row in table(study, "reference_summary"))


@pytest.fixture
def edited(study, tmp_path):
    """A copy of the finished study in which one published number is another."""
    edited = type(study)(tmp_path / "edited")
    shutil.copytree(study.folder, edited.folder)
    file = edited.folder / "results/reference/smoke/efficiency.csv"
    rows = file.read_text(encoding="utf-8").splitlines()
    cells = rows[1].split(",")
    at = rows[0].split(",").index("efficiency")
    cells[at] = f"{1.01 * float(cells[at]):.10g}"
    file.write_text("\n".join([rows[0], ",".join(cells), *rows[2:]]) + "\n", encoding="utf-8")
    return edited


def test_another_reference_runs_the_comparison_alone_and_shows(edited):
    run = edited.snakemake()
    assert run.returncode == 0, run.stdout
    assert "2 of 2 steps (100%) done" in run.stdout  # the comparison, and the rule of all
    found = verdicts(edited)
    assert {name for name, verdict in found.items() if verdict == "differs"} == {"efficiency"}
    (difference,) = table(edited, "reference_differences")
    assert (difference["table"], difference["column"]) == ("efficiency", "efficiency")
    assert difference["verdict"] == "beyond tolerance"
    assert float(difference["found"]) / float(difference["reference"]) == pytest.approx(1 / 1.01)
