"""Tables 1 and 2: the parameters of each case with unit and provenance."""

from __future__ import annotations

from dataclasses import asdict, fields

import pandas as pd

from galloping.configuration.load import load, plain
from galloping.configuration.parameters import (
    ParameterRow,
    conductor_parameters,
    spacer_parameters,
)
from galloping.physics import ice_coefficients


def conductor(settings: dict) -> pd.DataFrame:
    """Table 1, with the aerodynamic coefficients that the reading stands for.

    settings: cases, as in the configuration.
    """
    study = load({"cases": settings["cases"]})
    rows = conductor_parameters(study)
    for name, case in study.cases.items():
        rows += _aerodynamic(name, plain(case.ice))
    order = list(study.cases)
    rows = sorted(rows, key=lambda row: order.index(row.case))
    return _table(rows)


def spacers(settings: dict) -> pd.DataFrame:
    """Table 2."""
    return _table(spacer_parameters(load({"cases": settings["cases"]})))


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
        for (symbol, direction), values in zip(
            names, ice_coefficients.coefficients(ice), strict=True
        )
        for i, value in enumerate(values, start=1)
    ]
