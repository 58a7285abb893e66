"""The default study (run `make` first) still has the numbers that were published."""

import pandas as pd
import pytest


@pytest.fixture(scope="module")
def summary(root):
    file = root / "results" / "tables" / "reference_summary.csv"
    assert file.is_file(), f"{file} is missing: run `make` first"
    return pd.read_csv(file).set_index("table")


def test_published_numbers_come_out_again(summary, root):
    """Where they should not any more, `make reference` publishes the new ones."""
    published = {path.stem for path in (root / "results" / "reference").glob("*.csv")}
    assert published | {"settings"} == set(summary.index)
    assert summary.loc[summary["verdict"] != "agrees", "verdict"].to_dict() == {}
    assert (summary["values_compared"] > 0).all()
