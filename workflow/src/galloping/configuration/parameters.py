"""The physical parameters of each case with unit and source, for the first two tables."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import reduce
from operator import getitem

from galloping.configuration.fields import Provenance
from galloping.configuration.load import plain
from galloping.configuration.schema import child, leaves, schema
from galloping.configuration.settings import Settings


@dataclass(frozen=True)
class ParameterRow:
    """One row of a parameter table; `key` is the path below the case."""

    case: str
    key: str
    symbol: str
    value: float | int | str
    unit: str
    provenance: Provenance
    note: str


def conductor_parameters(settings: Settings) -> list[ParameterRow]:
    """Table 1: everything about a case except its spacers."""
    return [row for row in _rows(settings) if not row.key.startswith("spacers.")]


def spacer_parameters(settings: Settings) -> list[ParameterRow]:
    """Table 2: mass and positions of the spacers, one position a row."""
    return [row for row in _rows(settings) if row.key.startswith("spacers.")]


def _rows(settings: Settings) -> Iterator[ParameterRow]:
    for name, case in settings.cases.items():
        values = plain(case)
        named = [
            (key.replace("<name>", release), node)
            for key, node in leaves(child(child(schema(), "cases"), name))
            for release in (values["releases"] if "<name>" in key else [""])
            if not key.startswith("truth.") or values["truth"]["model"] == "continuous"
        ]
        for key, node in named:
            value = reduce(getitem, key.split("."), values)
            for i, item in enumerate(value if isinstance(value, list) else [value]):
                if item is not None:
                    symbol = node["symbol"].format(i + 1)
                    yield ParameterRow(
                        name, key, symbol, item, node["unit"], *_source(node, i, item)
                    )


def _source(node: dict, i: int, value: float | int | str) -> tuple[Provenance, str]:
    """Provenance and note of a value: a changed one is ours, and says what it stands in for."""
    default = node["default"]
    if isinstance(default, list):
        default = default[i] if i < len(default) else None
    if value == default:
        return node["provenance"], node.get("note", "")
    if default is None:
        return "assumed", ""
    return "assumed", f"default {default} ({node['provenance']})"
