"""Tables 1 and 2: the parameters of each case with unit and provenance."""

from __future__ import annotations

from dataclasses import asdict

from galloping.physics import aerodynamics
from galloping.configuration.load import load, plain
from galloping.configuration.parameters import (
    Parameter,
    conductor_parameters,
    spacer_parameters,
)


def conductor(cases: dict) -> list[dict]:
    """Table 1, with the aerodynamic coefficients that the reading stands for."""
    settings = load({"cases": cases})
    rows = conductor_parameters(settings)
    for name, case in settings.cases.items():
        rows += _aerodynamic(name, plain(case.ice))
    order = list(settings.cases)
    rows = sorted(rows, key=lambda row: order.index(row.case))
    return list(map(asdict, rows))


def spacers(cases: dict) -> list[dict]:
    """Table 2."""
    return list(map(asdict, spacer_parameters(load({"cases": cases}))))


def _aerodynamic(case: str, ice: dict) -> list[Parameter]:
    if ice["reading"] == "custom":
        return []  # configured one by one, and listed as such
    names = zip(("beta", "eta"), ("vertical", "horizontal"), strict=True)
    return [
        Parameter(
            case=case,
            key=f"ice.{direction}",
            symbol=f"{symbol}_{i}",
            value=value,
            unit="1",
            provenance="derived",
            note=f"printed digits, reading {ice['reading']}",
        )
        for (symbol, direction), values in zip(names, aerodynamics.coefficients(ice), strict=True)
        for i, value in enumerate(values, start=1)
    ]
