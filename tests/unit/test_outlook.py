"""What a run says before it begins."""

import json
from dataclasses import asdict
from pathlib import Path

import pytest

from galloping.reproducibility.plan import Plan, PlannedJob, duration_in_words, outlook
from galloping.reproducibility.receipts import Receipt, digest, receipt_path, receipts

RESULTS = "results/mine"
STUDY = {"results": RESULTS, "wind": {"speed": 12.0}, "levels": [0.05]}


def job(name, speed=12.0, code="a", inputs=(), study=None):
    """The plan of a job of a rule of its own, named as its file."""
    settings = {"speed": {"wind.speed": speed}, "code": {"digest": code}}
    settings |= {"study": {"study": study}} if study else {}
    paths = [f"{RESULTS}/{each}" for each in (*inputs, name)]
    return PlannedJob(Path(name).stem, settings, tuple(paths[:-1]), (paths[-1],))


def done(planned, seconds):
    """Its file and receipt."""
    (path,) = planned.outputs
    Path(path).parent.mkdir(parents=True, exist_ok=True)
    Path(path).write_text(path)
    made = Receipt(
        path, planned.rule, {}, f"{RESULTS}/logs/a.log", planned.settings,
        {each: digest(each) for each in planned.inputs}, digest(path), 1, seconds,
    )  # fmt: skip
    receipt_path(path).write_text(json.dumps(asdict(made)))


@pytest.fixture
def finished(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done(job("model.json"), 58.5)
    done(job("table.csv", inputs=["model.json"]), 118.5)
    done(job("report.html", study=STUDY), 1.0)


def told(*jobs, study=STUDY, cores=2):
    return list(outlook(Plan(study, jobs), receipts(RESULTS), cores))


def test_nothing_is_said_where_nothing_is_to_be_done(finished):
    table = job("table.csv", inputs=["model.json"])
    assert told(job("model.json"), table, job("report.html", study=STUDY)) == []


def test_an_edit_is_named_with_what_runs_again_and_about_how_long(finished):
    edited = {**STUDY, "wind": {"speed": 13.0}}
    jobs = (
        job("model.json", speed=13.0), job("table.csv", inputs=["model.json"]),
        job("report.html", study=STUDY),
    )  # fmt: skip
    assert told(*jobs, study=edited) == [
        "2 of 3 jobs will run, about 2 min on 2 cores",
        "Edited since they last ran: wind.speed from 12.0 to 13.0.",
    ]
    assert told(*jobs, study=edited, cores=None)[0] == "2 of 3 jobs will run, about 3 min of work"


def test_other_code_is_named_by_its_rules(finished):
    assert told(job("model.json", code="b"), job("table.csv", inputs=["model.json"])) == [
        "2 of 2 jobs will run, about 2 min on 2 cores",
        "Code or libraries changed behind: model.",
    ]


def test_the_first_run_has_the_reference_alone_to_tell_times_by(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    first = "1 of 1 jobs will run, for the first time:"
    assert told(job("model.json")) == [f"{first} how long is not known yet"]
    (tmp_path / "origin.json").write_text('{"core_minutes": 30.2}')
    compared = {**STUDY, "reference": str(tmp_path)}
    assert told(job("model.json"), study=compared) == [f"{first} the reference took a core 30 min"]


def test_durations_are_spoken():
    said = map(duration_in_words, (4.2, 89, 600, 9000))
    assert list(said) == ["4 s", "89 s", "10 min", "2 h"]
