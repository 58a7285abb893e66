"""A disk that is full, or that cannot be written."""

import shutil
import subprocess

import pytest
from trial import RUN, SMOKE

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("study"), pytest.mark.faults]

JOB_STOPPED = r"^The study stopped: The disk is full: .* free some space and run again "
REFUSED = r"^The disk of \S+ is full: free some space and run again\.$"


def put_on_small_disk(trial, folder, spare):
    """Move a folder to a memory disk with `spare` bytes left."""
    aside = folder.with_name("aside")
    folder.rename(aside)
    folder.mkdir()
    trial.mount(folder, "-t", "tmpfs", "-o", "size=1g", "tmpfs")
    subprocess.run(["cp", "-a", f"{aside}/.", folder], check=True)
    shutil.rmtree(aside)
    trial.mount(folder, "-o", f"remount,size={shutil.disk_usage(folder).used + spare}")


def grow(trial, folder):
    trial.mount(folder, "-o", "remount,size=1g")


@pytest.mark.parametrize(
    ("fault", "part", "spare", "line"),
    [
        ("disk of the results full", SMOKE, 1_200_000, JOB_STOPPED),
        ("disk of the project full", "", 1_500_000, JOB_STOPPED),
        ("disk of the project full to the last byte", "", 0, REFUSED),
    ],
    ids=["results", "project", "last byte"],
)
def test_full(begin, fault, part, spare, line):
    trial = begin(fault, at=0.5)
    disk = trial.folder / part
    put_on_small_disk(trial, disk, spare)
    run = trial.run(RUN)
    trial.note_finished()
    trial.expect(run, line)
    grow(trial, disk)
    trial.recover(RUN)
    trial.check()


def test_read_only(begin):
    trial = begin("results read-only", at=0.8)
    trial.note_finished()
    trial.mount(trial.results, "--bind", str(trial.results))
    trial.mount(trial.results, "-o", "remount,ro,bind")
    trial.expect(trial.run(RUN), rf"^\S+/{SMOKE} is read-only: make it writable and run again\.$")
    trial.mount(trial.results, "-o", "remount,rw,bind")
    trial.recover(RUN)
    trial.check()
