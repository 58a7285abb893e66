"""Compares the files of a study with their receipts, quickly enough for the start of every run."""

import os
import shlex
from collections.abc import Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from galloping.reproducibility.receipts import Receipt, digest
from galloping.storage import read_json, write_json

# Lies with Snakemake's records, and is lost with them: size, times and digest of what was read, of
# each study.
SEEN = Path(".snakemake/digests.json")


@dataclass(frozen=True)
class Deviations:
    """Files that are not as their receipts say, by path.

    missing: should be here and are not. damaged: have other content. unknown: were here before,
    and no receipt tells of them any more. new: were not known when the study was last remembered.
    present: size, times, number and digest of what is here.
    """

    missing: tuple[str, ...]
    damaged: tuple[str, ...]
    unknown: tuple[str, ...]
    new: tuple[str, ...]
    present: dict[str, list]


def make_command(configfiles: Iterable[str | Path] = (), goal: str = "") -> str:
    """What to type to reach a goal of the Makefile for the study of these configuration files."""
    files = " ".join(os.path.relpath(file) for file in configfiles)
    settings = f"CONFIG={shlex.quote(files)}" if files else ""
    return " ".join(filter(None, ("make", goal, settings)))


def inspect(results: str, known: Mapping[str, Receipt], *, thorough: bool = False) -> Deviations:
    """Compare files with their receipts.

    known: receipts by path. thorough: read every file, also those whose size and times are as when
    last read.
    """
    states = {path: state for path in known if (state := _state(path))}
    seen = _seen().get(results, {})
    read = [p for p, state in states.items() if thorough or seen.get(p, [None])[:-1] != state]
    with ThreadPoolExecutor() as pool:
        digests = dict(zip(read, pool.map(digest, read), strict=True))
    present = {p: [*state, digests.get(p) or seen[p][-1]] for p, state in states.items()}
    return Deviations(
        missing=tuple(p for p, receipt in known.items() if receipt.kept and p not in present),
        damaged=tuple(p for p in present if present[p][-1] != known[p].sha256),
        unknown=tuple(path for path in seen if path not in known and Path(path).exists()),
        new=tuple(p for p in present if p not in seen),
        present=present,
    )


def remember(results: str, findings: Deviations) -> None:
    """Note what is here, which the next inspection need not read again."""
    seen = _seen()
    if (now := seen | {results: findings.present}) != seen:
        with suppress(OSError):  # only costs time: a full disk is told by what must write to it
            write_json(SEEN, now)


def _state(path: str) -> list[int] | None:
    """What changes when a file is written, even if its time is set back."""
    try:
        status = Path(path).stat()
    except OSError:
        return None
    return [status.st_size, status.st_mtime_ns, status.st_ctime_ns, status.st_ino]


def _seen() -> dict[str, dict[str, list]]:
    """By study, which may lie in the folder of another, and path."""
    try:
        return read_json(SEEN)
    except (OSError, ValueError):
        return {}
