"""Receipts, what is made and said of them before a run, audit and repair; without Snakemake."""

import os
import shutil
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import Mock

import pytest
from snakemake.iocontainers import InputFiles, OutputFiles, Params

from galloping.configuration.load import plain
from galloping.configuration.settings import Settings
from galloping.reproducibility import job, lock, repair
from galloping.reproducibility import receipts as kept
from galloping.reproducibility.plan import Plan, PlannedJob, describe_run, duration_in_words
from galloping.reproducibility.receipts import (
    RECEIPTS,
    digest,
    read_receipt,
    read_receipts,
    receipt_path,
)
from galloping.reproducibility.repair import audit

RESULTS = "results/mine"
SETTINGS = {"speed": {"wind.speed": 12.0}, "code": {"digest": "abc"}}
OTHER = {"speed": {"wind.speed": 13.0}, "code": {"digest": "abc"}}


def make(path, content="1\n", inputs=(), settings=SETTINGS, work=None, place=""):
    """Run a job that writes `content`, or works otherwise; the path from the working folder.

    place: prefix of its paths, of local copies of results in a storage.
    """
    results = f"{place}{RESULTS}"
    target = Path(results, path)
    described = SimpleNamespace(
        input=InputFiles([f"{results}/{name}" for name in inputs]),
        output=OutputFiles(fromdict={"made": str(target), RECEIPTS: str(receipt_path(target))}),
        log=[f"{results}/logs/{path}.log"],
        params=Params(fromdict=settings),
        config={"results": RESULTS},
        wildcards={"case": "a", "cell": "b"},
        rule="make",
    )
    target.parent.mkdir(parents=True, exist_ok=True)
    job.run(work or (lambda made, case, **_: Path(made).write_text(content)), described)
    return str(target)


def plan(*paths, settings=SETTINGS, **inputs):
    """The plan of jobs that write `paths`, each from its inputs by the stem of its name."""
    jobs = []
    for path in paths:
        given = tuple(f"{RESULTS}/{name}" for name in inputs.get(Path(path).stem, ()))
        jobs.append(PlannedJob("make", settings, given, (f"{RESULTS}/{path}",)))
    return Plan({"results": RESULTS}, tuple(jobs))


def current_files(study):
    return sorted(repair.find_current(study, read_receipts(RESULTS)))


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def adopted(monkeypatch):
    """What a repair says of a plan, and how often Snakemake was told to take what is there."""
    told = []
    monkeypatch.setattr(repair, "record", told.append)
    return lambda study: (list(repair.adopt(study)), len(told))


def look():
    return kept.inspect(RESULTS, read_receipts(RESULTS))


def test_a_job_says_what_it_made_from_what():
    model = make("models/a.json")
    table = make("tables/t.csv", "x\n", inputs=["models/a.json"])
    receipt = read_receipt(table)
    assert receipt.inputs == {model: digest(model)}
    assert (receipt.sha256, receipt.size) == (digest(table), 2)
    assert (receipt.settings, receipt.rule) == (SETTINGS, "make")
    assert receipt.wildcards == {"case": "a", "cell": "b"}
    assert list(read_receipts(RESULTS)) == [model, table]
    assert read_receipts("results") == {}  # of results inside results


def test_receipts_of_results_in_a_storage_are_those_of_results_in_place(folder):
    place = ".snakemake/storage/fs/store/"
    for prefix in ("", place):
        make("models/a.json", place=prefix)
        make("tables/t.csv", "x\n", inputs=["models/a.json"], place=prefix)
    here, there = (read_receipt(f"{prefix}{RESULTS}/tables/t.csv") for prefix in ("", place))
    same = {"seconds": 0.0, "finished": ""}
    assert replace(there, **same) == replace(here, **same)


def test_the_folder_of_results_is_that_of_a_configuration_that_names_none():
    assert plain(Settings())["results"] == job.RESULTS


def test_failures_are_told_in_a_line_with_the_log(folder):
    (folder / "clock").touch()
    since = (folder / "clock").stat().st_mtime_ns
    logs = Path(f"{RESULTS}/logs/models")
    with pytest.raises(SystemExit) as end:
        make("models/a.json", work=Mock(side_effect=ValueError("too much wind")))
    assert str(end.value) == f"ValueError: too much wind (details: {logs}/a.json.log)"
    assert "Traceback" in (logs / "a.json.log").read_text()
    model = Path(make("models/b.json"))
    killed = logs / "c.json.log"
    killed.write_text("a warning\n")
    assert job.failures(RESULTS, since) == [
        f"ValueError: too much wind ({logs}/a.json.log)",
        f"a job was killed ({killed})",
    ]
    os.utime(killed, (0, 0))  # of an earlier run
    assert len(job.failures(RESULTS, since)) == 1
    full = OSError(28, "No space left on device", "x.npz")
    with pytest.raises(SystemExit, match=r"x\.npz"):
        make("models/d.json", work=Mock(side_effect=full))
    model.write_text("2\n")
    with pytest.raises(SystemExit, match=r"models/b\.json"):
        make("tables/t.csv", inputs=["models/b.json"])
    assert (
        list(read_receipts(RESULTS)) == [str(model)] and not Path(RESULTS, "tables/t.csv").exists()
    )


def same_size_and_times(path):
    status = path.stat()
    path.write_text("2\n")
    os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns))


def replace_by_folder(path):
    path.unlink()
    path.mkdir()


@pytest.mark.parametrize(
    "harm", [lambda p: os.truncate(p, 1), same_size_and_times, replace_by_folder]
)
def test_what_is_not_as_its_receipt_says_is_named(harm):
    model, table, lost = make("models/a.json"), make("tables/t.csv"), make("tables/u.csv")
    kept.remember(RESULTS, look())
    harm(Path(model))
    Path(lost).unlink()
    receipt_path(table).unlink()
    findings = look()
    assert (findings.damaged, findings.missing) == ((model,), (lost,))
    assert (findings.unrecorded, findings.unseen) == ((table,), ())
    kept.DIGEST_FILE.unlink()
    findings = look()
    assert (findings.damaged, findings.unrecorded, findings.unseen) == ((model,), (), (model,))


def test_what_is_deleted_with_its_receipt_is_missed_until_it_is_made():
    model, table = make("models/a.json"), make("tables/t.csv")
    kept.remember(RESULTS, look())
    for path in (model, table):
        shutil.rmtree(Path(path).parent)
    for _ in range(2):  # as long as no run makes it
        assert sorted(look().missing) == [model, table]
        kept.remember(RESULTS, look())
    make("models/a.json")
    assert look().missing == (table,)
    kept.remember(RESULTS, replace(look(), missing=()))  # no job makes it any more
    assert look().missing == ()


def test_a_copy_of_results_among_results_is_none_of_them():
    table = make("tables/t.csv")
    shutil.copytree(Path(table).parent, Path(RESULTS, "tables_before"))
    make("tables/t.csv", "2\n")
    assert list(read_receipts(RESULTS)) == [table] and look().damaged == ()


def test_after_a_kill_only_a_repair_may_lock_a_study():
    with pytest.raises(lock.Killed), lock.locked(RESULTS, "mend"):
        raise lock.Killed
    with pytest.raises(lock.Obstacle, match="`mend`"), lock.locked(RESULTS, "mend"):
        pass
    with lock.locked(RESULTS, "mend", repairing=True):
        pass
    with lock.locked(RESULTS, "mend"):
        pass


def test_files_are_set_aside_over_no_other():
    table = Path(make("tables/t.csv"))
    for text in ("first\n", "second\n"):
        table.write_text(text)
        repair.set_aside(RESULTS, str(table))
    kept = sorted(Path(RESULTS, "set_aside/tables").iterdir())
    assert [path.read_text() for path in kept] == ["first\n", "second\n"]
    left = Path(RESULTS, "models/.partial-123-b.json")
    left.parent.mkdir()
    left.touch()
    assert len(list(lock.clear_unfinished(RESULTS))) == 1 and not left.exists()


def test_each_file_has_one_state_and_what_is_made_as_planned_is_adopted(adopted):
    model = make("models/a.json")
    sound = make("tables/sound.csv", inputs=["models/a.json"])
    make("tables/outdated.csv", settings=OTHER)
    old = make("tables/old.csv")
    receipt_path(make("tables/unknown.csv")).unlink()
    Path(make("tables/missing.csv")).unlink()
    Path(make("tables/damaged.csv")).write_text("2\n")
    names = ("sound", "damaged", "missing", "outdated", "unknown")
    tables = [f"tables/{name}.csv" for name in names]
    checked = audit(plan(*tables, sound=["models/a.json"]))
    states = {name: getattr(checked, name) for name in names}
    assert states == {name: (f"{RESULTS}/tables/{name}.csv",) for name in names}
    assert [receipt.path for receipt in checked.left_over] == [model, old]
    Path(*checked.damaged).unlink()  # as is done first
    (adopting, aside), times = adopted(plan("models/a.json", *tables, sound=["models/a.json"]))
    assert adopting.startswith("2 files") and aside.startswith("3 files") and times == 1
    all_of_them = (model, old, *(path for (path,) in states.values()))
    assert [path for path in all_of_them if Path(path).exists()] == [model, sound]
    assert old not in read_receipts(RESULTS)


def test_nothing_made_from_another_input_is_as_planned(folder):
    source = folder / RESULTS / "published.csv"
    source.parent.mkdir(parents=True)
    source.write_text("1\n")
    model = make("models/a.json", inputs=["published.csv"])
    score = make("scores/s.csv", inputs=["models/a.json"])
    table, alone = make("tables/t.csv", inputs=["scores/s.csv"]), make("tables/u.csv")
    names = ("tables/t.csv", "scores/s.csv", "models/a.json", "tables/u.csv")
    given = {"t": ["scores/s.csv"], "s": ["models/a.json"], "a": ["published.csv"]}
    study = plan(*names, **given)
    assert current_files(study) == [model, score, table, alone]
    make("models/a.json", "2\n", ["published.csv"])  # its content is another
    assert current_files(study) == [model, alone]
    make("models/a.json", "1\n", ["published.csv"], OTHER)  # its settings are
    assert current_files(study) == [alone]
    make("models/a.json", inputs=["published.csv"])
    source.write_text("2\n")  # what it was made from is, which no job makes
    assert current_files(study) == [alone] and audit(study).outdated == (model,)


@pytest.mark.parametrize("settings", [SETTINGS, OTHER], ids=["same", "other"])
def test_a_file_left_elsewhere_stands_for_its_job_if_made_as_planned(adopted, settings):
    model = make("models/a.json", settings=settings)
    table = make("tables/t.csv", inputs=["models/a.json"])
    kept.write_receipt(replace(read_receipt(model), kept=False))
    Path(model).unlink()
    assert look().missing == ()
    study = plan("models/a.json", "tables/t.csv", t=["models/a.json"])
    same = settings == SETTINGS
    checked = audit(study)
    assert (checked.elsewhere if same else checked.outdated) == (model,)
    assert checked.sound == (table,)
    assert current_files(study) == ([model, table] if same else [])
    adopted(study)
    assert Path(table).exists() == same


# what a run says before it begins

STUDY = {"results": RESULTS, "wind": {"speed": 12.0}}
REPORT = {"study": {"study": STUDY}, "code": {"digest": "abc"}}
NAMES = ("models/a.json", "tables/t.csv")


def told(model=SETTINGS, study=STUDY, cores=2):
    """What is said where the model is planned with these settings."""
    plans = (plan(NAMES[0], settings=model), plan(NAMES[1], t=NAMES[:1]),
             plan("report.html", settings=REPORT))  # fmt: skip
    jobs = tuple(job for each in plans for job in each.jobs)
    return list(describe_run(Plan(study, jobs), read_receipts(RESULTS), cores))


def test_an_edit_is_named_with_what_runs_again_and_about_how_long():
    made = make(NAMES[0]), make(NAMES[1], inputs=NAMES[:1]), make("report.html", settings=REPORT)
    for path, seconds in zip(made, (58.5, 118.5, 1.0), strict=True):
        kept.write_receipt(replace(read_receipt(path), seconds=seconds))
    assert told() == []
    edited = {**STUDY, "wind": {"speed": 13.0}}
    assert told(OTHER, edited) == [
        "2 of 3 jobs will run, about 2 min on 2 cores",
        "Edited since they last ran: wind.speed from 12.0 to 13.0.",
    ]
    assert told(OTHER, edited, None)[0] == "2 of 3 jobs will run, about 3 min of work"
    code = told(SETTINGS | {"code": {"digest": "b"}})
    assert code[1:] == ["The code or a library has changed for: make."]


def test_a_file_left_elsewhere_is_announced_where_a_job_needs_it(folder):
    model, *_ = [make(NAMES[0]), *(make(name, inputs=NAMES[:1]) for name in (NAMES[1], "u.csv"))]
    kept.write_receipt(replace(read_receipt(model), kept=False))
    Path(model).unlink()

    def announced(settings):
        plans = (plan(NAMES[0]), plan(NAMES[1], t=NAMES[:1]),
                 plan("u.csv", u=NAMES[:1], settings=settings))  # fmt: skip
        jobs = tuple(job for each in plans for job in each.jobs)
        return list(describe_run(Plan(STUDY, jobs), read_receipts(RESULTS), 2))

    assert announced(SETTINGS) == []
    assert announced(OTHER)[0].startswith("3 of 3 jobs")  # the model, and all that depends on it


def test_the_first_run_has_the_reference_alone_to_tell_times_by(folder):
    first = "3 of 3 jobs will run, for the first time:"
    assert told() == [f"{first} how long is not known yet"]
    (folder / "origin.json").write_text('{"core_minutes": 30.2}')
    compared = {**STUDY, "reference": str(folder)}
    assert told(study=compared) == [f"{first} the reference took 30 min on one core"]
    said = map(duration_in_words, (4.2, 89, 600, 9000))
    assert list(said) == ["4 s", "89 s", "10 min", "2 h"]
