"""Tables 1 and 2: the parameters of each case with unit and source; readings of the paper."""

from collections.abc import Iterator
from functools import reduce
from operator import getitem
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from galloping import paper
from galloping.configuration.load import load, plain
from galloping.configuration.schema import child, leaves, schema
from galloping.configuration.settings import Settings
from galloping.line.galerkin import ice_coefficients
from galloping.paper.agreement import CASE

COLUMNS = ["case", "key", "symbol", "value", "unit", "provenance", "note"]


def conductor(settings: dict, region: pd.DataFrame | None = None) -> pd.DataFrame:
    """Tabulate parameters of each overhead line without its spacers, with units and sources.

    The aerodynamic coefficients are those of the reading. settings: cases, as in the configuration.
    region: paper_region.csv, inferred from the paper's printed numbers of one line: a value of this
    line in its interval there is `inferred`, and the interval noted.
    """
    study = load({"cases": settings["cases"]})
    table = _tabulate_parameters(study)
    table = table[~table["key"].str.startswith("spacers.")]
    ice = (
        row
        for name, case in study.cases.items()
        for row in _aerodynamic_rows(name, plain(case.ice))
    )
    table = pd.concat([table, _as_table(ice)])
    table = table.sort_values("case", key=lambda of: of.map(list(study.cases).index), kind="stable")
    if region is None:
        return table.reset_index(drop=True)
    for k, row in enumerate(table.to_dict("records")):
        if row["case"] != CASE:
            continue
        inferred_rows = region[(region["key"] == row["key"]) & region["best"].notna()]
        value = np.nan if isinstance(row["value"], str) else float(row["value"])
        for low, high in inferred_rows[["low", "high"]].to_numpy()[:1]:
            if low <= value <= high:
                note = f"from the paper's printed numbers (make paper): {low:.3g} to {high:.3g}"
                table.iloc[k, -2:] = "inferred", note
    return table.reset_index(drop=True)


def spacers(settings: dict) -> pd.DataFrame:
    """Tabulate the mass and positions of the spacers of each overhead line (table 2).

    There is a row for each position.
    """
    table = _tabulate_parameters(load({"cases": settings["cases"]}))
    return table[table["key"].str.startswith("spacers.")].reset_index(drop=True)


def readings() -> pd.DataFrame:
    """Return the table of interpretations of the reproduced paper's damaged text, with reasons."""
    return pd.read_csv(Path(paper.__path__[0], "readings.csv"), keep_default_na=False)


def _as_table(rows: Iterator[tuple]) -> pd.DataFrame:
    return pd.DataFrame(rows, columns=COLUMNS, dtype=object)


def _tabulate_parameters(study: Settings) -> pd.DataFrame:
    """Tabulate every value of every case; `key` is its path below the case."""
    return _as_table(
        row for name, case in study.cases.items() for row in _of_case(name, plain(case))
    )


def _of_case(name: str, values: dict) -> Iterator[tuple]:
    nodes = [
        (key.replace("<name>", release), node)
        for key, node in leaves(child(child(schema(), "cases"), name))
        for release in (values["initial_states"] if "<name>" in key else [""])
        if not key.startswith("truth.") or values["truth"]["model"] == "continuous"
    ]
    for key, node in nodes:
        value = reduce(getitem, key.split("."), values)
        for i, item in enumerate(value if isinstance(value, list) else [value]):
            if item is not None:
                symbol = node["symbol"].format(i + 1)
                yield name, key, symbol, item, node["unit"], *_describe_source(node, i, item)


def _describe_source(node: dict, i: int, value: Any) -> tuple[str, str]:
    """Describe provenance and note of a value: a changed one is ours, with the one it replaces."""
    default = node["default"]
    if isinstance(default, list):
        default = default[i] if i < len(default) else None
    if value == default:
        return node["provenance"], node.get("note", "")
    return "assumed", "" if default is None else f"default {default} ({node['provenance']})"


def _aerodynamic_rows(case: str, ice: dict) -> Iterator[tuple]:
    if ice["reading"] == "custom":
        return  # configured one by one, and listed as such
    names = (("vertical", "beta"), ("horizontal", "eta"))
    for (direction, symbol), values in zip(names, ice_coefficients(ice), strict=True):
        for i, value in enumerate(values, start=1):
            note = f"printed digits, reading {ice['reading']}"
            yield case, f"ice.{direction}", f"{symbol}_{i}", value, "1", "derived", note
