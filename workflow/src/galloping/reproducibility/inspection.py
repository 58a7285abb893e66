"""Compares the files of a study with their receipts, quickly enough for the start of every run."""

from __future__ import annotations

import os
import shlex
from base64 import urlsafe_b64encode
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from galloping.reproducibility.receipts import Receipt, digest, receipts
from galloping.storage import read_json, write_json

RECORDS = Path(".snakemake")
SEEN = RECORDS / "digests.json"


class DamagedResults(ValueError):
    """Results that must not be used as they are; the message says so in one line."""


@dataclass(frozen=True)
class Findings:
    """Receipts whose file should be here and is not, and those whose file has other content."""

    missing: tuple[Receipt, ...]
    damaged: tuple[Receipt, ...]


def make_command(configfiles: Iterable[str | Path] = (), goal: str = "") -> str:
    """What to type to reach a goal of the Makefile for the study of these configuration files."""
    files = " ".join(os.path.relpath(file) for file in configfiles)
    settings = f"CONFIG={shlex.quote(files)}" if files else ""
    return " ".join(filter(None, ("make", goal, settings)))


def lost(results: str, repair: str | None, written: Callable[[str], bool]) -> list[str]:
    """Files of a study that were made and are gone; to be made again.

    repair: the command that mends damage, for messages; None where there is none, as in a study
    that other workflows use as a module. written: whether a job of the study writes such a path.
    Raises DamagedResults if a file is not what its job wrote, if nothing says how it was made, or
    if Snakemake's records of it are gone, without which it would not see what was edited since.
    While Snakemake holds its lock, files come and go, and nothing is compared.
    """
    if locked():
        return []
    found = list(receipts(results))
    if without := unrecorded(found):
        raise DamagedResults(
            f"{results}: Snakemake's records of {len(without)} files (.snakemake/metadata) are "
            "gone, and with them what was edited since; "
            + (f"`{repair}` compares the receipts instead" if repair else "remove the folder")
        )
    findings = inspect(found)
    faults = {
        "edited or damaged since its job wrote it": [r.path for r in findings.damaged],
        "no receipt says how it was made": list(filter(written, _strangers(results, found))),
    }
    cure = f"`{repair}` sets it aside and makes it again" if repair else "remove it and run again"
    for fault, paths in faults.items():
        if paths:
            more = f" and {len(paths) - 1} more" if paths[1:] else ""
            raise DamagedResults(f"{paths[0]}{more}: {fault}; {cure}")
    return [receipt.path for receipt in findings.missing if written(receipt.path)]


def locked() -> bool:
    """Whether Snakemake's lock lies in the working folder."""
    return any((RECORDS / "locks").glob("*"))


def unrecorded(found: Iterable[Receipt]) -> list[str]:
    """Files that are here and of which Snakemake does not know how they were made.

    It takes them as up to date whatever is edited. Those of jobs that it knows to be unfinished are
    not among them: it makes them again.
    """
    known = _recorded("metadata") | _recorded("incomplete")
    return [r.path for r in found if _record_name(r.path) not in known and Path(r.path).exists()]


def _strangers(results: str, found: Iterable[Receipt]) -> list[str]:
    """Files of a results folder without a receipt, but those that Snakemake makes again anyway."""
    known = {receipt.path for receipt in found}
    told = (f"{results}/logs/", f"{results}/benchmarks/")  # about jobs, not made by them
    files = (
        (Path(folder) / name).as_posix()
        for folder, _, names in os.walk(results)
        for name in names
        if not name.startswith(".")
    )
    unfinished = _recorded("incomplete")
    return sorted(
        file
        for file in files
        if file not in known and not file.startswith(told) and _record_name(file) not in unfinished
    )


def _record_name(path: str) -> str:
    return urlsafe_b64encode(path.encode()).decode()


def _recorded(kind: str) -> set[str]:
    """Names of Snakemake's records; long ones are spread over folders that begin with @."""
    root = RECORDS / kind
    return {
        "".join(part.removeprefix("@") for part in (*Path(folder).relative_to(root).parts, name))
        for folder, _, names in os.walk(root)
        for name in names
    }


def inspect(found: Iterable[Receipt], *, thorough: bool = False) -> Findings:
    """Compare files with their receipts.

    thorough: read every file, also those whose size and times are as when last read.
    """
    found = list(found)
    states = {receipt.path: _state(receipt.path) for receipt in found}
    seen = {} if thorough else _seen()
    changed = [p for p, state in states.items() if state and seen.get(p, [None])[:-1] != state]
    with ThreadPoolExecutor() as pool:
        read = dict(zip(changed, pool.map(digest, changed), strict=True))
    known = {
        path: [*state, read[path] if path in read else seen[path][-1]]
        for path, state in states.items()
        if state
    }
    if read:
        _remember(known)
    return Findings(
        missing=tuple(r for r in found if r.kept and not states[r.path]),
        damaged=tuple(r for r in found if states[r.path] and known[r.path][-1] != r.sha256),
    )


def _state(path: str) -> list[int] | None:
    """What changes when a file is written, even if its time is set back."""
    try:
        status = Path(path).stat()
    except OSError:
        return None
    return [status.st_size, status.st_mtime_ns, status.st_ctime_ns, status.st_ino]


def _seen() -> dict[str, list]:
    try:
        return read_json(SEEN)
    except (OSError, ValueError):
        return {}


def _remember(known: dict[str, list]) -> None:
    try:
        write_json(SEEN, {**_seen(), **known})
    except OSError:
        return  # only costs time: a full or read-only disk is told by what must write to it
