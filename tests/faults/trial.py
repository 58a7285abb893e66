"""One fault: what it hit, what was said, what mended it, and what is different in the end.

*Finished* before a fault is a file that Snakemake has recorded as made, whose receipt is there and
whose job is not marked as under way. *Lost* is a finished file that recovery computed again,
although neither it nor anything it was made from was harmed by the fault. A job that was under way
is no loss, nor is what follows from a harmed file. *Wrong* is a file whose bytes are not those of
the undisturbed study, or that is missing, or that the undisturbed study does not have; logs,
benchmarks, the report and the list of runs (they show run times) and files set aside by repair do
not count, nor do the times in receipts.
"""

import json
import re
import shutil
import subprocess
import sys
import time
from base64 import urlsafe_b64decode
from collections.abc import Iterable
from hashlib import sha256
from pathlib import Path

import pytest
from commands import Command

SMOKE = "results/smoke"
RUN = "make smoke"
REPAIR = "make repair CONFIG=config/smoke.yaml"
VERIFY = "make verify CONFIG=config/smoke.yaml"
APART = {"logs", "benchmarks", "set_aside", "report.html", "runs.csv"}
TIMES = {"seconds", "finished"}
COLUMNS = (
    "fault",
    "moment",
    "said",
    "recovery",
    "seconds_to_first_job",
    "seconds_to_resume",
    "results_lost",
    "results_wrong",
)


def contents(folder: Path) -> dict[str, object]:
    """What counts of every file of a study: digests, and receipts without times."""
    found = {}
    for path in (folder / SMOKE).rglob("*"):
        name = path.relative_to(folder / SMOKE)
        if path.is_dir() or name.parts[0] in APART:
            continue
        if path.suffix == ".receipt":
            receipt = json.loads(path.read_bytes())
            found[str(name)] = {k: v for k, v in receipt.items() if k not in TIMES}
        else:
            found[str(name)] = sha256(path.read_bytes()).hexdigest()
    return found


def receipts(folder: Path) -> dict[str, Path]:
    """The receipts of a study by the file they are of."""
    found = (folder / SMOKE).rglob(".*.receipt")
    return {
        str(path.with_name(path.name[1:].removesuffix(".receipt")).relative_to(folder)): path
        for path in found
        if "set_aside" not in path.parts
    }


def written(folder: Path) -> dict[str, tuple[int, int]]:
    """When the receipt of each file was written, and which one it is."""
    states = {name: path.stat() for name, path in receipts(folder).items()}
    return {name: (state.st_mtime_ns, state.st_ino) for name, state in states.items()}


def recorded(folder: Path, records: str) -> dict[str, Path]:
    """Snakemake's records of a kind (`metadata` or `incomplete`) by the file they are of."""
    found = (folder / ".snakemake" / records).glob("*")
    return {urlsafe_b64decode(path.name).decode(): path for path in found}


def copy(source: Path, folder: Path) -> None:
    """A copy that keeps all times, with this Python as its environment."""
    folder.mkdir(exist_ok=True)
    subprocess.run(["cp", "-a", f"{source}/.", folder], check=True)
    environment = folder / ".venv"
    environment.mkdir(exist_ok=True)
    for part in Path(sys.prefix).iterdir():
        if part.name != "made" and not (environment / part.name).is_symlink():
            (environment / part.name).symlink_to(part)
    (environment / "made").touch()  # newer than the lock: never made again


def rewind(folder: Path, moment: float) -> None:
    """Take back what was made after `moment`, in seconds since the epoch, with all its traces."""
    records = recorded(folder, "metadata")
    for name, receipt in receipts(folder).items():
        if receipt.stat().st_mtime <= moment:
            continue
        log = folder / json.loads(receipt.read_bytes())["log"]
        part = log.relative_to(folder / SMOKE / "logs").with_suffix(".tsv")
        benchmark = folder / SMOKE / "benchmarks" / part
        for path in (folder / name, receipt, records[name], log, benchmark):
            path.unlink(missing_ok=True)  # outputs of one job share log and benchmark


class Trial:
    """A copy of a study that is disturbed, and the row of the table that comes of it."""

    def __init__(self, fault: str, folder: Path, sound: dict[str, object]):
        self.folder, self.sound = folder, sound
        self.row = dict.fromkeys(COLUMNS, "") | {"fault": fault}
        self.commands: list[Command] = []
        self._mounts: list[Path] = []
        self._finished: dict[str, tuple[int, int]] = {}
        self._harmed: set[str] = set()

    @property
    def results(self) -> Path:
        return self.folder / SMOKE

    def start(self, text: str = RUN) -> Command:
        log = self.folder.with_name(f"{self.folder.name}.{len(self.commands)}.log")
        self.commands.append(Command(text, self.folder, log))
        return self.commands[-1]

    def run(self, text: str = RUN) -> Command:
        command = self.start(text)
        command.wait()
        return command

    def expect(self, command: Command, line: str) -> None:
        """Check that a command failed and said why in one line, which is noted."""
        said = [text for text in command.said().splitlines() if re.search(line, text)]
        assert command.wait() != 0, command.said()
        assert len(said) == 1, f"not in one line: {line}\n{command.said()}"
        self.row["said"] = said[0]

    def note_finished(self) -> None:
        """Note what is finished now: call it when Snakemake is dead or idle, before any harm."""
        made, under_way = (recorded(self.folder, kind) for kind in ("metadata", "incomplete"))
        self._finished = {
            name: when
            for name, when in written(self.folder).items()
            if name in made and name not in under_way
        }

    def note_harmed(self, *files: Path) -> None:
        """Note what the fault spoils: all that the same jobs make, and what is made from it."""
        made = {
            name: json.loads(receipt.read_bytes())
            for name, receipt in receipts(self.folder).items()
        }
        logs = {made[str(file.relative_to(self.folder))]["log"] for file in files}
        harmed = {name for name, receipt in made.items() if receipt["log"] in logs}
        while more := {n for n, r in made.items() if r["inputs"].keys() & harmed} - harmed:
            harmed |= more
        self._harmed |= harmed

    def note_outdated(self, names: Iterable[str]) -> None:
        """Note what an edit of the settings makes anew in any case."""
        self._harmed |= set(names)

    def recover(self, text: str) -> Command:
        """Run the one command that is documented for the fault."""
        command = self.start(text)
        self.row["recovery"] = text
        self.row["seconds_to_first_job"] = round(command.seconds_to_first_job(), 2)
        assert command.wait() == 0, command.said()
        self.row["seconds_to_resume"] = round(time.monotonic() - command.began, 2)
        return command

    def check(self) -> None:
        """Count what was lost and what is wrong, and ask `make verify`."""
        now = written(self.folder)
        lost = {name for name, when in self._finished.items() if now.get(name) != when}
        lost -= self._harmed
        found = contents(self.folder)
        wrong = {k for k in found.keys() | self.sound.keys() if found.get(k) != self.sound.get(k)}
        self.row |= {"results_lost": len(lost), "results_wrong": len(wrong)}
        assert not wrong, f"wrong: {sorted(wrong)}"
        assert not lost, f"lost: {sorted(lost)}"
        verified = self.run(VERIFY)
        assert verified.wait() == 0, verified.said()

    def mount(self, folder: Path, *options: str) -> None:
        """Mount something on a folder until the trial ends; skip the test if that is forbidden."""
        run = subprocess.run(["mount", *options, folder], capture_output=True, text=True)
        if run.returncode:
            reason = " ".join(run.stderr.split())
            self.row["said"] = f"not tried: {reason}"
            pytest.skip(reason)
        if "remount" not in ",".join(options):
            self._mounts.append(folder)

    def end(self) -> None:
        for command in self.commands:
            command.end()
        for folder in reversed(self._mounts):
            subprocess.run(["umount", folder], check=True)
        shutil.rmtree(self.folder)
