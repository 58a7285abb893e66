"""The smoke study through Snakemake: what it writes, and that it is as it was when run again."""

import pytest

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
