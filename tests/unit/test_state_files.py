"""What a study keeps about itself, damaged: it is left aside or named in one line."""

import json
import re
from dataclasses import asdict
from pathlib import Path

import pytest

from galloping.reproducibility.lock import LOCK_FILE, RESULT_FOLDERS, Obstacle, check_places
from galloping.reproducibility.receipts import (
    DIGEST_FILE,
    Receipt,
    inspect,
    read_receipt,
    read_receipts,
    receipt_path,
    remember,
    write_receipt,
)

RESULTS = "results/mine"
TABLE = f"{RESULTS}/tables/t.csv"
RULES = Path(__file__).parents[2] / "workflow" / "rules"


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    """A working folder with one result."""
    monkeypatch.chdir(tmp_path)
    Path(TABLE).parent.mkdir(parents=True)
    Path(TABLE).write_text("a\n")
    write_receipt(Receipt(TABLE, "make", {}, f"{RESULTS}/logs/t.log", {}, {}, "0" * 64, 2, 0.1))
    return tmp_path


DAMAGED = [
    "[]", "null", "3", '{"results/mine": null}', '{"results/mine": []}', "[" * 100_000, "\x00", "",
    json.dumps({RESULTS: {TABLE: None, "a": [], "b": [1, 2, 3, 4, 5], "c": {}}}),
]  # fmt: skip


@pytest.mark.parametrize("content", DAMAGED)
def test_a_damaged_memory_of_digests_is_left_aside(content):
    DIGEST_FILE.parent.mkdir()
    DIGEST_FILE.write_text(content)
    findings = inspect(RESULTS, read_receipts(RESULTS))
    assert findings.damaged == (TABLE,) and findings.unseen == (TABLE,)
    remember(RESULTS, findings)
    assert inspect(RESULTS, read_receipts(RESULTS)).unseen == ()


@pytest.mark.parametrize("content", DAMAGED)
def test_a_damaged_receipt_is_none(content):
    receipt_path(TABLE).write_text(content)
    assert read_receipt(TABLE) is None and read_receipts(RESULTS) == {}


@pytest.mark.parametrize(
    ("name", "value"),
    [("inputs", None), ("inputs", {"a": 1}), ("settings", []), ("log", 3), ("seconds", "1"),
     ("size", None), ("kept", "no"), ("wildcards", {"a": None})],
)  # fmt: skip
def test_a_receipt_with_values_of_another_type_is_none(name, value):
    sound = asdict(read_receipt(TABLE))
    receipt_path(TABLE).write_text(json.dumps(sound | {name: value}))
    assert read_receipt(TABLE) is None


@pytest.mark.parametrize(
    ("path", "is_folder"),
    [(".snakemake", False), (RESULTS + "/logs", False), (RESULTS + "/models", False),
     (RESULTS + "/report.html", True), (RESULTS + "/.running", True), (str(DIGEST_FILE), True)],
)  # fmt: skip
def test_what_lies_where_something_else_belongs_is_named(path, is_folder):
    check_places(RESULTS)
    if is_folder:
        Path(path).mkdir(parents=True)
    else:
        Path(path).write_text("mine")
    with pytest.raises(Obstacle, match=re.escape(path)) as fault:
        check_places(RESULTS)
    assert "\n" not in str(fault.value)


def test_results_among_the_tables_of_another_study_are_refused():
    Path(RESULTS, LOCK_FILE).touch()
    check_places(f"{RESULTS}/wide/tables")
    with pytest.raises(Obstacle, match=f"^results: '{RESULTS}/tables/x' is in the results of"):
        check_places(f"{RESULTS}/tables/x")


def test_the_folders_of_results_are_those_of_the_rules():
    text = "".join(path.read_text(encoding="utf-8") for path in RULES.glob("*.smk"))
    assert set(RESULT_FOLDERS) == set(re.findall(r"<results>/([a-z]+)(?=[/\"])", text))
