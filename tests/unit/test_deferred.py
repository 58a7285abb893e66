"""Functions that are named before they are imported."""

import subprocess
import sys
from pkgutil import resolve_name

import pytest

from galloping import deferred


def test_a_function_is_named_and_not_imported():
    code = (
        "import sys; from galloping.deferred import tables; print(tables.scores.noise_r2);"
        "print('galloping.tables' in sys.modules)"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.split() == ["galloping.tables.scores:noise_r2", "False"]
    assert resolve_name(deferred.tables.scores.noise_r2).__name__ == "noise_r2"


@pytest.mark.parametrize("name", ["table", "tables.score", "tables.scores.noise"])
def test_a_name_that_is_not_there_is_told(name):
    *parents, last = name.split(".")
    found = deferred
    for parent in parents:
        found = getattr(found, parent)
    with pytest.raises(AttributeError, match=f"galloping.{name}: no such module or function"):
        getattr(found, last)
