"""Commands that are started, watched and ended together with everything they started."""

import os
import re
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import TypeVar

import psutil

PATIENCE = 600.0  # seconds; a smoke study takes forty on two free cores
JOB_STARTS = re.compile(r"^Execute \d+ jobs", re.MULTILINE)
INHERITED = ("PYTHONPATH", "MAKEFLAGS", "MFLAGS", "MAKELEVEL", "CONFIG")
Awaited = TypeVar("Awaited")


class Command:
    """A command in a session of its own, and what it says, in the file `log`."""

    def __init__(self, text: str, folder: Path, log: Path):
        self.text, self.log, self.began = text, log, time.monotonic()
        with log.open("w") as file:
            self.process = subprocess.Popen(
                text.split(),
                cwd=folder,
                env={k: v for k, v in os.environ.items() if k not in INHERITED} | {"CORES": "2"},
                stdin=subprocess.DEVNULL,
                stdout=file,
                stderr=subprocess.STDOUT,
                start_new_session=True,
                # A shell that runs tests in the background lets them ignore Ctrl-C.
                preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
            )

    def said(self) -> str:
        return self.log.read_text(encoding="utf-8", errors="replace")

    def wait(self) -> int:
        """The exit code, once the command has ended."""
        return self.process.wait(PATIENCE)

    def until(self, condition: Callable[[], Awaited]) -> Awaited:
        """What `condition` returns as soon as that is true."""
        last = time.monotonic() + PATIENCE
        while not (found := condition()):
            assert self.process.poll() is None, f"`{self.text}` ended too soon:\n{self.said()}"
            assert time.monotonic() < last, f"`{self.text}` waited in vain:\n{self.said()}"
            time.sleep(0.02)
        return found

    def seconds_to_first_job(self) -> float:
        """From the start of the command to its first job, or to its end if it needs none."""
        while self.process.poll() is None and not JOB_STARTS.search(self.said()):
            assert time.monotonic() < self.began + PATIENCE, self.said()
            time.sleep(0.02)
        return time.monotonic() - self.began

    def members(self) -> Iterator[psutil.Process]:
        """The command and all it started, also what has lost its parent."""
        for process in psutil.process_iter():
            with suppress(OSError, psutil.Error):
                if os.getsid(process.pid) == self.process.pid:
                    yield process

    def snakemake(self) -> psutil.Process | None:
        """Snakemake's main process."""
        return next((p for p in self.members() if p.cmdline()[1:3] == ["-m", "snakemake"]), None)

    def jobs(self, rule: str = "") -> list[psutil.Process]:
        """The scripts that run now, of one rule."""
        found = []
        for process in self.members():
            with suppress(psutil.Error):
                script = "".join(process.cmdline()[1:2])
                if "/.snakemake/scripts/" in script and script.endswith(f"{rule}.py"):
                    found.append(process)
        return found

    def end(self) -> None:
        """End by force whatever is left."""
        while left := list(self.members()):
            for process in left:
                with suppress(psutil.Error):
                    process.kill()
            psutil.wait_procs(left, timeout=5)
            self.process.poll()
