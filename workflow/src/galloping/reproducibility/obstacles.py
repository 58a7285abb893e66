"""What keeps a run from starting, or has ended one, beside its jobs."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterable
from pathlib import Path

from galloping.reproducibility.inspection import locked
from galloping.reproducibility.processes import orphans, running

FULL = 1 << 20  # bytes: with less, Snakemake cannot even keep its records


def other_run(folder: Path, repair: str) -> str | None:
    """A line about another run in `folder`, the working folder, and what to do about it.

    repair: the command that brings the study of a killed run back.
    """
    if locked() and (live := running(folder)):
        return f"Process {live[0].pid} is running a study in this folder: wait for it, or stop it."
    if locked() or orphans(folder):
        return f"A run in this folder was killed: `{repair}` takes it from there."
    return None


def unwritable(folders: Iterable[Path]) -> str | None:
    """A line about the first existing folder that is read-only or on a full disk."""
    for folder in filter(Path.exists, folders):
        name = "This folder" if folder == Path.cwd() else folder
        if not os.access(folder, os.W_OK):
            return f"{name} is read-only: make it writable and run again."
        if shutil.disk_usage(folder).free < FULL:
            return f"{name}: the disk is full; free some space and run again."
    return None
