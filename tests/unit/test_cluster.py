"""The jobs of a killed run, with stand-ins for SLURM's commands; the real ones: tests/cluster."""

import getpass

import pytest

from galloping.reproducibility.cluster import ClusterError, cancel_jobs

RUN = "9f1c4a52-0e54-4a6e-8d34-7ac1c0f5b0aa"


@pytest.fixture
def slurm(tmp_path, monkeypatch):
    """Let squeue list the lines of a file, and scancel remove those of the ids that it is given."""
    tools, queue = tmp_path / "tools", tmp_path / "queue"
    tools.mkdir()
    command(tools / "squeue", f'[ "$3" = {getpass.getuser()} ] && cat {queue}')
    command(tools / "scancel", f'shift; for id; do sed -i "/^$id|/d" {queue}; done')
    monkeypatch.setenv("PATH", f"{tools}:/usr/bin:/bin")
    return queue


def command(path, text):
    path.write_text(f"#!/bin/sh\n{text}\n")
    path.chmod(0o755)


@pytest.fixture
def folder(tmp_path):
    folder = tmp_path / "a study"
    folder.mkdir()
    return folder


def test_jobs_of_the_folder_are_cancelled_and_no_others(slurm, folder):
    others = f"3|{RUN}|{folder}2\n4|shell|{folder}\n5|{RUN}|/\n"
    slurm.write_text(f"1|{RUN}|{folder}\n2|lines_{RUN}|{folder}\n{others}")
    assert cancel_jobs(folder) == ["1", "2"]
    assert slurm.read_text() == others
    assert cancel_jobs(folder) == []


def test_jobs_that_do_not_end_are_named(slurm, folder):
    slurm.write_text(f"17|{RUN}|{folder}\n")
    command(slurm.with_name("tools") / "scancel", "true")
    with pytest.raises(ClusterError, match="SLURM jobs 17 do not end"):
        cancel_jobs(folder, patience=0)


def test_slurm_that_does_not_answer_matters_where_it_was_used(slurm, folder):
    command(slurm.with_name("tools") / "squeue", "echo no controller >&2; exit 1")
    assert cancel_jobs(folder) == []
    (folder / ".snakemake/slurm_logs").mkdir(parents=True)
    with pytest.raises(ClusterError, match=r"SLURM does not answer \(no controller\)"):
        cancel_jobs(folder)


def test_machine_without_slurm_has_no_jobs(folder, monkeypatch):
    monkeypatch.setenv("PATH", str(folder))
    assert cancel_jobs(folder) == []
