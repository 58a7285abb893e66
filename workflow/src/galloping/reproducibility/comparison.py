"""Numbers of two runs of the study, compared within stated tolerances.

Two machines agree to rounding, not to the byte, so that tables are compared row by row: a row is
found by what it is about (its case, method, level and so on), wherever it stands.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

# Two numbers agree if they differ by no more than the larger of the two tolerances.
RELATIVE_TOLERANCE = 1e-3
ABSOLUTE_TOLERANCE = 1e-6  # in the column's own unit

# Columns that say what a row is about; all others are results.
KEYS = (
    "case",
    "claim",
    "quantity",
    "key",
    "symbol",
    "equation",
    "term",
    "release",
    "recordings",
    "protocol",
    "cell",
    "level",
    "points",
    "method",
    "replicate",
    "order",
    "state",
)
COLUMNS = ("row", "column", "reference", "found", "difference", "tolerance")
WHOLE = "(row)"  # stands for a column where a row is missing or new
HEADING = "(column)"  # stands for a row where a column is missing or new


def compare_tables(
    reference: pd.DataFrame, found: pd.DataFrame, keys: Sequence[str] | None = None
) -> pd.DataFrame:
    """What differs between two tables of the same kind; no row if they agree.

    keys: the columns that together identify a row; by default those of `KEYS` that both have.
    Returns one row a difference: `row` (its keys as text), `column`, `reference` and `found` (as
    text), `difference` (found - reference; NaN where one is not a number) and `tolerance` (NaN
    for text, which must be equal). Empty cells agree with each other, infinities with their like.
    A missing or new row has the column "(row)"; a missing or new column has the row "(column)".
    Raises ValueError where a row cannot be identified: no key, or two rows with the same ones.
    """
    left, right = _by_row(reference, found, keys)
    present = [
        *_presence(HEADING, reference.columns, found.columns, as_row=False),
        *_presence(WHOLE, left.index, right.index, as_row=True),
    ]
    values = _values(left, right)
    values = values.loc[~values["agrees"], list(COLUMNS)]
    return pd.DataFrame([*present, *values.itertuples(index=False)], columns=COLUMNS)


def compare_values(
    reference: pd.DataFrame, found: pd.DataFrame, keys: Sequence[str] | None = None
) -> pd.DataFrame:
    """Every value that both tables have, as in `compare_tables`; with a column `agrees` (bool)."""
    return _values(*_by_row(reference, found, keys))


def describe(difference: pd.Series) -> str:
    """One difference as one line of text."""
    where = f"{difference['row']}, {difference['column']}"
    line = f"{where}: reference {difference['reference']}, found {difference['found']}"
    if np.isnan(difference["tolerance"]):
        return line
    return f"{line} (allowed {difference['tolerance']:.3g})"


def _by_row(
    reference: pd.DataFrame, found: pd.DataFrame, keys: Sequence[str] | None
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Both tables as text without their keys, which name the rows."""
    if keys is None:
        keys = [name for name in reference.columns if name in found.columns and name in KEYS]
    if not keys:
        raise ValueError(f"no column says what a row is about: {', '.join(reference.columns)}")
    left, right = (_indexed(table, keys) for table in (reference, found))
    return left, right


def _indexed(table: pd.DataFrame, keys: Sequence[str]) -> pd.DataFrame:
    """A table as text without its keys, which name the rows."""
    text = table.astype(object).where(table.notna(), "").astype(str)
    parts = [name + "=" + text[name].map(_canonical) for name in keys]
    names = parts[0].str.cat(parts[1:], sep=", ") if len(parts) > 1 else parts[0]
    twice = names[names.duplicated()]
    if len(twice):
        raise ValueError(f"two rows are about the same: {twice.iloc[0]}")
    return text.drop(columns=list(keys)).set_axis(names.to_list())


def _canonical(text: str) -> str:
    """A key as text: 5, 5.0 and "5" are the same key."""
    try:
        return f"{float(text):.12g}"
    except ValueError:
        return text


def _presence(kind: str, reference: pd.Index, found: pd.Index, as_row: bool) -> list[tuple]:
    sides = [(name, "present", "absent") for name in reference.difference(found, sort=False)]
    sides += [(name, "absent", "present") for name in found.difference(reference, sort=False)]
    return [
        ((name, kind) if as_row else (kind, name)) + (one, other, np.nan, np.nan)
        for name, one, other in sides
    ]


def _values(left: pd.DataFrame, right: pd.DataFrame) -> pd.DataFrame:
    rows = left.index[left.index.isin(right.index)]
    names = [name for name in left.columns if name in right.columns]
    columns = [_column(name, left.loc[rows, name], right.loc[rows, name]) for name in names]
    empty = pd.DataFrame(columns=[*COLUMNS, "agrees"]).astype({"agrees": bool})
    return pd.concat(columns, ignore_index=True) if columns else empty


def _column(name: str, reference: pd.Series, found: pd.Series) -> pd.DataFrame:
    """One column of rows that both tables have in the same order."""
    first, second = (pd.to_numeric(side, errors="coerce") for side in (reference, found))
    first, second = first.to_numpy(float), second.to_numpy(float)
    numbers = ~np.isnan(first) & ~np.isnan(second)
    with np.errstate(invalid="ignore"):  # infinity less infinity
        difference = np.where(first == second, 0.0, second - first)
    size = np.where(np.isinf(first), 0.0, np.abs(first))  # only infinity agrees with infinity
    tolerance = np.maximum(ABSOLUTE_TOLERANCE, RELATIVE_TOLERANCE * size)
    equal = (reference == found).to_numpy()
    return pd.DataFrame(
        {
            "row": reference.index,
            "column": name,
            "reference": reference.to_numpy(),
            "found": found.to_numpy(),
            "difference": np.where(numbers, difference, np.nan),
            "tolerance": np.where(numbers, tolerance, np.nan),
            "agrees": np.where(numbers, np.abs(difference) <= tolerance, equal),
        }
    )
