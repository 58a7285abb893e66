"""What the commands of the Makefile refuse and show before they do it."""

import argparse
import shutil
import subprocess
from dataclasses import asdict
from pathlib import Path

import pytest
import run_study
from studies import Study, run, script

from galloping.configuration.load import load, plain
from galloping.reproducibility import plan
from galloping.reproducibility.lock import end_in_one_line
from galloping.reproducibility.receipts import Receipt, receipt_path, remember, write_receipt
from galloping.reproducibility.receipts import inspect as find_deviations
from galloping.storage import write_json, write_text

ROOT = Path(__file__).parents[2]


def make_report(settings):
    """The receipt of the report of a study, by its path."""
    path = f"{settings.results}/report.html"
    made = Receipt(path, "write_report", {}, f"{settings.results}/logs/report.log",
                   {"study": {"study": plain(settings)}}, {}, "0" * 64, 2, 1.0)  # fmt: skip
    write_receipt(made)
    return {path: made}


def test_a_run_with_earlier_settings_is_announced(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(run_study, "WORKFLOW", tmp_path / "workflow")  # nothing newer than
    monkeypatch.setattr(run_study.sysconfig, "get_path", lambda _: tmp_path / "site")
    for path in ("config/config.yaml", "site/a"):
        write_text(tmp_path / path, "")
    earlier, now = load({"measurement": {"replicates": 5}}), load({})
    made = make_report(earlier)
    monkeypatch.setattr(plan, "make_plan", lambda _: plan.Plan(plain(now), ()))
    monkeypatch.setattr(plan, "describe_run", lambda *_: ["announced"])
    options = argparse.Namespace(cores="1", workflow_profile=None)
    assert list(run_study.announce(now, [], made, options)) == ["announced"]
    assert list(run_study.announce(earlier, [], made, options)) == []


def test_files_that_are_gone_with_their_receipts_are_asked_for_if_planned(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    paths = [f"results/models/{name}.json" for name in "ab"]
    for path in paths:
        write_text(path, "1\n")
        write_receipt(Receipt(path, "make", {}, "results/logs/a", {}, {}, "0" * 64, 2, 1.0))
    remember("results", find_deviations("results", run_study.read_receipts("results")))
    shutil.rmtree("results/models")
    job = plan.PlannedJob("make", {}, (), (paths[0],))
    monkeypatch.setattr(plan, "make_plan", lambda _: plan.Plan({"results": "results"}, (job,)))
    monkeypatch.setattr(plan, "find_recorded", lambda _: set())
    assert run_study.check("results", [], "repair") == ["all", paths[0]]
    assert find_deviations("results", {}).missing == (paths[0],)


def test_statements_are_counted_only_where_the_paper_is_in_the_study(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    paper = Path("results/tables/paper.csv")
    paper.parent.mkdir(parents=True)
    shutil.copy(ROOT / "results/reference/paper.csv", paper)
    told = []
    for settings in ({}, {"cases": {"mine": {}}}):
        run_study.print_summary(load(settings), 0, 1.0)
        told.append(capsys.readouterr().out.splitlines())
    assert len(told[0]) == 2 and told[1] == told[0][:1]


@pytest.mark.parametrize(
    ("error", "line"),
    [
        (KeyboardInterrupt(), "Interrupted: run it again to go on."),
        (FileNotFoundError(2, "No such file or directory", "a.zip"),
         "a.zip: No such file or directory"),
        (OSError("disk"), "disk"),
    ],
)  # fmt: skip
def test_errors_and_interrupts_are_one_line(error, line):
    with pytest.raises(SystemExit) as end, end_in_one_line():
        raise error
    assert end.value.code == line


def test_an_archive_that_is_not_there_is_not_called_forged(root):
    status, said = script(root, "keep_results", "verify_archive", "none.zip")
    assert (status, said) == (1, ["none.zip: No such file or directory"])


@pytest.mark.parametrize("goal", ["smoke", "trust", "reality", "published", "paper", "exam"])
def test_settings_of_a_command_are_merged_over_its_own(root, goal):
    done = subprocess.run(
        ["make", "-n", goal, "CONFIG=mine.yaml"], cwd=root, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert f"--configfile config/{goal}.yaml mine.yaml" in done.stdout


def test_the_command_of_a_copied_clone_runs_its_own_library(root, tmp_path):
    place = tmp_path / "a clone" / ".venv" / "bin"
    place.mkdir(parents=True)
    write_text(place / "python", '#!/bin/sh\necho "$0" "$PYTHONPATH" "$@"\n')
    shutil.copy(root / "workflow/scripts/galloping.sh", place / "galloping")
    for command in place.iterdir():
        command.chmod(0o755)
    (tmp_path / "link").symlink_to("a clone/.venv/bin/galloping")
    clone = place.parents[1]
    for command in (place / "galloping", tmp_path / "link"):
        said = subprocess.check_output([command, "identify", "b c"], cwd=tmp_path, text=True)
        assert said == f"{place}/python {clone}/workflow/src -m galloping identify b c\n"
    said = subprocess.check_output([".venv/bin/galloping"], cwd=clone, text=True)
    assert said == f"{place}/python {clone}/workflow/src -m galloping\n"


def test_help_starts_no_run(root):
    status, said = script(root, "run_study", "--help")
    assert status == 0 and said[0].startswith("usage: run_study.py [-h] [--repair] [--only FILE")


@pytest.mark.parametrize("cores", ["0", "1.5"])
def test_a_number_of_cores_that_is_none_is_one_line(root, cores):
    assert script(root, "run_study", "--cores", cores) == (
        1,
        [f"CORES: {cores!r} is not a number of cores; must be all or a whole number >= 1"],
    )


@pytest.mark.slow
def test_pruning_shows_what_it_would_remove(fresh, tmp_path):
    study = Study(tmp_path / "study")
    shutil.copytree(fresh.folder, study.folder, ignore=shutil.ignore_patterns(".snakemake"))
    path, log = (f"results/smoke/{name}" for name in ("scores/old.csv", "logs/old.log"))
    write_text(study.folder / path, "1\n")
    write_text(study.folder / log, "")
    made = Receipt(path, "evaluate_cell", {}, log, {}, {}, "0" * 64, size=2, seconds=1.0)
    write_json(study.folder / receipt_path(path), asdict(made))
    told = "results/smoke: 1 left over files, 0.0 MB, to be removed by DELETE=yes"
    assert study.keep("prune") == (0, [path, told]) and (study.folder / path).exists()
    status, (removed, *_) = study.keep("prune", "--delete")
    assert status == 0 and not (study.folder / path).exists()
    assert removed.split() == [path, str(receipt_path(path)), log]
    status, (said,) = study.keep("prune")
    assert status == 0 and "nothing is left over" in said


@pytest.mark.parametrize(
    ("content", "line"),
    [
        (None, "config/config.yaml: No such file or directory"),
        ("measurement: {replicates: many}\n", "measurement.replicates: 'many' is text"),
    ],
    ids=["missing", "wrong"],
)
def test_plain_snakemake_says_of_a_bad_configuration_what_make_says(root, tmp_path, content, line):
    (tmp_path / "workflow").symlink_to(root / "workflow")
    (tmp_path / "config").mkdir()
    if content is not None:
        (tmp_path / "config" / "config.yaml").write_text(content, encoding="utf-8")
    status, made = script(tmp_path, "run_study")
    assert status == 1 and made[0].startswith(line)
    plain = run(tmp_path, "-m", "snakemake", "-n", "--workflow-profile", "none")
    assert plain.returncode != 0 and plain.stdout.splitlines() == made, plain.stdout
    assert {path.name for path in tmp_path.iterdir()} <= {"workflow", "config", ".snakemake"}
