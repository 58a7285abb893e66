"""One real run of the smoke study, in copies of the repository, for all tests that look at it."""

from __future__ import annotations

import fcntl
import multiprocessing
import os
import pickle
import shutil
import subprocess
import sys
import time
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import pandas as pd
import plans
import pytest

CONFIGURATION = "config/smoke.yaml"


def run(folder: Path, *command: object, **variables: str) -> subprocess.CompletedProcess:
    """What Python says of a script, or `-m` a module, in a folder."""
    return subprocess.run(
        [sys.executable, *map(str, command)],
        cwd=folder,
        env={**os.environ, **variables},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )


def script(folder: Path, name: str, *options: object) -> tuple[int, list[str]]:
    """(exit code, lines) of one of the project's scripts."""
    source = str(folder / "workflow" / "src")
    done = run(folder, f"workflow/scripts/{name}.py", *options, PYTHONPATH=source)
    return done.returncode, done.stdout.splitlines()


@dataclass(frozen=True)
class Study:
    """A copy of the repository.

    first: Snakemake's own output of the first run. began: when it did, in seconds since the epoch;
    seconds: how long it took.
    """

    folder: Path
    first: subprocess.CompletedProcess | None = None
    began: float = 0.0
    seconds: float = 0.0

    @property
    def results(self) -> Path:
        return self.folder / "results" / "smoke"

    def copied(self, folder: Path) -> Study:
        """A copy of a study that ran to its end."""
        assert self.first.returncode == 0, "the smoke study failed: see test_smoke.py"
        shutil.copytree(self.folder, folder, symlinks=True)
        return replace(self, folder=folder)

    def snakemake(
        self, *options: str, config: tuple[str, ...] = (), **variables: str
    ) -> subprocess.CompletedProcess:
        """The smoke study with further configuration files, options and environment variables."""
        command = ("-m", "snakemake", "--configfile", CONFIGURATION, *config, "--cores", "2")
        return run(self.folder, *command, *options, **{"PYTHONPATH": "", **variables})

    def ran(self, *options: str, **how) -> str:
        """What is said of a run that comes to its end."""
        done = self.snakemake(*options, **how)
        assert done.returncode == 0, done.stdout
        return done.stdout

    def keep(self, name: str, *options: object) -> tuple[int, list[str]]:
        """(exit code, lines) of a command on the results."""
        return script(self.folder, "keep_results", name, *options, "--configfile", CONFIGURATION)

    def table(self, name: str) -> pd.DataFrame:
        return pd.read_csv(self.results / "tables" / f"{name}.csv")

    def files(self) -> dict[str, tuple[int, int]]:
        """Size and time of every file, but Snakemake's records and compiled Python."""
        found = {}
        for path in self.folder.rglob("*"):
            name = path.relative_to(self.folder)
            if path.is_file() and not {".snakemake", "__pycache__"} & set(name.parts):
                found[str(name)] = (path.stat().st_size, path.stat().st_mtime_ns)
        return found


def copy_repository(root: Path, folder: Path) -> None:
    """What is or will be tracked by git, of the results only the published ones, and what numba
    compiled of it."""
    command = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    listed = subprocess.check_output(command, cwd=root, text=True)
    compiled = (root / "workflow" / "src").rglob("*.nb[ci]")
    for name in [*filter(None, listed.split("\0")), *(c.relative_to(root) for c in compiled)]:
        source = root / name
        if source.is_file() or source.is_symlink():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(source, folder / name, follow_symlinks=False)


def hold_to_reference(tables, reference):
    """Asserts that a study's tables have the numbers of its reference.

    Where they should not have them any more, `make reference` takes the new ones.
    """
    summary = pd.read_csv(tables / "reference_summary.csv").set_index("table")
    differences = pd.read_csv(tables / "reference_differences.csv")
    names = {path.stem for path in reference.glob("*.csv")}
    assert names | {"settings", "processor"} == set(summary.index)
    assert (summary["values_compared"] > 0).all()
    verdicts = summary["verdict"]
    assert verdicts["settings"] == "agrees"
    if verdicts["processor"] == "agrees":
        assert verdicts[verdicts != "agrees"].to_dict() == {}
        assert differences.empty
        assert summary["largest_difference_in_tolerances"].max() < 0.1
    # Another processor rounds otherwise, which decides where the data cannot tell models apart,
    # and the whole of motion that never repeats: the resonant line's from 12 m/s on.
    assert not differences["verdict"].str.startswith("only").any()
    chaotic = differences["row"].str.contains(r"\bcase=internal_resonance(?:,|$)")
    chaotic &= differences["table"].isin(("resonance_map", "clearance", "measures"))
    tables = differences.loc[~chaotic & (differences["table"] != "processor"), "table"]
    share = tables.value_counts() / summary["values_compared"]
    assert share[share > 0.05].to_dict() == {}


@pytest.fixture(scope="session")
def fresh(root, tmp_path_factory):
    """A copy in which nothing has been run."""
    folder = tmp_path_factory.mktemp("fresh")
    copy_repository(root, folder)
    return Study(folder)


@pytest.fixture(scope="session")
def study(root, tmp_path_factory, worker_id):
    """A copy in which the smoke study has been run once: by the first process that needs it."""
    base = tmp_path_factory.getbasetemp()
    shared = (base if worker_id == "master" else base.parent) / "finished"
    with shared.with_suffix(".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not shared.exists():
            copy_repository(root, shared)
            began = time.time()
            first = Study(shared).snakemake()
            ran = Study(shared, first, began, time.time() - began)
            shared.with_suffix(".run").write_bytes(pickle.dumps(ran))
    ran = pickle.loads(shared.with_suffix(".run").read_bytes())
    folder = tmp_path_factory.mktemp("study")
    shutil.copytree(shared, folder, symlinks=True, dirs_exist_ok=True)
    return replace(ran, folder=folder)


@pytest.fixture(scope="session")
def planned():
    """The plan of a study of a folder and configuration files, each in a process of its own that
    has Snakemake imported already: for half of what as many starts of Snakemake cost.
    """
    forks = multiprocessing.get_context("forkserver")
    forks.set_forkserver_preload(["pandas", "pydantic", "snakemake.api"])
    with forks.Pool(1, maxtasksperchild=1) as pool:
        yield lambda *of: pool.apply(plans.plan, of)


@pytest.fixture(scope="session")
def jobs_of(root, planned, tmp_path_factory):
    """The jobs of the default study with other settings, by the first file that they write."""
    folder = tmp_path_factory.mktemp("plans")
    shutil.copytree(root / "config", folder / "config")
    for name in ("workflow", "examples"):
        (folder / name).symlink_to(root / name)

    @cache
    def jobs(text):
        (folder / "mine.yaml").write_text(text, encoding="utf-8")
        return {job["outputs"][0]: job for job in planned(folder, "mine.yaml")}

    return jobs
