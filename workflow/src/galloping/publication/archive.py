"""Zip archives: the same bytes for the same files, read without trust in who made them; and the
SHA-256 of every file of a folder, in the format of `sha256sum --check`."""

import re
import shutil
import stat
import struct
import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path

from galloping.reproducibility.receipts import digest
from galloping.storage import write_text

# Far above what a study needs, far below what would harm.
MAX_ENTRIES = 20_000
MAX_SIZE = 4 * 2**30  # bytes, of all files together

EARLIEST = (1980, 1, 1, 0, 0, 0)  # the time that every entry has; a zip knows none before
PLAIN = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.+=-]*(/[A-Za-z0-9_][A-Za-z0-9_.+=-]*)*")
# what is raised for what is no zip file, a broken one, or one with a name twice
BROKEN = (zipfile.BadZipFile, zlib.error, struct.error, EOFError, ValueError, RuntimeError)
UNSOUND = (*BROKEN, FileExistsError, NotADirectoryError, IsADirectoryError)


class NotRestorable(Exception):
    """An archive or publication that is not used; one line a reason."""


def is_plain(path: str) -> bool:
    """Whether a path stays inside its folder on any system, and hides nothing.

    Relative, with '/', of letters, digits and `_.+=-`, no part beginning with a dot.
    """
    return PLAIN.fullmatch(path) is not None


def files_of(folder: Path) -> list[str]:
    """All files below a folder, sorted, relative to it."""
    found = (path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file())
    return sorted(found)


def pack(folder: Path, target: Path) -> None:
    """Write all files of a folder, with paths relative to it, as a zip.

    Names in order, fixed times and permissions, fixed compression: same files, same bytes.
    """
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED, compresslevel=6) as archive:
        for path in files_of(folder):
            entry = zipfile.ZipInfo(path, EARLIEST)
            entry.create_system = 3  # Unix, also where it is not
            entry.external_attr = (stat.S_IFREG | 0o644) << 16
            archive.writestr(entry, (folder / path).read_bytes(), zipfile.ZIP_DEFLATED, 6)


def unpack(archive: Path, folder: Path) -> None:
    """Write all files of a zip into an empty folder, as regular files whatever they claim to be.

    Raises NotRestorable, before anything is written, for names that reach outside or hide and for
    too much, and while writing for contents that are not as declared. The caller removes
    the folder.
    """
    try:
        with zipfile.ZipFile(archive) as content:
            entries = content.infolist()
            size = sum(entry.file_size for entry in entries)
            if len(entries) > MAX_ENTRIES or size > MAX_SIZE:
                told = f"{len(entries)} files of {size} bytes; at most {MAX_ENTRIES} of {MAX_SIZE}"
                raise NotRestorable(f"{archive}: {told} are allowed")
            for entry in entries:
                if not is_plain(entry.orig_filename):
                    raise NotRestorable(
                        f"{archive}: {entry.orig_filename!r} is not a plain path (letters, digits "
                        "and _.+=-, with '/', no part beginning with a dot)"
                    )
            for entry in entries:
                target = folder / entry.filename
                target.parent.mkdir(parents=True, exist_ok=True)
                with content.open(entry) as source, target.open("xb") as sink:
                    shutil.copyfileobj(source, sink)  # never more than declared
    except UNSOUND as error:
        raise NotRestorable(f"{archive}: not a sound zip file ({error})") from None


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
