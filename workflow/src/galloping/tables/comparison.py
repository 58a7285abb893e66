"""Comparison of the numbers of two runs of the study within stated tolerances.

Two machines agree to rounding, not to the byte, so that tables are compared row by row: a row is
identified by its keys (its case, method, level and so on), at any place.
"""

import json
import platform
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from llvmlite.binding import get_host_cpu_name
from threadpoolctl import threadpool_info

from galloping.storage import read_json

# Two numbers agree if their difference is within the larger of the two tolerances.
RELATIVE_TOLERANCE = 1e-3
ABSOLUTE_TOLERANCE = 1e-6  # unit of the column

# columns that identify a row; all others are results
KEYS = frozenset((
    "case", "claim", "quantity", "key", "symbol", "equation", "term", "initial_displacement",
    "line", "truth", "sensors", "path", "table", "column", "reading", "recordings", "protocol",
    "cell", "level", "points", "method", "setting", "group", "system", "samples", "replicate",
    "order", "state", "x", "y", "wind_m_s", "direction", "orbit", "place", "measure", "stratum",
    "recording", "other",
))  # fmt: skip
TIME_COLUMNS = ("seconds", "seconds_median")  # processor times, which differ between runs
COLUMNS = ("row", "column", "reference", "this_run", "difference", "tolerance")
WHOLE_ROW = "(row)"  # name of the column if a whole row is missing or new
WHOLE_COLUMN = "(column)"  # name of the row if a whole column is missing or new
MAX_LISTED = 10  # listed differences of one table
REFERENCE_TABLES = ("reference_summary", "reference_differences")  # tables of this comparison


def compare_tables(reference: pd.DataFrame, table: pd.DataFrame) -> pd.DataFrame:
    """Compare two tables and return a row for each difference beyond the tolerances.

    The tables are of the same kind. A row is identified by those columns of `KEYS` that both tables
    have. Returns one row per difference: `row` (its keys as text), `column`, `reference` and
    `this_run` (as text), `difference` (this_run - reference; NaN if one is not a number) and
    `tolerance` (NaN for text, which must be equal). Empty cells agree with each other, infinities
    with infinities of the same sign. A missing or new row has the column "(row)"; a missing or new
    column has the row "(column)". Rows with the same keys are distinguished by their order. Raises
    ValueError if the tables have no key.
    """
    return _compare_values(reference, table)[0]


def _compare_values(
    reference: pd.DataFrame, table: pd.DataFrame
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Return the differences, and every common value, with a column `agrees` (bool)."""
    reference_rows, table_rows = _index_by_keys(reference, table)
    present = [
        (WHOLE_COLUMN, n, *sides)
        for n, *sides in _compare_presence(reference.columns, table.columns)
    ]
    present += [
        (n, WHOLE_ROW, *sides)
        for n, *sides in _compare_presence(reference_rows.index, table_rows.index)
    ]
    values = _merge_values(reference_rows, table_rows)
    apart = values.loc[~values["agrees"], list(COLUMNS)]
    return pd.DataFrame([*present, *apart.itertuples(index=False)], columns=COLUMNS), values


def describe(difference: pd.Series) -> str:
    """Format one difference between two tables as a line of text."""
    where = f"{difference['row']}, {difference['column']}"
    line = f"{where}: reference {difference['reference']}, found {difference['this_run']}"
    allowed = difference["tolerance"]
    return line if np.isnan(allowed) else f"{line} (allowed {allowed:.3g})"


def flatten(section: Mapping[str, object], path: str = "") -> Iterator[tuple[str, str]]:
    """Yield flattened settings as pairs of a dotted key and its value in JSON.

    An empty section is a value.
    """
    for key, value in section.items():
        if isinstance(value, Mapping) and value:
            yield from flatten(value, f"{path}{key}.")
        else:
            yield f"{path}{key}", json.dumps(value)


def list_tables(results: Path) -> dict[str, Path]:
    """Map the names of a study's tables to their files, except comparisons with a reference."""
    present = (results / "tables").glob("*.csv")
    return {f"tables/{path.name}": path for path in present if path.stem not in REFERENCE_TABLES}


def list_differences(
    published: Path, results: str, only: Collection[str] | None = None
) -> Iterator[str]:
    """Yield a line of text for each difference between published tables and those of a run.

    published: the results folder of an unpacked archive. results: that of the run. only: files of
    the run that are compared, by default all tables of both.
    """
    there, here = list_tables(published), list_tables(Path(results))
    for name in sorted(there.keys() | here.keys()):
        if only is not None and f"{results}/{name}" not in only:
            continue
        if name not in here:
            yield f"{name}: not in {results}"
        elif name not in there:
            yield f"{name}: not in the archive"
        else:
            yield from (
                f"{name}: {line}" for line in _describe_differences(there[name], here[name])
            )


def _describe_differences(*files: Path) -> Iterator[str]:
    try:
        rows = compare_tables(*(pd.read_csv(f, dtype=str, keep_default_na=False) for f in files))
    except ValueError as error:
        yield " ".join(str(error).split())
        return
    yield from (describe(row) for _, row in rows.head(MAX_LISTED).iterrows())
    if len(rows) > MAX_LISTED:
        yield f"{len(rows) - MAX_LISTED} more differences"


def _index_by_keys(*tables: pd.DataFrame) -> Iterator[pd.DataFrame]:
    """Yield tables as text without their keys, which name the rows."""
    first = tables[0].columns
    keys = [name for name in first if name in KEYS and all(name in t.columns for t in tables)]
    if not keys:
        raise ValueError(f"no column says what a row is about: {', '.join(first)}")
    for table in tables:
        text = table.astype(object).where(table.notna(), "").astype(str)
        names = (
            text[keys].apply(_key_as_text).agg(", ".join, axis=1) if len(text) else text[keys[0]]
        )
        number = names.groupby(names).cumcount() + 1  # > 1 for points along a branch
        names = names.where(number == 1, names + ", row " + number.astype(str))
        yield text.drop(columns=[*keys, *TIME_COLUMNS], errors="ignore").set_axis(names)


def _key_as_text(column: pd.Series) -> pd.Series:
    """Convert the keys of a column to text: 5, 5.0 and "5" are the same key."""
    numbers = pd.to_numeric(column, errors="coerce")
    text = column.where(numbers.isna(), numbers.map("{:.12g}".format))
    return f"{column.name}=" + text


def _compare_presence(reference: pd.Index, names: pd.Index) -> Iterator[tuple]:
    for name in reference.difference(names, sort=False):
        yield name, "present", "absent", np.nan, np.nan
    for name in names.difference(reference, sort=False):
        yield name, "absent", "present", np.nan, np.nan


def _merge_values(*sides: pd.DataFrame) -> pd.DataFrame:
    """Merge all values of rows and columns that both tables have, column by column."""
    long = [side.rename_axis(index="row", columns="column").unstack() for side in sides]
    keys = ("reference", "this_run")
    values = pd.concat(long, axis=1, join="inner", keys=keys).reset_index()
    first, second = (pd.to_numeric(values[key], errors="coerce").to_numpy(float) for key in keys)
    numbers = ~np.isnan(first) & ~np.isnan(second)
    with np.errstate(invalid="ignore"):  # infinity less infinity
        difference = np.where(first == second, 0.0, second - first)
    size = np.where(np.isinf(first), 0.0, np.abs(first))  # only infinity agrees with infinity
    tolerance = np.maximum(ABSOLUTE_TOLERANCE, RELATIVE_TOLERANCE * size)
    return values.assign(
        difference=np.where(numbers, difference, np.nan),
        tolerance=np.where(numbers, tolerance, np.nan),
        agrees=np.where(
            numbers, np.abs(difference) <= tolerance, values["reference"] == values["this_run"]
        ),
    )


SETTINGS, PROCESSOR = "settings", "processor"  # rows of the summary other than tables

AGREES = "agrees"
DIFFERS = "differs"
NO_REFERENCE = "no reference"
# reasons for differences of a table, if settings or processors differ
REASONS = {
    SETTINGS: "settings differ: numbers are expected to differ",
    PROCESSOR: "processors differ: numbers may differ where the data fit several models",
}

DIFFERENCE_COLUMNS = ("table", *COLUMNS, "verdict")
SUMMARY_COLUMNS = (
    "table", "rows_compared", "rows_only_in_reference", "rows_only_in_this_run", "values_compared",
    "values_beyond_tolerance", "largest_difference_in_tolerances", "largest_difference_at",
    "verdict",
)  # fmt: skip


@dataclass(frozen=True)
class Origin:
    """Provenance of a study's numbers: settings, processor and computing time.

    settings: those on which the numbers depend. core_minutes: processor time of the jobs, if known.
    """

    settings: dict
    processor: str
    core_minutes: float | None = None


def read_origin(path: str) -> Origin:
    """Read the provenance (settings, processor) of the committed reference results.

    Raises ValueError for a file of another kind.
    """
    try:
        return Origin(**read_json(path))
    except (ValueError, TypeError):
        raise ValueError(
            f"{path}: does not say how the reference was made; restore or remove it"
        ) from None


def describe_processor() -> str:
    """Describe the processor, on which rounding in compiled code and linear algebra depends."""
    kernels = {pool["architecture"] for pool in threadpool_info() if "architecture" in pool}
    return ", ".join([platform.system(), platform.machine(), get_host_cpu_name(), *sorted(kernels)])


def compare_study(
    reference: Mapping[str, pd.DataFrame],
    made: Origin | None,
    tables: Mapping[str, pd.DataFrame],
    present: Origin,
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Compare all tables of a study with reference tables: a summary, and all differences.

    made, present: provenance of the reference and of this study; None without a reference. summary:
    one row each for settings, processor and the tables, with `SUMMARY_COLUMNS`. differences: one
    row for each beyond its tolerance, with `DIFFERENCE_COLUMNS`.
    """
    parts: dict[str, pd.DataFrame] = {}
    counts: dict[str, dict[str, object]] = {
        name: {"verdict": NO_REFERENCE} for name in (SETTINGS, PROCESSOR, *tables)
    }
    if made is not None:
        for name in REASONS:
            sides = (each.settings if name == SETTINGS else {"name": each.processor}
                     for each in (made, present))  # fmt: skip
            parts[name], counts[name] = _compare_origins(*(dict(flatten(side)) for side in sides))
        reason = next((why for name, why in REASONS.items() if len(parts[name])), DIFFERS)
        for name in tables.keys() & reference.keys():
            try:
                parts[name], counts[name] = _compare_table(reference[name], tables[name], reason)
            except ValueError as error:  # no column names the rows
                counts[name] = {"verdict": f"cannot be compared: {error}"}
    summary = pd.DataFrame([{"table": name, **each} for name, each in counts.items()])
    found = [parts[name].assign(table=name) for name in counts if len(parts.get(name, ()))]
    differences = pd.concat(found, ignore_index=True) if found else pd.DataFrame(columns=COLUMNS)
    kind = np.where(differences["tolerance"].isna(), "not the same", "beyond tolerance")
    kind = np.where(differences["reference"] == "absent", "only in this run", kind)
    kind = np.where(differences["this_run"] == "absent", "only in the reference", kind)
    return (
        summary.reindex(columns=SUMMARY_COLUMNS),
        differences.assign(verdict=kind).reindex(columns=DIFFERENCE_COLUMNS),
    )


def _compare_origins(
    old: Mapping[str, str], present: Mapping[str, str]
) -> tuple[pd.DataFrame, dict[str, object]]:
    sides = pd.DataFrame({"reference": old, "this_run": present}, dtype=object).fillna("absent")
    keys = dict.fromkeys([*old, *present])
    sides = sides.loc[list(keys)].rename_axis("row").reset_index()
    differences = sides[sides["reference"] != sides["this_run"]]
    absent = {side: int((sides[side] == "absent").sum()) for side in ("reference", "this_run")}
    shared = len(keys) - sum(absent.values())
    return differences.assign(column="value", difference=np.nan, tolerance=np.nan), {
        "rows_compared": shared,
        "rows_only_in_reference": absent["this_run"],
        "rows_only_in_this_run": absent["reference"],
        "values_compared": shared,
        "values_beyond_tolerance": len(differences) - sum(absent.values()),
        "verdict": DIFFERS if len(differences) else AGREES,
    }


def _compare_table(
    reference: pd.DataFrame, table: pd.DataFrame, reason: str
) -> tuple[pd.DataFrame, dict[str, object]]:
    """Compare one table: differences and their summary. reason: why it may differ."""
    differences, values = _compare_values(reference, table)
    rows = differences[differences["column"] == WHOLE_ROW]
    columns = differences[differences["row"] == WHOLE_COLUMN]
    if len(columns):
        reason = f"columns differ: {', '.join(columns['column'])}"
    parts = (values["difference"].abs() / values["tolerance"]).fillna(0)
    largest = values.loc[parts.idxmax()] if parts.any() else None
    return differences, {
        "rows_compared": values["row"].nunique(),
        "rows_only_in_reference": int((rows["this_run"] == "absent").sum()),
        "rows_only_in_this_run": int((rows["reference"] == "absent").sum()),
        "values_compared": len(values),
        "values_beyond_tolerance": len(differences) - len(rows) - len(columns),
        "largest_difference_in_tolerances": parts.max() if len(parts) else 0.0,
        "largest_difference_at": None if largest is None
        else f"{largest['row']}, {largest['column']}",
        "verdict": reason if len(differences) else AGREES,
    }  # fmt: skip
