"""Optional packages that an installation may lack, as pyproject.toml lists them."""

import re
import shlex
from collections.abc import Iterator
from importlib import metadata


def missing_line(error: ModuleNotFoundError) -> str:
    """Format an error message that names a missing package and the pip command to install it.

    Raises the error if the missing module is part of this library.
    """
    name = (error.name or "").partition(".")[0]
    if name in ("", "galloping"):
        raise error
    lacking = " ".join(map(shlex.quote, _missing_requirements())) or name
    return f"{name} is not installed, which the command needs: python -m pip install {lacking}"


def _missing_requirements() -> Iterator[str]:
    """Yield missing requirements of the extra `field`; none if this library is not installed."""
    try:
        requirements = metadata.requires("galloping") or []
    except metadata.PackageNotFoundError:
        return
    for requirement in requirements:
        needed, _, condition = requirement.partition(";")
        if re.fullmatch(r"extra == ['\"]field['\"]", condition.strip()):
            name = re.split(r"[^\w.-]", needed, maxsplit=1)[0]
            if not any(metadata.distributions(name=name)):
                yield needed.strip()
