"""Types as a user's type checker sees them: of documented calls, and of what scripts hand over."""

import ast
import doctest
import inspect
import json
import sys
from dataclasses import MISSING, fields
from importlib.util import find_spec
from pathlib import Path

import pytest
from studies import run

import galloping

ROOT = Path(__file__).parents[2]
SOURCE = ROOT / "workflow" / "src"
CHECKERS = {
    "mypy": ["--strict", "--follow-imports", "silent", "."],
    "basedpyright": ["--pythonpath", sys.executable],
}


@pytest.mark.parametrize("name", ["Input", "PolynomialModel", "Recording"])
def test_the_arguments_that_type_checkers_see_are_the_fields(name):
    held = getattr(galloping, name)
    source = ast.parse(inspect.getsource(held))
    (init,) = (node for node in ast.walk(source) if getattr(node, "name", "") == "__init__")
    assert [each.arg for each in init.args.args[1:]] == [field.name for field in fields(held)]
    required = [f for f in fields(held) if {f.default, f.default_factory} == {MISSING}]
    assert len(init.args.args) - 1 - len(init.args.defaults) == len(required)


def code_of(page, begin):
    """All code of a page of docs/, by how its blocks begin."""
    text = (ROOT / "docs" / page).read_text(encoding="utf-8")
    return "".join(block.partition("```")[0] for block in text.split(begin)[1:])


@pytest.mark.slow
@pytest.mark.parametrize("checker", CHECKERS)
def test_scripts_of_users_pass(checker, tmp_path):
    if not find_spec(checker):
        pytest.skip(f"{checker} is not installed: make tools")
    scripts = {
        "page": code_of("python.md", "```python\n"),
        "tutorial": code_of("tutorial_systems.md", "```{code-cell}\n"),
        "examples": doctest.script_from_examples(galloping.__doc__),
        "from_python": (ROOT / "examples" / "from_python.py").read_text(encoding="utf-8"),
        "typed_script": Path(__file__).with_name("typed_script.py").read_text(encoding="utf-8"),
    }
    for name, text in scripts.items():
        (tmp_path / f"{name}.py").write_text(text, encoding="utf-8")
    configured = {
        "typeCheckingMode": "standard",
        "reportUnusedExpression": False,
        "extraPaths": [str(SOURCE)],
    }
    (tmp_path / "pyrightconfig.json").write_text(json.dumps(configured))
    done = run(tmp_path, "-m", checker, *CHECKERS[checker], MYPYPATH=str(SOURCE))
    assert done.returncode == 0, done.stdout
