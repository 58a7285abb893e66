"""The tables that come out of a user's recordings."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from galloping.field.forecast import Forecast
from galloping.field.units import NONE, coefficient_unit
from galloping.identification.model import IdentifiedModel
from galloping.intervals import NORMAL_95
from galloping.polynomial import term_name
from galloping.storage import write_json

MODEL_COLUMNS = {  # with the unit of each
    "equation": "", "term": "", "coefficient": "of the row", "unit": "",
    "standard_error": "of the row", "low": "of the row", "high": "of the row", "verdict": "",
}  # fmt: skip


def model_rows(identified: IdentifiedModel, units: Mapping[str, str] = NONE) -> list[dict]:
    """Rows of model.csv: one for each present term, and each absent one with a limit.

    An equation is named by the state whose derivative it gives, a term as pysindy names it. units:
    of inputs, by name.
    """
    model, rows = identified.model, []
    inputs = {name: units.get(name, "") for name in model.inputs}
    for i, state in enumerate(model.states):
        for j, term in enumerate(model.terms):
            value, error = model.coefficients[i, j], identified.standard_errors[i, j]
            limit = identified.detection_limits[i, j]
            present = np.isfinite(value) and value != 0
            if not present and not np.isfinite(limit):
                continue
            known = i in identified.known
            half = NORMAL_95 * error if present else limit
            rows.append(
                {
                    "equation": state,
                    "term": term_name(term, model.names),
                    "coefficient": float(value),
                    "unit": coefficient_unit(state, term, model.names, inputs),
                    "standard_error": float(error) if present else np.nan,
                    "low": float(value - half),
                    "high": float(value + half),
                    "verdict": "known" if known else "present" if present else "absent",
                }
            )
    return rows


def forecast_rows(predicted: Forecast) -> list[dict]:
    """Rows of forecast.csv: time and, for each channel, median and 90 % band."""
    rows = []
    for k, time in enumerate(predicted.time):
        row = {"time_s": float(time)}
        for i, name in enumerate(predicted.names):
            row[name] = float(predicted.median[k, i])
            row[f"{name}_low"] = float(predicted.low[k, i])
            row[f"{name}_high"] = float(predicted.high[k, i])
        rows.append(row)
    return rows


def describe_tables(folder: Path, tables: dict[str, dict[str, str]]) -> None:
    """Write the Frictionless `datapackage.json` of a folder.

    tables: for each CSV file its columns with their units.
    """
    resources = [
        {
            "name": Path(file).stem,
            "path": file,
            "schema": {
                "fields": [
                    {"name": name, **({"unit": unit} if unit else {})}
                    for name, unit in columns.items()
                ]
            },
        }
        for file, columns in tables.items()
    ]
    write_json(folder / "datapackage.json", {"name": "galloping", "resources": resources})
