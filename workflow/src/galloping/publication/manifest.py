"""The SHA-256 of every file of a folder, in the format of `sha256sum --check`."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from galloping.publication.archive import files_of
from galloping.reproducibility.receipts import digest
from galloping.storage import write_text

MANIFEST = "manifest.sha256"


def write_manifest(folder: Path) -> None:
    """Write the manifest of all files below `folder` into it."""
    paths = [path for path in files_of(folder) if path != MANIFEST]
    write_text(folder / MANIFEST, "".join(f"{digest(folder / p)}  {p}\n" for p in paths))


def manifest_faults(folder: Path) -> Iterator[str]:
    """One line for every file that is missing, new or not as its manifest says."""
    try:
        lines = (folder / MANIFEST).read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError):
        yield f"{MANIFEST}: missing, or not text"
        return
    listed = {path: sha256 for sha256, _, path in (line.partition("  ") for line in lines)}
    present = set(files_of(folder)) - {MANIFEST}
    for path in sorted(listed.keys() | present):
        if path not in listed:
            yield f"{path}: not in the manifest"
        elif path not in present:
            yield f"{path}: missing"
        elif digest(folder / path) != listed[path]:
            yield f"{path}: changed"
