"""Text tables as instruments and spreadsheets write them: where columns part and rows begin."""

from __future__ import annotations

import csv
import re
import warnings
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from galloping.field.units import is_unit, named

HEAD = 65536  # bytes that the layout of a text table is told from
BINARY = {  # first bytes of what is no text table, whatever its name
    b"PK\x03\x04": "a zip archive or an Excel sheet; unpack it, or save the sheet as CSV",
    b"\xd0\xcf\x11\xe0": "an old Excel sheet; save it as CSV",
    b"\x1f\x8b": "a gzip archive; unpack it",
    b"PAR1": "a Parquet file; name it .parquet",
    b"\x89HDF": "an HDF5 file; name it .h5",
    b"CDF": "a NetCDF file; name it .nc",
    b"MATLAB 5": "a MATLAB file; name it .mat",
    b"\x80": "a pickle, which is never loaded",
    b"\x7fELF": "a program",
    b"%PDF": "a PDF document",
    b"\xff\xfe": "text in UTF-16; save it as UTF-8",
    b"\xfe\xff": "text in UTF-16; save it as UTF-8",
    b"<": "a web page or XML",
}
MARKS = (";", "\t", ",", None)  # between columns, None white space; a comma may be a decimal one
DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+([eE][+-]?\d+)?")
SAY_DECIMAL = "with a decimal comma say --decimal , (decimal: ',' in a mapping)"


class TextError(ValueError):
    """A text that is no table; one line."""


@dataclass(frozen=True)
class _Layout:
    """Of a text table. header, units: a cell for each column. first: index of its first row."""

    separator: str | None
    header: list[str]
    units: list[str | None]
    first: int
    notes: tuple[str, ...]


def read_text(
    path: Path, decimal: str, time: str
) -> tuple[list[tuple[str, np.ndarray, str | None]], int, tuple[str, ...]]:
    """Header, values and unit, or None, of each column; the first row; what was passed over.

    decimal: the decimal mark. time: name of the column of times. The first row of data is counted
    as an editor counts lines. Raises TextError; other errors of reading pass.
    """
    layout = _layout(_head(path), decimal, time)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", pd.errors.ParserWarning)
            frame = pd.read_csv(
                path, sep=layout.separator or r"\s+", decimal=decimal, skiprows=layout.first,
                header=None, names=range(len(layout.header)), index_col=False,
                encoding="utf-8-sig", skipinitialspace=True, low_memory=False,
            )  # fmt: skip
    except (pd.errors.ParserWarning, pd.errors.ParserError) as error:
        raise TextError(_uneven(path, layout)) from error
    except pd.errors.EmptyDataError as error:
        raise TextError("no rows of data") from error
    except UnicodeDecodeError as error:
        byte = error.object[error.start]
        raise TextError(f"byte {byte:#x} is not UTF-8; save the file as UTF-8") from error
    cells = zip(layout.header, layout.units, frame, strict=True)
    content = [(header, frame[k].to_numpy(), unit) for header, unit, k in cells if header]
    return content, layout.first + 1, layout.notes


def _head(path: Path) -> list[str]:
    """The first lines of a text file, all of them whole."""
    with path.open("rb") as file:
        head = file.read(HEAD)
        whole = not file.read(1)
    for magic, kind in BINARY.items():
        if head.startswith(magic):
            raise TextError(f"this is {kind}, not a text table")
    if b"\0" in head:
        raise TextError("not a text table in UTF-8 (it holds zero bytes)")
    if not whole:
        head = head[: head.rfind(b"\n") + 1] or head
    try:
        return head.decode("utf-8-sig").splitlines()
    except UnicodeDecodeError as error:
        raise TextError(f"byte {error.start} is not UTF-8; save the file as UTF-8") from error


def _layout(lines: list[str], decimal: str, time: str) -> _Layout:
    """Where columns are parted and rows begin, from the first lines of a file.

    Most rows have the same number of cells, two or more. The header is the first line of so many
    cells that names the column of times or, where none does, the first one. Other lines before the
    first number, such as a logger writes, are passed over, but for a row of units.
    """
    written = [k for k, line in enumerate(lines) if line.strip()]
    plain = [k for k in written if not lines[k].startswith("#")]
    if not plain:
        raise TextError("no header")
    separator, columns = _parted(lines, plain, decimal)
    cells = {k: _cells(lines[k].lstrip("#"), separator) for k in written}
    whole = [k for k in written if len(cells[k]) == columns]
    naming = (k for k in whole if named(time)[0] in (named(cell)[0] for cell in cells[k]))
    header = next(naming, next(k for k in whole if k in plain))
    if _is_data(cells[header], decimal):
        header = _above(header, cells, columns, separator)
    below = [k for k in whole if k > header]
    start = next((k for k in below if _is_data(cells[k], decimal)), header + 1)
    units = [None] * columns
    passed = [k for k in written if k < header or header < k < start]
    if below and below[0] < start and any(map(is_unit, _bare(cells[below[0]]))):
        units = [unit if is_unit(unit) else None for unit in _bare(cells[below[0]])]
        passed.remove(below[0])
    rows = [k + 1 for k in passed if k in plain]
    notes = tuple(f"{len(rows)} rows before the data were left out, row {k}" for k in rows[:1])
    return _Layout(separator, cells[header], units, start, notes)


def _bare(cells: list[str]) -> list[str]:
    """Cells of a row of units, without brackets around them."""
    return [cell.strip("[]()") for cell in cells]


def _above(first: int, cells: dict[int, list[str]], columns: int, separator: str | None) -> int:
    """The line above the first row of data, which must be the header."""
    header = max((k for k in cells if k < first), default=None)
    if header is None:
        row = ", ".join(cells[first][:3])
        raise TextError(f"the first row must name the columns; it is {row}, ...")
    if len(cells[header]) != columns:
        halved = separator == "," and columns == 2 * len(cells[header])
        hint = f"; {SAY_DECIMAL}, and another separator between columns" if halved else ""
        raise TextError(
            f"row {header + 1}, the header, has {len(cells[header])} cells, row {first + 1} has "
            f"{columns}{hint}"
        )
    return header


def _parted(lines: list[str], plain: list[int], decimal: str) -> tuple[str | None, int]:
    """What parts the columns, and how many there are.

    It gives most rows the same number of cells and, where there is a choice, a header as well:
    `csv.Sniffer` would take decimal commas for it.
    """
    found = []
    for separator in (mark for mark in MARKS if mark != decimal):
        rows = [_cells(lines[k], separator) for k in plain]
        sizes = Counter(map(len, rows[len(rows) // 2 :]))
        columns, count = sizes.most_common(1)[0]
        if columns > 1 and 2 * count > sizes.total():
            headed = not _is_data(next(row for row in rows if len(row) == columns), decimal)
            found.append((not headed, separator, columns))
    if not found:
        raise TextError(
            f"row {plain[-1] + 1}: {lines[plain[-1]]!r:.60} is one column, or rows differ; "
            "columns must be parted by commas (without decimal commas), semicolons, tabs or blanks"
        )
    return min(found, key=lambda each: each[0])[1:]


def _cells(line: str, separator: str | None) -> list[str]:
    """The cells of a line; white space may part them in any amount."""
    if separator is None:
        line, separator = " ".join(line.split()), " "
    return [
        cell.strip()
        for cell in next(csv.reader([line], delimiter=separator, skipinitialspace=True), [])
    ]


def _is_data(cells: list[str], decimal: str) -> bool:
    """Whether a row begins with a number or a time."""
    first = next(filter(None, cells), "0")
    if re.match(r"\d+[-/.:]\d+[-/.:]\d", first):
        return True
    try:
        float(first.replace(decimal, "."))
    except ValueError:
        return DECIMAL_COMMA.fullmatch(first) is not None
    return True


def _uneven(path: Path, layout: _Layout) -> str:
    """What is wrong with the first row that has more cells than the header."""
    with path.open(encoding="utf-8-sig", errors="replace", newline="") as file:
        before = 0
        for k, line in enumerate(file):
            cells = _cells(line, layout.separator) if k >= layout.first else []
            if line.count('"') % 2:
                before = before or k + 1
            if len(cells) > len(layout.header):
                return f"row {k + 1} has {len(cells)} cells, the header {len(layout.header)}"
    return f"row {before}: a quotation mark is not closed" if before else "rows differ in length"
