"""The runs of a study: when, how long, with how many cores, and what work they did."""

from __future__ import annotations

import csv
from collections.abc import Iterable
from dataclasses import asdict, dataclass, fields
from datetime import datetime
from pathlib import Path

from galloping.reproducibility.receipts import Receipt, receipts
from galloping.storage import write_rows


@dataclass(frozen=True)
class Run:
    """One run that made something.

    began: ISO 8601, UTC. seconds: its wall time. jobs: those that finished. work_seconds: the sum
    of their own work, without the start of Python and the imports. outcome: finished or stopped.
    """

    began: str
    seconds: float
    cores: int
    jobs: int
    work_seconds: float
    outcome: str

    @property
    def overhead(self) -> float:
        """Core seconds that the run held for each second of work in its jobs."""
        return self.seconds * self.cores / self.work_seconds


def work(found: Iterable[Receipt]) -> dict[str, float]:
    """Seconds of work by job, each named by its log: a job with several files counts once."""
    return {receipt.log: receipt.seconds for receipt in found}


def note_run(results: str, began: datetime, seconds: float, cores: int, outcome: str) -> None:
    """Add a run to `runs.csv` of the results, if it made anything that is still there."""
    start = began.isoformat(timespec="seconds")
    jobs = work(receipt for receipt in receipts(results) if receipt.finished >= start)
    if jobs:
        run = Run(start, round(seconds, 3), cores, len(jobs), round(sum(jobs.values()), 3), outcome)
        write_rows(Path(results) / "runs.csv", [asdict(one) for one in (*runs(results), run)])


def runs(results: str) -> list[Run]:
    """The runs of a study, the last one last."""
    try:
        with (Path(results) / "runs.csv").open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
    except FileNotFoundError:
        return []
    kinds = {"str": str, "int": int, "float": float}
    return [Run(**{f.name: kinds[f.type](row[f.name]) for f in fields(Run)}) for row in rows]
