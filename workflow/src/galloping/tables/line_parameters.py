"""Tables 1 and 2: the parameters of each case with unit and provenance."""

from dataclasses import asdict, fields, replace
from importlib.resources import files

import numpy as np
import pandas as pd

from galloping.configuration.load import load, plain
from galloping.configuration.parameters import (
    ParameterRow,
    conductor_parameters,
    spacer_parameters,
)
from galloping.physics.galerkin import ice_coefficients


def conductor(settings: dict, region: pd.DataFrame | None = None) -> pd.DataFrame:
    """Table 1, with the aerodynamic coefficients that the reading stands for.

    settings: cases, as in the configuration. region: paper_region.csv, what was inferred from the
    paper's printed numbers: a value in its interval there is `inferred`, and the interval noted.
    """
    study = load({"cases": settings["cases"]})
    rows = conductor_parameters(study)
    for name, case in study.cases.items():
        rows += _aerodynamic(name, plain(case.ice))
    if region is not None:
        rows = [_inferred(row, region) for row in rows]
    order = list(study.cases)
    rows = sorted(rows, key=lambda row: order.index(row.case))
    return _table(rows)


def spacers(settings: dict) -> pd.DataFrame:
    """Table 2."""
    return _table(spacer_parameters(load({"cases": settings["cases"]})))


def readings(settings: dict) -> pd.DataFrame:
    """How the damaged text of the paper is read: what it prints, what stands for it, and why."""
    with files("galloping.paper").joinpath("readings.csv").open(encoding="utf-8") as file:
        return pd.read_csv(file, keep_default_na=False)


def _inferred(row: ParameterRow, region: pd.DataFrame) -> ParameterRow:
    found = region[(region["key"] == row.key) & region["best"].notna()]
    if found.empty or not found.iloc[0]["low"] <= _number(row.value) <= found.iloc[0]["high"]:
        return row
    low, high = found.iloc[0][["low", "high"]]
    note = f"from the paper's printed numbers (make paper): {low:.3g} to {high:.3g}"
    return replace(row, provenance="inferred", note=note)


def _number(value: float | str) -> float:
    return np.nan if isinstance(value, str) else float(value)


def _table(rows: list[ParameterRow]) -> pd.DataFrame:
    names = [field.name for field in fields(ParameterRow)]
    return pd.DataFrame(list(map(asdict, rows)), columns=names, dtype=object)


def _aerodynamic(case: str, ice: dict) -> list[ParameterRow]:
    if ice["reading"] == "custom":
        return []  # configured one by one, and listed as such
    names = zip(("beta", "eta"), ("vertical", "horizontal"), strict=True)
    return [
        ParameterRow(
            case=case,
            key=f"ice.{direction}",
            symbol=f"{symbol}_{i}",
            value=value,
            unit="1",
            provenance="derived",
            note=f"printed digits, reading {ice['reading']}",
        )
        for (symbol, direction), values in zip(names, ice_coefficients(ice), strict=True)
        for i, value in enumerate(values, start=1)
    ]
