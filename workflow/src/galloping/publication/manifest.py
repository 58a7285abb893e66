"""The SHA-256 of every file of a folder, in the format of `sha256sum --check`."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from galloping.reproducibility.receipts import digest
from galloping.storage import write_text

MANIFEST = "manifest.sha256"
LINE = re.compile(r"([0-9a-f]{64})  (.+)")


def write_manifest(folder: Path) -> None:
    """Write the manifest of all files below `folder` into it."""
    lines = [f"{digest(folder / path)}  {path}\n" for path in _paths(folder)]
    write_text(folder / MANIFEST, "".join(lines))


def faults(folder: Path) -> Iterator[str]:
    """One line for every file that is missing, new or not as its manifest says."""
    try:
        lines = (folder / MANIFEST).read_text(encoding="utf-8").splitlines()
    except FileNotFoundError:
        yield f"{MANIFEST}: missing"
        return
    except UnicodeDecodeError:
        yield f"{MANIFEST}: not text"
        return
    listed: dict[str, str] = {}
    for number, line in enumerate(lines, start=1):
        if not (parsed := LINE.fullmatch(line)):
            yield f"{MANIFEST}: line {number} is not a digest and a path"
        elif parsed[2] in listed:
            yield f"{MANIFEST}: line {number} names {parsed[2]} again"
        else:
            listed[parsed[2]] = parsed[1]
    present = _paths(folder)
    for path in sorted(listed.keys() | set(present)):
        if path not in listed:
            yield f"{path}: not in the manifest"
        elif path not in present:
            yield f"{path}: missing"
        elif digest(folder / path) != listed[path]:
            yield f"{path}: changed"


def _paths(folder: Path) -> list[str]:
    """All files but the manifest, sorted, relative to `folder`."""
    found = (path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file())
    return sorted(path for path in found if path != MANIFEST)
