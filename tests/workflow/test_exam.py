"""The exam in small: the answers to a few of its recordings are those of the reference."""

import pandas as pd
import pytest
import yaml
from studies import copy_repository, script

from galloping.storage import read_json
from galloping.tables.comparison import describe_processor
from galloping.tables.exam import collect_answers, find_changes, restore_types

FEW = {
    "published": {"cases": ["van_der_pol", "duffing", "circulation", "sprott_a"]},
    "short": {"cases": ["lorenz"]},
    "intervals": {"cases": ["gamma 0.04"]},
    "random": {"replicates": 4},
    "random_minute": {"replicates": 10},
    "displacements": {"replicates": 2},
    "faults": {"cases": ["none", "clock", "gusts"], "replicates": 2},
    "random_forces": {"replicates": 2},
    "forces": {"cases": ["step of a force"], "replicates": 1},
    "free_decays": {"replicates": 5},
    "files": {"cases": ["limit cycle in minutes", "decay with a knock"], "replicates": 1},
}
# share of the answers, on another kind of processor, which rounds otherwise
MAX_CHANGED_SHARE = 0.1


@pytest.fixture
def folder(root, tmp_path):
    copy_repository(root, tmp_path)
    (tmp_path / "few.yaml").write_text(yaml.safe_dump({"trials": FEW}), encoding="utf-8")
    return tmp_path


def test_another_name_is_refused_in_one_line(root):
    code, lines = script(root, "take_exam", "--stratum", "randm")
    assert code == 1 and len(lines) == 1 and "'randm'" in lines[0]
    code, lines = script(root, "take_exam", "--before", "config/exam.yaml")
    assert code == 1 and len(lines) == 1 and "config/exam.yaml" in lines[0]


@pytest.mark.slow
def test_the_answers_are_those_of_the_reference(root, folder):
    files = ("--configfile", "config/exam.yaml", "few.yaml")
    code, lines = script(folder, "take_exam", "--cores", 2, "--stratum", *FEW, *files)
    assert code == 0, lines
    trials = sorted((folder / "results/exam/trials").rglob("*.csv"))
    now = collect_answers({f"{path.parent.name}/{path.stem}": pd.read_csv(path) for path in trials})
    assert set(now["stratum"]) == {*FEW} and not now.duplicated(["stratum", "recording"]).any()
    reference = root / "results/reference/exam"
    before = restore_types(pd.read_csv(reference / "answers.csv"))
    asked = before.merge(now[["stratum", "recording"]])
    assert len(asked) == len(now)
    changed = find_changes(asked, now)
    same_kind = read_json(reference / "origin.json")["processor"] == describe_processor()
    allowed = 0 if same_kind else MAX_CHANGED_SHARE * len(now)
    assert len(changed) <= allowed, changed.to_string()
