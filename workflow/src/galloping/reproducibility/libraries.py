"""Installed versions of libraries: results depend on them as on the code that uses them."""

from __future__ import annotations

import hashlib
import platform
from collections.abc import Iterable
from functools import cache
from importlib import metadata, util
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

# Distributions that are not named as what is imported of them.
DISTRIBUTIONS = {
    "rocrate_validator": "roc-validator",
    "sklearn": "scikit-learn",
    "yaml": "PyYAML",
}


def versions(imported: Iterable[str]) -> dict[str, str]:
    """Versions of Python and of the installed libraries behind some imports, by name.

    imported: names of top-level packages. What their distributions require counts as well, as far
    as it is installed.
    """
    found: dict[str, str] = {}
    for name in imported:
        distribution = canonicalize_name(DISTRIBUTIONS.get(name, name))
        if _distribution(distribution):
            found |= _with_requirements(distribution)
        elif digest := _files(name):
            found[name] = digest
    return {"python": ".".join(platform.python_version_tuple()[:2]), **dict(sorted(found.items()))}


@cache
def _with_requirements(distribution: str) -> dict[str, str]:
    """Versions of a distribution and of all it requires, by name."""
    found, seen, waiting = {}, set(), [(distribution, "")]
    while waiting:
        name, extra = one = waiting.pop()
        if one not in seen and (described := _distribution(name)):
            found[name] = described["Version"]
            waiting += _requirements(name, extra)
        seen.add(one)
    return found


@cache
def _distribution(name: str) -> metadata.PackageMetadata | None:
    try:
        return metadata.distribution(name).metadata
    except metadata.PackageNotFoundError:
        return None


@cache
def _requirements(name: str, extra: str) -> list[tuple[str, str]]:
    """Names and extras of what an installed distribution requires on this platform."""
    requirements = map(Requirement, _distribution(name).get_all("Requires-Dist") or [])
    return [
        (canonicalize_name(requirement.name), wanted)
        for requirement in requirements
        if requirement.marker is None or requirement.marker.evaluate({"extra": extra})
        for wanted in ("", *requirement.extras)
    ]


@cache
def _files(name: str) -> str | None:
    """Digest of the top-level files of a package that no installer has recorded, as with conda."""
    spec = util.find_spec(name)
    if spec is None or spec.origin is None:
        return None
    origin = Path(spec.origin)
    files = sorted(origin.parent.glob("*.py")) if spec.submodule_search_locations else [origin]
    content = b"".join(file.name.encode() + file.read_bytes() for file in files)
    return hashlib.sha256(content).hexdigest()[:16]
