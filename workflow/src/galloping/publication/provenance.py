"""What a study was made with: the commit, Python and the packages, the machine, the time taken."""

from __future__ import annotations

import csv
import os
import platform
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import distributions
from pathlib import Path

from packaging.utils import canonicalize_name

from galloping.reproducibility.plan import Plan
from galloping.reproducibility.receipts import Receipt

# columns of Snakemake's benchmark files
MEASURED = {"s": "wall_seconds", "cpu_time": "cpu_seconds", "max_rss": "peak_memory_mb"}


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


def run_times(plan: Plan, known: Mapping[str, Receipt]) -> list[dict[str, str]]:
    """One row a job, empty where nothing was measured.

    known: receipts by path of their file. work_seconds is the job's own work; the wall time holds
    the start of Python and the imports too.
    """
    rows = []
    for job in sorted(plan.jobs, key=lambda job: (job.rule, job.outputs)):
        receipt, measured = known.get(job.outputs[0]), {}
        if Path(job.benchmark).exists():
            with Path(job.benchmark).open(encoding="utf-8", newline="") as file:
                measured = next(csv.DictReader(file, delimiter="\t"), {})
        rows.append(
            {
                "rule": job.rule,
                "file": job.outputs[0],
                "work_seconds": f"{receipt.seconds:g}" if receipt else "",
                **{name: measured.get(key, "") for key, name in MEASURED.items()},
            }
        )
    return rows


def _git(*arguments: str) -> str:
    return subprocess.run(
        ["git", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        check=True,
    ).stdout
