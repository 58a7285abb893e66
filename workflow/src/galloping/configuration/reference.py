"""What is generated from the settings, for files that are named: the key table and the JSON schema.

python -m galloping.configuration.reference config/README.md workflow/schemas/config.schema.json
"""

import json
import sys
from pathlib import Path

from galloping.configuration.schema import allowed, leaves, schema

BEGIN = "<!-- keys: generated from the settings, do not edit -->"
END = "<!-- end of keys -->"
HEADER = ("Key", "Default", "Unit", "Allowed", "Provenance", "Meaning")


def key_table() -> str:
    """Every key of a study as a Markdown table."""
    lines = [_row(HEADER), _row(["---"] * len(HEADER))]
    lines += [_row(_cells(path, node)) for path, node in leaves()]
    return "\n".join(lines)


def with_key_table(text: str) -> str:
    """A Markdown text with the table between the two markers brought up to date.

    Raises ValueError where a marker is missing.
    """
    before, begin, below = text.partition(BEGIN)
    _, end, after = below.partition(END)
    if not (begin and end):
        raise ValueError(f"needs the two lines\n{BEGIN}\n{END}")
    return f"{before}{BEGIN}\n\n{key_table()}\n\n{END}{after}"


def json_schema() -> str:
    """The JSON schema of a study, for editors; it is stricter than `load` on `1e-3` as text."""
    dialect = {"$schema": "https://json-schema.org/draft/2020-12/schema"}
    return json.dumps(dialect | schema(), indent=2) + "\n"


def _cells(path: str, node: dict) -> list[str]:
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


def _row(cells: list[str] | tuple[str, ...]) -> str:
    return f"| {' | '.join(cells)} |"


def generated(path: Path) -> str:
    """What a file has to hold: `.md` with the key table, `.json` the JSON schema."""
    if path.suffix == ".json":
        return json_schema()
    return with_key_table(path.read_text(encoding="utf-8"))


if __name__ == "__main__":
    for path in map(Path, sys.argv[1:]):
        path.write_text(generated(path), encoding="utf-8")
