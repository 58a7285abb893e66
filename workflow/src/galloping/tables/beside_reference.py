"""A run's numbers beside the reference: what agrees, what differs, and whether it should."""

import platform
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np  # brings the linear algebra that is asked for its kernels
import pandas as pd
from llvmlite.binding import get_host_cpu_name
from threadpoolctl import threadpool_info

from galloping.storage import read_json
from galloping.tables.comparison import COLUMNS, WHOLE, compare_tables, compare_values, flat

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
    "table", "rows_compared", "rows_only_in_reference", "rows_only_in_this_run", "values_compared",
    "values_beyond_tolerance", "largest_difference_in_tolerances", "largest_difference_at",
    "verdict",
)  # fmt: skip


@dataclass(frozen=True)
class Origin:
    """What numbers were made with. settings: those on which they depend.

    core_minutes: that the jobs took on the processor; none where nobody asks.
    """

    settings: dict
    processor: str
    core_minutes: float | None = None


def read_origin(path: str) -> Origin:
    """Reads what a reference was made with. Raises ValueError for a file of another kind."""
    try:
        return Origin(**read_json(path))
    except (ValueError, TypeError):
        raise ValueError(
            f"{path}: does not say how the reference was made; restore or remove it"
        ) from None


def processor() -> str:
    """What compiled code and linear algebra take this machine for: two kinds round otherwise."""
    kernels = {found["architecture"] for found in threadpool_info() if "architecture" in found}
    return ", ".join([platform.system(), platform.machine(), get_host_cpu_name(), *sorted(kernels)])


def compare_study(
    reference: Mapping[str, pd.DataFrame],
    made: Origin | None,
    tables: Mapping[str, pd.DataFrame],
    present: Origin,
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """(summary, differences) of a study's tables and those of the reference, by name.

    made, present: what the reference and this study were made with; None without a reference.
    summary: one row each for settings, processor and the tables, with `SUMMARY_COLUMNS`.
    differences: one row a difference beyond its tolerance, with `DIFFERENCE_COLUMNS`.
    """
    parts, counts = {}, {name: {"verdict": NO_REFERENCE} for name in (SETTINGS, PROCESSOR, *tables)}
    if made is not None:
        for name in REASONS:
            sides = (each.settings if name == SETTINGS else {"name": each.processor}
                     for each in (made, present))  # fmt: skip
            parts[name], counts[name] = _origins(*(dict(flat(side)) for side in sides))
        reason = next((why for name, why in REASONS.items() if len(parts[name])), DIFFERS)
        for name in tables.keys() & reference.keys():
            try:
                parts[name], counts[name] = _tables(reference[name], tables[name], reason)
            except ValueError as error:  # columns that are new or gone
                counts[name] = {"verdict": f"cannot be compared: {error}"}
    summary = pd.DataFrame([{"table": name, **each} for name, each in counts.items()])
    found = [parts[name].assign(table=name) for name in counts if len(parts.get(name, ()))]
    differences = pd.concat(found, ignore_index=True) if found else pd.DataFrame(columns=COLUMNS)
    kind = np.where(differences["tolerance"].isna(), "not the same", "beyond tolerance")
    kind = np.where(differences["reference"] == "absent", "only in this run", kind)
    kind = np.where(differences["found"] == "absent", "only in the reference", kind)
    return (
        summary.reindex(columns=SUMMARY_COLUMNS),
        differences.assign(verdict=kind).reindex(columns=DIFFERENCE_COLUMNS),
    )


def _origins(
    made: Mapping[str, str], present: Mapping[str, str]
) -> tuple[pd.DataFrame, dict[str, object]]:
    """The differences in what two studies were made with, and their numbers of the summary."""
    sides = pd.DataFrame({"reference": made, "found": present}, dtype=object).fillna("absent")
    keys = dict.fromkeys([*made, *present])
    sides = sides.loc[list(keys)].rename_axis("row").reset_index()
    differences = sides[sides["reference"] != sides["found"]]
    absent = {side: int((sides[side] == "absent").sum()) for side in ("reference", "found")}
    shared = len(keys) - sum(absent.values())
    return differences.assign(column="value", difference=np.nan, tolerance=np.nan), {
        "rows_compared": shared,
        "rows_only_in_reference": absent["found"],
        "rows_only_in_this_run": absent["reference"],
        "values_compared": shared,
        "values_beyond_tolerance": len(differences) - sum(absent.values()),
        "verdict": DIFFERS if len(differences) else AGREES,
    }


def _tables(
    reference: pd.DataFrame, table: pd.DataFrame, reason: str
) -> tuple[pd.DataFrame, dict[str, object]]:
    """The differences in one table, and its numbers of the summary. reason: why it may differ."""
    found, values = compare_tables(reference, table), compare_values(reference, table)
    rows = found[found["column"] == WHOLE]
    parts = (values["difference"].abs() / values["tolerance"]).fillna(0)
    largest = values.loc[parts.idxmax()] if parts.any() else None
    return found, {
        "rows_compared": values["row"].nunique(),
        "rows_only_in_reference": int((rows["found"] == "absent").sum()),
        "rows_only_in_this_run": int((rows["reference"] == "absent").sum()),
        "values_compared": len(values),
        "values_beyond_tolerance": len(found) - len(rows),
        "largest_difference_in_tolerances": parts.max() if len(parts) else 0.0,
        "largest_difference_at": None if largest is None
        else f"{largest['row']}, {largest['column']}",
        "verdict": reason if len(found) else AGREES,
    }  # fmt: skip
