"""The repository itself: its style, the order of its rooms, and what its README shows."""

import ast
import re
from pathlib import Path

import pandas as pd
import pytest
import yaml
from studies import run

from galloping.report import printed_numbers
from galloping.storage import read_json

ROOT = Path(__file__).parents[2]
SOURCE, REFERENCE = ROOT / "workflow" / "src" / "galloping", ROOT / "results" / "reference"


@pytest.mark.slow
@pytest.mark.parametrize(
    "command",
    [
        "ruff check --no-cache", "ruff format --check --no-cache", "snakemake --lint",
        "snakefmt --check Snakefile workflow/Snakefile workflow/rules",
    ],
)  # fmt: skip
def test_style(command):
    done = run(ROOT, "-m", *command.split())
    assert done.returncode == 0, done.stdout


def test_the_profiles_agree_and_that_for_slurm_names_every_rule(fresh):
    listed = fresh.ran("--list-rules", "--quiet", "all")
    default, slurm = (
        yaml.safe_load((fresh.folder / f"workflow/profiles/{name}/config.yaml").read_text())
        for name in ("default", "slurm")
    )
    rules = set(slurm["groups"])
    assert rules | {"all"} == {line for line in listed.splitlines() if line.isidentifier()}
    shared = default.keys() & slurm.keys() - {"cores"}
    assert len(shared) > 3 and [key for key in shared if default[key] != slurm[key]] == []


def test_every_rule_says_which_memory_and_time_it_needs():
    """So that any executor knows, without a profile."""
    text = "\n".join(path.read_text("utf-8") for path in (ROOT / "workflow/rules").glob("*.smk"))
    rules = {rule.partition(":")[0]: rule for rule in re.split(r"(?m)^rule ", text)[1:]}
    asked = {
        name: re.findall(r"    resources:\n +\*\*\w+_RESOURCES,\n", rules[name]) for name in rules
    }
    assert len(rules) > 15 and [name for name in rules if len(asked[name]) != 1] == []


# --- the order of the rooms in docs/architecture.md is the order of imports ---


def rooms():
    """In the order of the table, the ground first."""
    page = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    table = page.split("## Who may import whom")[1].split("\n## ")[0]
    rows = [line.split("|")[1] for line in table.splitlines() if line.startswith("| `")]
    return [name for row in rows for name in re.findall(r"`(\w+)`", row)]


def room(parts, order):
    """The room of a module, by the parts of its name: packages of identification are rooms."""
    inner = parts[0] == "identification" and parts[1:] and parts[1] in order
    return parts[1] if inner else parts[0]


def imported(path, order):
    """The rooms that a module imports, wherever in it, or has imported by `deferred`."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            names = [f"{node.module}.{alias.name}" for alias in node.names]
        else:
            continue
        parts = (name.replace(".deferred.", ".").split(".") for name in names)
        yield from (room(own[1:], order) for own in parts if own[0] == SOURCE.name and own[1:])


def test_every_room_has_its_place_and_imports_none_below_it():
    order, paths = rooms(), SOURCE.rglob("*.py")
    modules = {path: room(path.relative_to(SOURCE).with_suffix("").parts, order) for path in paths}
    assert sorted(order) == sorted({*modules.values()} - {"__init__"})
    wrong = {
        f"{path.relative_to(SOURCE)} imports {name}"
        for path, own in modules.items()
        for name in imported(path, order)
        if own in order and name not in {*order[: order.index(own) + 1], "__version__"}
    }
    assert not wrong


def count_lines_of_code(path):
    """Count the lines of a module without its docstrings."""
    text = path.read_text(encoding="utf-8")
    documented = (ast.Module, ast.ClassDef, ast.FunctionDef)
    nodes = [node for node in ast.walk(ast.parse(text)) if isinstance(node, documented)]
    strings = [node.body[0] for node in nodes if ast.get_docstring(node)]
    return len(text.splitlines()) - sum(s.end_lineno - s.lineno + 1 for s in strings)


def test_modules_and_packages_have_names_of_their_own_and_at_most_500_lines_of_code():
    paths = [path for path in SOURCE.parents[1].rglob("*.py") if path.stem != "__init__"]
    packages = [path.parent for path in SOURCE.rglob("__init__.py")]
    names = sorted(path.stem for path in (*paths, *packages))
    assert names == sorted(set(names))
    longer = [path.stem for path in paths if count_lines_of_code(path) > 500]
    assert longer == ["taylor"]  # whose compiled functions numba wants in one file


def relaxed_functions():
    """Functions that numba compiles with relaxed arithmetic, in which sums may be reordered."""
    functions = [
        node
        for path in SOURCE.rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.FunctionDef)
        and any("fastmath" in ast.unparse(each) for each in node.decorator_list)
    ]
    assert functions
    return functions


def test_compiled_functions_with_relaxed_arithmetic_have_no_constant_powers():
    """numba compiles `x ** 2` once in a process, with the options of the function that is compiled
    first: how a sum of such squares is rounded would depend on what was compiled before.
    """
    powers = [
        f"{function.name}: {ast.unparse(node)}"
        for function in relaxed_functions()
        for node in ast.walk(function)
        if isinstance(node, ast.BinOp)
        and isinstance(node.op, ast.Pow)
        and isinstance(node.right, ast.Constant)
    ]
    assert not powers


def test_compiled_functions_with_relaxed_arithmetic_are_inlined_where_they_are_called():
    """Else code from the cache has other last bits than code that was just compiled."""
    called = {
        node.func.id
        for path in SOURCE.rglob("*.py")
        for function in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(function, ast.FunctionDef)
        and any("njit" in ast.unparse(each) for each in function.decorator_list)
        for node in ast.walk(function)
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name)
    }
    for function in relaxed_functions():
        options = ast.unparse(function.decorator_list[0])
        assert function.name not in called or "forceinline=True" in options, function.name


HEAVY = {"numpy", "scipy", "numba", "pandas", "matplotlib", "pysindy", "snakemake"}


@pytest.mark.parametrize(
    ("imports", "heavy"),
    [
        ("galloping", HEAVY | {"pydantic"}),
        ("galloping.cli", HEAVY),
        ("galloping.configuration.load", HEAVY - {"numpy"}),
        ("galloping.study.cells, galloping.study.shown, galloping.summary, "
         "galloping.paper.claims", HEAVY - {"numpy", "scipy"}),
    ],
)  # fmt: skip
def test_what_is_imported_often_imports_nothing_heavy(imports, heavy):
    done = run(ROOT, "-c", f"import sys, {imports}; print(*sys.modules)")
    assert done.returncode == 0 and set(done.stdout.split()) & heavy == set()


# --- the README and the page of the paper: numbers of the reference, what the commands print ---


def rows(paper):
    """The lines of the page's table of the paper's claims, as the report has them."""
    for claim, cells in printed_numbers.build_table(paper).items():
        shown = ([cell.printed for cell in cells], [cell.ours for cell in cells],
                 [cell.verdict for cell in cells])  # fmt: skip
        yield f"| {claim} | " + " | ".join("; ".join(dict.fromkeys(of)) for of in shown) + " |"


def test_the_pages_have_the_claims_and_times_of_the_reference():
    paper = pd.read_csv(REFERENCE / "paper.csv")
    region = pd.read_csv(REFERENCE / "paper" / "paper_region.csv")
    shown = [*rows(paper)]
    lines = (ROOT / "docs" / "paper.md").read_text().splitlines()
    first = lines.index(shown[0])
    assert lines[first : first + len(shown)] == shown
    origins = (read_json(REFERENCE / folder / "origin.json") for folder in ("", "smoke"))
    whole, smoke = (origin["core_minutes"] for origin in origins)
    text = " ".join((ROOT / "README.md").read_text().split())
    for said in (f"`make` takes {whole:.0f} minutes", f"`make smoke` takes {smoke:g} minutes",
                 printed_numbers.describe_setting(paper, region),
                 printed_numbers.describe_counts(paper)):  # fmt: skip
        assert said in text
