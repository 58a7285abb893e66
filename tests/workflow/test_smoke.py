"""The smoke study through Snakemake: what it writes, that it is as it was when run again, how its
numbers stand beside its reference, what another reference runs again, and Snakemake's own report.
"""

import json
import re
import zipfile
from dataclasses import replace
from pathlib import Path

import pandas as pd
import pytest
from studies import hold_to_reference

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("study")]


def test_study_runs_to_the_end(study):
    assert study.first.returncode == 0, study.first.stdout


def test_every_job_leaves_a_log_and_a_benchmark(study):
    logs, benchmarks = (
        {path.relative_to(study.results / kind).with_suffix("")
         for path in (study.results / kind).rglob(f"*.{end}")}
        for kind, end in (("logs", "log"), ("benchmarks", "tsv"))
    )  # fmt: skip
    assert logs and logs == benchmarks


def test_second_run_has_nothing_to_do(study):
    before = study.files()
    assert "Nothing to be done" in study.ran()
    assert study.files() == before


def test_the_report_of_snakemake_has_every_figure_and_table_with_its_caption(study, tmp_path):
    study.ran("--report", str(tmp_path / "report.zip"))
    with zipfile.ZipFile(tmp_path / "report.zip") as archive:
        page = archive.read("report/report.html").decode()
    found = json.JSONDecoder().raw_decode(
        page, page.index("{", page.index('<script id="results">'))
    )[0]
    captions = {Path(path).name: result["caption"] for path, result in found.items()}
    made = [*study.results.glob("tables/*.csv"), *study.results.glob("figures/*.[sg][vi][gf]")]
    assert len(made) > 40 and {path.name for path in made} | {"report.html"} == captions.keys()
    assert all(len(caption) > 30 for caption in captions.values())
    assert "Lines of the study: <tt" in page


def test_a_caption_that_is_edited_makes_the_page_again_and_nothing_else(study, tmp_path):
    edited = study.copied(tmp_path / "study")
    caption = edited.folder / "workflow/report/figures/figure07.rst"
    caption.write_text("Another caption.\n")
    assert re.search(r"total +2\n", said := edited.ran("--dry-run")), said
    assert "write_report" in said


def test_the_numbers_of_the_reference_come_out_again(study, root):
    hold_to_reference(study.results / "tables", root / "results" / "reference" / "smoke")


@pytest.fixture(scope="module")
def edited(study, tmp_path_factory):
    """A copy of the finished study in which one column of the reference is another, run again."""
    edited = study.copied(tmp_path_factory.mktemp("reference") / "edited")
    file = edited.folder / "results/reference/smoke/efficiency.csv"
    numbers = pd.read_csv(file)
    numbers["min_coefficient_over_bound"] *= 1.01
    numbers.to_csv(file, index=False)
    return replace(edited, first=edited.snakemake())


def test_another_reference_runs_the_comparison_alone_and_shows(edited):
    said = edited.first.stdout
    assert "3 of 3 steps (100%) done" in said, said  # the comparison, the report, the rule of all
    found = edited.table("reference_differences").query("column == 'min_coefficient_over_bound'")
    assert len(found) > 10 and set(found["verdict"]) == {"beyond tolerance"}
    with pytest.raises(AssertionError):
        hold_to_reference(edited.results / "tables", edited.folder / "results/reference/smoke")


def test_only_a_finished_study_becomes_the_reference(edited, study):
    reference = edited.folder / "results/reference/smoke"

    def tables(folder):
        return {name: (folder / name).read_bytes() for name in names - {"origin.json"}}

    names = {path.name for path in reference.iterdir()}
    before = tables(reference)
    lost = edited.results / "bounds/non_resonant/state/noise_0.05.npz"
    kept = lost.rename(lost.with_suffix(".kept"))
    status, (said,) = edited.keep("take_reference")
    assert status != 0 and tables(reference) == before
    assert re.match(r"results/smoke: \d+ files are not finished .*; the reference is left", said)
    kept.rename(lost)
    (reference / "gone.csv").write_text("case\n")
    status, said = edited.keep("take_reference")
    assert status == 0, said
    assert {path.name for path in reference.iterdir()} == names
    assert tables(reference) == tables(study.results / "tables")
    (reference / "origin.json").unlink()
    status, said = edited.keep("take_reference")
    assert status != 0 and "holds tables of something else" in said[-1]
    assert {path.name for path in reference.iterdir()} == names - {"origin.json"}
