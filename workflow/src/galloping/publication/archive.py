"""Archives of publications: reproducible bytes, verification, and restoring of results.

The same files give the same bytes. An archive is not trusted: tests show whether it is complete and
agrees with a study here. A manifest has the SHA-256 of every file of a folder, in the format of
`sha256sum --check`.
"""

import errno
import os
import re
import stat
import struct
import tempfile
import time
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

from pydantic import TypeAdapter, ValidationError

from galloping.configuration.load import load, plain
from galloping.configuration.yaml_file import ConfigurationError, read
from galloping.fields import list_first
from galloping.reproducibility.plan import Plan
from galloping.reproducibility.receipts import (
    Receipt,
    digest,
    read_receipt,
    read_receipts,
    receipt_path,
    write_receipt,
)
from galloping.reproducibility.repair import adopt, audit, set_aside
from galloping.storage import partial_prefix, write_text
from galloping.tables.comparison import flatten, list_differences

CONFIGURATION, RECEIPTS, MANIFEST = "configuration.yaml", "receipts.json", "manifest.sha256"
MAX_ENTRIES = 20_000  # files in an archive, many more than a study has
MAX_SIZE = 4 * 2**30  # bytes: size of all files together

ENTRY_TIME = (1980, 1, 1, 0, 0, 0)  # time of every entry: the earliest that a zip can store
PLAIN_PATH = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.+=-]*(/[A-Za-z0-9_][A-Za-z0-9_.+=-]*)*")
COMPRESSIONS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
# errors raised for files that are no zip, broken zips, and a file with the name of a folder
ZIP_ERRORS = (
    zipfile.BadZipFile, zlib.error, struct.error, EOFError, ValueError, RuntimeError,
    FileExistsError, NotADirectoryError, IsADirectoryError, ArithmeticError, LookupError,
    MemoryError, AttributeError, TypeError,
)  # fmt: skip
NAME_ERRORS = (errno.EINVAL, errno.ENAMETOOLONG, errno.EOVERFLOW)  # errors in names and offsets


class NotRestorable(Exception):
    """Error that an archive is faulty or does not fit the study; its message lists the reasons."""


def is_plain(path: str) -> bool:
    """Decide whether a path matches PLAIN_PATH: safe on any system, relative, no part hidden."""
    return PLAIN_PATH.fullmatch(path) is not None


def list_files(folder: Path) -> list[str]:
    """List the paths of all files below a folder, sorted and relative to that folder."""
    return sorted(p.relative_to(folder).as_posix() for p in folder.rglob("*") if p.is_file())


def pack(folder: Path, target: Path) -> None:
    """Write all files of a folder to a zip archive; the same files give the same bytes.

    Paths are relative to the folder. Names are sorted, times, permissions and compression fixed.
    """
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED, compresslevel=6) as archive:
        for path in list_files(folder):
            entry = zipfile.ZipInfo(path, ENTRY_TIME)
            entry.create_system = 3  # Unix, also where it is not
            entry.external_attr = (stat.S_IFREG | 0o644) << 16
            archive.writestr(entry, (folder / path).read_bytes(), zipfile.ZIP_DEFLATED, 6)


def unpack(archive: Path, folder: Path) -> None:
    """Extract an untrusted zip archive into an empty folder, after checks of paths and sizes.

    All files become regular files, whatever their declared type. Raises NotRestorable, before
    anything is written, for names that reach outside or hide and for excessive size, and while
    writing for contents that are not as declared. The caller removes the folder.
    """
    try:
        with zipfile.ZipFile(archive) as content:
            entries = content.infolist()
            size = sum(entry.file_size for entry in entries)
            if len(entries) > MAX_ENTRIES or size > MAX_SIZE:
                text = f"{len(entries)} files of {size} bytes; at most {MAX_ENTRIES} of {MAX_SIZE}"
                raise NotRestorable(f"{archive}: {text} are allowed")
            for entry in entries:
                if not is_plain(entry.orig_filename):
                    raise NotRestorable(
                        f"{archive}: {entry.orig_filename!r} is not a plain path (letters, digits "
                        "and _.+=-, with '/', no part beginning with a dot)"
                    )
                if entry.compress_type not in COMPRESSIONS:
                    raise NotRestorable(
                        f"{archive}: {entry.orig_filename} is compressed by method "
                        f"{entry.compress_type}; must be stored or deflated"
                    )
            content.extractall(folder)  # at most the declared size of each entry
    except ZIP_ERRORS as error:
        cause = " ".join(str(error).split())[:200]
        raise NotRestorable(f"{archive}: not a sound zip file ({cause})") from None
    except OSError as error:
        if error.errno not in NAME_ERRORS:
            raise
        raise NotRestorable(f"{archive}: not a sound zip file ({error.strerror})") from None


def write_manifest(folder: Path) -> None:
    """Write a list of the SHA-256 of every file below a folder into that folder."""
    paths = [path for path in list_files(folder) if path != MANIFEST]
    write_text(folder / MANIFEST, "".join(f"{digest(folder / p)}  {p}\n" for p in paths))


def find_manifest_faults(folder: Path) -> Iterator[str]:
    """Yield a line for each file that is missing, new or changed since the manifest was written."""
    try:
        lines = (folder / MANIFEST).read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError):
        yield f"{MANIFEST}: missing, or not text"
        return
    digests = {path: sha256 for sha256, _, path in (line.partition("  ") for line in lines)}
    present = set(list_files(folder)) - {MANIFEST}
    for path in sorted(digests.keys() | present):
        if path not in digests:
            yield f"{path}: not in the manifest"
        elif path not in present:
            yield f"{path}: missing"
        elif digest(folder / path) != digests[path]:
            yield f"{path}: changed"


FOLDER_KEYS = ("results", "reference")  # settings without effect on numbers
RECEIPT_LIST = TypeAdapter(list[Receipt])


def check_digest(archive: str | Path, expected: str | None) -> str:
    """Return an archive's SHA-256; raise NotRestorable unless it is the `expected` one, if any."""
    present = digest(archive)
    if expected and present != expected.strip().lower():
        raise NotRestorable(f"{archive}: SHA-256 {present}, not {expected}")
    return present


def read_published_settings(folder: Path) -> dict:
    """Read the settings in an unpacked archive; raise NotRestorable for faulty ones."""
    try:
        return plain(load(read(folder / CONFIGURATION)))
    except ConfigurationError as error:
        text = str(error).splitlines()[0].removeprefix(f"{folder}/")
        raise NotRestorable(f"{CONFIGURATION}: {text}") from None


def read_published_receipts(folder: Path) -> dict[str, Receipt]:
    """Read from an unpacked archive the records of how its files were made, by path.

    `kept` of a receipt says whether the file is in the archive. Raises NotRestorable, also for a
    receipt of a file or log outside the results folder.
    """
    results = read_published_settings(folder)["results"]
    try:
        records = RECEIPT_LIST.validate_json((folder / RECEIPTS).read_bytes(), strict=True)
    except (OSError, ValidationError):
        raise NotRestorable(f"{RECEIPTS}: missing, or not a list of receipts") from None
    for receipt in records:
        for path, base in ((receipt.path, results), (receipt.log, f"{results}/logs")):
            if not (is_plain(path) and path.startswith(f"{base}/")):
                raise NotRestorable(f"{RECEIPTS}: {path!r} is not a plain path in {base}")
    return {r.path: replace(r, kept=(folder / r.path).is_file()) for r in records}


def find_faults(folder: Path) -> Iterator[str]:
    """Yield a line for each contradiction between an unpacked archive's files and its records."""
    if lines := list(find_manifest_faults(folder)):
        yield from lines  # the receipts would repeat them
        return
    try:
        records, study = read_published_receipts(folder), read_published_settings(folder)
    except NotRestorable as error:
        yield str(error)
        return
    reference = f"{study['reference']}/"
    sources = set().union(*(receipt.inputs for receipt in records.values())) - records.keys()
    for name in list_files(folder):
        if name in sources:  # no job made it: only the manifest has its digest
            continue
        if name.startswith(f"{study['results']}/") and not name.startswith(reference):
            if name not in records:
                yield f"{name}: without a receipt of how it was made"
            elif digest(folder / name) != records[name].sha256:
                yield f"{name}: not what its receipt says"


def describe_changed_settings(published: Mapping, present: Mapping) -> Iterator[str]:
    """Yield a line of text for each setting that differs between two studies, except folders."""
    archived, local = dict(flatten(published)), dict(flatten(present))
    for key in dict.fromkeys([*archived, *local]):
        there, here = (settings.get(key, "nothing") for settings in (archived, local))
        if key not in FOLDER_KEYS and there != here:
            yield f"{key}: {there} in the archive, {here} here"


def restore(archive: Path, plan: Plan, *, replacing: bool = False) -> Iterator[str]:
    """Put the results of an archive into the study's folder after checks; yield messages.

    No result is written before the archive is found complete and in agreement with what was
    computed here. Afterwards Snakemake regards a file as made if its receipt, and those of all
    files before it, agree with the plan; others are set aside. replacing: set aside results that
    are not those of the archive. Raises NotRestorable.
    """
    results = plan.results
    # on the file system of the results; `make repair` sweeps it if this process is killed
    with tempfile.TemporaryDirectory(prefix=partial_prefix(), dir=results) as temporary:
        folder = Path(temporary)
        unpack(archive, folder)
        if lines := list(find_faults(folder)):
            raise NotRestorable("\n".join(lines))
        published = read_published_settings(folder)
        if published["results"] != results:
            raise NotRestorable(
                f"results: {published['results']!r} in the archive, not {results!r}"
            )
        if not list(describe_changed_settings(published, plan.settings)):
            sound = audit(plan).sound
            if lines := list(list_differences(folder / results, results, only=sound)):
                why = "the same study, computed here, has other numbers: see `make verify`"
                raise NotRestorable("\n".join([*lines, why]))
        records = read_published_receipts(folder)
        digests = {path: receipt.sha256 for path, receipt in records.items()}
        others = [path for path in _present_files(plan) if digests.get(path) != digest(path)]
        if others and not replacing:
            text = "not as in the archive; REPLACE=yes sets what differs aside"
            raise NotRestorable(f"{list_first(others)}: {text}")
        for path in others:
            set_aside(results, path)
            receipt_path(path).unlink(missing_ok=True)
        placed = [p for p in digests if (folder / p).exists() and not Path(p).exists()]
        for path in placed:
            Path(path).parent.mkdir(parents=True, exist_ok=True)
            (folder / path).replace(path)
        for path, receipt in records.items():
            # keep the receipt of a file that was here before
            if path in placed or not (Path(path).exists() and read_receipt(path)):
                write_receipt(replace(receipt, kept=Path(path).exists()))
    now = time.time_ns()
    for path in _present_files(plan):
        os.utime(path, ns=(now, now))  # so that no file is older than its inputs
    if others:
        yield f"{len(others)} other files set aside in {results}/set_aside"
    yield f"{len(placed)} files restored"
    yield from adopt(plan)


def _present_files(plan: Plan) -> list[str]:
    """List the files of the study that exist: planned, or made."""
    known = {*plan.maker, *read_receipts(plan.results)}
    return sorted(path for path in known if Path(path).exists())
