"""Which processes of this machine work in a study's folder."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import psutil


def running(folder: Path) -> list[psutil.Process]:
    """Snakemake's main processes in `folder`, without this one and those that started it."""
    own = {os.getpid(), *(parent.pid for parent in psutil.Process().parents())}
    return [p for p in _working_in(folder, _is_main) if p.pid not in own]


def orphans(folder: Path) -> list[psutil.Process]:
    """Jobs of a main process that is gone, in `folder`; those of a live one are not orphans."""
    alive = {process.pid for process in running(folder)}
    return [
        job
        for job in _working_in(folder, _is_job)
        if not alive & {parent.pid for parent in job.parents()}
    ]


def end(processes: list[psutil.Process], patience: float = 5.0) -> None:
    """End processes, by force after `patience` seconds."""
    for process in processes:
        _quietly(process.terminate)
    _, stubborn = psutil.wait_procs(processes, timeout=patience)
    for process in stubborn:
        _quietly(process.kill)
    psutil.wait_procs(stubborn, timeout=patience)


def _working_in(folder: Path, wanted: Callable[[list[str]], bool]) -> list[psutil.Process]:
    found = []
    for process in psutil.process_iter():
        try:
            if wanted(process.cmdline()) and Path(process.cwd()) == folder.resolve():
                found.append(process)
        except (psutil.NoSuchProcess, psutil.AccessDenied, psutil.ZombieProcess):
            continue  # ended meanwhile, or another user's
    return found


def _is_main(command: list[str]) -> bool:
    """The Snakemake of a job on a cluster is told its mode."""
    return any(Path(part).name == "snakemake" for part in command[:4]) and "--mode" not in command


def _is_job(command: list[str]) -> bool:
    return "/.snakemake/scripts/" in "".join(command[1:2])


def _quietly(act: Callable[[], None]) -> None:
    try:
        act()
    except psutil.NoSuchProcess:
        return
