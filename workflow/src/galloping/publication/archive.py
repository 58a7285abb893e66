"""Zip archives: the same bytes for the same files, and read without trust in who made them."""

from __future__ import annotations

import re
import shutil
import stat
import struct
import zipfile
import zlib
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path, PurePosixPath

# Far above what a study needs, far below what would harm.
MAX_ENTRIES = 20_000
MAX_SIZE = 4 * 2**30  # bytes, of all files together
MAX_RATIO = 200  # of a file's size to its size in the archive
SMALL = 2**20  # bytes; a ratio says nothing about files below it

EARLIEST = (1980, 1, 1, 0, 0, 0)  # the time that every entry has; a zip knows none before
MODE = stat.S_IFREG | 0o644
COMPRESSION_LEVEL = 6
HEADER = 30  # bytes of a local file header without its name
PLAIN = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.+=-]*(/[A-Za-z0-9_][A-Za-z0-9_.+=-]*)*")

Entry = zipfile.ZipInfo
# what zipfile raises for what is no zip file, or a broken one
UNSOUND = (zipfile.BadZipFile, zlib.error, struct.error, EOFError, ValueError, RuntimeError)


class UnsafeArchive(ValueError):
    """An archive that must not be unpacked; the message says why in one line."""


def is_plain(path: str) -> bool:
    """Whether a path stays inside its folder on any system, and hides nothing.

    Relative, with '/', of letters, digits and `_.+=-`, no part beginning with a dot.
    """
    return PLAIN.fullmatch(path) is not None


def pack(folder: Path, target: Path) -> None:
    """Write all files of a folder, with paths relative to it, as a zip.

    Names in order, fixed times and permissions, fixed compression: same files, same bytes.
    """
    with zipfile.ZipFile(target, "w") as archive:
        for path in sorted(p.relative_to(folder).as_posix() for p in _files(folder)):
            entry = Entry(path, EARLIEST)
            entry.create_system = 3  # Unix, also where it is not
            entry.external_attr = MODE << 16
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry._compresslevel = COMPRESSION_LEVEL
            entry.file_size = (folder / path).stat().st_size
            with (folder / path).open("rb") as source, archive.open(entry, "w") as sink:
                shutil.copyfileobj(source, sink)


def unpack(archive: Path, folder: Path) -> None:
    """Write all files of a zip into an empty folder.

    Raises UnsafeArchive, before anything is written, for what `refusal` names, and while writing
    for contents that are not as declared; the caller removes the folder then.
    """
    try:
        with zipfile.ZipFile(archive) as content:
            entries = content.infolist()
            if reason := refusal(entries, content.start_dir):
                raise UnsafeArchive(f"{archive}: {reason}")
            for entry in entries:
                target = folder / entry.filename
                target.parent.mkdir(parents=True, exist_ok=True)
                with content.open(entry) as source, target.open("xb") as sink:
                    shutil.copyfileobj(source, sink)  # never more than declared
    except UnsafeArchive:
        raise
    except UNSOUND as error:
        raise UnsafeArchive(f"{archive}: not a sound zip file ({error})") from None


def refusal(entries: Sequence[Entry], end: int) -> str | None:
    """Why a zip of these entries must not be unpacked, or None.

    end: where its directory begins, in bytes from its start.
    """
    if len(entries) > MAX_ENTRIES:
        return f"{len(entries)} entries; at most {MAX_ENTRIES} are allowed"
    if (size := sum(entry.file_size for entry in entries)) > MAX_SIZE:
        return f"{size} bytes when unpacked; at most {MAX_SIZE} are allowed"
    for entry in entries:
        if reason := _refusal_of(entry):
            return f"{_shown(entry.orig_filename)}: {reason}"
    return _clash(entries) or _overlap(entries, end)


def _refusal_of(entry: Entry) -> str | None:
    """Why one entry must not be unpacked."""
    if not is_plain(entry.orig_filename):
        return (
            "not a plain path inside the archive (letters, digits and _.+=-, with '/', "
            "no part beginning with a dot)"
        )
    kind = stat.S_IFMT(entry.external_attr >> 16)
    if kind not in (0, stat.S_IFREG):
        return "not a regular file" if kind != stat.S_IFLNK else "a link"
    if entry.flag_bits & 0x1:
        return "encrypted"
    if entry.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        return "compressed in another way than deflate"
    if entry.file_size > max(SMALL, MAX_RATIO * entry.compress_size):
        return f"more than {MAX_RATIO} times its size in the archive when unpacked"
    return None


def _clash(entries: Sequence[Entry]) -> str | None:
    """Names that would fall on each other, on a file system that ignores case too."""
    spelled: dict[str, str] = {}
    files: set[str] = set()
    for entry in entries:
        name = entry.filename
        if name.lower() in files:
            return f"{name}: given twice (upper and lower case are the same)"
        files.add(name.lower())
        for part in (name, *map(str, PurePosixPath(name).parents)):
            if spelled.setdefault(part.lower(), part) != part:
                return f"{part}: differs from {spelled[part.lower()]} in upper and lower case only"
    for entry in entries:
        for parent in PurePosixPath(entry.filename).parents:
            if str(parent).lower() in files:
                return f"{parent}: both a file and a folder"
    return None


def _overlap(entries: Sequence[Entry], end: int) -> str | None:
    """Entries that share bytes of the archive: a small zip that unpacks to a large one."""
    ordered = sorted(entries, key=lambda entry: entry.header_offset)
    starts = [entry.header_offset for entry in ordered]
    for entry, (start, following) in zip(ordered, pairwise([*starts, end]), strict=True):
        if start + HEADER + len(entry.orig_filename) + entry.compress_size > following:
            return f"{entry.filename}: overlaps what follows it"
    return None


def _shown(name: str) -> str:
    return name if name.isprintable() else repr(name)


def _files(folder: Path) -> list[Path]:
    return [path for path in folder.rglob("*") if path.is_file()]
