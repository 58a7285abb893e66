"""A run beside the reference: what its summary and its list of differences say."""

import pandas as pd
import pytest

from galloping.tables.comparison import (
    AGREES,
    DIFFERENCE_COLUMNS,
    DIFFERS,
    NO_REFERENCE,
    REASONS,
    SUMMARY_COLUMNS,
    Origin,
    compare_study,
    read_origin,
)

SETTINGS = {"measurement": {"seed": 1, "levels": [0, 0.05]}, "thresholds": {}}


def table(*values):
    return pd.DataFrame({"case": list("abcd")[: len(values)], "r2": values})


def compare(found, settings=SETTINGS, processor="one"):
    """(summary by table, differences) of tables beside a reference with the table `noise`."""
    made, present = Origin(SETTINGS, "one"), Origin(settings, processor)
    summary, differences = compare_study({"noise": table(0.5, 0.9)}, made, found, present)
    assert tuple(summary) == SUMMARY_COLUMNS and tuple(differences) == DIFFERENCE_COLUMNS
    assert list(summary["table"]) == ["settings", "processor", *found]
    rows = summary.to_dict("records")
    return {row["table"]: row for row in rows}, differences.to_dict("records")


@pytest.mark.parametrize(("found", "away", "at"), [(0.9, 0, ""), (0.90045, 0.5, "case=b, r2")])
def test_numbers_within_tolerance_agree_and_the_largest_difference_is_told(found, away, at):
    summary, differences = compare({"noise": table(0.5, found)})
    assert differences == []
    assert {row["verdict"] for row in summary.values()} == {AGREES}
    counted = summary["noise"]
    assert (counted["rows_compared"], counted["values_compared"]) == (2, 2)
    assert counted["values_beyond_tolerance"] == 0
    assert counted["largest_difference_in_tolerances"] == pytest.approx(away)
    assert not away or counted["largest_difference_at"] == at


def test_what_is_beyond_tolerance_new_or_gone_is_listed():
    summary, differences = compare({"noise": table(0.6).iloc[:1]})
    assert [(d["row"], d["column"], d["verdict"]) for d in differences] == [
        ("case=b", "(row)", "only in the reference"),
        ("case=a", "r2", "beyond tolerance"),
    ]
    assert differences[1]["difference"] == pytest.approx(0.1)
    row = summary["noise"]
    assert row["verdict"] == DIFFERS
    assert (row["rows_compared"], row["rows_only_in_reference"]) == (1, 1)
    assert row["values_beyond_tolerance"] == 1
    summary, differences = compare({"noise": table(0.5, 0.9, 0.1)})
    assert [d["verdict"] for d in differences] == ["only in this run"]
    assert summary["noise"]["rows_only_in_this_run"] == 1


@pytest.mark.parametrize(
    ("settings", "key", "values", "verdict"),
    [
        ({"measurement": {"seed": 2}}, "measurement.seed", ("1", "2"), "not the same"),
        ({"measurement": {"seed": 1.0001}}, "measurement.seed", ("1", "1.0001"), "not the same"),
        ({"thresholds": {"a": 1}}, "thresholds.a", ("absent", "1"), "only in this run"),
        ({"degree": 3}, "degree", ("absent", "3"), "only in this run"),
    ],
)
def test_other_settings_are_named_and_excuse_other_numbers(settings, key, values, verdict):
    edited = SETTINGS | settings
    edited["measurement"] = SETTINGS["measurement"] | edited["measurement"]
    summary, differences = compare({"noise": table(0.5, 0.1)}, edited)
    found = {d["row"]: d for d in differences if d["table"] == "settings"}
    assert (found[key]["reference"], found[key]["found"]) == values
    assert found[key]["verdict"] == verdict
    assert summary["settings"]["verdict"] == DIFFERS
    assert summary["noise"]["verdict"] == REASONS["settings"]
    summary, _ = compare({"noise": table(0.5, 0.9)}, edited)
    assert summary["noise"]["verdict"] == AGREES


def test_another_processor_is_named_and_may_be_the_reason():
    summary, differences = compare({"noise": table(0.5, 0.1), "new": table(1)}, processor="two")
    assert (differences[0]["table"], differences[0]["found"]) == ("processor", '"two"')
    assert summary["processor"]["verdict"] == DIFFERS
    assert summary["noise"]["verdict"] == REASONS["processor"]
    summary, _ = compare({"noise": table(0.5, 0.1)}, SETTINGS | {"degree": 3}, processor="two")
    assert summary["noise"]["verdict"] == REASONS["settings"]


def test_what_the_reference_lacks_is_no_difference():
    summary, differences = compare({"noise": table(0.5, 0.9), "new": table(1)})
    assert differences == [] and summary["new"]["verdict"] == NO_REFERENCE
    summary, differences = compare_study({}, None, {"noise": table(1)}, Origin(SETTINGS, "one"))
    assert differences.empty and set(summary["verdict"]) == {NO_REFERENCE}


def test_tables_of_another_make_do_not_stop_the_study():
    summary, _ = compare({"noise": pd.DataFrame({"r2": [0.5, 0.6]})})
    assert summary["noise"]["verdict"] == (
        "cannot be compared: no column says what a row is about: case, r2"
    )


@pytest.mark.parametrize("content", ["", "{}", '{"settings": {}}', "[1]"])
def test_a_broken_reference_is_named(tmp_path, content):
    file = tmp_path / "origin.json"
    file.write_text(content)
    with pytest.raises(ValueError, match=r"origin\.json: does not say how the reference was made"):
        read_origin(str(file))
