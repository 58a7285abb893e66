"""scores/**.csv, tables/{table}.csv and other tidy tables: one observation a row."""

from __future__ import annotations

import os

import pandas as pd

from galloping.storage import write_rows


def write(path: str | os.PathLike, table: pd.DataFrame) -> None:
    write_rows(path, table.to_dict("records"), list(table))


def read(path: str | os.PathLike) -> pd.DataFrame:
    return pd.read_csv(path)


def read_as_written(path: str | os.PathLike) -> pd.DataFrame:
    """All cells as text: empty cells and the word "nan" are not the same."""
    return pd.read_csv(path, dtype=str, keep_default_na=False)
