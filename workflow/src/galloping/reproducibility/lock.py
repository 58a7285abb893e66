"""Lock of a study's folder: one process at a time, and cleaning up after killed ones."""

import fcntl
import os
import shlex
import shutil
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import psutil

from galloping.configuration.yaml_file import ConfigurationError
from galloping.storage import PARTIAL_PREFIX

LOCK_FILE = ".running"  # file in the results that names the working process, empty without one
RESULTS_VARIABLE = "GALLOPING_RESULTS"  # environment variable of all processes of a run
MIN_FREE_SPACE = 1 << 20  # bytes of free disk space: Snakemake's records need less
MAX_END_TIME = 5.0  # s: time in which interrupted processes must end


# folders of the results; a test compares them with the rules
RESULT_FOLDERS = (
    "assessment", "benchmarks", "bounds", "figures", "identified", "logs", "models", "oracles",
    "paper", "reconstructions", "recordings", "reproduction", "scores", "sweeps",
    "tables", "trajectories", "trials",
)  # fmt: skip


class Obstacle(RuntimeError):
    """Error that prevents work on a study; its one-line message says what the user should do."""


class Killed(RuntimeError):
    """Error that a run of the study was killed without cleaning up, so that it needs a repair."""


@contextmanager
def locked(results: str, repair: str, *, repairing: bool = False) -> Iterator[int]:
    """Lock the results of a study in a `with` block against simultaneous runs and repairs.

    Yields the start time, in nanoseconds of the file system's clock. repair: the command that
    continues after a killed run. repairing: whether this process is that command. Raises Obstacle
    if another process uses the study, if a run of it was killed, or if the disk is full or
    read-only. After Killed, or if this process is killed, only a repair may lock the study.
    """
    check_places(results)
    check_disk(results)
    if others := list_snakemakes(Path.cwd()):
        raise Obstacle(_describe_holder(others[0].pid))
    Path(results).mkdir(parents=True, exist_ok=True)
    with Path(results, LOCK_FILE).open("a+", encoding="ascii") as mark:
        mark.seek(0)
        try:
            fcntl.flock(mark, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise Obstacle(_describe_holder(mark.read())) from None
        if mark.read() and not repairing:  # read with the lock: another run may have ended just now
            raise Obstacle(format_killed_message(repair))
        mark.truncate(0)
        mark.write(str(os.getpid()))
        mark.flush()
        try:
            yield os.fstat(mark.fileno()).st_mtime_ns
        finally:
            if not isinstance(sys.exception(), Killed):
                mark.truncate(0)


@contextmanager
def end_in_one_line(repair: str = "") -> Iterator[None]:
    """End the process with one line if a `with` block raises an error, or after Ctrl-C.

    The errors are those that a user can correct. repair: as in `locked`.
    """
    try:
        yield
    except (ConfigurationError, Obstacle) as error:
        sys.exit(str(error))
    except Killed:
        sys.exit(format_killed_message(repair))
    except KeyboardInterrupt:
        sys.exit("Interrupted: run it again to go on.")
    except OSError as error:
        sys.exit(f"{error.filename}: {error.strerror}" if error.filename else str(error))


def check_disk(results: str) -> None:
    """Raise Obstacle if the working or results folder is read-only or its disk is full."""
    for place in filter(Path.exists, (Path.cwd(), Path.cwd() / results)):
        if not os.access(place, os.W_OK):
            raise Obstacle(f"{place} is read-only: make it writable and run again.")
        if shutil.disk_usage(place).free < MIN_FREE_SPACE:
            raise Obstacle(f"The disk of {place} is full: free some space and run again.")


def check_places(results: str) -> None:
    """Raise Obstacle if a file is in the place of a folder of the study, or vice versa.

    Also if the results would be in a folder of another study's results, such as its tables.
    """
    root = Path(results)
    for study in root.parents:
        inside = root.relative_to(study)
        if inside.parts[0] in RESULT_FOLDERS and (study / LOCK_FILE).exists():
            text = f"results: {results!r} is in the results of another study, {study}"
            raise Obstacle(f"{text}; must be outside {study / inside.parts[0]}")
    inside_results = [root / name for name in RESULT_FOLDERS]
    folders = (Path(".snakemake"), *reversed(root.parents), root, *inside_results)
    files = (Path(".snakemake", "seen.json"), root / LOCK_FILE, root / "report.html")
    wrong = [
        (path, "file or a broken link", "folder")
        for path in folders
        if os.path.lexists(path) and not path.is_dir()
    ]
    wrong += [(path, "folder", "file") for path in files if path.is_dir()]
    for path, kind, wanted in wrong:
        raise Obstacle(f"{path} is a {kind} where a {wanted} belongs: move it away and run again.")


def format_killed_message(repair: str) -> str:
    """Format the message that a run of the study was killed and which command continues it."""
    return f"A run in this folder was killed: `{repair}` takes it from there."


def make_command(configfiles: Iterable[str | Path] = (), goal: str = "") -> str:
    """Format the `make` command for a target of the Makefile and given configuration files."""
    files = " ".join(os.path.relpath(file) for file in configfiles)
    settings = f"CONFIG={shlex.quote(files)}" if files else ""
    return " ".join(filter(None, ("make", goal, settings)))


def marked_environment(results: str) -> dict[str, str]:
    """Return environment variables that mark all processes of a run, to find them later."""
    return {**os.environ, RESULTS_VARIABLE: str(Path(results).resolve())}


def list_snakemakes(folder: Path) -> list[psutil.Process]:
    """List the main Snakemake processes in a folder, except ancestors of this process."""
    ancestors = {os.getpid(), *(parent.pid for parent in psutil.Process().parents())}
    return [
        process
        for process in psutil.process_iter(["cmdline", "cwd"])  # None where it is another user's
        if process.pid not in ancestors and process.info["cwd"] == str(folder.resolve())
        and any(Path(part).name == "snakemake" for part in (process.info["cmdline"] or [])[:4])
    ]  # fmt: skip


def end_orphans(results: str) -> int:
    """End the processes that a killed run left running, by force if need be; return the number."""
    mark = marked_environment(results)[RESULTS_VARIABLE]
    orphans = [
        process
        for process in psutil.process_iter(["environ"])
        if (process.info["environ"] or {}).get(RESULTS_VARIABLE) == mark
        and process.pid != os.getpid()
    ]
    for end in (psutil.Process.terminate, psutil.Process.kill):
        for process in orphans:
            with suppress(psutil.NoSuchProcess):
                end(process)
        psutil.wait_procs(orphans, timeout=MAX_END_TIME)
    return len(orphans)


def clear_unfinished(results: str) -> Iterator[str]:
    """Remove partly written files, see `storage.replacing`; yield a message for each."""
    for path in sorted(Path(results).rglob(f"{PARTIAL_PREFIX}*")):
        shutil.rmtree(path) if path.is_dir() else path.unlink()
        yield f"removed the unfinished {path}"


def _describe_holder(process: object) -> str:
    return f"Process {process} is running a study in this folder: wait for it, or stop it."
