"""Tables of two runs are compared by what their rows are about, within stated tolerances; what the
summary and the list of differences say of a run beside the reference."""

import io

import pandas as pd
import pytest

from galloping.tables import comparison
from galloping.tables.comparison import AGREES, DIFFERS, NO_REFERENCE, REASONS, Origin

TABLE = """case,method,level,r2,value,verdict
a,stlsq,0.05,0.9,0,ok
a,lasso,0.05,0.8,1,ok
b,stlsq,0.05,,2,refused
b,lasso,0.05,inf,0,
"""


def table(text=TABLE, **options):
    return pd.read_csv(io.StringIO(text), **options)


def changes(text):
    found = comparison.compare_tables(table(), table(text))
    return [tuple(row) for row in found[["row", "column", "reference", "this_run"]].to_numpy()]


def test_a_table_agrees_with_itself_in_any_order_and_form():
    twice = table(TABLE.replace("lasso", "stlsq"))
    for one, other in (
        (table(), table().sample(frac=1, random_state=1)),
        (table(), table()[table().columns[::-1]]),
        (table(), table(dtype=str, keep_default_na=False)),
        (twice, twice),
        (table(TABLE.replace("level,r2", "reference,found")),) * 2,
        (table("claim,other,ratio\na,b,1\na,c,2\n"), table("claim,other,ratio\na,c,2\na,b,1\n")),
    ):
        found = comparison.compare_tables(one, other)
        assert len(found) == 0 and tuple(found.columns) == comparison.COLUMNS


@pytest.mark.parametrize(
    ("old", "new", "columns"),
    [
        ("0.9", "0.9008", []), ("0.9", "0.9011", ["r2"]), ("0.9", "0.8992", []),
        ("0.9", "0.8989", ["r2"]), ("0,ok", "-9e-7,ok", []), ("0,ok", "-2e-6,ok", ["value"]),
        ("inf", "-inf", ["r2"]), ("inf", "1e300", ["r2"]), ("0.9", "inf", ["r2"]),
        ("b,stlsq,0.05,,", "b,stlsq,0.05,0.1,", ["r2"]), ("0.9", "many", ["r2"]),
        ("0.9", "", ["r2"]), ("refused", "ok", ["verdict"]), ("0,ok", "0,", ["verdict"]),
        ("2,ref", "3,ref", ["value"]),
    ],
)  # fmt: skip
def test_numbers_agree_to_a_thousandth_or_a_millionth_and_what_differs_is_named(old, new, columns):
    assert [one[1] for one in changes(TABLE.replace(old, new, 1))] == columns


def test_rows_and_columns_that_one_table_lacks_are_named():
    without = TABLE.replace("a,lasso,0.05,0.8,1,ok\n", "")
    row = "case=a, method=lasso, level=0.05"
    assert changes(without) == [(row, "(row)", "present", "absent")]
    assert changes(TABLE.replace("lasso,0.05,0.8", "lasso,0.1,0.8")) == [
        (row, "(row)", "present", "absent"),
        ("case=a, method=lasso, level=0.1", "(row)", "absent", "present"),
    ]
    assert changes(TABLE.replace("value", "fits")) == [
        ("(column)", "value", "present", "absent"),
        ("(column)", "fits", "absent", "present"),
    ]


def test_a_difference_in_words_and_rows_about_the_same_by_their_order():
    other = table(TABLE.replace("0.9,", "1,").replace("refused", "ok"))
    found = comparison.compare_tables(table(), other)
    assert [comparison.describe(row) for _, row in found.iterrows()] == [
        "case=a, method=stlsq, level=0.05, r2: reference 0.9, found 1.0 (allowed 0.0009)",
        "case=b, method=stlsq, level=0.05, verdict: reference refused, found ok",
    ]
    twice = TABLE.replace("lasso", "stlsq")
    found = comparison.compare_tables(table(twice), table(twice.replace("0.8,1", "0.7,1")))
    assert found["row"].tolist() == ["case=a, method=stlsq, level=0.05, row 2"]


def test_the_first_differences_of_two_folders_are_told(tmp_path):
    rows = "".join(f"{name},{{}}\n" for name in "abcdefghijkl")
    archived, here = tmp_path / "archived", tmp_path / "here"
    for folder, value in ((archived, "1"), (here, "2")):
        (folder / "tables").mkdir(parents=True)
        (folder / "tables/t.csv").write_text("case,r2\n" + rows.replace("{}", value))
    assert list(comparison.list_differences(here, here)) == []
    (here / "tables/u.csv").touch()
    lines = list(comparison.list_differences(archived, here))
    assert lines[0] == "tables/t.csv: case=a, r2: reference 1, found 2 (allowed 0.001)"
    assert lines[-2:] == ["tables/t.csv: 2 more differences", "tables/u.csv: not in the archive"]


# beside the reference

SETTINGS = {"measurement": {"seed": 1, "levels": [0, 0.05]}, "thresholds": {}}


def noise(*values):
    return pd.DataFrame({"case": list("abcd")[: len(values)], "r2": values})


def compare(found, settings=SETTINGS, processor="one"):
    """(summary by table, differences) of tables beside a reference with the table `noise`."""
    made, present = Origin(SETTINGS, "one"), Origin(settings, processor)
    reference = {"noise": noise(0.5, 0.9)}
    summary, differences = comparison.compare_study(reference, made, found, present)
    assert tuple(summary) == comparison.SUMMARY_COLUMNS
    assert tuple(differences) == comparison.DIFFERENCE_COLUMNS
    assert list(summary["table"]) == ["settings", "processor", *found]
    rows = summary.to_dict("records")
    return {row["table"]: row for row in rows}, differences.to_dict("records")


@pytest.mark.parametrize(("found", "away", "at"), [(0.9, 0, ""), (0.90045, 0.5, "case=b, r2")])
def test_numbers_within_tolerance_agree_and_the_largest_difference_is_told(found, away, at):
    summary, differences = compare({"noise": noise(0.5, found), "new": noise(1)})
    verdicts = {name: row["verdict"] for name, row in summary.items()}
    assert differences == [] and verdicts.pop("new") == NO_REFERENCE
    assert set(verdicts.values()) == {AGREES}
    noisy = summary["noise"]
    counts = ("rows_compared", "values_compared", "values_beyond_tolerance")
    assert [noisy[each] for each in counts] == [2, 2, 0]
    assert noisy["largest_difference_in_tolerances"] == pytest.approx(away)
    assert not away or noisy["largest_difference_at"] == at


def test_what_is_beyond_tolerance_new_or_gone_is_listed():
    summary, differences = compare({"noise": noise(0.6)})
    assert [(d["row"], d["column"], d["verdict"]) for d in differences] == [
        ("case=b", "(row)", "only in the reference"),
        ("case=a", "r2", "beyond tolerance"),
    ]
    assert differences[1]["difference"] == pytest.approx(0.1)
    counts = ("rows_compared", "rows_only_in_reference", "values_beyond_tolerance")
    assert [summary["noise"][each] for each in ("verdict", *counts)] == [DIFFERS, 1, 1, 1]
    summary, differences = compare({"noise": noise(0.5, 0.9, 0.1)})
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
    summary, differences = compare({"noise": noise(0.5, 0.1)}, edited)
    (told,) = (d for d in differences if (d["table"], d["row"]) == ("settings", key))
    assert (told["reference"], told["this_run"], told["verdict"]) == (*values, verdict)
    assert summary["settings"]["verdict"] == DIFFERS
    assert summary["noise"]["verdict"] == REASONS["settings"]
    summary, _ = compare({"noise": noise(0.5, 0.9)}, edited)
    assert summary["noise"]["verdict"] == AGREES


def test_another_processor_is_named_and_may_be_the_reason():
    summary, differences = compare({"noise": noise(0.5, 0.1)}, processor="two")
    assert (differences[0]["table"], differences[0]["this_run"]) == ("processor", '"two"')
    assert summary["processor"]["verdict"] == DIFFERS
    assert summary["noise"]["verdict"] == REASONS["processor"]
    summary, _ = compare({"noise": noise(0.5, 0.1)}, SETTINGS | {"degree": 3}, processor="two")
    assert summary["noise"]["verdict"] == REASONS["settings"]


def test_what_cannot_be_compared_does_not_stop_the_study():
    run = {"noise": noise(1)}, Origin(SETTINGS, "one")
    summary, differences = comparison.compare_study({}, None, *run)
    assert differences.empty and set(summary["verdict"]) == {NO_REFERENCE}
    summary, _ = compare({"noise": pd.DataFrame({"r2": [0.5, 0.6]})})
    said = "cannot be compared: no column says what a row is about: case, r2"
    assert summary["noise"]["verdict"] == said


@pytest.mark.parametrize("content", ["", "{}", '{"settings": {}}', "[1]"])
def test_a_broken_reference_is_named(tmp_path, content):
    file = tmp_path / "origin.json"
    file.write_text(content)
    with pytest.raises(ValueError, match=r"origin\.json: "):
        comparison.read_origin(str(file))
