"""Snakemake's records of the study, deleted."""

import os
import re
import shutil
import signal

import pytest
from trial import REPAIR, RUN, Trial, contents, copy, recorded, written

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("study"), pytest.mark.faults]

GONE = (
    r"^results/smoke: Snakemake's records of .* are gone, .*; "
    rf"`{re.escape(REPAIR)}` compares the receipts instead$"
)
EDIT = "\nfigures: {dpi: 100}\n"


def edit(trial):
    with (trial.folder / "config/smoke.yaml").open("a") as file:
        file.write(EDIT)


def delete_records(trial):
    shutil.rmtree(trial.folder / ".snakemake")


@pytest.fixture(scope="module")
def edited(study, tmp_path_factory):
    """What counts of a study after the edit, and the files that the edit made anew."""
    trial = Trial("", tmp_path_factory.mktemp("edited"), {})
    copy(study.folder, trial.folder)
    before = written(trial.folder)
    edit(trial)
    assert trial.run(RUN).wait() == 0, trial.commands[-1].said()
    after = written(trial.folder)
    sound = contents(trial.folder)
    trial.end()
    return sound, {name for name in after if after[name] != before[name]}


def test_records_deleted(begin):
    trial = begin(".snakemake deleted")
    trial.note_finished()
    delete_records(trial)
    trial.expect(trial.run(RUN), GONE)
    trial.recover(REPAIR)
    trial.check()


def test_records_deleted_and_an_edit(begin, edited):
    trial = begin(".snakemake deleted, then a parameter edited")
    trial.note_finished()
    delete_records(trial)
    edit(trial)
    trial.expect(trial.run(RUN), GONE)
    trial.recover(REPAIR)
    trial.note_outdated(edited[1])
    trial.sound = edited[0]
    trial.check()


def test_records_deleted_an_edit_and_repair_killed(begin, edited):
    trial = begin(".snakemake deleted, a parameter edited, repair killed with SIGKILL")
    trial.note_finished()
    delete_records(trial)
    edit(trial)
    trial.expect(trial.run(RUN), GONE)
    repair = trial.start(REPAIR)
    repair.until(lambda: recorded(trial.folder, "metadata"))
    os.killpg(repair.process.pid, signal.SIGKILL)
    repair.wait()
    trial.recover(REPAIR)
    trial.note_outdated(edited[1])
    trial.sound = edited[0]
    trial.check()


def test_records_deleted_while_orphans_work(begin):
    trial = begin(".snakemake deleted while orphans of a killed run work", at=0.3)
    run = trial.start()
    run.until(lambda: run.jobs("identify_model"))
    run.until(run.snakemake).kill()
    run.wait()
    trial.note_finished()
    delete_records(trial)
    trial.expect(trial.run(RUN), rf"{GONE}|^A run in this folder was killed: `{re.escape(REPAIR)}`")
    trial.recover(REPAIR)
    trial.check()
