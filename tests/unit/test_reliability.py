"""The list of runs, what is in the way of one, and the reliability figures made of measurements."""

import csv
import os
import subprocess
import sys
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from galloping.reproducibility import obstacles
from galloping.reproducibility.receipts import Receipt, write_receipt
from galloping.reproducibility.runs import note_run, runs
from galloping.storage import write_rows

RESULTS = "results"
FAULT = {
    "fault": "SIGKILL",
    "said": "killed",
    "seconds_to_first_job": 2.0,
    "seconds_to_resume": 30.0,
    "results_lost": 0,
    "results_wrong": 0,
}


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def made(log, *names, seconds=10.0, finished):
    """Receipts of the files of one job."""
    for name in names:
        write_receipt(
            Receipt(
                path=f"{RESULTS}/{name}",
                rule="make",
                wildcards={},
                log=f"{RESULTS}/logs/{log}.log",
                settings={},
                inputs={},
                sha256="",
                size=0,
                seconds=seconds,
                finished=finished.isoformat(timespec="seconds"),
            )
        )


def figures(root):
    """The rows that the script writes, by quantity."""
    script = root / "workflow/scripts/reliability.py"
    subprocess.run([sys.executable, script, "reliability.csv"], check=True, capture_output=True)
    with Path("reliability.csv").open(newline="") as file:
        return {row["quantity"]: row for row in csv.DictReader(file)}


def test_a_run_counts_its_own_jobs_once():
    began = datetime.now(UTC)
    made("old", "old.csv", finished=began - timedelta(seconds=5))
    made("two", "a.csv", "b.csv", finished=began + timedelta(seconds=5))
    made("one", "c.csv", seconds=20.0, finished=began + timedelta(seconds=9))
    note_run(RESULTS, began, 20.0, 2, "finished")
    (run,) = runs(RESULTS)
    assert (run.jobs, run.work_seconds, run.outcome) == (2, 30.0, "finished")
    assert run.overhead == pytest.approx(20.0 * 2 / 30.0)


def test_a_run_that_makes_nothing_is_not_listed():
    began = datetime.now(UTC)
    made("old", "old.csv", finished=began - timedelta(seconds=5))
    note_run(RESULTS, began, 2.0, 2, "finished")
    assert runs(RESULTS) == []


def test_runs_are_listed_one_after_the_other():
    first = datetime.now(UTC)
    for number in range(2):
        began = first + timedelta(seconds=10 * number)
        made(f"job{number}", f"{number}.csv", finished=began)
        note_run(RESULTS, began, 5.0, 1, "finished")
    assert [run.jobs for run in runs(RESULTS)] == [1, 1]


def test_nothing_is_in_the_way_of_a_first_run():
    assert obstacles.obstacle(RESULTS, "make repair") is None


def test_the_lock_of_a_killed_run_is_in_the_way(folder):
    lock = folder / ".snakemake/locks/0.input.lock"
    lock.parent.mkdir(parents=True)
    lock.touch()
    assert obstacles.obstacle(RESULTS, "make repair").endswith("`make repair` takes it from there.")


def test_a_folder_that_cannot_be_written_is_named(folder, monkeypatch):
    (folder / RESULTS).mkdir()
    monkeypatch.setattr(os, "access", lambda path, mode: path != folder / RESULTS)
    assert obstacles.obstacle(RESULTS, "make repair") == (
        f"{folder / RESULTS} is read-only: make it writable and run again."
    )


def test_a_full_disk_is_named(folder, monkeypatch):
    monkeypatch.setattr(obstacles, "FULL", 1 << 62)
    assert obstacles.obstacle(RESULTS, "make repair").startswith(f"The disk of {folder} is full")


def test_what_was_not_measured_says_so(root):
    found = figures(root)
    assert found["faults tried"]["value"] == "not measured"
    assert found["jobs a minute on SLURM"]["value"] == "not measured"
    assert found["snakemake -n"]["value"] == "not measured"


def test_faults_are_counted(root):
    write_rows(
        "results/reliability/faults.csv",
        [
            FAULT,
            {**FAULT, "results_lost": 2, "results_wrong": 1, "seconds_to_resume": 10.0},
            {**FAULT, "said": "not tried: mount is not permitted", "results_wrong": ""},
            {**FAULT, "results_lost": "", "results_wrong": "", "seconds_to_resume": ""},
        ],
    )
    found = figures(root)
    values = {name: found[name]["value"] for name in found}
    assert values["faults tried"] == "3"
    assert values["faults that could not be tried here"] == "1"
    assert values["faults without recovery"] == "1"
    assert (values["results lost"], values["results wrong"]) == ("2", "1")
    assert values["median time to resume, to the whole study"] == "20"


def test_overhead_is_that_of_the_last_run_of_the_whole_study(root):
    began = datetime.now(UTC)
    made("a", "a.csv", finished=began)
    made("b", "b.csv", finished=began)
    note_run(RESULTS, began, 15.0, 2, "finished")
    again = began + timedelta(seconds=60)
    made("b", "b.csv", finished=again)
    note_run(RESULTS, again, 100.0, 2, "finished")
    found = figures(root)
    row = found["wall time of the default study on 2 cores over that of its numerical work"]
    assert (row["value"], row["bar"]) == ("1.5", "<= 1.5")


def test_measured_tables_are_taken_over_with_their_bars(root):
    write_rows(
        "results/reliability/planning.csv",
        [
            {"quantity": "jobs of the default study", "value": 1100, "unit": "1"},
            {"quantity": "snakemake -n of the default study", "value": 2.5, "unit": "s"},
        ],
    )
    found = figures(root)
    assert found["snakemake -n of the default study"]["value"] == "2.5"
    assert found["snakemake -n of the default study"]["bar"] == "<= 5"
