"""The jobs that a study has on a SLURM cluster, which outlive a main process that was killed."""

from __future__ import annotations

import getpass
import re
import shutil
import subprocess
import time
from pathlib import Path

from galloping.reproducibility.inspection import RECORDS

# Snakemake names all jobs of a run by one UUID, after a prefix if one is configured.
OF_SNAKEMAKE = re.compile(r"([\w-]+_)?[0-9a-f]{8}(-[0-9a-f]{4}){3}-[0-9a-f]{12}")
SUBMITTED = RECORDS / "slurm_logs"


class ClusterError(RuntimeError):
    """SLURM does not do as it is told; the message says what to do."""


def cancel_jobs(folder: Path, patience: float = 120.0) -> list[str]:
    """Cancel the jobs that SLURM has of this user's runs in `folder`; return when they are gone.

    patience: in seconds; SLURM itself gives a job 30 s to end after a first signal.

    Returns the ids of the jobs; none on a machine without SLURM. Raises ClusterError if SLURM
    cannot be asked although a run in `folder` has submitted to it, or if jobs do not end.
    """
    if not shutil.which("squeue"):
        return []
    try:
        cancelled = left = _jobs(folder)
    except ClusterError:
        if (folder / SUBMITTED).exists():
            raise
        return []
    if cancelled:
        _ask("scancel", "--quiet", *cancelled)
    end = time.monotonic() + patience
    while left:
        if time.monotonic() > end:
            raise ClusterError(
                f"SLURM jobs {' '.join(left)} do not end: try again when `squeue` has them no more"
            )
        time.sleep(1)
        left = _jobs(folder)
    return cancelled


def _jobs(folder: Path) -> list[str]:
    listed = _ask("squeue", "--noheader", "--user", getpass.getuser(), "--format", "%A|%j|%Z")
    jobs = [line.split("|", 2) for line in listed.splitlines()]
    return [
        number
        for number, name, where in jobs
        if OF_SNAKEMAKE.fullmatch(name) and Path(where).resolve() == folder.resolve()
    ]


def _ask(*command: str) -> str:
    try:
        run = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True)
    except (OSError, subprocess.SubprocessError) as error:
        said = (getattr(error, "stderr", None) or str(error)).strip().splitlines()[-1]
        raise ClusterError(
            f"SLURM does not answer ({said}): jobs of a killed run may still be writing here; "
            "try again when it does"
        ) from error
    return run.stdout
