"""The data dictionary: what each table shows, and what each of its columns holds, with its unit.

`tables.csv` has a row for each table, without a column: its caption; and a row for a column of one
table, or, where `table` is empty, of every table with such a column that has no row of its own. A
module apart from the page, whose edits need not make the table again.
"""

from collections.abc import Mapping
from functools import cache
from pathlib import Path

import pandas as pd

EVERY = ""  # table
WHOLE = ""  # column


@cache
def _dictionary() -> pd.DataFrame:
    return pd.read_csv(
        Path(__file__).with_name("tables.csv"), dtype=str, keep_default_na=False, encoding="utf-8"
    )


def columns(settings: Mapping) -> pd.DataFrame:
    """table, column, unit, meaning, for all who read the tables. settings: tables of the study."""
    rows = _dictionary()
    shown = (rows["column"] != WHOLE) & rows["table"].isin([EVERY, *settings["tables"]])
    return rows[shown].reset_index(drop=True)


def captions() -> dict[str, str]:
    """What each table shows, in reStructuredText, by its name."""
    rows = _dictionary()
    return rows[rows["column"] == WHOLE].set_index("table")["meaning"].to_dict()


def meaning(table: str, column: str) -> str:
    """In words, with the unit behind; '' for a column that the dictionary lacks."""
    rows = _dictionary()
    rows = rows[(rows["column"] == column) & rows["table"].isin([EVERY, table])]
    if rows.empty:
        return ""
    own = rows.sort_values("table").iloc[-1]  # of this table, if there is one
    return f"{own['meaning']} ({own['unit']})" if own["unit"] else own["meaning"]
