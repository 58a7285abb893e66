"""Text tables as instruments and spreadsheets write them: where columns part and rows begin."""

import csv
import io
import re
import warnings
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from typing import BinaryIO

import numpy as np
import pandas as pd

from galloping.field.columns import is_time, target
from galloping.field.units import is_unit, named

HEAD = 65536  # bytes that the layout of a text table is told from
BINARY = {  # first bytes of what is no text table, whatever its name
    b"PK\x03\x04": "a zip archive or an Excel sheet; unpack it, or name the sheet .xlsx",
    b"\xd0\xcf\x11\xe0": "an old Excel sheet; save it as .xlsx or CSV",
    b"\x1f\x8b": "a gzip archive; unpack it",
    b"PAR1": "a Parquet file; name it .parquet",
    b"\x89HDF": "an HDF5 file; name it .h5",
    b"CDF": "a NetCDF file; name it .nc",
    b"MATLAB 5": "a MATLAB file; name it .mat",
    b"\x80": "a pickle, which is never loaded",
    b"\x7fELF": "a program",
    b"%PDF": "a PDF document",
    b"<": "a web page or XML",
}
MARKS = (";", "\t", ",", None)  # between columns, None white space; a comma may be a decimal one
ENCODINGS = ("utf-8-sig", "cp1252")  # the first that fits; UTF-16 says so itself
DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+([eE][+-]?\d+)?")
DECIMAL_POINT = re.compile(DECIMAL_COMMA.pattern.replace(",", r"\."))
THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2}(,\d{3})+")  # or a decimal comma: nothing tells
MISSING = {  # words for a missing sample, besides those that pandas knows
    "-", "--", "---", "?", "*", "#nv", "#wert!", "#value!", "#ref!", "#div/0!", "overflow", "over",
    "ovl", "ovfl", "ofl", "ol", "underflow", "err", "error", "bad", "invalid", "missing", "no data",
    "nodata", "none", "fault", "fehler", "inf", "-inf", "+inf",
}  # fmt: skip
SAY_DECIMAL = "with a decimal comma say --decimal , (decimal: ',' in a mapping)"


class TextError(ValueError):
    """A text that is no table; one line."""


@dataclass(frozen=True)
class _Layout:
    """Of a text table. header, units: a cell for each column. first: index of its first row."""

    separator: str | None
    decimal: str
    header: list[str]
    units: list[str | None]
    first: int
    notes: tuple[str, ...]


def read_text(
    opened: Callable[[], BinaryIO], decimal: str | None, time: str | None, rows: int | None = None
) -> tuple[list[tuple[str, np.ndarray, str | None]], int, tuple[str, ...]]:
    """Header, values and unit, or None, of each column; the first row; what was passed over.

    opened: the file. decimal: the decimal mark, None to tell it from the rows. time: name of the
    column of times, None to tell it from the names. rows: so many at most. The first row of data is
    counted as an editor counts lines. Raises TextError; other errors of reading pass.
    """
    with opened() as file:
        head = file.read(HEAD)
        whole = not file.read(1)
    for magic, kind in BINARY.items():
        if head.startswith(magic):
            raise TextError(f"this is {kind}, not a text table")
    wide = head.startswith((b"\xff\xfe", b"\xfe\xff"))
    if b"\0" in head and not wide:
        raise TextError("not a text table in UTF-8 (it holds zero bytes)")
    for encoding in ("utf-16",) if wide else ENCODINGS:
        try:
            return _read(opened, _lines(head, whole, encoding), encoding, decimal, time, rows)
        except UnicodeDecodeError as error:
            byte = error.object[error.start]
    raise TextError(f"byte {byte:#x} is no text in UTF-8 or Windows-1252; save the file as UTF-8")


def _lines(head: bytes, whole: bool, encoding: str) -> list[str]:
    """The first lines of a text file, all of them whole."""
    if encoding == "utf-16":
        head = head[: len(head) // 2 * 2]
        lines = head.decode(encoding).splitlines()
        return lines if whole else lines[:-1]
    if not whole:
        head = head[: head.rfind(b"\n") + 1] or head
    return head.decode(encoding).splitlines()


def _read(opened, lines, encoding, decimal, time, rows):  # as `read_text`
    layout = _layout(lines, decimal, time)
    try:
        with warnings.catch_warnings(), opened() as file:
            warnings.simplefilter("error", pd.errors.ParserWarning)
            frame = pd.read_csv(
                file, sep=layout.separator or r"\s+", decimal=layout.decimal,
                skiprows=layout.first, header=None, names=range(len(layout.header)),
                index_col=False, encoding=encoding, skipinitialspace=True, low_memory=False,
                nrows=rows,
            )  # fmt: skip
    except (pd.errors.ParserWarning, pd.errors.ParserError) as error:
        raise TextError(_uneven(opened, encoding, layout)) from error
    except pd.errors.EmptyDataError as error:
        raise TextError("no rows of data") from error
    notes = list(layout.notes)
    if encoding == "cp1252":
        notes.append("no text in UTF-8; read as Windows-1252")
    content = []
    for k, (header, unit) in enumerate(zip(layout.header, layout.units, strict=True)):
        if header:
            values, words = _without_words(frame[k], layout.decimal)
            content.append((header, values.to_numpy(), unit))
            notes += [
                f"column {named(header)[0]!r}: {count} cells of {word!r} were left out, as missing "
                "samples"
                for word, count in words.items()
            ]
    return content, layout.first + 1, tuple(notes)


def _without_words(cells: pd.Series, decimal: str) -> tuple[pd.Series, dict[str, int]]:
    """Numbers, where all other cells are words for a missing sample, and the counts of these."""
    if cells.dtype.kind in "fiub":
        return cells, {}
    text = cells.astype("string").str.strip()
    words = text[text.str.casefold().isin(MISSING)]
    numbers = pd.to_numeric(
        text.drop(words.index).str.replace(decimal, "."), errors="coerce"
    ).reindex(text.index)
    if not len(words) or (numbers.isna() & text.notna()).sum() > len(words) or not numbers.any():
        return cells, {}
    return numbers.astype(float), words.value_counts().to_dict()


def _layout(lines: list[str], decimal: str | None, time: str | None) -> _Layout:
    """Where columns are parted and rows begin, from the first lines of a file.

    Most rows have the same number of cells, two or more. The header is the first line of so many
    cells that names the column of times or, where it is not known, the most columns that a reader
    would know; where none does, the first one. Other lines before the first number, such as a
    logger writes, are passed over, but for a row of units.
    """
    written = [k for k, line in enumerate(lines) if line.strip(" ,;\t\r")]
    plain = [k for k in written if not lines[k].startswith("#")]
    if not plain:
        raise TextError("no header")
    separator, columns = _parted(lines, plain, decimal)
    cells = {k: _cells(lines[k].lstrip("#"), separator) for k in written}
    whole = [k for k in written if len(cells[k]) == columns]
    notes = []
    if decimal is None:
        decimal = _decimal([cell for k in whole for cell in cells[k]]) if separator != "," else "."
        if decimal == ",":
            notes.append("commas were read as decimal marks")
    start = next((k for k in whole if k in plain and _is_data(cells[k], decimal)), None)
    header = _header(cells, [k for k in whole if start is None or k <= start], plain, time)
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
    notes += [f"rows before the data were left out: {len(rows)}, from row {k} on" for k in rows[:1]]
    return _Layout(separator, decimal, cells[header], units, start, tuple(notes))


def _header(
    cells: dict[int, list[str]], rows: list[int], plain: list[int], time: str | None
) -> int:
    """Which of the rows, up to the first of data, names the columns."""
    if time is not None:
        name = named(time)[0]
        naming = (k for k in rows if name in (named(cell)[0] for cell in cells[k]))
        return next(naming, next(k for k in rows if k in plain))

    def known(row: int) -> int:
        return sum(bool(is_time(c) or target(c) or named(c)[1]) for c in map(str, cells[row]))

    best = max(rows, key=known)  # the first of equals
    return best if known(best) else next(k for k in rows if k in plain)


def _decimal(cells: list[str]) -> str:
    """The decimal mark: a comma where some cells can mean nothing else, and none has a point."""
    commas = [cell for cell in cells if DECIMAL_COMMA.fullmatch(cell)]
    told = any(not THOUSANDS.fullmatch(cell) for cell in commas)
    return "," if told and not any(map(DECIMAL_POINT.fullmatch, cells)) else "."


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


def _parted(lines: list[str], plain: list[int], decimal: str | None) -> tuple[str | None, int]:
    """What parts the columns, and how many there are.

    It gives most rows the same number of cells and, where there is a choice, a header as well:
    `csv.Sniffer` would take decimal commas for it.
    """
    found = []
    for separator in (mark for mark in MARKS if mark is None or mark != decimal):
        rows = [_cells(lines[k], separator) for k in plain]
        sizes = Counter(map(len, rows[len(rows) // 2 :]))
        columns, count = sizes.most_common(1)[0]
        if columns > 1 and 2 * count > sizes.total():
            first = next(row for row in rows if len(row) == columns)
            headed = not _is_data(first, decimal or ".")
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


def _uneven(opened: Callable[[], BinaryIO], encoding: str, layout: _Layout) -> str:
    """What is wrong with the first row that has more cells than the header."""
    with io.TextIOWrapper(opened(), encoding, errors="replace", newline="") as file:
        before = 0
        for k, line in enumerate(file):
            cells = _cells(line, layout.separator) if k >= layout.first else []
            if line.count('"') % 2:
                before = before or k + 1
            if len(cells) > len(layout.header):
                return f"row {k + 1} has {len(cells)} cells, the header {len(layout.header)}"
    return f"row {before}: a quotation mark is not closed" if before else "rows differ in length"
