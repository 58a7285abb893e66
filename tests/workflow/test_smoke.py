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
