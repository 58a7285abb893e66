"""Functions of modules that are not imported, as attributes: `deferred.trials.ambient.trial`.

Rules and the register of methods name the function of a job. To import it there would take seconds
at each start of Snakemake or of the command. Here the function is the text `module:function`: the
job imports it with `pkgutil.resolve_name`, and `reproducibility.digest` finds its code by it.
"""

import re
from functools import cache
from pathlib import Path
from typing import Any

SOURCE = Path(__file__).parents[1]


class Deferred:
    """Reference to a package or module of this library by its full name, without importing it."""

    def __init__(self, name: str) -> None:
        self._name = name

    def __getattr__(self, name: str) -> Any:  # a Deferred or a str
        """Return a module, or a function as `module:function`; raise AttributeError for neither."""
        below = f"{self._name}.{name}"
        if file_of(below):
            return Deferred(below)
        own = file_of(self._name)
        if own and re.search(rf"^def {name}\(", own.read_text(encoding="utf-8"), re.MULTILINE):
            return f"{self._name}:{name}"
        raise AttributeError(f"{below}: no such module or function")


@cache
def file_of(name: str) -> Path | None:
    """Return the source file of a module or package (`__init__.py`) by its full name, or None."""
    base = SOURCE.joinpath(*name.split("."))
    return next(filter(Path.is_file, (base / "__init__.py", base.with_suffix(".py"))), None)


def __getattr__(name: str) -> Any:
    return getattr(Deferred(__package__), name)
