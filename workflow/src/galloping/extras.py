"""What an installation may lack: extras of this distribution, as pyproject.toml lists them."""

import re
import shlex
from collections.abc import Iterator
from importlib import metadata

FIELD = "field"  # what the command needs


def missing_line(error: ModuleNotFoundError) -> str:
    """What is missing for the command, and the line that installs all that is, in any shell.

    Raises the error if what is missing is part of this library.
    """
    name = (error.name or "").partition(".")[0]
    if name in ("", "galloping"):
        raise error
    lacking = " ".join(map(shlex.quote, _missing_requirements(FIELD))) or name
    return f"{name} is not installed, which the command needs: python -m pip install {lacking}"


def _missing_requirements(extra: str) -> Iterator[str]:
    """Requirements of an extra that are not installed; none if this library is not either."""
    try:
        requirements = metadata.requires("galloping") or []
    except metadata.PackageNotFoundError:
        return
    for requirement in requirements:
        needed, _, condition = requirement.partition(";")
        if re.fullmatch(rf"extra == ['\"]{extra}['\"]", condition.strip()):
            name = re.split(r"[^\w.-]", needed, maxsplit=1)[0]
            if not any(metadata.distributions(name=name)):
                yield needed.strip()
