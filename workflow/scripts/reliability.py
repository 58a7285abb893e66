"""How reliable the project is, in numbers: reliability.py OUTPUT.csv.

From what `make test-faults` and `make test-slurm` have written to results/reliability, and from the
runs of the study. What has not been measured says so.
"""

import csv
import statistics
import sys
from pathlib import Path

from galloping.reproducibility.receipts import receipts
from galloping.reproducibility.runs import runs, work
from galloping.storage import write_rows

MEASURED = Path("results/reliability")
STUDIES = {"the default study": "results", "the small version": "results/smoke"}
NOT_MEASURED = "not measured"


def table(name: str) -> list[dict[str, str]]:
    """A table of results/reliability, empty if it has not been written."""
    try:
        with (MEASURED / f"{name}.csv").open(encoding="utf-8", newline="") as file:
            return list(csv.DictReader(file))
    except FileNotFoundError:
        return []


def row(quantity: str, value: object, unit: str, bar: str = "") -> dict[str, object]:
    return {"quantity": quantity, "value": value, "unit": unit, "bar": bar}


def of_faults(faults: list[dict[str, str]]) -> list[dict]:
    """Counts and medians; a fault that could not be tried counts apart."""
    tried = [fault for fault in faults if not fault["said"].startswith("not tried")]
    mended = [fault for fault in tried if fault["results_wrong"] != ""]

    def total(column: str) -> object:
        return sum(int(fault[column]) for fault in mended) if mended else NOT_MEASURED

    def median(column: str) -> object:
        times = [float(fault[column]) for fault in mended if fault[column]]
        return statistics.median(times) if times else NOT_MEASURED

    return [
        row("faults tried", len(tried) or NOT_MEASURED, "1"),
        row("faults that could not be tried here", len(faults) - len(tried), "1"),
        row("faults without recovery", len(tried) - len(mended), "1", "0"),
        row("results lost", total("results_lost"), "1", "0"),
        row("results wrong", total("results_wrong"), "1", "0"),
        row("median time to resume, to the first new job", median("seconds_to_first_job"), "s"),
        row("median time to resume, to the whole study", median("seconds_to_resume"), "s"),
    ]


def of_work(study: str, results: str) -> dict:
    """Overhead of the last run that made a whole study, over the work of its jobs."""
    whole = len(work(receipts(results)))
    cold = [run for run in runs(results) if run.outcome == "finished" and run.jobs == whole]
    overhead = cold[-1].overhead if cold else NOT_MEASURED
    place = f" on {cold[-1].cores} cores" if cold else ""
    bar = "<= 1.5" if study == "the default study" else ""
    return row(f"wall time of {study}{place} over that of its numerical work", overhead, "1", bar)


def of_table(name: str, missing: str, unit: str, bars: dict[str, str]) -> list[dict]:
    """The rows of a measured table with their bars, or one that says that it is missing."""
    found = [r for r in table(name) if r["unit"] == unit]
    return [
        row(r["quantity"], float(r["value"]), unit, bars.get(r["quantity"], "")) for r in found
    ] or [row(missing, NOT_MEASURED, unit)]


def main(output: str) -> None:
    write_rows(
        output,
        [
            *of_faults(table("faults")),
            *(of_work(study, results) for study, results in STUDIES.items()),
            *of_table("slurm", "jobs a minute on SLURM", "1/min", {}),
            *of_table(
                "planning", "snakemake -n", "s", {"snakemake -n of the default study": "<= 5"}
            ),
        ],
    )
    print(Path(output).read_text(encoding="utf-8"), end="")


if __name__ == "__main__":
    main(*sys.argv[1:])
