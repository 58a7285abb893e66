r"""Write or check what is generated from the settings: the key table and the JSON schema.

python -m galloping.configuration.reference --write config/README.md \
    workflow/schemas/config.schema.json
"""

import argparse
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


def main(arguments: list[str] | None = None) -> int:
    """Command line; returns the exit status."""
    parser = argparse.ArgumentParser(prog="python -m galloping.configuration.reference")
    mode = parser.add_mutually_exclusive_group(required=True)
    mode.add_argument("--check", action="store_true", help="fail where a file is out of date")
    mode.add_argument("--write", action="store_true", help="bring the files up to date")
    parser.add_argument("files", nargs="+", type=Path, help=".md: key table, .json: JSON schema")
    options = parser.parse_args(arguments)

    stale = False
    for path in options.files:
        present = path.read_text(encoding="utf-8") if path.exists() else ""
        try:
            wanted = json_schema() if path.suffix == ".json" else with_key_table(present)
        except ValueError as error:
            print(f"{path}: {error}", file=sys.stderr)
            return 1
        if options.write:
            path.write_text(wanted, encoding="utf-8")
        elif wanted != present:
            print(f"{path}: out of date; run with --write", file=sys.stderr)
            stale = True
    return int(stale)


if __name__ == "__main__":
    sys.exit(main())
