"""Columns of numbers from instrument files: text, Excel, Parquet, HDF5, NetCDF, MATLAB."""

import csv
import io
import json
import warnings
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from decimal import Decimal
from math import prod
from numbers import Number, Real
from pathlib import Path
from typing import TypeVar
from zipfile import ZipFile

import numpy as np
import pandas as pd

from galloping.fields import list_first
from galloping.readers import MAX_LISTED_NAMES, FileError
from galloping.readers.array_files import ARRAY_READERS, arrays_in, check_size
from galloping.readers.columns import DATE_PATTERN
from galloping.readers.layout import DECIMAL_COMMA, DECIMAL_HINT, MINUS, THOUSANDS_COMMA
from galloping.readers.text_table import read_text
from galloping.readers.units import EMPTY_MAPPING, UnitError, is_scaled, split_header

Converted = TypeVar("Converted")
TEXT_SUFFIXES, SHEET_SUFFIX = (".csv", ".txt", ".tsv", ".dat", ".asc", ".lvm"), ".xlsx"
MAX_CELLS = 50_000_000  # cells of an Excel sheet
MAX_CHARACTERS = 100_000_000  # characters of a column
MAX_NAME_LENGTH = 60  # characters of a name in a message


@dataclass(frozen=True)
class FileTable:
    """Columns of numbers or text that were read from one file, with their units.

    columns: (n,) arrays of floats or text by name. units: by column, if the file has them.
    first_row: number of the first row of data, as an editor counts lines. notes: one line for each
    ignored part. unclear: names that two columns have. scalars: single numbers besides the columns,
    by name, as in a workspace of MATLAB. others: shapes of arrays that are no columns, by name,
    such as `2 x 500`.
    """

    path: Path
    columns: dict[str, np.ndarray]
    units: dict[str, str]
    first_row: int
    notes: tuple[str, ...] = ()
    unclear: frozenset[str] = frozenset()
    scalars: Mapping[str, float] = field(default_factory=dict)
    others: Mapping[str, str] = field(default_factory=dict)

    @property
    def is_headless(self) -> bool:
        """Whether the file has no row of names, so that columns are named by numbers."""
        return list(self.columns) == [str(k + 1) for k in range(len(self.columns))]

    def label(self, name: str) -> str:
        """Format the file and column name, with which an error message begins."""
        return f"{self.path}: column {name!r}"

    @property
    def content(self) -> str:
        """Text that lists the file's columns with their units, and its other contents."""
        columns = [
            f"{name!r:.{MAX_NAME_LENGTH}}"
            + f" [{self.unit(name):.{MAX_NAME_LENGTH}}]" * bool(self.unit(name))
            for name in self.columns
        ]
        others = _list_shapes(self.others)
        others += [f"{name:.{MAX_NAME_LENGTH}} = {value:g}" for name, value in self.scalars.items()]
        text = list_first(columns, MAX_LISTED_NAMES)
        if others:
            text += (
                f"; each must be a vector of its own, unlike {list_first(others, MAX_LISTED_NAMES)}"
            )
        return text

    def column(self, name: str) -> np.ndarray:
        """Return a column by its name; raise FileError if it is missing or ambiguous.

        The name may have the unit behind it.
        """
        bare, _ = split_header(name)
        if bare not in self.columns:
            raise FileError(
                f"{self.path}: no column {bare!r:.{MAX_NAME_LENGTH}}; it has {self.content}"
            )
        if bare in self.unclear:
            raise FileError(
                f"{self.path}: two columns are named {bare!r}, with other samples; give each a "
                "name of its own"
            )
        return self.columns[bare]

    def unit(self, name: str) -> str:
        """Return the unit that the file states for a column, or '' if it states none."""
        return self.units.get(split_header(name)[0], "")

    def convert(
        self, name: str, specified: str | None, convert: Callable[[str], Converted]
    ) -> Converted:
        """Apply a function, such as a conversion to SI, to the unit of a column.

        The unit is the specified one, or else that of the file. If both are given, they must agree,
        unless the specified one is `1`, which leaves numbers unchanged, or the text in the file is
        no unit, such as `counts`. Raises FileError.
        """
        file_unit = self.unit(name).split(" since ")[0]
        try:
            if not specified and is_scaled(file_unit):  # `50 mm` may be the range of a sensor
                raise UnitError(
                    f"unit {file_unit!r:.60} is a number of units; say what one count is"
                )
            converted = convert(specified or file_unit)
        except UnitError as error:
            raise FileError(f"{self.label(name)}: {error}") from error
        with suppress(UnitError):
            if specified not in (None, "1") and file_unit and convert(file_unit) != converted:
                raise FileError(
                    f"{self.label(name)} is in {file_unit} by the file and in {specified} by the "
                    "mapping; must be the same"
                )
        return converted

    def kind(self, name: str) -> str:
        """Return the kind of a column's first cell: `number`, `date` or `text`."""
        values = self.column(name)
        if values.dtype.kind not in "OUT":
            return "date" if values.dtype.kind in "mM" else "number"
        first = str(next(iter(values), ""))
        if DATE_PATTERN.match(first):
            return "date"
        return "text" if np.isnan(pd.to_numeric(first, errors="coerce")) else "number"

    def numbers(self, name: str) -> np.ndarray:
        """Convert a column to floats, with NaN for empty cells; raise FileError for text."""
        values = self.column(name)
        if values.dtype.kind in "fiub":
            numbers = values.astype(float)
        else:
            numbers = pd.to_numeric(pd.Series(values), errors="coerce").to_numpy(float)
            for row in np.flatnonzero(np.isnan(numbers) & ~pd.isna(values)):
                raise self.cell_error(int(row), name, "is not a number")
        for row in np.flatnonzero(np.abs(numbers) > 1e100):  # infinities, too
            raise self.cell_error(int(row), name, "is no measurement")
        return numbers

    def cell_error(self, row: int, name: str, what: str) -> FileError:
        """Make the FileError for a faulty cell, whose message names file, row and column.

        row: index of the cell. what: the fault.
        """
        cell = self.column(name)[row]
        value = repr(str(cell) if isinstance(cell, str) else float(cell))[:60]
        hint = f"; {DECIMAL_HINT}" if DECIMAL_COMMA.fullmatch(str(cell)) else ""
        if THOUSANDS_COMMA.fullmatch(str(cell)):
            hint += ", without the comma if it separates thousands"
        if split_header(str(cell))[0] == name:
            hint = "; where names are repeated, cut the file into two"
        return FileError(
            f"{self.path}: row {row + self.first_row}, column {name!r}: {value} {what}{hint}"
        )


def read_table(
    path: str | Path, decimal: str | None = None, time: str | None = None, rows: int | None = None
) -> FileTable:
    """Read the columns of a text, Excel, Parquet, HDF5, NetCDF or MATLAB file.

    The suffix of the file gives its format: .csv .txt .tsv .dat .asc .lvm .xlsx .parquet .h5 .hdf5
    .nc .mat. decimal: the decimal mark of text tables. time: the column of times, by which
    their header differs from lines above it. If these are None, the rows determine them. rows:
    largest number of rows of a text table to read, None for all. The `unit` of fields in a
    `datapackage.json` beside a file (Frictionless Data) counts as the file's own. Raises FileError.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    try:
        _check_file(path, suffix)
        if suffix in TEXT_SUFFIXES:
            table = _make_table(path, *read_text(lambda: path.open("rb"), decimal, time, rows))
        elif suffix == SHEET_SUFFIX:
            text, notes = _read_sheet(path, decimal)
            content, first, more = read_text(lambda: io.BytesIO(text), ".", time, rows)
            table = _make_table(path, content, first, (*notes, *more))
        else:
            table = _read_arrays(path, suffix)
        if max(map(len, table.columns.values())) == 0:
            raise FileError("no rows of data")
        table.units.update(_read_described_units(path, table.units))
    except FileError as error:
        raise FileError(f"{path}: {error}") from error
    except PermissionError:
        raise
    except Exception as error:  # libraries raise many kinds where a file is damaged
        kind = "text table" if suffix in TEXT_SUFFIXES else f"{suffix[1:]} file"
        raise FileError(f"{path}: cannot be read: damaged, cut off, or no {kind}") from error
    return table


def _check_file(path: Path, suffix: str) -> None:
    if not path.is_file():
        raise FileError("not a file" if path.exists() else "no such file")
    if suffix not in (*TEXT_SUFFIXES, SHEET_SUFFIX, *ARRAY_READERS):
        raise FileError(
            f"files {suffix or 'without a suffix'} are not read; save or export it as CSV, or as "
            f"one of {', '.join((*TEXT_SUFFIXES[1:], SHEET_SUFFIX, *ARRAY_READERS))}"
        )
    size = path.stat().st_size
    if size == 0:
        raise FileError("the file is empty")
    check_size(size)


def _make_table(
    path: Path,
    content: list[tuple],
    first_row: int,
    notes: tuple[str, ...] = (),
    scalars: Mapping[str, float] = EMPTY_MAPPING,
    others: Mapping[str, str] = EMPTY_MAPPING,
) -> FileTable:
    """Assemble a table. content: header, values and unit, or None, of each column."""
    columns: dict[str, np.ndarray] = {}
    units: dict[str, str] = {}
    unclear: set[str] = set()
    for header, values, unit in content:
        name, unit_in_header = split_header(printable(header))
        if name in columns:
            if pd.Series(values).equals(pd.Series(columns[name])):
                notes += (f"column {name!r} is there twice, with the same samples",)
            else:
                unclear.add(name)
            continue
        columns[name] = values
        if unit or unit_in_header:
            units[name] = printable(unit or unit_in_header)
    notes = tuple(map(printable, notes))
    return FileTable(path, columns, units, first_row, notes, frozenset(unclear), scalars, others)


def printable(text: str) -> str:
    """Replace unprintable characters and runs of white space in a text by single blanks.

    A line break in a name would start new lines in messages and summaries, and an escape sequence
    would control the terminal.
    """
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())


def _read_sheet(path: Path, decimal: str | None) -> tuple[bytes, tuple[str, ...]]:
    """Read the longest sheet of an Excel file as CSV, with notes on ignored parts.

    decimal: of texts.
    """

    def as_text(cell: object) -> object:
        if isinstance(cell, str):
            cell = printable(cell)
            number = cell.replace(MINUS, "-")
            if decimal == "," and DECIMAL_COMMA.fullmatch(number):
                return number.replace(",", ".")
        return cell.isoformat() if hasattr(cell, "isoformat") else cell

    try:
        from openpyxl import load_workbook
    except ImportError:
        raise FileError(
            "Excel files need openpyxl: pip install openpyxl, or save it as CSV"
        ) from None
    with ZipFile(path) as parts:
        check_size(sum(part.file_size for part in parts.infolist()), "arrays")
    with warnings.catch_warnings(action="ignore"):  # of openpyxl, on styles and the like
        book = load_workbook(path, read_only=True, data_only=True)
        sheets = {sheet.title: _read_rows(sheet) for sheet in book.worksheets}
    book.close()
    name = max(sheets, key=lambda title: len(sheets[title]))
    text = io.StringIO()
    csv.writer(text).writerows([[as_text(cell) for cell in row] for row in sheets[name]])
    notes = (f"of {len(sheets)} sheets the longest (of equal ones the first), {name!r}, was read",)
    return text.getvalue().encode(), notes if len(sheets) > 1 else ()


def _read_rows(sheet) -> list[tuple]:
    """Read the rows of a sheet, without empty ones at the end; FileError for too many cells."""
    rows, count = [], 0
    for row in sheet.iter_rows(values_only=True):
        count += len(row)
        if count > MAX_CELLS:
            raise FileError(f"sheet {sheet.title!r} has more than {MAX_CELLS} cells")
        rows.append(row)
    while rows and all(cell is None for cell in rows[-1]):
        rows.pop()
    return rows


def _read_arrays(path: Path, suffix: str) -> FileTable:
    vectors, others, scalars, loaded = [], {}, {}, 0
    for one in arrays_in(path, suffix):
        if one.is_vector:
            loaded += 8 * prod(one.shape)
            check_size(loaded, "arrays")
            values = np.ravel(one.load())
            if values.dtype.kind == "O" and hasattr(next(iter(values), None), "isoformat"):
                values = np.array([str(time) for time in values], object)  # of a day
            if _is_plain(values):
                vectors.append((one.name, values, one.unit))
                continue
        is_complex = one.kind == "c"
        others[printable(one.name)] = " x ".join(map(str, one.shape)) + ", complex" * is_complex
    if max((len(values) for _, values, _ in vectors), default=0) > 1:
        single = {name: values[0] for name, values, _ in vectors if len(values) == 1}
        vectors = [each for each in vectors if len(each[1]) > 1]
        scalars = {
            printable(n): float(x) for n, x in single.items() if isinstance(x, Real | Decimal)
        }
    contents = list_first(_list_shapes(others), MAX_LISTED_NAMES)
    if not vectors:
        more = "; save the fields of a structure by save -struct" if suffix == ".mat" else ""
        raise FileError(
            "no column; each must be a vector of its own, and the file holds "
            f"{contents or 'nothing'}{more}"
        )
    notes = (f"no columns of numbers or text, left out: {contents}",) if contents else ()
    return _make_table(path, vectors, 1, notes, scalars, others)


def _list_shapes(arrays: Mapping[str, str]) -> list[str]:
    return [f"{name:.{MAX_NAME_LENGTH}} ({shape})" for name, shape in arrays.items()]


def _is_plain(values: np.ndarray) -> bool:
    """Decide whether a vector begins with a number or a text, and has no excessively long texts."""
    length = sum(len(x) for x in values if isinstance(x, str)) if values.dtype.kind == "O" else 0
    is_plain = all(isinstance(x, str | Number | None) for x in values[:1].tolist())
    return is_plain and length <= MAX_CHARACTERS


def _read_described_units(path: Path, own: Mapping[str, str]) -> dict[str, str]:
    """Read units of columns from a `datapackage.json` beside a file; own: those in the file."""
    description = path.with_name("datapackage.json")
    if not description.is_file():
        return {}
    try:
        resources = json.loads(description.read_text(encoding="utf-8"))["resources"]
        units = {
            field["name"]: str(field["unit"])
            for resource in resources
            if resource.get("path") == path.name
            for field in resource.get("schema", {}).get("fields", [])
            if "unit" in field
        }
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise FileError(f"{description}: not a data package: {error}") from error
    for name, unit in units.items():
        if own.get(name, unit) != unit:
            raise FileError(f"column {name!r} has another unit in {description.name}")
    return units
