"""What keeps a run from starting, or ends one, beside its jobs."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

from galloping.reproducibility.inspection import locked
from galloping.reproducibility.processes import orphans, running

FULL = 1 << 20  # bytes: with less, Snakemake cannot even keep its records


def obstacle(results: str, repair: str) -> str | None:
    """A line that says what is in the way of a run in the working folder and what to do about it.

    repair: the command that brings the study of a killed run back.
    """
    folder = Path.cwd()
    if locked() and (live := running(folder)):
        return f"Process {live[0].pid} is running a study in this folder: wait for it, or stop it."
    if locked() or orphans(folder):
        return f"A run in this folder was killed: `{repair}` takes it from there."
    for place in filter(Path.exists, (folder, folder / results)):
        if not os.access(place, os.W_OK):
            return f"{place} is read-only: make it writable and run again."
        if shutil.disk_usage(place).free < FULL:
            return f"The disk of {place} is full: free some space and run again."
    return None
