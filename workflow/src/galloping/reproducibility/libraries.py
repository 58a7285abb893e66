"""Installed versions of libraries: results depend on them as on the code that uses them."""

import platform
from collections.abc import Iterable
from functools import cache
from importlib import metadata

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

# Distributions that are not named as what is imported of them.
DISTRIBUTIONS = {"sklearn": "scikit-learn", "yaml": "PyYAML"}


def versions(imported: Iterable[str]) -> dict[str, str]:
    """Versions of Python and of the installed libraries behind some imports, by name.

    imported: names of top-level packages. What their distributions require counts as well, as far
    as it is installed.
    """
    found: dict[str, str] = {}
    for name in imported:
        distribution = canonicalize_name(DISTRIBUTIONS.get(name, name))
        found |= _with_requirements(distribution)
    return {"python": ".".join(platform.python_version_tuple()[:2]), **dict(sorted(found.items()))}


@cache
def _with_requirements(distribution: str) -> dict[str, str]:
    """Versions of an installed distribution and of all it requires on this platform, by name."""
    found: dict[str, str] = {}
    waiting = [distribution]
    while waiting:
        name = waiting.pop()
        if name not in found and (described := _distribution(name)):
            found[name] = described["Version"]
            required = map(Requirement, described.get_all("Requires-Dist") or [])
            waiting += [
                canonicalize_name(requirement.name)
                for requirement in required
                if requirement.marker is None or requirement.marker.evaluate({"extra": ""})
            ]
    return found


@cache
def _distribution(name: str) -> metadata.PackageMetadata | None:
    try:
        return metadata.distribution(name).metadata
    except metadata.PackageNotFoundError:
        return None
