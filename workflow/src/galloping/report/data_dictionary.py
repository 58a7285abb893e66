"""Data dictionary: captions of the tables, and meaning and unit of each column.

`tables.csv` has a row for each table, without a column: its caption; and a row for a column of one
table, or, if `table` is empty, of every table with such a column that has no row of its own. This
module is separate from the page, so that edits of the page do not make the table again. pandas is
imported late, because every start of Snakemake reads the captions.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pandas as pd

EVERY_TABLE = ""  # name of the table in rows about columns of all tables
WHOLE_TABLE = ""  # name of the column in rows about a table


@cache
def _read_dictionary() -> list[dict[str, str]]:
    with Path(__file__).with_name("tables.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def columns(settings: Mapping) -> pd.DataFrame:
    """Tabulate the name, unit and meaning of each column in the tables of a study.

    settings: tables of the study.
    """
    import pandas as pd

    shown = {EVERY_TABLE, *settings["tables"]}
    rows = (
        row for row in _read_dictionary() if row["column"] != WHOLE_TABLE and row["table"] in shown
    )
    return pd.DataFrame(rows)


def captions() -> dict[str, str]:
    """Return the caption of each table of a study, in reStructuredText, by table name."""
    return {
        row["table"]: row["meaning"] for row in _read_dictionary() if row["column"] == WHOLE_TABLE
    }


def meaning(table: str, column: str) -> str:
    """Return the meaning and unit of a table column as text, '' if it is not documented."""
    rows = [r for r in _read_dictionary() if r["column"] == column]
    rows = [r for r in rows if r["table"] in (EVERY_TABLE, table)]
    if not rows:
        return ""
    row = max(rows, key=lambda row: row["table"])  # of this table, if there is one
    return f"{row['meaning']} ({row['unit']})" if row["unit"] else row["meaning"]
