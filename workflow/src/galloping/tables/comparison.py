"""Numbers of two runs of the study, compared within stated tolerances.

Two machines agree to rounding, not to the byte, so that tables are compared row by row: a row is
found by what it is about (its case, method, level and so on), wherever it stands.
"""

import json
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path

import numpy as np
import pandas as pd

# Two numbers agree if they differ by no more than the larger of the two tolerances.
RELATIVE_TOLERANCE = 1e-3
ABSOLUTE_TOLERANCE = 1e-6  # in the column's own unit

# Columns that say what a row is about; all others are results.
KEYS = frozenset((
    "case", "claim", "quantity", "key", "symbol", "equation", "term", "release", "line", "truth",
    "sensors", "path", "table", "column", "reading", "recordings", "protocol", "cell", "level",
    "points", "method", "setting", "group", "system", "samples", "replicate", "order", "state",
    "x", "y", "wind_m_s", "direction", "what", "measure",
))  # fmt: skip
MEASURED = "seconds_median"  # of the processor, which no two runs share
COLUMNS = ("row", "column", "reference", "found", "difference", "tolerance")
WHOLE = "(row)"  # stands for a column where a row is missing or new
HEADING = "(column)"  # stands for a row where a column is missing or new
SHOWN = 10  # differences of one table that are told one by one
OF_REFERENCE = ("reference_summary", "reference_differences")  # about other numbers than the run's


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


def flat(section: Mapping[str, object], path: str = "") -> Iterator[tuple[str, str]]:
    """(dotted key, value as JSON) of settings; an empty section is a value."""
    for key, value in section.items():
        if isinstance(value, Mapping) and value:
            yield from flat(value, f"{path}{key}.")
        else:
            yield f"{path}{key}", json.dumps(value)


def tables(results: Path) -> dict[str, Path]:
    """The tables of a study that do not tell of other studies, by name."""
    present = (results / "tables").glob("*.csv")
    return {f"tables/{path.name}": path for path in present if path.stem not in OF_REFERENCE}


def table_differences(
    published: Path, results: str, only: Collection[str] | None = None
) -> Iterator[str]:
    """One line for each number or text in which published tables and those of a run differ.

    published: the results folder of an unpacked archive. results: that of the run. only: of these
    files of the run; by default all tables of both.
    """
    there, here = tables(published), tables(Path(results))
    for name in sorted(there.keys() | here.keys()):
        if only is not None and f"{results}/{name}" not in only:
            continue
        if name not in here:
            yield f"{name}: not in {results}"
        elif name not in there:
            yield f"{name}: not in the archive"
        else:
            yield from (f"{name}: {line}" for line in _differences(there[name], here[name]))


def _differences(*files: Path) -> Iterator[str]:
    try:
        rows = compare_tables(*(pd.read_csv(f, dtype=str, keep_default_na=False) for f in files))
    except ValueError as error:
        yield " ".join(str(error).split())
        return
    yield from (describe(row) for _, row in rows.head(SHOWN).iterrows())
    if len(rows) > SHOWN:
        yield f"{len(rows) - SHOWN} more differences"


def _by_row(*tables: pd.DataFrame) -> Iterator[pd.DataFrame]:
    """Tables as text without their keys, which name the rows."""
    first = tables[0].columns
    keys = [name for name in first if name in KEYS and all(name in t.columns for t in tables)]
    if not keys:
        raise ValueError(f"no column says what a row is about: {', '.join(first)}")
    for table in tables:
        text = table.astype(object).where(table.notna(), "").astype(str)
        names = text[keys].apply(_key).agg(", ".join, axis=1) if len(text) else text[keys[0]]
        again = names.groupby(names).cumcount() + 1  # such as points along a branch
        names = names.where(again == 1, names + ", row " + again.astype(str))
        yield text.drop(columns=[*keys, MEASURED], errors="ignore").set_axis(names)


def _key(column: pd.Series) -> pd.Series:
    """The keys of a column as text: 5, 5.0 and "5" are the same key."""
    numbers = pd.to_numeric(column, errors="coerce")
    text = column.where(numbers.isna(), numbers.map("{:.12g}".format))
    return f"{column.name}=" + text


def _presence(reference: pd.Index, found: pd.Index) -> Iterator[tuple]:
    for name in reference.difference(found, sort=False):
        yield name, "present", "absent", np.nan, np.nan
    for name in found.difference(reference, sort=False):
        yield name, "absent", "present", np.nan, np.nan


def _values(*sides: pd.DataFrame) -> pd.DataFrame:
    """All values of rows and columns that both tables have, column by column."""
    # not "value", which is a column of some tables
    left, right = (
        side.rename_axis("row").reset_index().melt("row", var_name="column", value_name=name)
        for side, name in zip(sides, ("reference", "found"), strict=True)
    )
    values = left.merge(right, on=["row", "column"])
    first, second = (
        pd.to_numeric(values[side], errors="coerce").to_numpy(float)
        for side in ("reference", "found")
    )
    numbers = ~np.isnan(first) & ~np.isnan(second)
    with np.errstate(invalid="ignore"):  # infinity less infinity
        difference = np.where(first == second, 0.0, second - first)
    size = np.where(np.isinf(first), 0.0, np.abs(first))  # only infinity agrees with infinity
    tolerance = np.maximum(ABSOLUTE_TOLERANCE, RELATIVE_TOLERANCE * size)
    close = np.isclose(second, first, RELATIVE_TOLERANCE, 0) | np.isclose(
        second, first, 0, ABSOLUTE_TOLERANCE
    )
    return values.assign(
        difference=np.where(numbers, difference, np.nan),
        tolerance=np.where(numbers, tolerance, np.nan),
        agrees=np.where(numbers, close, values["reference"] == values["found"]),
    )
