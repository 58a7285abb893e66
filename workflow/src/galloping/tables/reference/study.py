"""A run's numbers beside the reference: what agrees, what differs, and whether it should."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd

from galloping.storage import read_json
from galloping.tables.reference.comparison import COLUMNS, WHOLE, compare_tables, compare_values

# What stands among the tables by these names: what the numbers were made with.
SETTINGS, PROCESSOR = "settings", "processor"

AGREES = "agrees"
DIFFERS = "differs"
NO_REFERENCE = "no reference"
# Why a table may differ, by what else does.
REASONS = {
    SETTINGS: "settings differ: numbers are expected to differ",
    PROCESSOR: "processors differ: so may numbers where the data cannot tell models apart",
}

# Of `differences`; the last says of what kind a difference is.
DIFFERENCE_COLUMNS = ("table", *COLUMNS, "verdict")
SUMMARY_COLUMNS = (
    "table",
    "rows_compared",
    "rows_only_in_reference",
    "rows_only_in_this_run",
    "values_compared",
    "values_beyond_tolerance",
    "largest_difference_in_tolerances",
    "largest_difference_at",
    "verdict",
)


@dataclass(frozen=True)
class Origin:
    """What numbers were made with. settings: those on which they depend."""

    settings: dict
    processor: str


def read_origin(path: str) -> Origin:
    """Reads what a reference was made with. Raises ValueError for a file of another kind."""
    try:
        return Origin(**read_json(path))
    except (ValueError, TypeError):
        raise ValueError(
            f"{path}: does not say how the reference was made; restore or remove it"
        ) from None


def compare_study(
    reference: Mapping[str, pd.DataFrame],
    made: Origin | None,
    tables: Mapping[str, pd.DataFrame],
    present: Origin,
) -> tuple[list[dict], list[dict]]:
    """(summary, differences) of a study's tables and those of the reference, by name.

    made, present: what the reference and this study were made with; None without a reference.
    summary: one row each for settings, processor and the tables, with `SUMMARY_COLUMNS`.
    differences: one row a difference beyond its tolerance, with `DIFFERENCE_COLUMNS`.
    """
    if made is None:
        return [_summary(name, NO_REFERENCE) for name in (SETTINGS, PROCESSOR, *tables)], []
    settings, first = _origin(SETTINGS, made.settings, present.settings)
    processor, second = _origin(PROCESSOR, {"name": made.processor}, {"name": present.processor})
    differences, summary = [*settings, *processor], [first, second]
    reason = REASONS[differences[0]["table"]] if differences else DIFFERS
    for name, table in tables.items():
        found, row = [], _summary(name, NO_REFERENCE)
        if name in reference:
            try:
                found, row = _table(name, reference[name], table)
            except ValueError as error:  # columns that are new or gone
                row = _summary(name, f"cannot be compared: {error}")
        if found:
            row["verdict"] = reason
        summary.append(row)
        differences += found
    return summary, differences


def _origin(name: str, *origins: Mapping[str, object]) -> tuple[list[dict], dict]:
    """The differences in what two studies were made with, and their row of the summary."""
    made, present = (dict(flat(origin)) for origin in origins)
    keys = dict.fromkeys([*made, *present])
    sides = {key: (made.get(key, "absent"), present.get(key, "absent")) for key in keys}
    differences = [
        _difference(name, key, "value", was, now, np.nan, np.nan)
        for key, (was, now) in sides.items()
        if was != now
    ]
    shared = made.keys() & present.keys()
    return differences, _summary(
        name,
        DIFFERS if differences else AGREES,
        rows_compared=len(shared),
        rows_only_in_reference=len(made.keys() - shared),
        rows_only_in_this_run=len(present.keys() - shared),
        values_compared=len(shared),
        values_beyond_tolerance=sum(made[key] != present[key] for key in shared),
    )


def _table(name: str, reference: pd.DataFrame, table: pd.DataFrame) -> tuple[list[dict], dict]:
    """The differences in one table, and its row of the summary."""
    found = compare_tables(reference, table)
    values = compare_values(reference, table)
    whole = found["column"] == WHOLE
    parts = (values["difference"].abs() / values["tolerance"]).fillna(0)
    row = _summary(
        name,
        DIFFERS if len(found) else AGREES,
        rows_compared=values["row"].nunique(),
        rows_only_in_reference=int((whole & (found["found"] == "absent")).sum()),
        rows_only_in_this_run=int((whole & (found["reference"] == "absent")).sum()),
        values_compared=len(values),
        values_beyond_tolerance=int((~whole).sum()),
    )
    row["largest_difference_in_tolerances"] = float(parts.max()) if len(parts) else 0.0
    if parts.any():
        where = values.loc[parts.idxmax()]
        row["largest_difference_at"] = f"{where['row']}, {where['column']}"
    return [_difference(name, *each) for each in found.itertuples(index=False)], row


def flat(section: Mapping[str, object], path: str = "") -> Iterator[tuple[str, str]]:
    """(dotted key, value as JSON); an empty section is a value."""
    for key, value in section.items():
        if isinstance(value, Mapping) and value:
            yield from flat(value, f"{path}{key}.")
        else:
            yield f"{path}{key}", json.dumps(value)


def _difference(table: str, *values: object) -> dict:
    row = dict(zip(COLUMNS, values, strict=True))
    if row["found"] == "absent":
        verdict = "only in the reference"
    elif row["reference"] == "absent":
        verdict = "only in this run"
    elif np.isnan(row["tolerance"]):
        verdict = "not the same"
    else:
        verdict = "beyond tolerance"
    return {"table": table, **row, "verdict": verdict}


def _summary(table: str, verdict: str, **counts: int) -> dict:
    row = {"table": table, **counts, "verdict": verdict}
    return {column: row.get(column, "") for column in SUMMARY_COLUMNS}
