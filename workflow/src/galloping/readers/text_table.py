"""The layout of text tables as loggers and spreadsheets write them, and their columns."""

import codecs
import csv
import re
import warnings
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from typing import BinaryIO

import numpy as np
import pandas as pd

from galloping.readers import FileError
from galloping.readers.columns import is_time, target
from galloping.readers.units import is_unit, named

HEAD = 65536  # bytes that the layout of a text table is told from
BINARY = {  # first bytes of what is no text table, whatever its name
    b"PK\x03\x04": "a zip archive or an Excel sheet; unpack it, or name the sheet .xlsx",
    b"\x1f\x8b": "a gzip archive; unpack it",
    b"PAR1": "a Parquet file; name it .parquet",
    b"\x80": "a pickle, which is never loaded",
    b"<": "a web page or XML",
}
MARKS = (";", "\t", ",", None)  # between columns, None white space; a comma may be a decimal one
CHINESE = re.compile(rb"[\x81-\xfe]{4}")  # two characters of GB 18030; no Western words are such
ENCODINGS = {"cp1252": "Windows-1252", "gb18030": "GB 18030"}  # besides those of Unicode
DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+([eE][+-]?\d+)?")
DECIMAL_POINT = re.compile(DECIMAL_COMMA.pattern.replace(",", r"\."))
THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2}(,\d{3})+")  # or a decimal comma: nothing tells
MISSING = {  # words for a missing sample, besides those that pandas knows
    "-", "--", "---", "?", "*", "#nv", "#wert!", "#value!", "#ref!", "#div/0!", "overflow", "over",
    "ovl", "ovfl", "ofl", "ol", "underflow", "err", "error", "bad", "invalid", "missing", "no data",
    "nodata", "none", "fault", "fehler", "inf", "-inf", "+inf",
}  # fmt: skip
SAY_DECIMAL = "with a decimal comma say --decimal , (decimal: ',' in a mapping)"


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
    """Header, values and unit, or None, of each column; the first row; what was passed over."""
    with opened() as file:
        head = file.read(HEAD)
        whole = not file.read(1)
    for magic, kind in BINARY.items():
        if head.startswith(magic):
            raise FileError(f"this is {kind}, not a text table")
    wide = head.startswith((b"\xff\xfe", b"\xfe\xff"))
    if b"\0" in head and not wide:
        raise FileError("not a text table in UTF-8 (it holds zero bytes)")
    other = "gb18030" if CHINESE.search(head) else "cp1252"
    for encoding in ("utf-16",) if wide else ("utf-8-sig", other):  # the first that fits
        try:
            lines = codecs.getincrementaldecoder(encoding)().decode(head, whole).splitlines()
            layout = _layout(lines if whole else lines[:-1] or lines, decimal, time)
            frame = _frame(opened, layout, encoding, rows)
            break
        except UnicodeDecodeError as error:
            byte = error.object[error.start]
    else:
        raise FileError(
            f"byte {byte:#x} is no text in UTF-8 or {ENCODINGS[other]}; save it as UTF-8"
        )
    notes = list(layout.notes)
    if encoding in ENCODINGS:
        notes.append(f"no text in UTF-8; read as {ENCODINGS[encoding]}")
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


def _frame(
    opened: Callable[[], BinaryIO], layout: _Layout, encoding: str, rows: int | None
) -> pd.DataFrame:
    try:
        with warnings.catch_warnings(), opened() as file:
            warnings.simplefilter("error", pd.errors.ParserWarning)
            return pd.read_csv(
                file, sep=layout.separator or r"\s+", decimal=layout.decimal,
                skiprows=layout.first, header=None, names=range(len(layout.header)),
                index_col=False, encoding=encoding, skipinitialspace=True, low_memory=False,
                nrows=rows,
            )  # fmt: skip
    except (pd.errors.ParserWarning, pd.errors.ParserError) as error:
        raise FileError(_uneven(error, layout)) from error
    except pd.errors.EmptyDataError as error:
        raise FileError("no rows of data") from error


def _without_words(cells: pd.Series, decimal: str) -> tuple[pd.Series, dict[str, int]]:
    """Numbers, where all other cells are words for a missing sample, and the counts of these."""
    if cells.dtype.kind in "fiub":
        return cells, {}
    text = cells.astype("string").str.strip()
    words = text[text.str.casefold().isin(MISSING)]
    others = text.drop(words.index).str.replace(decimal, ".")
    numbers = pd.to_numeric(others, errors="coerce").reindex(text.index)
    if not len(words) or (numbers.isna() & text.notna()).sum() > len(words) or not numbers.any():
        return cells, {}
    return numbers.astype(float), words.value_counts().to_dict()


def _layout(lines: list[str], decimal: str | None, time: str | None) -> _Layout:
    """Where columns are parted and rows begin, from the first lines of a file.

    Most rows have the same number of cells, two or more. Lines of a logger before the first number
    are passed over, but for the header and a row of units.
    """
    written = [k for k, line in enumerate(lines) if line.strip(" ,;\t\r")]
    plain = [k for k in written if not lines[k].startswith("#")]
    if not plain:
        raise FileError("no header")
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
    if below and below[0] < start:
        bare = [cell.strip("[]()") for cell in cells[below[0]]]
        units = [unit if is_unit(unit) else None for unit in bare]
        passed = [k for k in passed if k != below[0] or not any(units)]
    rows = [k + 1 for k in passed if k in plain]
    notes += [f"rows before the data were left out: {len(rows)}, from row {k} on" for k in rows[:1]]
    return _Layout(separator, decimal, cells[header], units, start, tuple(notes))


def _header(
    cells: dict[int, list[str]], rows: list[int], plain: list[int], time: str | None
) -> int:
    """Which of the rows, up to the first of data, names the columns.

    The first that names the column of times or, where that is not known, the most columns that a
    reader would know; where none does, the first one.
    """
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


def _above(first: int, cells: dict[int, list[str]], columns: int, separator: str | None) -> int:
    """The line above the first row of data, which must be the header."""
    header = max((k for k in cells if k < first), default=None)
    if header is None:
        row = ", ".join(cells[first][:3])
        raise FileError(f"the first row must name the columns; it is {row}, ...")
    if len(cells[header]) != columns:
        halved = separator == "," and columns == 2 * len(cells[header])
        hint = f"; {SAY_DECIMAL}, and another separator between columns" if halved else ""
        raise FileError(
            f"row {header + 1}, the header, has {len(cells[header])} cells, row {first + 1} has "
            f"{columns}{hint}"
        )
    return header


def _parted(lines: list[str], plain: list[int], decimal: str | None) -> tuple[str | None, int]:
    """What parts the columns, as most rows and the header say it, and how many there are.

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
        raise FileError(
            f"row {plain[-1] + 1}: {lines[plain[-1]]!r:.60} is one column, or rows differ; "
            "columns must be parted by commas (without decimal commas), semicolons, tabs or blanks"
        )
    return min(found, key=lambda each: each[0])[1:]


def _cells(line: str, separator: str | None) -> list[str]:
    if separator is None:
        line, separator = " ".join(line.split()), " "
    cells = csv.reader([line], delimiter=separator, skipinitialspace=True)
    return [cell.strip() for cell in next(cells, [])]


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


def _uneven(error: Exception, layout: _Layout) -> str:
    """What pandas says is wrong with the first row that has more cells than the header."""
    cells = f"the header {len(layout.header)}"
    if found := re.search(r"in line (\d+), saw (\d+)", str(error)):
        return f"row {found[1]} has {found[2]} cells, {cells}"
    if found := re.search(r"EOF inside string starting at row (\d+)", str(error)):
        return f"row {int(found[1]) + 1}: a quotation mark is not closed"
    return f"row {layout.first + 1} has more cells than {cells}"
