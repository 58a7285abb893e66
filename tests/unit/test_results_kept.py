"""Receipts, what is made of them at the start of a run, and recovery, without Snakemake."""

import json
import os
import subprocess
import sys
from base64 import urlsafe_b64encode
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import psutil
import pytest

from galloping.reproducibility import audit, inspection, job, processes, recovery
from galloping.reproducibility.failures import closing_line
from galloping.reproducibility.plan import PlannedJob
from galloping.reproducibility.receipts import (
    digest,
    read_receipt,
    receipt_path,
    receipts,
    write_receipt,
)

RESULTS = "results/mine"
SETTINGS = {"speed": 12.0, "code": "abc"}


class Wildcards(dict):
    """As in a script: items by name."""


def script(path, inputs=(), settings=SETTINGS):
    """The `snakemake` object of a job that writes one file."""
    return SimpleNamespace(
        input=[f"{RESULTS}/{name}" for name in inputs],
        output=[f"{RESULTS}/{path}"],
        log=[f"{RESULTS}/logs/{path}.log"],
        params=SimpleNamespace(settings=settings),
        wildcards=Wildcards(case="a"),
        rule="make",
    )


def record(path, kind="metadata"):
    """Where Snakemake keeps what it knows of a file."""
    return Path(".snakemake", kind, urlsafe_b64encode(str(path).encode()).decode())


def make(path, content="1\n", inputs=(), settings=SETTINGS):
    """Run a job that writes `content`, as Snakemake does; the path from the working folder."""
    described = script(path, inputs, settings)
    target = Path(described.output[0])
    target.parent.mkdir(parents=True, exist_ok=True)
    job.run(lambda: target.write_text(content), described)
    record(target).touch()
    return str(target)


def planned(path, inputs=(), settings=SETTINGS):
    return PlannedJob(
        rule="make",
        wildcards={"case": "a"},
        settings=settings,
        inputs=tuple(f"{RESULTS}/{name}" for name in inputs),
        outputs=(f"{RESULTS}/{path}",),
        log=f"{RESULTS}/logs/{path}.log",
        benchmark=f"{RESULTS}/benchmarks/{path}.tsv",
    )


class FakePlan:
    """A plan that remembers what is recorded."""

    def __init__(self, *jobs):
        self.settings = {"results": RESULTS}
        self.jobs = jobs
        self.recorded = []

    def record(self, jobs):
        self.recorded += [path for one in jobs for path in one.outputs]


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """A working folder in which Snakemake has run."""
    monkeypatch.chdir(tmp_path)
    for kind in ("metadata", "incomplete"):
        (tmp_path / ".snakemake" / kind).mkdir(parents=True)
    return tmp_path


def lost():
    return inspection.lost(RESULTS, "make repair", written)


def written(path):
    """Whether a job writes it."""
    return path.startswith((f"{RESULTS}/models/", f"{RESULTS}/tables/")) and "notes" not in path


# receipts


def test_a_job_says_what_it_made_from_what():
    model = make("models/a.json")
    table = make("tables/t.csv", "x\n", inputs=["models/a.json"])
    receipt = read_receipt(table)
    assert receipt.inputs == {model: digest(model)}
    assert (receipt.sha256, receipt.size) == (digest(table), 2)
    assert (receipt.settings, receipt.rule, receipt.wildcards) == (SETTINGS, "make", {"case": "a"})
    assert [one.path for one in receipts(RESULTS)] == [model, table]


def test_results_inside_results_are_not_theirs():
    make("models/a.json")
    assert list(receipts("results")) == []


def test_a_failed_job_leaves_no_receipt_and_says_why_in_a_line(capsys):
    def work():
        raise ValueError("too much wind")

    described = script("models/a.json")
    with pytest.raises(SystemExit) as end:
        job.run(work, described)
    assert str(end.value).startswith("ValueError: too much wind (details: ")
    assert "\n" not in str(end.value)
    assert read_receipt(described.output[0]) is None
    log = Path(described.log[0]).read_text()
    assert "Traceback" in log and log.endswith("ValueError: too much wind\n")


def test_a_full_disk_is_called_by_its_name():
    def work():
        raise OSError(28, "No space left on device", "x.npz")

    with pytest.raises(SystemExit, match=r"The disk is full: x\.npz; free some space"):
        job.run(work, script("models/a.json"))


def test_a_job_refuses_an_input_that_is_not_what_its_job_wrote():
    model = make("models/a.json")
    Path(model).write_text("2\n")
    with pytest.raises(SystemExit, match=r"models/a\.json is not what its job wrote"):
        make("tables/t.csv", inputs=["models/a.json"])
    assert not Path(f"{RESULTS}/tables/t.csv").exists()


@pytest.mark.parametrize("text", ["", "{", '{"path": 1}', "[1]"])
def test_an_unreadable_receipt_is_none(text):
    model = make("models/a.json")
    receipt_path(model).write_text(text)
    assert read_receipt(model) is None


# the start of a run


def test_sound_results_have_nothing_to_say():
    make("models/a.json")
    assert lost() == []
    assert lost() == []


def test_lost_files_are_named():
    model = make("models/a.json")
    make("tables/t.csv")
    Path(model).unlink()
    assert lost() == [model]


def same_size_and_times(path):
    status = path.stat()
    path.write_text("2\n")
    os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns))


@pytest.mark.parametrize(
    "harm",
    [
        lambda path: path.write_text("22\n"),
        lambda path: os.truncate(path, 1),
        same_size_and_times,
    ],
    ids=["edited", "truncated", "size and times kept"],
)
@pytest.mark.parametrize("seen", [True, False], ids=["seen before", "first seen"])
def test_damage_ends_the_run_in_a_line(harm, seen):
    model = Path(make("models/a.json"))
    if seen:
        assert lost() == []
    harm(model)
    with pytest.raises(inspection.DamagedResults, match=r"models/a\.json: .*`make repair`") as end:
        lost()
    assert "\n" not in str(end.value)


def test_a_file_that_nothing_tells_of_ends_the_run_in_a_line():
    make("models/a.json")
    mine = Path(RESULTS, "models/notes.txt")
    mine.touch()
    assert lost() == []
    made = make("models/b.json")
    receipt_path(made).unlink()
    with pytest.raises(inspection.DamagedResults, match=r"b\.json: no receipt .*`make repair`"):
        lost()
    record(made, "incomplete").touch()  # Snakemake makes it again by itself
    assert lost() == []


def test_only_what_changed_is_read_again(monkeypatch):
    make("models/a.json")
    model = make("models/b.json")
    lost()
    read = []
    monkeypatch.setattr(inspection, "digest", lambda path: read.append(path) or digest(path))
    assert lost() == [] and read == []
    Path(model).touch()
    assert lost() == [] and read == [model]
    inspection.inspect(receipts(RESULTS), thorough=True)
    assert len(read) == 3


def test_a_folder_that_cannot_be_written_costs_only_time(monkeypatch):
    def refuse(*args):
        raise OSError(30, "Read-only file system")

    make("models/a.json")
    monkeypatch.setattr(inspection, "write_json", refuse)
    assert lost() == []


def test_a_lost_record_ends_the_run():
    make("models/a.json")
    model = make("models/b.json")
    record(model).unlink()
    with pytest.raises(inspection.DamagedResults, match=r"records of 1 files .* are gone"):
        lost()
    record(model, "incomplete").touch()  # Snakemake makes it again by itself
    assert lost() == []


def test_records_of_long_names_are_found():
    model = make("models/a.json")
    name = record(model).name
    record(model).unlink()
    folder = Path(".snakemake/metadata", f"@{name[:4]}")
    folder.mkdir()
    (folder / name[4:]).touch()
    assert lost() == []


def test_nothing_is_compared_while_a_run_holds_the_lock(folder):
    Path(make("models/a.json")).unlink()
    (folder / ".snakemake/locks").mkdir()
    (folder / ".snakemake/locks/0.input.lock").touch()
    assert lost() == []


# recovery


def test_damaged_files_are_set_aside_and_none_is_overwritten():
    table = Path(make("tables/t.csv"))
    for edit in ("first\n", "second\n"):
        table.write_text(edit)
        (line,) = recovery.set_aside_damaged(RESULTS)
        assert str(table) in line
        assert lost() == [str(table)]
        make("tables/t.csv")
    kept = sorted(Path(RESULTS, "set_aside/tables").iterdir())
    assert [path.read_text() for path in kept] == ["first\n", "second\n"]
    assert list(recovery.set_aside_damaged(RESULTS)) == []


def test_a_file_whose_receipt_cannot_be_read_is_set_aside_and_asked_for_again():
    model, table = make("models/a.json"), make("tables/t.csv", inputs=["models/a.json"])
    receipt_path(table).write_text("{")
    plan = FakePlan(planned("models/a.json"), planned("tables/t.csv", ["models/a.json"]))
    (line,) = recovery.set_aside_unknown(plan)
    assert table in line and lost() == [table]
    assert Path(model).exists() and Path(RESULTS, "set_aside/tables/t.csv").exists()
    assert list(recovery.set_aside_unknown(plan)) == []


def test_unfinished_files_are_swept_and_receipts_stay():
    model = make("models/a.json")
    left = Path(RESULTS, "models/.partial-123-b.json")
    left.touch()
    assert len(list(recovery.sweep(RESULTS))) == 1
    assert not left.exists() and receipt_path(model).exists()


def test_only_what_is_made_as_planned_is_adopted():
    model = make("models/a.json")
    table = make("tables/t.csv", inputs=["models/a.json"])
    other = make("tables/u.csv", settings={"speed": 13.0})
    unknown = make("tables/v.csv")
    receipt_path(unknown).unlink()
    old = make("tables/w.csv")
    plan = FakePlan(
        planned("models/a.json"),
        planned("tables/t.csv", ["models/a.json"]),
        planned("tables/u.csv"),
        planned("tables/v.csv"),
    )
    kept, aside = recovery.adopt(plan)
    assert plan.recorded == [model, table]
    assert kept.startswith("2 files") and aside.startswith("3 files")
    assert not any(Path(path).exists() for path in (other, unknown, old))
    assert {one.path for one in receipts(RESULTS)} == {model, table, other}


def test_a_file_made_from_another_input_is_not_adopted():
    make("models/a.json")
    make("tables/t.csv", inputs=["models/a.json"])
    model = make("models/a.json", "2\n")
    plan = FakePlan(planned("models/a.json"), planned("tables/t.csv", ["models/a.json"]))
    list(recovery.adopt(plan))
    assert plan.recorded == [model]


def test_a_file_made_from_another_source_is_neither_adopted_nor_sound(folder):
    (folder / RESULTS).mkdir(parents=True)
    source = folder / RESULTS / "published.csv"
    source.write_text("1\n")
    table = make("tables/t.csv", inputs=["published.csv"])
    plan = FakePlan(planned("tables/t.csv", ["published.csv"]))
    assert audit.audit(plan).sound == (table,)
    source.write_text("2\n")
    assert audit.audit(plan).inconsistent == (table,)
    list(recovery.adopt(plan))
    assert plan.recorded == []


def test_nothing_made_from_what_is_not_as_planned_is_adopted():
    make("models/a.json", settings={"speed": 13.0})
    make("scores/s.csv", inputs=["models/a.json"])
    make("tables/t.csv", inputs=["scores/s.csv"])
    alone = make("tables/u.csv")
    plan = FakePlan(
        planned("tables/t.csv", ["scores/s.csv"]),
        planned("scores/s.csv", ["models/a.json"]),
        planned("models/a.json"),
        planned("tables/u.csv"),
    )
    list(recovery.adopt(plan))
    assert plan.recorded == [alone]


def test_a_table_of_other_cells_is_not_adopted():
    model = make("models/a.json")
    other = make("models/b.json")
    make("tables/t.csv", inputs=["models/a.json", "models/b.json"])
    models = (planned("models/a.json"), planned("models/b.json"))
    plan = FakePlan(*models, planned("tables/t.csv", ["models/a.json"]))
    list(recovery.adopt(plan))
    assert plan.recorded == [model, other]


def leave_elsewhere(path):
    """What restoring does with a file that the archive does not hold."""
    write_receipt(replace(read_receipt(path), kept=False))
    Path(path).unlink()


def test_a_file_left_elsewhere_is_neither_lost_nor_damaged_and_stands_for_its_job():
    model = make("models/a.json")
    table = make("tables/t.csv", inputs=["models/a.json"])
    leave_elsewhere(model)
    assert lost() == []
    plan = FakePlan(planned("models/a.json"), planned("tables/t.csv", ["models/a.json"]))
    (kept,) = recovery.adopt(plan)
    assert plan.recorded == [model, table] and kept.startswith("1 files")
    found = audit.audit(plan)
    assert (found.elsewhere, found.sound) == ((model,), (table,))


def test_a_file_left_elsewhere_with_other_settings_stands_for_nothing():
    model = make("models/a.json", settings={"speed": 13.0})
    make("tables/t.csv", inputs=["models/a.json"])
    leave_elsewhere(model)
    plan = FakePlan(planned("models/a.json"), planned("tables/t.csv", ["models/a.json"]))
    assert audit.audit(plan).outdated == (model,)
    list(recovery.adopt(plan))
    assert plan.recorded == []
    assert lost() == [f"{RESULTS}/tables/t.csv"]


SLEEPER = "import time; print('up', flush=True); time.sleep(60)"


@pytest.fixture
def sleeper(folder):
    """Start a process with the given file as its script; ended after the test."""
    started = []

    def start(script):
        script.parent.mkdir(parents=True, exist_ok=True)
        script.write_text(SLEEPER)
        process = subprocess.Popen([sys.executable, script], stdout=subprocess.PIPE, text=True)
        started.append(process)
        assert process.stdout.readline() == "up\n"
        return process

    yield start
    for process in started:
        process.kill()
        process.wait()


def test_orphans_are_ended_and_the_lock_goes(folder, sleeper):
    orphan = sleeper(folder / ".snakemake/scripts/tmp1.make.py")
    (folder / ".snakemake/locks").mkdir()
    (folder / ".snakemake/locks/0.input.lock").touch()
    said = list(recovery.release(folder))
    assert [line.split()[0] for line in said] == ["ended", "removed"]
    assert not psutil.pid_exists(orphan.pid)
    assert not inspection.locked()
    assert list(recovery.release(folder)) == []


def test_a_live_run_is_left_alone(folder, sleeper):
    live = sleeper(folder / "bin/snakemake")
    with pytest.raises(recovery.StillRunning, match=f"process {live.pid} is running"):
        list(recovery.release(folder))
    assert live.poll() is None


def test_jobs_of_other_folders_are_left_alone(folder, sleeper, tmp_path_factory):
    sleeper(folder / ".snakemake/scripts/tmp1.make.py")
    assert processes.orphans(tmp_path_factory.mktemp("other")) == []


def test_stubborn_processes_are_ended_by_force(folder):
    code = "import signal, time; signal.signal(signal.SIGTERM, signal.SIG_IGN); print(flush=True)"
    process = subprocess.Popen(
        [sys.executable, "-c", f"{code}; time.sleep(60)"], stdout=subprocess.PIPE
    )
    process.stdout.readline()
    processes.end([psutil.Process(process.pid)], patience=0.2)
    assert not psutil.pid_exists(process.pid)


# audit


def test_each_file_has_one_state():
    make("models/a.json")
    make("tables/sound.csv", inputs=["models/a.json"])
    make("tables/inconsistent.csv", inputs=["models/a.json"])
    receipt = receipt_path(f"{RESULTS}/tables/inconsistent.csv")
    text = json.loads(receipt.read_text())
    text["inputs"][f"{RESULTS}/models/a.json"] = "0" * 64
    receipt.write_text(json.dumps(text))
    Path(make("tables/damaged.csv")).write_text("2\n")
    Path(make("tables/lost.csv")).unlink()
    make("tables/outdated.csv", settings={"speed": 13.0})
    receipt_path(make("tables/unknown.csv")).unlink()
    left = make("tables/left_over.csv")
    names = ("sound", "damaged", "lost", "outdated", "inconsistent", "unknown", "absent")
    inputs = {"sound": ["models/a.json"], "inconsistent": ["models/a.json"]}
    tables = (planned(f"tables/{name}.csv", inputs.get(name, ())) for name in names)
    found = audit.audit(FakePlan(planned("models/a.json"), *tables))
    assert found.sound == (f"{RESULTS}/models/a.json", f"{RESULTS}/tables/sound.csv")
    for name in names[1:]:
        assert getattr(found, name) == (f"{RESULTS}/tables/{name}.csv",)
    assert [one.path for one in found.left_over] == [left]


def test_pruning_takes_receipt_log_and_benchmark_along():
    kept = make("models/a.json")
    make("tables/old.csv")
    Path(RESULTS, "benchmarks/tables").mkdir(parents=True)
    Path(RESULTS, "benchmarks/tables/old.csv.tsv").touch()
    mine = Path(RESULTS, "models/notes.txt")
    mine.touch()
    (left,) = audit.audit(FakePlan(planned("models/a.json"))).left_over
    assert len(audit.remove(left)) == 4
    files = {str(path) for path in Path(RESULTS).rglob("*") if path.is_file()}
    log = f"{RESULTS}/logs/models/a.json.log"
    assert files == {kept, str(receipt_path(kept)), str(mine), log}
    assert not Path(RESULTS, "tables").exists()


def test_receipts_say_when_a_job_is_the_planned_one():
    receipt = read_receipt(make("models/a.json"))
    job = planned("models/a.json")
    assert job.made(receipt)
    assert not job.made(None)
    assert not job.made(replace(receipt, rule="other"))
    assert not job.made(replace(receipt, settings={**SETTINGS, "code": "def"}))


# the closing line


def test_the_closing_line_gives_the_last_word_of_failed_jobs(folder):
    log = folder / "results/logs/draw.log"
    log.parent.mkdir(parents=True)
    log.write_text("Traceback\n  ...\nValueError: no wind\n\n")
    run = folder / "run.log"
    run.write_text(f"Error in rule draw:\n    log: {log} (check log file(s) for error details)\n")
    line = closing_line([run])
    assert f"ValueError: no wind ({log})" in line and "\n" not in line


def test_the_closing_line_names_the_signal_that_ended_a_job(folder):
    log = folder / "results/logs/draw.log"
    log.parent.mkdir(parents=True)
    log.write_text("a warning of an earlier run\n")
    run = folder / "run.log"
    run.write_text(
        "Command 'python tmp1.draw.py' died with <Signals.SIGKILL: 9>.\n[Sat Nov 21 2026]\n"
        "Error in rule draw:\n    message: None\n    jobid: 1\n"
        f"    log: {log} (check log file(s) for error details)\n"
        "Error in rule draw:\n    message: None\n"
        f"    log: {folder}/b.log, {folder}/cluster.log (check log file(s) for error details)\n"
    )
    line = closing_line([run])
    assert f"killed by SIGKILL ({log})" in line and f"{folder}/b.log" in line
    assert "earlier" not in line


def test_the_closing_line_finds_the_job_that_failed_in_a_group_on_a_cluster(folder):
    draw, simulate, group = (folder / name for name in ("draw.log", "simulate.log", "1.log"))
    draw.write_text("ValueError: no wind\n")
    simulate.write_text("all went well\n")
    group.write_text(
        "srun: error: n1: task 0: Exited with exit code 1\n[Sat Nov 21 2026]\nError in rule draw:\n"
        f"    message: None\n    log: {draw} (check log file(s) for error details)\n"
    )
    run = folder / "run.log"
    said = (
        f"    message: Error in group show\n    log: {group} (check log file(s) for details)\n"
        f"    jobs:\n        rule simulate:\n            log: {simulate} (check log file(s))\n"
        "    Error in rule simulate:\n        message: None\n"
        f"        log: {simulate} (check log file(s) for error details)\n"
    )
    run.write_text(said)
    line = closing_line([run])
    assert f"ValueError: no wind ({draw})" in line and "well" not in line

    group.write_text("slurmstepd: error: *** JOB 1 ON n1 CANCELLED DUE TO TIME LIMIT ***\n")
    assert f"DUE TO TIME LIMIT *** ({group})" in closing_line([run])


def test_the_closing_line_of_an_interrupted_run_has_no_cause(folder):
    assert "interrupted" in closing_line([folder / "none.log"])
