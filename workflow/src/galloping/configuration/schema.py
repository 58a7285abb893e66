"""JSON schema of the settings, the single source of messages and documentation.

python -m galloping.configuration.schema config/README.md workflow/schemas/config.schema.json
"""

import json
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

from galloping.configuration.settings import Settings


@cache
def schema() -> dict:
    """Return the JSON schema of the settings of a study."""
    return Settings.model_json_schema()


def resolve(node: dict) -> dict:
    """Replace a reference or optional type in a node of the JSON schema by its definition."""
    if "$ref" in node:
        definition = schema()["$defs"][node["$ref"].rpartition("/")[2]]
        return definition | {key: value for key, value in node.items() if key != "$ref"}
    if "anyOf" in node:
        value = next(option for option in node["anyOf"] if option.get("type") != "null")
        return resolve(value) | node | {"optional": True}
    return node


def child(node: dict, key: object) -> dict:
    """Return the schema node of a key in a section, or of a name chosen by the user."""
    if key in node.get("properties", {}):
        return resolve(node["properties"][key])
    return resolve(named_value(node))


def item(node: dict) -> dict:
    """Return the schema node of the items of a list."""
    return resolve(node["items"] if "items" in node else node["prefixItems"][0])


def named_value(node: dict) -> dict:
    """Return the schema of the values of a mapping, if the user chooses the keys of the mapping."""
    if "patternProperties" in node:
        return next(iter(node["patternProperties"].values()))
    return node["additionalProperties"]


def names(node: dict) -> list[str]:
    """List the keys that a section of the schema may have; none if the user chooses them."""
    return list(node.get("properties", ())) or node.get("propertyNames", {}).get("enum", [])


def leaves(node: dict | None = None, path: str = "") -> Iterator[tuple[str, dict]]:
    """Yield dotted path and schema node of each setting, such as `cases.<name>.wind.speed`."""
    node = resolve(node or schema())
    if "properties" in node:
        for key, value in node["properties"].items():
            yield from leaves(value, f"{path}.{key}".removeprefix("."))
    elif "patternProperties" in node:
        yield from leaves(named_value(node), f"{path}.<name>")
    else:
        yield path, node


def allowed(node: dict, with_unit: bool = True) -> str:
    """Describe in words the allowed values of a setting, such as `> 0 m` or `one of a, b`."""
    unit = node.get("unit", "") if with_unit else ""
    text = _describe_type(node, "" if unit in ("", "1") else unit)
    text = ", ".join(filter(None, (text, node.get("rule"))))
    return f"null or {text}" if "optional" in node else text


def _describe_type(node: dict, unit: str) -> str:
    match node:
        case {"enum": options}:
            return f"one of {', '.join(options)}"
        case {"type": "array"}:
            return f"a list of {_describe_items(node)} {unit}".strip()
        case {"type": "object", "additionalProperties": dict(value)}:
            return f"a mapping of {', '.join(names(node))} to {_describe_type(value, unit)}"
        case {"type": "object", "properties": keys}:
            return f"a mapping of {', '.join(keys)}"
        case {"type": "object"}:
            return "a mapping of one or more names"
        case {"type": "integer"}:
            return f"a whole number {_describe_bounds(node)} {unit}".strip()
        case {"type": "number"}:
            bounds, in_unit = _describe_bounds(node), f" in {unit}" if unit else ""
            return f"{bounds} {unit}".strip() if bounds else f"a number{in_unit}"
        case {"type": "boolean"}:
            return "true or false"
    return "" if "rule" in node else "text"


def _describe_items(node: dict) -> str:
    element = item(node)
    if "enum" in element:
        return f"one or more of {', '.join(element['enum'])}"
    count = "distinct " if "uniqueItems" in node else ""
    if "prefixItems" in node:
        count = f"{node['minItems']} "
    elif "minItems" in node:
        count = f"one or more {count}"
    kind = {"integer": "whole numbers", "string": "texts"}.get(element["type"], "numbers")
    return f"{count}{kind} {_describe_bounds(element)}".strip()


def _describe_bounds(node: dict) -> str:
    if "minimum" in node and "maximum" in node:
        return f"{node['minimum']:.12g}..{node['maximum']:.12g}"
    signs = {"exclusiveMinimum": ">", "minimum": ">=", "exclusiveMaximum": "<", "maximum": "<="}
    return " and ".join(f"{sign} {node[key]:.12g}" for key, sign in signs.items() if key in node)


TABLE_BEGIN = "<!-- keys: generated from the settings, do not edit -->"
TABLE_END = "<!-- end of keys -->"
HEADER = ("Key", "Default", "Unit", "Allowed", "Provenance", "Meaning")


def with_key_table(text: str) -> str:
    """Replace the table of keys between two markers; raise ValueError if one is missing."""
    before, begin, below = text.partition(TABLE_BEGIN)
    _, end, after = below.partition(TABLE_END)
    if not (begin and end):
        raise ValueError(f"needs the two lines\n{TABLE_BEGIN}\n{TABLE_END}")
    rows = [HEADER, ["---"] * len(HEADER), *(_table_cells(path, node) for path, node in leaves())]
    table = "\n".join(f"| {' | '.join(cells)} |" for cells in rows)
    return f"{before}{TABLE_BEGIN}\n\n{table}\n\n{TABLE_END}{after}"


def _table_cells(path: str, node: dict) -> list[str]:
    default = json.dumps(node["default"]).replace('"', "")
    provenance = node.get("provenance", "")
    if note := node.get("note"):
        provenance += f" ({note})"
    why = f" ({node['why']})" if "why" in node else ""
    return [
        f"`{path}`",
        f"`{default}`",
        node["unit"],
        allowed(node, with_unit=False) + why,
        provenance,
        node["description"],
    ]


EXTRA_KEYWORDS = ("unit", "symbol", "provenance", "note", "rule", "why")  # extend JSON schema


def schema_for_editors() -> str:
    """Return the JSON schema by which text editors check a configuration file.

    Any key may be missing, since files are merged. A case may be null, which leaves it out. Units
    and rules beyond JSON schema are part of the descriptions, which editors show.
    """
    node = _for_editors(schema())
    cases = node["properties"]["cases"]["patternProperties"]
    for name, case in cases.items():
        cases[name] = {"anyOf": [case, {"type": "null"}]}
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema"}
    return json.dumps(head | node | {"title": "A study of galloping lines"}, indent=1) + "\n"


def _for_editors(node: Any) -> Any:
    if isinstance(node, list):
        return [_for_editors(each) for each in node]
    if not isinstance(node, dict):
        return node
    converted = {key: _for_editors(value) for key, value in node.items()}
    if isinstance(text := node.get("description"), str):
        unit = node.get("unit", "") if node.get("unit") != "1" else ""
        converted["description"] = "; ".join(filter(None, (text, unit, node.get("rule"))))
        converted = {key: value for key, value in converted.items() if key not in EXTRA_KEYWORDS}
    if "patternProperties" in node:
        converted["additionalProperties"] = False
    return converted


if __name__ == "__main__":
    page, file = map(Path, sys.argv[1:])
    page.write_text(with_key_table(page.read_text(encoding="utf-8")), encoding="utf-8")
    file.write_text(schema_for_editors(), encoding="utf-8")
