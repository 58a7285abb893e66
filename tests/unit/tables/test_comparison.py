"""Tables of two runs are compared by what their rows are about, within stated tolerances."""

import io

import pandas as pd
import pytest

from galloping.tables.comparison import COLUMNS, compare_tables, describe

TABLE = """case,method,level,r2,value,verdict
a,stlsq,0.05,0.9,0,ok
a,lasso,0.05,0.8,1,ok
b,stlsq,0.05,,2,refused
b,lasso,0.05,inf,0,
"""


def table(text=TABLE, **options):
    return pd.read_csv(io.StringIO(text), **options)


def changes(text, **options):
    found = compare_tables(table(), table(text, **options))
    return [tuple(row) for row in found[["row", "column", "reference", "found"]].to_numpy()]


def test_a_table_agrees_with_itself_in_any_order_and_form():
    assert len(compare_tables(table(), table().sample(frac=1, random_state=1))) == 0
    assert len(compare_tables(table(), table()[table().columns[::-1]])) == 0
    assert len(compare_tables(table(), table(dtype=str, keep_default_na=False))) == 0
    assert tuple(compare_tables(table(), table()).columns) == COLUMNS


@pytest.mark.parametrize(
    ("value", "agrees"), [("0.9008", True), ("0.9011", False), ("0.8992", True), ("0.8989", False)]
)
def test_numbers_agree_to_a_thousandth(value, agrees):
    found = changes(TABLE.replace("0.9,", f"{value},"))
    assert found == ([] if agrees else [("case=a, method=stlsq, level=0.05", "r2", "0.9", value)])


def test_numbers_near_zero_agree_to_a_millionth():
    zero = TABLE.replace("0.9,", "0,")
    assert len(compare_tables(table(zero), table(zero.replace(",0,", ",-9e-7,", 1)))) == 0
    found = compare_tables(table(zero), table(zero.replace(",0,", ",-2e-6,", 1)))
    assert found["difference"].tolist() == [-2e-6] and found["tolerance"].tolist() == [1e-6]


@pytest.mark.parametrize(
    ("old", "new", "column"),
    [
        ("inf", "-inf", "r2"),
        ("inf", "1e300", "r2"),
        ("0.9", "inf", "r2"),
        ("0.9", "", "r2"),
        ("b,stlsq,0.05,,", "b,stlsq,0.05,0.1,", "r2"),
        ("0.9", "many", "r2"),
        ("refused", "ok", "verdict"),
        ("0,ok", "0,", "verdict"),
        ("2,refused", "3,refused", "value"),
    ],
)
def test_what_is_not_the_same_is_named(old, new, column):
    assert [one[1] for one in changes(TABLE.replace(old, new, 1))] == [column]


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


def test_rows_about_the_same_are_told_apart_by_their_order():
    twice = TABLE.replace("lasso", "stlsq")
    assert len(compare_tables(table(twice), table(twice))) == 0
    found = compare_tables(table(twice), table(twice.replace("0.8,1", "0.7,1")))
    assert found["row"].tolist() == ["case=a, method=stlsq, level=0.05, row 2"]


def test_a_difference_in_words():
    found = compare_tables(table(), table(TABLE.replace("0.9,", "1,").replace("refused", "ok")))
    assert [describe(row) for _, row in found.iterrows()] == [
        "case=a, method=stlsq, level=0.05, r2: reference 0.9, found 1.0 (allowed 0.0009)",
        "case=b, method=stlsq, level=0.05, verdict: reference refused, found ok",
    ]
