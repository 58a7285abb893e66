"""Reader of text tables, as loggers and spreadsheets write them."""

import codecs
import io
import re
import warnings
from collections.abc import Callable
from typing import BinaryIO

import numpy as np
import pandas as pd

from galloping.readers import FileError
from galloping.readers.layout import (
    DECIMAL_COMMA,
    DECIMAL_POINT,
    MINUS,
    Layout,
    find_layout,
    split_cells,
)
from galloping.readers.units import split_header

HEAD_BYTES = 65536  # bytes from which the layout of a text table is determined
BINARY_FORMATS = {  # formats by the first bytes of a file that is no text table
    b"PK\x03\x04": "a zip archive or an Excel sheet; unpack it, or name the sheet .xlsx",
    b"\x1f\x8b": "a gzip archive; unpack it",
    b"PAR1": "a Parquet file; name it .parquet",
    b"\x80": "a pickle, which is never loaded",
    b"<": "a web page or XML",
}
CHINESE_TEXT = re.compile(rb"[\x81-\xfe]{4}")  # two GB 18030 characters, unlike Western words
ENCODINGS = {"cp1252": "Windows-1252", "gb18030": "GB 18030"}  # encodings other than Unicode
WIDE_ENCODINGS = {  # by their first bytes; those of UTF-32 may begin with those of UTF-16
    "utf-32": (codecs.BOM_UTF32_LE, codecs.BOM_UTF32_BE),
    "utf-16": (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE),
}
MISSING_WORDS = {  # words for a missing sample that pandas does not know
    "-", "--", "---", "?", "*", "***", "#nv", "#wert!", "#value!", "#ref!", "#div/0!", "overflow",
    "over", "ovl", "ovfl", "ofl", "ol", "underflow", "err", "error", "bad", "invalid", "missing",
    "no data", "nodata", "none", "fault", "fehler", "nan", "nan(ind)", "-nan(ind)", "n.a.",
}  # fmt: skip


def read_text(
    opener: Callable[[], BinaryIO], decimal: str | None, time: str | None, rows: int | None = None
) -> tuple[list[tuple[str, np.ndarray, str | None]], int, tuple[str, ...]]:
    """Read the columns of a text table, the line where data begin, and notes on ignored parts.

    Returns header, values, and unit or None, of each column, then the line and the notes.
    """
    with opener() as file:
        head = file.read(HEAD_BYTES)
        whole = not file.read(1)
    for magic, kind in BINARY_FORMATS.items():
        if head.startswith(magic):
            raise FileError(f"this is {kind}, not a text table")
    wide = next((name for name, marks in WIDE_ENCODINGS.items() if head.startswith(marks)), None)
    if b"\0" in head and not wide:
        raise FileError("not a text table in UTF-8 (it holds zero bytes)")
    other = "gb18030" if CHINESE_TEXT.search(head) else "cp1252"
    for encoding in (wide,) if wide else ("utf-8-sig", other):  # the first that fits
        try:
            lines = codecs.getincrementaldecoder(encoding)().decode(head, whole).splitlines()
            layout = find_layout(lines if whole else lines[:-1] or lines, decimal, time)
            frame = _read_frame(opener, layout, encoding, rows)
            if layout.separator is None and frame.iloc[:, -1].isna().any():
                _check_even(opener, layout, encoding)
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
            plain = frame[k].replace(MINUS, "-", regex=True)
            cells = _replace_decimal_commas(plain, header, layout)
            values, words = _replace_missing_words(cells, layout.decimal)
            content.append((header, values.to_numpy(), unit))
            notes += [
                f"column {split_header(header)[0]!r}: {count} cells of {word!r} were left out, as "
                "missing samples"
                for word, count in words.items()
            ]
    return content, layout.line, tuple(notes)


def _read_frame(
    opener: Callable[[], BinaryIO], layout: Layout, encoding: str, rows: int | None
) -> pd.DataFrame:
    try:
        with warnings.catch_warnings(), opener() as file:
            warnings.simplefilter("error", pd.errors.ParserWarning)
            return pd.read_csv(
                file, sep=layout.separator or r"\s+", decimal=layout.decimal,
                skiprows=layout.first, header=None, names=range(len(layout.header)),
                index_col=False, encoding=encoding, skipinitialspace=True, low_memory=False,
                nrows=rows,
            )  # fmt: skip
    except (pd.errors.ParserWarning, pd.errors.ParserError) as error:
        raise FileError(_describe_uneven(error, layout)) from error
    except pd.errors.EmptyDataError as error:
        raise FileError("no rows of data") from error


def _check_even(opener: Callable[[], BinaryIO], layout: Layout, encoding: str) -> None:
    """Refuse a row with fewer cells than others: nothing shows which of its cells is missing.

    The last row may be cut off.
    """
    short = None
    with io.TextIOWrapper(opener(), encoding) as lines:
        for row, line in enumerate(lines, 1):
            if short and line.strip():
                raise FileError(
                    f"row {short[0]} has {short[1]} cells, the header {len(layout.header)}; write "
                    "missing samples as NaN"
                )
            count = len(split_cells(line, None))
            if row >= layout.line and 0 < count < len(layout.header):
                short = row, count


def _replace_decimal_commas(cells: pd.Series, header: str, layout: Layout) -> pd.Series:
    """Replace the decimal commas of a column that pandas left as text, such as for one bad cell.

    Raises FileError if a number of the column has a point, which then separates thousands.
    """
    if layout.decimal != "," or cells.dtype.kind in "fiub":
        return cells
    text = cells.astype("string").str.strip()
    commas = text.str.fullmatch(DECIMAL_COMMA.pattern).fillna(False)
    points = np.flatnonzero(text.str.fullmatch(DECIMAL_POINT.pattern).fillna(False))
    if len(points):
        where = f"row {layout.line + int(points[0])}, column {split_header(header)[0]!r}"
        raise FileError(
            f"{where}: {text[points[0]]!r} has a point, which separates thousands where the "
            "decimal mark is a comma; leave it out"
        )
    return text.where(~commas, text.str.replace(",", ".")).astype(object)


def _replace_missing_words(cells: pd.Series, decimal: str) -> tuple[pd.Series, dict[str, int]]:
    """Convert cells to numbers if all others are words for a missing sample, and count these."""
    if cells.dtype.kind in "fiub":
        return cells, {}
    text = cells.astype("string").str.strip()
    words = text[text.str.casefold().isin(MISSING_WORDS)]
    others = text.drop(words.index).str.replace(decimal, ".")
    numbers = pd.to_numeric(others, errors="coerce").reindex(text.index)
    if not len(words) or (numbers.isna() & text.notna()).sum() > len(words) or numbers.isna().all():
        return cells, {}
    return numbers.astype(float), words.value_counts().to_dict()


def _describe_uneven(error: Exception, layout: Layout) -> str:
    """Describe the error of pandas for the first row that has more cells than the header."""
    cells = f"the header {len(layout.header)}"
    if match := re.search(r"in line (\d+), saw (\d+)", str(error)):
        return f"row {match[1]} has {match[2]} cells, {cells}"
    if match := re.search(r"EOF inside string starting at row (\d+)", str(error)):
        return f"row {int(match[1]) + 1}: a quotation mark is not closed"
    return f"row {layout.line} has more cells than {cells}"
