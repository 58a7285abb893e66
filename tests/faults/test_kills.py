"""Kills and interruptions, of the study, of its jobs and of its repair."""

import os
import random
import re
import shutil
import signal
import time

import psutil
import pytest
from commands import JOB_STARTS
from trial import REPAIR, RUN

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("study")]

LEAD = 2.0  # seconds that a run works before it is killed
KILLED = rf"^A run in this folder was killed: `{re.escape(REPAIR)}` takes it from there\.$"


def moments(number, seed):
    """Parts of the study's time; the last two also in the short run of the tests."""
    draw = random.Random(seed)
    parts = sorted(draw.uniform(0, 0.95) for _ in range(number))
    return [
        pytest.param(part, id=f"{part:.2f}", marks=() if part in parts[-2:] else pytest.mark.faults)
        for part in parts
    ]


def run_until(trial_of, part, span):
    """(trial, run): a run of the study that has come to this part of its time.

    It begins with what the undisturbed study had made a little earlier.
    """
    length = span[1] - span[0]
    moment = part * length
    trial = trial_of(at=max(moment - LEAD, 0) / length)
    trial.row["moment"] = f"{moment:.1f} s of {length:.1f} s"
    run = trial.start()
    if moment > LEAD:
        run.until(lambda: JOB_STARTS.search(run.said()))
        time.sleep(LEAD)
    else:
        run.until(run.snakemake)
        time.sleep(moment)
    return trial, run


def kill_snakemake(run):
    run.until(run.snakemake).kill()
    run.wait()


def kill_all(run):
    os.killpg(run.process.pid, signal.SIGKILL)
    psutil.wait_procs(list(run.members()), timeout=10)
    run.wait()


@pytest.mark.parametrize("part", moments(20, seed=4))
def test_snakemake_killed(begin, span, part):
    trial, run = run_until(lambda **at: begin("SIGKILL of Snakemake", **at), part, span)
    kill_snakemake(run)
    trial.note_finished()
    trial.expect(run, KILLED)
    trial.recover(REPAIR)
    trial.check()


@pytest.mark.faults
def test_snakemake_killed_before_its_first_job(begin):
    trial = begin("SIGKILL of Snakemake before its first job", at=0.8)
    run = trial.start()
    run.until(lambda: any((trial.folder / ".snakemake/locks").glob("*")))
    kill_snakemake(run)
    trial.note_finished()
    trial.expect(run, KILLED)
    trial.recover(REPAIR)
    trial.check()


@pytest.mark.faults
@pytest.mark.parametrize("part", [0.2, 0.5, 0.8])
def test_everything_killed(begin, span, part):
    trial, run = run_until(
        lambda **at: begin("SIGKILL of Snakemake and its jobs", **at), part, span
    )
    kill_all(run)
    trial.note_finished()
    trial.expect(trial.run(RUN), KILLED)
    trial.recover(REPAIR)
    trial.check()


@pytest.mark.faults
def test_a_job_killed(begin):
    trial = begin("SIGKILL of a job", at=0.5)
    run = trial.start()
    job = run.until(lambda: run.jobs())[0]
    job.suspend()  # so that it cannot end before the kill
    job.kill()
    run.wait()
    trial.note_finished()
    trial.expect(run, r"^The study stopped: .*killed.* run it again to go on\.$")
    trial.recover(RUN)
    trial.check()


@pytest.mark.faults
def test_interrupted(begin):
    trial = begin("Ctrl-C", at=0.5)
    run = trial.start()
    run.until(lambda: run.jobs())
    os.killpg(run.process.pid, signal.SIGINT)
    run.wait()
    trial.note_finished()
    trial.expect(run, r"^Interrupted\. Finished jobs are kept; run it again to go on\.$")
    trial.recover(RUN)
    trial.check()


@pytest.mark.faults
def test_a_second_run(begin):
    trial = begin("a second run in the same folder", at=0.7)
    first = trial.start()
    first.until(lambda: first.jobs())
    trial.note_finished()
    pid = first.snakemake().pid
    trial.expect(trial.run(RUN), rf"^Process {pid} is running a study in this folder: wait for it")
    trial.row["recovery"] = "none: the first run goes on"
    assert first.wait() == 0, first.said()
    trial.check()


@pytest.mark.faults
def test_repair_of_a_live_run(begin):
    trial = begin("repair while a run is alive", at=0.7)
    first = trial.start()
    first.until(lambda: first.jobs())
    trial.note_finished()
    pid = first.snakemake().pid
    trial.expect(
        trial.run(REPAIR), rf"^[Pp]rocess {pid} is running a study in this folder: wait for it"
    )
    trial.row["recovery"] = "none: the run goes on"
    assert first.wait() == 0, first.said()
    trial.check()


@pytest.mark.faults
def test_a_run_over_orphans(begin):
    trial = begin("a run started while orphans of a killed one work", at=0.3)
    run = trial.start()
    run.until(lambda: run.jobs("identify_model"))
    kill_snakemake(run)
    trial.note_finished()
    shutil.rmtree(trial.folder / ".snakemake/locks")
    assert run.jobs()
    trial.expect(trial.run(RUN), KILLED)
    trial.recover(REPAIR)
    trial.check()


@pytest.mark.faults
def test_repair_killed_while_it_computes(begin):
    trial = begin("SIGKILL of Snakemake, then of the one that repair runs", at=0.6)
    run = trial.start()
    run.until(lambda: run.jobs())
    kill_snakemake(run)
    trial.note_finished()
    repair = trial.start(REPAIR)
    repair.until(lambda: JOB_STARTS.search(repair.said()) and repair.jobs())
    kill_snakemake(repair)
    trial.expect(repair, KILLED)
    trial.recover(REPAIR)
    trial.check()


@pytest.mark.faults
def test_repair_killed_while_it_sets_aside(begin):
    trial = begin("SIGKILL of repair while it sets damaged files aside")
    trial.note_finished()
    damaged = sorted((trial.results / "tables").glob("*.csv"))
    for table in damaged:
        table.write_text("edited\n")
    trial.note_harmed(*damaged)
    trial.expect(trial.run(RUN), r"^results/smoke/tables/claims\.csv and \d+ more: edited or")
    repair = trial.start(REPAIR)
    repair.until((trial.results / "set_aside").exists)
    kill_all(repair)
    trial.recover(REPAIR)
    trial.check()
    kept = (trial.results / "set_aside/tables").iterdir()
    assert {path.read_text() for path in kept} == {"edited\n"}
