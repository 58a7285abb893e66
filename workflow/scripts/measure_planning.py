"""Time and memory that Snakemake takes to plan: measure_planning.py OUTPUT.csv.

For the default study and for one of 5,000 jobs, which has more noise levels, in a temporary copy
of the project as git has it staged. Nothing is computed.
"""

import os
import re
import statistics
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import yaml

from galloping.storage import write_rows

ROOT = Path(__file__).parents[2]
LEVELS = 96  # noise levels of the larger study
REPEATS = 3  # of the default study's plan; the others take long enough to be steady


@dataclass(frozen=True)
class Planning:
    """One plan. seconds: median wall time; memory: largest resident set in MiB."""

    jobs: int
    seconds: float
    memory: float


def plan(folder: Path, *options: str, repeats: int = 1) -> Planning:
    """Run `snakemake -n` in a copy of the project."""
    said = folder / "plan.log"
    times, memory = [], 0.0
    for _ in range(repeats):
        start = time.perf_counter()
        with said.open("w") as file:
            process = subprocess.Popen(
                [sys.executable, "-m", "snakemake", "-n", "--quiet", "rules", *options],
                cwd=folder,
                stdout=file,
                stderr=file,
            )
            _, status, usage = os.wait4(process.pid, 0)
        times.append(time.perf_counter() - start)
        if status:
            sys.exit(f"snakemake -n failed: {said.read_text().strip().splitlines()[-1]}")
        memory = max(memory, usage.ru_maxrss / 1024)
    jobs = int(re.search(r"^total +(\d+)$", said.read_text(), re.MULTILINE)[1])
    return Planning(jobs, statistics.median(times), memory)


def rows(name: str, found: Planning) -> list[dict]:
    return [
        {"quantity": f"jobs of {name}", "value": found.jobs, "unit": "1"},
        {"quantity": f"snakemake -n of {name}", "value": found.seconds, "unit": "s"},
        {"quantity": f"memory of snakemake -n of {name}", "value": found.memory, "unit": "MiB"},
    ]


def main(output: str) -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        subprocess.run(
            ["git", "checkout-index", "--all", f"--prefix={folder}/"], cwd=ROOT, check=True
        )
        larger = folder / "larger.yaml"
        levels = [round(0.001 * number, 3) for number in range(LEVELS)]
        larger.write_text(yaml.safe_dump({"measurement": {"levels": levels}}))
        cluster = ("--workflow-profile", "workflow/profiles/slurm")
        write_rows(
            output,
            [
                *rows("the default study", plan(folder, repeats=REPEATS)),
                *rows("a larger study", plan(folder, "--configfile", str(larger))),
                *rows(
                    "the larger study for a cluster",
                    plan(folder, *cluster, "--configfile", str(larger)),
                ),
            ],
        )


if __name__ == "__main__":
    main(*sys.argv[1:])
