"""Brings a study back to a state from which it can go on, whatever ended or befell it."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from galloping.reproducibility.cluster import cancel_jobs
from galloping.reproducibility.inspection import RECORDS, inspect, locked
from galloping.reproducibility.plan import Plan, PlannedJob
from galloping.reproducibility.processes import end, orphans, running
from galloping.reproducibility.receipts import (
    Receipt,
    consistent,
    read_receipt,
    receipt_path,
    receipts,
    write_receipt,
)
from galloping.storage import PARTIAL

SET_ASIDE = "set_aside"


class StillRunning(RuntimeError):
    """A live run works in the folder; the message says which."""


def release(folder: Path) -> Iterator[str]:
    """End what a killed run left running and take its lock; says what was done.

    Raises StillRunning if the run is alive on this machine, ClusterError if its jobs on a cluster
    cannot be ended.
    """
    if live := running(folder):
        raise StillRunning(
            f"process {live[0].pid} is running a study in this folder: wait for it, or stop it"
        )
    if cancelled := cancel_jobs(folder):
        yield f"cancelled {len(cancelled)} SLURM jobs that a killed run had left"
    if left := orphans(folder):
        end(left)
        yield f"ended {len(left)} jobs that a killed run had left running"
    if locked():
        shutil.rmtree(folder / RECORDS / "locks")
        yield "removed the lock of a killed run"


def sweep(results: str) -> Iterator[str]:
    """Remove what a killed process had not finished writing (see `storage.replacing`)."""
    for path in sorted(Path(results).rglob(f"{PARTIAL}*")):
        shutil.rmtree(path) if path.is_dir() else path.unlink()
        yield f"removed the unfinished {path}"


def set_aside_damaged(results: str) -> Iterator[str]:
    """Move files that are not what their jobs wrote out of the way; their receipts stay.

    A receipt without its file lets the next run make the file again.
    """
    for receipt in inspect(receipts(results), thorough=True).damaged:
        kept = set_aside(results, receipt.path)
        yield f"{receipt.path} was edited or damaged: set aside as {kept}"


def set_aside_unknown(plan: Plan) -> Iterator[str]:
    """Move planned files without a receipt that can be read out of the way.

    A receipt without a digest takes its place, so that the next run makes the file again.
    """
    results = plan.settings["results"]
    for job in plan.jobs:
        for path in job.outputs:
            if Path(path).exists() and read_receipt(path) is None:
                kept = set_aside(results, path)
                write_receipt(job.unmade(path))
                yield f"{path} has no receipt that can be read: set aside as {kept}"


def adopt(plan: Plan) -> Iterator[str]:
    """Let Snakemake's records take over files that are exactly those of the plan.

    For results of which Snakemake lacks records. A file counts if its receipt names the same
    settings and code as the plan, and the same inputs as the receipts of those, and so on back to
    the first files; the caller has made sure that files are as in their receipts. Others are set
    aside, to be made again.
    """
    results = plan.settings["results"]
    known = {receipt.path: receipt for receipt in receipts(results)}
    adopted = [job for job in _as_planned(plan, known) if _complete(job, known)]
    kept = {path for job in adopted for path in job.outputs if Path(path).exists()}
    others = sorted(({p for job in plan.jobs for p in job.outputs} | known.keys()) - kept)
    others = [path for path in others if Path(path).exists()]
    for path in others:
        set_aside(results, path)
    for path in known.keys() - {path for job in plan.jobs for path in job.outputs}:
        receipt_path(path).unlink()  # else the file would be missed
    plan.record(adopted)  # last: what has no record when this is killed is adopted the next time
    if kept:
        yield f"{len(kept)} files are as their receipts say and made as configured now: kept"
    if others:
        yield (
            f"{len(others)} files were made otherwise than configured now: set aside in "
            f"{results}/{SET_ASIDE}"
        )


def set_aside(results: str, path: str) -> Path:
    """Move a file of the results out of the way, over no other one; where to."""
    base = Path(results) / SET_ASIDE / Path(path).relative_to(results)
    target, number = base, 1
    while target.exists():
        number += 1
        target = base.with_name(f"{base.name}.{number}")
    target.parent.mkdir(parents=True, exist_ok=True)
    Path(path).replace(target)
    return target


def _as_planned(plan: Plan, known: dict[str, Receipt]) -> list[PlannedJob]:
    """The jobs of which no receipt, nor any of what they were made from, tells otherwise."""
    maker = {path: job for job in plan.jobs for path in job.outputs}

    @cache
    def as_planned(log: str) -> bool:
        job = jobs[log]
        before = {maker[path].log for path in job.inputs if path in maker}
        return all(map(as_planned, sorted(before))) and all(
            job.made(known[path]) and consistent(known[path], known)
            for path in job.outputs
            if path in known
        )

    jobs = {job.log: job for job in plan.jobs}
    return [job for job in plan.jobs if as_planned(job.log)]


def _complete(job: PlannedJob, known: dict[str, Receipt]) -> bool:
    """Whether all that a job writes is here, or was left elsewhere on purpose."""
    return all(
        path in known and (Path(path).exists() or not known[path].kept) for path in job.outputs
    )
