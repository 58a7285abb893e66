"""The smoke study on a SLURM cluster, through faults, beside the same study without one."""

import re
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

import pytest
from slurm import NODES, Cluster
from studies import copy_repository

from galloping.reproducibility.processes import orphans
from galloping.reproducibility.receipts import receipt_path

pytestmark = pytest.mark.slurm

PATIENCE = 900.0  # seconds; a run takes about 150 on two free cores
SMOKE = ("--configfile", "config/smoke.yaml")
OPTIONS = (
    *SMOKE,
    *("--workflow-profile", "workflow/profiles/slurm"),
    # As in the profile, but with more than two jobs of cells, and asked after at once.
    *("--group-components", "case=20", "cell=2", "show=50"),
    *("--slurm-init-seconds-before-status-checks", "2"),
)
FINISHED = re.compile(r"^Finished jobid: \d+ \(Rule: (?!all\))", re.MULTILINE)


class Run:
    """The smoke study of a folder on the cluster. log: what Snakemake says."""

    def __init__(self, folder: Path, cluster: Cluster, log: Path):
        self.log, self.began = log, time.monotonic()
        with log.open("w") as file:
            self.process = subprocess.Popen(
                [sys.executable, "-m", "snakemake", *OPTIONS],
                cwd=folder,
                env=cluster.environment,
                stdin=subprocess.DEVNULL,
                stdout=file,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )

    def said(self) -> str:
        return self.log.read_text(encoding="utf-8", errors="replace")

    def until(self, done: Callable[[], bool], what: str) -> None:
        end = time.monotonic() + PATIENCE
        while not done():
            assert self.process.poll() is None, f"the study ended before {what}: {self.log}"
            assert time.monotonic() < end, f"waited in vain until {what}: {self.log}"
            time.sleep(0.5)

    def kill(self) -> None:
        """SIGKILL to the main process alone, which has no children but SLURM's commands."""
        self.process.kill()
        self.process.wait()


@dataclass(frozen=True)
class Disturbed:
    """A study that ended after faults.

    seconds: of its last run. cancelled, later: memory in MB and time in seconds that the cancelled
    job had asked for, and that jobs asked for that were submitted after it.
    """

    status: int
    said: str
    seconds: float
    cancelled: tuple[int, int]
    later: list[tuple[int, int]]


@pytest.fixture(scope="module")
def folder(root, tmp_path_factory):
    folder = tmp_path_factory.mktemp("slurm")
    copy_repository(root, folder)
    return folder


@pytest.fixture(scope="module")
def start(folder, cluster):
    """Begin a run; it ends with the tests if not before."""
    runs = []

    def begin() -> Run:
        runs.append(Run(folder, cluster, cluster.folder / f"run{len(runs) + 1}.log"))
        return runs[-1]

    yield begin
    for run in runs:
        run.kill()


def computing(cluster: Cluster, folder: Path) -> Callable[[], bool]:
    """Whether both nodes work on cells, and a model has been identified since this call."""
    before = identified(folder)
    return lambda: (
        all(cluster.jobs("RUNNING", node=node) for node in NODES)
        and bool(identified(folder) - before)
    )


def identified(folder: Path) -> set[tuple[Path, int]]:
    found = (folder / "results/smoke/identified").rglob("*.npz")
    return {(path, path.stat().st_mtime_ns) for path in found if not path.name.startswith(".")}


@pytest.fixture(scope="module")
def repaired(folder, cluster, start):
    """(jobs that a killed run had left on the cluster, what repair said)."""
    run = start()
    run.until(computing(cluster, folder), "both nodes worked")
    run.kill()
    left = cluster.jobs("RUNNING", "PENDING")
    repair = subprocess.run(
        [sys.executable, "workflow/scripts/repair.py", *SMOKE],
        cwd=folder,
        env={**cluster.environment, "PYTHONPATH": str(folder / "workflow/src")},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=PATIENCE,
        check=False,
    )
    assert repair.returncode == 0, repair.stdout
    return left, repair.stdout


@pytest.fixture(scope="module")
def disturbed(folder, cluster, start, repaired):
    """The study, run to its end while a job is cancelled and a node goes and comes back."""
    run = start()
    run.until(computing(cluster, folder), "both nodes worked")
    here, away = NODES
    (cancelled,) = cluster.jobs("RUNNING", node=here)
    asked = cluster.asked(cancelled)
    earlier = set(cluster.jobs("all"))
    cluster.query("scancel", cancelled)
    cluster.take_away(away)
    cluster.give_back(away)
    status = run.process.wait(PATIENCE)
    seconds = time.monotonic() - run.began
    later = [cluster.asked(job) for job in cluster.jobs("all") if job not in earlier]
    return Disturbed(status, run.said(), seconds, asked, later)


def outputs(folder: Path) -> dict[str, str]:
    """Digests of the results, without what tells of times and places."""
    results = folder / "results/smoke"
    return {
        str(path.relative_to(results)): sha256(path.read_bytes()).hexdigest()
        for path in results.rglob("*")
        if path.is_file()
        and path.suffix != ".receipt"
        and path.relative_to(results).parts[0] not in ("logs", "benchmarks")
    }


def test_repair_cancels_what_a_killed_run_left_on_the_cluster(repaired, folder, cluster):
    left, said = repaired
    assert len(left) >= 2
    assert f"cancelled {len(left)} SLURM jobs" in said
    assert "removed the lock" in said
    assert orphans(folder) == []


def test_study_ends_well_when_a_job_is_cancelled_and_a_node_lost(disturbed):
    assert disturbed.status == 0, disturbed.said


def test_cancelled_job_is_given_more(disturbed):
    memory, seconds = disturbed.cancelled
    assert (2 * memory, 2 * seconds) in disturbed.later


def test_results_have_the_bytes_of_a_local_run(disturbed, folder, study):
    assert study.first.returncode == 0, study.first.stdout
    local = outputs(study.folder)
    assert len(local) > 100
    assert outputs(folder) == local


def test_every_result_has_a_receipt(disturbed, folder):
    results = folder / "results/smoke"
    without = [name for name in outputs(folder) if not receipt_path(results / name).exists()]
    assert without == []


def test_jobs_a_minute(disturbed, study, rows):
    on_cluster = 60 * len(FINISHED.findall(disturbed.said)) / disturbed.seconds
    here = 60 * len(FINISHED.findall(study.first.stdout)) / study.seconds
    measured = {
        "jobs a minute on SLURM, a node lost and a job cancelled": on_cluster,
        "jobs a minute without SLURM, two cores": here,
    }
    rows += [
        {"quantity": quantity, "value": value, "unit": "1/min"}
        for quantity, value in measured.items()
    ]
    assert all(measured.values())


def test_second_run_has_nothing_to_do(disturbed, start):
    again = start()
    assert again.process.wait(PATIENCE) == 0
    assert "Nothing to be done" in again.said()
