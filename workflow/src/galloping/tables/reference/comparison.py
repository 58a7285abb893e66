"""Numbers of two runs of the study, compared within stated tolerances.

Two machines agree to rounding, not to the byte, so that tables are compared row by row: a row is
found by what it is about (its case, method, level and so on), wherever it stands.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence

import numpy as np
import pandas as pd

# Two numbers agree if they differ by no more than the larger of the two tolerances.
RELATIVE_TOLERANCE = 1e-3
ABSOLUTE_TOLERANCE = 1e-6  # in the column's own unit

# Columns that say what a row is about; all others are results.
KEYS = frozenset(
    (
        *("case", "claim", "quantity", "key", "symbol", "equation", "term", "release"),
        *("line", "truth", "sensors", "path", "table", "column", "reading"),
        *("recordings", "protocol", "cell", "level", "points", "method", "setting"),
        *(
            "group",
            "system",
            "samples",
            "replicate",
            "order",
            "state",
            "x",
            "y",
            "wind_m_s",
            "direction",
            "what",
            "measure",
        ),
    )
)
MEASURED = "seconds_median"  # of the processor, which no two runs share
COLUMNS = ("row", "column", "reference", "found", "difference", "tolerance")
WHOLE = "(row)"  # stands for a column where a row is missing or new
HEADING = "(column)"  # stands for a row where a column is missing or new


def compare_tables(reference: pd.DataFrame, found: pd.DataFrame) -> pd.DataFrame:
    """What differs between two tables of the same kind; no row if they agree.

    A row is known by those columns of `KEYS` that both tables have. Returns one row a difference:
    `row` (its keys as text), `column`, `reference` and `found` (as text), `difference` (found -
    reference; NaN where one is not a number) and `tolerance` (NaN for text, which must be equal).
    Empty cells agree with each other, infinities with their like. A missing or new row has the
    column "(row)"; a missing or new column has the row "(column)". Rows with the same keys are told
    apart by their order. Raises ValueError where the tables have no key.
    """
    left, right = _by_row(reference, found)
    present = [(HEADING, n, *sides) for n, *sides in _presence(reference.columns, found.columns)]
    present += [(n, WHOLE, *sides) for n, *sides in _presence(left.index, right.index)]
    values = _values(left, right)
    values = values.loc[~values["agrees"], list(COLUMNS)]
    return pd.DataFrame([*present, *values.itertuples(index=False)], columns=COLUMNS)


def compare_values(reference: pd.DataFrame, found: pd.DataFrame) -> pd.DataFrame:
    """Every value that both tables have, as in `compare_tables`; with a column `agrees` (bool)."""
    return _values(*_by_row(reference, found))


def describe(difference: pd.Series) -> str:
    """One difference as one line of text."""
    where = f"{difference['row']}, {difference['column']}"
    line = f"{where}: reference {difference['reference']}, found {difference['found']}"
    allowed = difference["tolerance"]
    return line if np.isnan(allowed) else f"{line} (allowed {allowed:.3g})"


def _by_row(*tables: pd.DataFrame) -> list[pd.DataFrame]:
    """Tables as text without their keys, which name the rows."""
    first = tables[0].columns
    keys = [name for name in first if name in KEYS and all(name in t.columns for t in tables)]
    if not keys:
        raise ValueError(f"no column says what a row is about: {', '.join(first)}")
    named = []
    for table in tables:
        text = table.astype(object).where(table.notna(), "").astype(str)
        names = [", ".join(parts) for parts in zip(*(_key(text[key]) for key in keys), strict=True)]
        rest = text.drop(columns=[*keys, MEASURED], errors="ignore")
        named.append(rest.set_axis(_numbered(names)))
    return named


def _numbered(names: Sequence[str]) -> list[str]:
    """Names of which those that come again, as of points along a branch, tell which they are."""
    seen: Counter[str] = Counter()
    numbered = []
    for name in names:
        seen[name] += 1
        numbered.append(f"{name}, row {seen[name]}" if seen[name] > 1 else name)
    return numbered


def _key(column: pd.Series) -> Iterator[str]:
    """The keys of a column as text: 5, 5.0 and "5" are the same key."""
    for text in column:
        try:
            yield f"{column.name}={float(text):.12g}"
        except ValueError:
            yield f"{column.name}={text}"


def _presence(reference: pd.Index, found: pd.Index) -> Iterator[tuple]:
    for name in reference.difference(found, sort=False):
        yield name, "present", "absent", np.nan, np.nan
    for name in found.difference(reference, sort=False):
        yield name, "absent", "present", np.nan, np.nan


def _values(left: pd.DataFrame, right: pd.DataFrame) -> pd.DataFrame:
    """All values of rows and columns that both tables have, column by column."""
    rows = left.index[left.index.isin(right.index)]
    names = [name for name in left.columns if name in right.columns]
    values = left.loc[rows, names].melt(
        var_name="column", value_name="reference", ignore_index=False
    )
    values = values.rename_axis("row").reset_index().astype(object)
    values["found"] = right.loc[rows, names].to_numpy().ravel(order="F")
    first, second = (
        pd.to_numeric(values[side], errors="coerce").to_numpy(float)
        for side in ("reference", "found")
    )
    numbers = ~np.isnan(first) & ~np.isnan(second)
    with np.errstate(invalid="ignore"):  # infinity less infinity
        difference = np.where(first == second, 0.0, second - first)
    size = np.where(np.isinf(first), 0.0, np.abs(first))  # only infinity agrees with infinity
    tolerance = np.maximum(ABSOLUTE_TOLERANCE, RELATIVE_TOLERANCE * size)
    equal = (values["reference"] == values["found"]).to_numpy(bool)
    return values.assign(
        difference=np.where(numbers, difference, np.nan),
        tolerance=np.where(numbers, tolerance, np.nan),
        agrees=np.where(numbers, np.abs(difference) <= tolerance, equal),
    )
