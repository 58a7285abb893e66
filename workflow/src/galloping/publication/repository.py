"""The state of the git repository that the study is run in."""

from __future__ import annotations

import subprocess
from dataclasses import dataclass


@dataclass(frozen=True)
class Commit:
    """What is checked out.

    digest: of the commit. date: when it was made (ISO 8601). described: after the nearest tag, as
    `git describe` says. changes: files that are not as in the commit, as `git status` lists them.
    """

    digest: str
    date: str
    described: str
    changes: tuple[str, ...]


def commit() -> Commit | None:
    """The commit checked out in the working folder, or None if git does not know of one."""
    try:
        digest, date = _git("show", "--no-patch", "--format=%H %cI", "HEAD").split()
        return Commit(
            digest=digest,
            date=date,
            described=_git("describe", "--tags", "--always", "--dirty").strip(),
            changes=tuple(_git("status", "--porcelain", "--untracked-files=all").splitlines()),
        )
    except (OSError, subprocess.CalledProcessError):
        return None


def _git(*arguments: str) -> str:
    return subprocess.run(
        ["git", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        check=True,
    ).stdout
