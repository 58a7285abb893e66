"""Keys of the configuration: `keys.csv` lists default, range, unit, source and meaning of each.

Columns. list: empty for a single value, `any` number of values, `2` or `3` of them, `distinct` ones
or `some`, which are distinct and not empty. type: `real`, `whole`, `bool`, names separated by
` | `, or a type that the section's class gives (`text`, `name`, `mapping`, `section`). default:
empty for the default of the type. symbol: `{}` is the number of the item if the value is a list.
provenance: `printed` is in the paper, `derived` follows from it, `inferred` comes from its
printed numbers (only in tables of results), `assumed` is ours. note: on the source. rule: what is
checked beyond type and range. why: the reason for the range, which covers lines that are built.

`renamed.csv` has keys that have another name now: the old key with its path, and the new name.
"""

import csv
import json
from pathlib import Path
from typing import Any

import yaml
from pydantic import Field, create_model
from pydantic.config import JsonDict

from galloping import fields

SIGNS = {">": "gt", ">=": "ge", "<": "lt", "<=": "le"}
FACTS = ("symbol", "provenance", "note", "rule", "why")
LISTS = {
    "": lambda item: item,
    "any": lambda item: fields.listing(item, ...),
    "2": lambda item: fields.listing(item, item),
    "3": lambda item: fields.listing(item, item, item),
    "distinct": fields.distinct,
    "some": fields.selection,
}
with Path(__file__).with_name("keys.csv").open(encoding="utf-8", newline="") as file:
    ROWS = list(csv.DictReader(file))
with Path(__file__).with_name("renamed.csv").open(encoding="utf-8", newline="") as file:
    RENAMED = {row["old"]: row["new"] for row in csv.DictReader(file)}


def keys(section: str, doc: str | None = None, **types: Any) -> Any:
    """Make the pydantic class of a settings section from the rows of the table keys.csv.

    doc: description of the section, if it needs no class with its own checks. types: of the keys
    whose type is not in the table; a pair of a type and the function that makes the default, if the
    default is neither in the table nor that of the type.
    """
    rows = [row for row in ROWS if row["section"] == section]
    named_fields: dict[str, Any] = {row["key"]: _make_field(row, types) for row in rows}
    return create_model(
        f"{section.title().replace('_', '')}Section",
        __base__=fields.Section,
        __doc__=doc,
        **named_fields,
    )


def _make_field(row: dict[str, str], types: dict[str, Any]) -> tuple[Any, Any]:
    item = types[row["key"]] if row["key"] in types else _item_type(row["type"], row["range"])
    item, factory = item if isinstance(item, tuple) else (item, item)
    if row["type"] == "section":
        return item, Field(default_factory=factory)
    kind = LISTS[row["list"]](item)
    facts: JsonDict = {"unit": row["unit"]}
    facts |= {name: row[name] for name in FACTS if row[name]}
    default = {"default": yaml.safe_load(row["default"])} if row["default"] else {}
    return kind | None if row["null"] else kind, Field(
        **default or {"default_factory": factory},
        description=row["description"],
        json_schema_extra=facts,
    )


def _item_type(kind: str, limits: str) -> Any:
    if kind == "bool":
        return bool
    if kind not in ("real", "whole"):
        return fields.one_of(tuple(kind.split(" | ")))
    if ".." in limits:
        low, high = limits.split("..")
        bounds = {"ge": low, "le": high}
    else:
        words = limits.split()
        bounds = {SIGNS[sign]: value for sign, value in zip(words[::2], words[1::2], strict=True)}
    make = fields.real if kind == "real" else fields.whole
    return make(**{sign: json.loads(value) for sign, value in bounds.items()})
