"""Puts published results in place, as if their jobs had run here; whole or not at all."""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Collection, Iterator, Mapping
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

from galloping.publication.archive import unpack
from galloping.publication.crate import REPORT
from galloping.publication.unpacked import published_receipts, settings
from galloping.publication.verification import faults
from galloping.reproducibility.plan import Plan
from galloping.reproducibility.receipts import (
    Receipt,
    digest,
    read_receipt,
    receipt_path,
    receipts,
    write_receipt,
)
from galloping.reproducibility.recovery import adopt, set_aside
from galloping.storage import partial_prefix


class NotRestorable(ValueError):
    """An archive that is not restored; one line a reason."""


def restore(archive: Path, plan: Plan, *, replacing: bool = False) -> Iterator[str]:
    """Put the results of an archive where the plan wants them; says what was done.

    No result is written before the archive is found whole. Afterwards Snakemake takes a file as
    made if its receipt, and those of all that it was made from, are of the plan's jobs with the
    plan's settings; others are set aside. replacing: set results aside that are not those of the
    archive. Raises UnsafeArchive, NotAPublication and NotRestorable.
    """
    results = plan.settings["results"]
    Path(results).mkdir(parents=True, exist_ok=True)
    # on the file system of the results; `make repair` sweeps it if this process is killed
    with tempfile.TemporaryDirectory(prefix=partial_prefix(), dir=results) as temporary:
        folder = Path(temporary)
        unpack(archive, folder)
        if found := list(faults(folder)):
            raise NotRestorable("\n".join(found))
        made = {receipt.path: receipt for receipt in published_receipts(folder)}
        if (theirs := settings(folder)["results"]) != results:
            raise NotRestorable(f"results: {theirs!r} in the archive, {results!r} here")
        digests = {path: receipt.sha256 for path, receipt in made.items()}
        if (report := folder / results / REPORT).exists():
            digests[f"{results}/{REPORT}"] = digest(report)
        others = [path for path in _present(plan) if digests.get(path) != digest(path)]
        if others and not replacing:
            more = f" and {len(others) - 1} more" if others[1:] else ""
            raise NotRestorable(
                f"{others[0]}{more}: not as in the archive; REPLACE=yes sets what differs aside"
            )
        plan.begin(plan.jobs)
        with ExitStack() as undoing:
            for path in others:
                _clear(results, path, undoing)
            placed = _place(folder, digests, undoing)
            _write_receipts(made, placed, undoing)
            undoing.pop_all()
    now = time.time_ns()
    for path in _present(plan):
        os.utime(path, ns=(now, now))  # none is newer than what was made from it
    if others:
        yield f"{len(others)} other files set aside in {results}/set_aside"
    yield f"{len(placed)} files restored"
    yield from adopt(plan)


def _present(plan: Plan) -> list[str]:
    """The files of the study that are in place: planned, made, or its report."""
    results = plan.settings["results"]
    known = {path for job in plan.jobs for path in job.outputs}
    known |= {receipt.path for receipt in receipts(results)} | {f"{results}/{REPORT}"}
    return sorted(path for path in known if Path(path).exists())


def _clear(results: str, path: str, undoing: ExitStack) -> None:
    """Set a file aside and drop its receipt."""
    if receipt := read_receipt(path):
        receipt_path(path).unlink()
        undoing.callback(write_receipt, receipt)
    undoing.callback(set_aside(results, path).replace, path)


def _place(folder: Path, digests: Mapping[str, str], undoing: ExitStack) -> list[str]:
    """Move the files of the archive that are not here yet to their places; which."""
    placed = [path for path in digests if (folder / path).exists() and not Path(path).exists()]
    for path in placed:
        Path(path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).replace(path)
        undoing.callback(Path(path).unlink)
    return placed


def _write_receipts(
    made: Mapping[str, Receipt], placed: Collection[str], undoing: ExitStack
) -> None:
    """Write the receipts of the archive, but of files that were here, with a receipt, before."""
    for path, receipt in made.items():
        present, earlier = Path(path).exists(), read_receipt(path)
        if earlier and present and path not in placed:
            continue
        if earlier:
            undoing.callback(write_receipt, earlier)
        else:
            undoing.callback(receipt_path(path).unlink, missing_ok=True)
        write_receipt(replace(receipt, kept=present))
