"""What a study was made with: the commit, Python and the packages and the machine."""

import os
import platform
import subprocess
from dataclasses import dataclass
from importlib.metadata import distributions

from packaging.utils import canonicalize_name


@dataclass(frozen=True)
class Commit:
    """What is checked out.

    digest: of the commit. date: when it was made (ISO 8601). described: after the nearest tag, as
    `git describe` says. changes: files that are not as in the commit.
    """

    digest: str
    date: str
    described: str
    changes: tuple[str, ...]


def commit() -> Commit | None:
    """The commit checked out in the working folder, or None if git does not know of one."""
    try:
        digest, date = _git("show", "--no-patch", "--format=%H %cI", "HEAD").split()
        described = _git("describe", "--tags", "--always", "--dirty").strip()
        status = _git("status", "--porcelain", "--untracked-files=all").splitlines()
    except (OSError, subprocess.CalledProcessError):
        return None
    return Commit(digest, date, described, tuple(line[3:] for line in status))


def environment() -> dict:
    """Versions of Python and of all packages, and apart from them what depends on the machine."""
    packages = {canonicalize_name(found.name): found.version for found in distributions()}
    return {
        "python": platform.python_version(),
        "packages": dict(sorted(packages.items())),
        "machine": {
            "system": platform.system(),
            "release": platform.release(),
            "architecture": platform.machine(),
            "cores": os.cpu_count(),
        },
    }


def _git(*arguments: str) -> str:
    return subprocess.run(
        ["git", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        check=True,
    ).stdout
