"""Rows of model.csv and forecast.csv, also for output of the command."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from galloping.identification.identified_model import IdentifiedModel
from galloping.model.polynomial import term_name
from galloping.readers.units import coefficient_unit

if TYPE_CHECKING:
    from galloping.behaviour.forecast import Forecast

MODEL_COLUMNS = {  # units by column
    "equation": "", "term": "", "coefficient": "of the row", "unit": "",
    "standard_error": "of the row", "low": "of the row", "high": "of the row", "verdict": "",
}  # fmt: skip


def model_rows(identified: IdentifiedModel, units: Mapping[str, str]) -> list[dict]:
    """Make the rows of model.csv: one for each term with a coefficient or a detection limit.

    An equation is named by the state whose derivative it gives, a term as by pysindy. units: of
    inputs, by name.
    """
    model, rows = identified.model, []
    low, high = identified.confidence_limits()
    inputs = {name: units.get(name, "") for name in model.inputs}
    for i, state in enumerate(model.states):
        for j, term in enumerate(model.terms):
            value, error = model.coefficients[i, j], identified.standard_errors[i, j]
            present = np.isfinite(value) and value != 0
            if not present and not np.isfinite(identified.detection_limits[i, j]):
                continue
            known = i in identified.known
            row = {
                "equation": state,
                "term": term_name(term, model.names),
                "coefficient": float(value),
                "unit": coefficient_unit(state, term, model.names, inputs),
                "standard_error": float(error) if present else np.nan,
                "low": float(low[i, j]),
                "high": float(high[i, j]),
                "verdict": "known" if known else "present" if present else "absent",
            }
            rows.append(row)
    return rows


def forecast_rows(predicted: "Forecast") -> list[dict]:
    """Make the rows of forecast.csv: time, and the median and 90 % band of each channel."""
    columns = {"time_s": predicted.time} | predicted.channel_columns()
    rows = np.column_stack(list(columns.values())).tolist()
    return [dict(zip(columns, row, strict=True)) for row in rows]
