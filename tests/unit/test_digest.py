"""What the code digest refuses and reads; what changes it is the table of test_reruns."""

import ast
from importlib import metadata
from operator import attrgetter

import pytest

from galloping import deferred
from galloping.reproducibility import digest


def test_a_misspelt_module_is_named():
    with pytest.raises(ValueError, match=r"galloping\.methods: "):
        digest.code("galloping.methods")


@pytest.mark.parametrize("name", ["table", "tables.score", "tables.scores.noise"])
def test_a_misspelt_function_is_named(name):
    with pytest.raises(AttributeError, match=f"galloping.{name}: "):
        attrgetter(name)(deferred)


def test_compiled_functions_use_no_other_module_of_the_package():
    # numba's cache of a function notices edits of its own file alone
    compiled = 0
    for path in (deferred.SOURCE / digest.PACKAGE).rglob("*.py"):
        tree = ast.parse(path.read_text())
        others = {
            alias.asname or alias.name
            for node in tree.body
            if isinstance(node, ast.ImportFrom) and node.module.startswith(digest.PACKAGE)
            for alias in node.names
        }
        for node in tree.body:
            if "njit" in " ".join(map(ast.unparse, getattr(node, "decorator_list", ()))):
                compiled += 1
                used = {part.id for part in ast.walk(node) if isinstance(part, ast.Name)}
                assert not used & others, (path, node.name)
    assert compiled > 5


def test_an_upgrade_shows_in_what_requires_it():
    found = digest.versions(["pandas", "yaml"])
    assert found["numpy"] == metadata.version("numpy")  # which pandas requires
    assert found["pyyaml"] == metadata.version("PyYAML")  # as it is called where it is installed
    assert "pyarrow" not in found  # which pandas may have
