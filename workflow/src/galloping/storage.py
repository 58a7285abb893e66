"""Files that are written whole or not at all, with the same bytes for the same content."""

import csv
import glob
import json
import os
import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np

PARTIAL_PREFIX = ".partial-"  # prefix of the name of an unfinished file


def partial_prefix() -> str:
    """Return the name prefix of this process's temporary files, which remain if it is killed."""
    return f"{PARTIAL_PREFIX}{os.getpid()}-"


@contextmanager
def replacing(path: str | os.PathLike) -> Iterator[Path]:
    """Yield a temporary path; rename it to `path` if the `with` block ends without error."""
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(f"{partial_prefix()}{path.name}")
    try:
        yield partial
        partial.replace(path)
    except OSError as error:
        if str(error.filename) == str(partial):  # a path that the caller does not know
            error.filename = str(path)
        raise
    finally:
        partial.unlink(missing_ok=True)


@contextmanager
def replacing_folder(path: str | os.PathLike) -> Iterator[Path]:
    """Yield a temporary folder; move its files to `path` if the `with` block ends without error.

    A new folder appears complete; in an existing one, each file replaces its namesake, and all
    others stay. Remains of a killed process of the same folder are removed. Raises OSError, naming
    the folder, if it cannot be written, before the block begins or when it ends. An error leaves no
    new files.
    """
    target = Path(path).resolve()
    parent = target if target.is_dir() else target.parent
    partial = parent / f"{partial_prefix()}{target.name}"
    new_folders = [folder for folder in (parent, *parent.parents) if not folder.exists()]
    lock = None
    try:
        partial.mkdir(parents=True)
        lock = _lock_folder(partial)
        for remnant in parent.glob(f"{PARTIAL_PREFIX}*-{glob.escape(target.name)}"):
            if remnant != partial and (remnant_lock := _lock_folder(remnant)) is not None:
                shutil.rmtree(remnant, ignore_errors=True)
                os.close(remnant_lock)
        yield partial
        if target.is_dir():
            for file in partial.iterdir():
                file.replace(target / file.name)
        else:
            partial.rename(target)
    except OSError as error:
        raise OSError(f"{path}: cannot be written: {error.strerror or error}") from error
    finally:
        shutil.rmtree(partial, ignore_errors=True)
        if lock is not None:
            os.close(lock)
        for folder in new_folders:
            if folder.is_dir() and not any(folder.iterdir()):
                folder.rmdir()


def _lock_folder(folder: Path) -> int | None:
    """Lock a folder as long as this process lives, or until the descriptor is closed.

    None if another process has locked it, or if the system or file system has no locks.
    """
    try:
        import fcntl  # not on Windows
    except ImportError:
        return None
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(descriptor)
        return None
    return descriptor


def write_arrays(path: str | os.PathLike, **arrays: np.ndarray) -> None:
    """Write named arrays to an uncompressed .npz file, completely or not at all."""
    with replacing(path) as partial, partial.open("wb") as file:
        np.savez(file, **arrays)  # type: ignore[arg-type]  # to its stub any name is a flag


def write_text(path: str | os.PathLike, text: str) -> None:
    """Write text to a UTF-8 file, completely or not at all."""
    with replacing(path) as partial:
        partial.write_text(text, encoding="utf-8")


def write_json(path: str | os.PathLike, content: object, indent: int | None = 2) -> None:
    """Write plain values to a JSON file, in one line without indent; raise ValueError for NaN."""
    write_text(path, json.dumps(content, indent=indent, allow_nan=False) + "\n")


def read_json(path: str | os.PathLike) -> dict:
    """Read a JSON file that contains an object, and return it as a dict."""
    return json.loads(Path(path).read_text(encoding="utf-8"))


def write_rows(
    path: str | os.PathLike,
    rows: Sequence[Mapping[str, object]],
    columns: Sequence[str] | None = None,
) -> None:
    """Write dicts as the rows of a CSV file, with ten significant digits per number.

    columns: by default those of the first row; needed if there may be no rows.
    """
    columns = list(rows[0]) if columns is None else columns
    with replacing(path) as partial, partial.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, fieldnames=columns, lineterminator="\n")
        writer.writeheader()
        for row in rows:
            writer.writerow({key: as_cell(value) for key, value in row.items()})


def as_cell(value: object) -> object:
    """Return a value as a cell of a CSV file: ten digits of a number, empty for NaN."""
    if isinstance(value, float):
        return "" if value != value else f"{value:.10g}"
    return value
