"""The physical parameters of each case with unit and source, for the first two tables."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import reduce
from operator import getitem

from galloping.configuration.lines import CaseSection, paper_cases
from galloping.configuration.load import plain
from galloping.configuration.schema import child, leaves, schema
from galloping.configuration.settings import Settings
from galloping.fields import Provenance, show


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


def departures(settings: Settings) -> dict[str, str]:
    """Why the paper's claims about each of its cases cannot be judged in a study; "" where they
    can: what the paper prints of the line is unchanged, whatever the rest is.
    """
    return {
        name: _departure(settings.cases.get(name), case) for name, case in paper_cases().items()
    }


def _departure(case: CaseSection | None, paper: CaseSection) -> str:
    if case is None:
        return "the study does not have it"
    if case.truth.model != "two_mode":
        return f"its recordings are those of a line that is {case.truth.model}"
    ours, papers = plain(case), plain(paper)
    for key, node in leaves(child(schema(), "cases")):
        path = key.split(".")[1:]  # below the name of the case
        if node.get("provenance") != "seed":
            continue
        value, printed = (reduce(getitem, path, values) for values in (ours, papers))
        # where the paper's own case has another value it is ours, as the tension of the second line
        if printed == node["default"] and value != printed:
            return f"{'.'.join(path)} is {show(value)}, where the paper has {show(printed)}"
    return ""


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
