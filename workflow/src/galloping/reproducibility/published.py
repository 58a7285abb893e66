"""A run's numbers beside the published ones: what agrees, what differs, and whether it should."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping

import numpy as np
import pandas as pd

from galloping.reproducibility.comparison import COLUMNS, WHOLE, compare_tables, compare_values

SETTINGS = "settings"  # the name under which settings stand among the tables

AGREES = "agrees"
DIFFERS = "differs"
EXPECTED = "settings differ: numbers are expected to differ"
UNPUBLISHED = "no reference"

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


def compare_study(
    reference: Mapping[str, pd.DataFrame],
    reference_settings: Mapping[str, object] | None,
    tables: Mapping[str, pd.DataFrame],
    settings: Mapping[str, object],
) -> tuple[list[dict], list[dict]]:
    """(summary, differences) of a study's tables and the published ones, by name of the table.

    settings: those on which numbers depend. reference_settings: the same of the published study,
    or None if nothing is published.
    summary: one row for the settings and one a table, with `SUMMARY_COLUMNS`.
    differences: one row a difference beyond its tolerance, with `DIFFERENCE_COLUMNS`.
    """
    if reference_settings is None:
        return [_summary(name, UNPUBLISHED) for name in (SETTINGS, *tables)], []
    published, present = (dict(flat(each)) for each in (reference_settings, settings))
    differences = list(_settings(published, present))
    differing = len(differences)
    shared = published.keys() & present.keys()
    summary = [
        _summary(
            SETTINGS,
            DIFFERS if differing else AGREES,
            rows_compared=len(shared),
            rows_only_in_reference=len(published.keys() - shared),
            rows_only_in_this_run=len(present.keys() - shared),
            values_compared=len(shared),
            values_beyond_tolerance=sum(published[key] != present[key] for key in shared),
        )
    ]
    for name, table in tables.items():
        if name not in reference:
            summary.append(_summary(name, UNPUBLISHED))
            continue
        try:
            found, row = _table(name, reference[name], table)
        except ValueError as error:  # columns that are new or gone
            found, row = [], _summary(name, f"cannot be compared: {error}")
        if found and differing:
            row["verdict"] = EXPECTED
        summary.append(row)
        differences += found
    return summary, differences


def flat(settings: Mapping[str, object], path: str = "") -> Iterator[tuple[str, str]]:
    """(dotted key, value as JSON); an empty section is a value."""
    for key, value in settings.items():
        if isinstance(value, Mapping) and value:
            yield from flat(value, f"{path}{key}.")
        else:
            yield f"{path}{key}", json.dumps(value)


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


def _settings(published: Mapping[str, str], present: Mapping[str, str]) -> Iterator[dict]:
    for key in [*published, *(key for key in present if key not in published)]:
        was, now = (each.get(key, "absent") for each in (published, present))
        if was != now:
            yield _difference(SETTINGS, key, "value", was, now, np.nan, np.nan)


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
