"""The order of the rooms in docs/architecture.md is the order of imports."""

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SOURCE = ROOT / "workflow" / "src" / "galloping"


def rooms():
    """In the order of the table, the ground first."""
    page = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    table = page.split("## Who may import whom")[1].split("\n## ")[0]
    rows = [line.split("|")[1] for line in table.splitlines() if line.startswith("| `")]
    return [name for row in rows for name in re.findall(r"`(\w+)`", row)]


def imported(path):
    """The rooms that a module imports, wherever in it."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            names = [f"{node.module}.{alias.name}" for alias in node.names]
        else:
            continue
        parts = (name.split(".") for name in names)
        yield from (own[1] for own in parts if own[0] == SOURCE.name and own[1:])


def room_of(path):
    return path.relative_to(SOURCE).parts[0].removesuffix(".py")


def test_every_room_has_its_place():
    there = {room_of(path) for path in SOURCE.rglob("*.py")} - {"__init__"}
    assert sorted(rooms()) == sorted(there)


def test_a_room_imports_none_below_it():
    order = rooms()
    wrong = {
        f"{path.relative_to(SOURCE)} imports {name}"
        for path in SOURCE.rglob("*.py")
        for name in imported(path)
        if room_of(path) in order
        and name not in {*order[: order.index(room_of(path)) + 1], "__version__"}
    }
    assert not wrong


def test_modules_have_names_of_their_own_and_at_most_500_lines():
    paths = [path for path in SOURCE.parents[1].rglob("*.py") if path.stem != "__init__"]
    names = sorted(path.stem for path in paths)
    assert names == sorted(set(names))
    assert [p.stem for p in paths if len(p.read_text(encoding="utf-8").splitlines()) > 500] == []


HEAVY = {"numpy", "scipy", "heyoka", "numba", "pandas", "matplotlib", "pysindy", "snakemake"}


@pytest.mark.parametrize(
    ("imports", "heavy"),
    [
        ("galloping", HEAVY | {"pydantic"}),
        ("galloping.cli", HEAVY),
        ("galloping.configuration.load", HEAVY - {"numpy"}),
        ("galloping.study.cells, galloping.study.cells, galloping.study.shown, galloping.field, "
         "galloping.paper.claims", HEAVY - {"numpy", "scipy"}),
    ],
)  # fmt: skip
def test_what_is_imported_often_imports_nothing_heavy(imports, heavy):
    code = f"import sys, {imports}; print(*sys.modules)"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert set(run.stdout.split()) & heavy == set()
