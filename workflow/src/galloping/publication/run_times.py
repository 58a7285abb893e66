"""What each job of a study took, as one table."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Mapping
from pathlib import Path

from galloping.reproducibility.plan import PlannedJob
from galloping.reproducibility.receipts import Receipt

# columns of Snakemake's benchmark files
MEASURED = {"s": "wall_seconds", "cpu_time": "cpu_seconds", "max_rss": "peak_memory_mb"}


def run_times(jobs: Iterable[PlannedJob], known: Mapping[str, Receipt]) -> list[dict[str, str]]:
    """One row a job by rule and wildcards, empty where nothing was recorded.

    known: receipts by path of their file. work_seconds is the job's own work; the wall time holds
    the start of Python and the imports too.
    """
    rows = []
    for job in sorted(jobs, key=lambda job: (job.rule, job.log)):
        receipt = known.get(job.outputs[0])
        measured = _benchmark(Path(job.benchmark))
        rows.append(
            {
                "rule": job.rule,
                "wildcards": " ".join(f"{name}={value}" for name, value in job.wildcards.items()),
                "work_seconds": f"{receipt.seconds:g}" if receipt else "",
                **{name: measured.get(key, "") for key, name in MEASURED.items()},
            }
        )
    return rows


def _benchmark(path: Path) -> dict[str, str]:
    """The measurements of one job; none if it was not measured."""
    try:
        with path.open(encoding="utf-8", newline="") as file:
            measured = next(csv.DictReader(file, delimiter="\t"), {})
    except FileNotFoundError:
        return {}
    return {name: "" if value in ("NA", "-") else value for name, value in measured.items()}
