"""Columns of numbers from files of instruments: text, Excel, Parquet, HDF5, NetCDF, MATLAB."""

import io
import json
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from numbers import Number
from pathlib import Path

import numpy as np
import pandas as pd

from galloping.readers import FileError
from galloping.readers.array_files import READERS, arrays_in
from galloping.readers.columns import DATED
from galloping.readers.text_table import DECIMAL_COMMA, SAY_DECIMAL, read_text
from galloping.readers.units import named

TEXT, SHEET = (".csv", ".txt", ".tsv", ".dat", ".asc"), ".xlsx"  # of files that are read
LARGEST = 2 * 1024**3  # bytes: a table of that size fits into the memory of a small machine


@dataclass(frozen=True)
class FileTable:
    """Columns of one file.

    columns: (n,) arrays of floats or text by name. units: by column, where the file says them.
    first_row: number of the first row of data, as an editor counts lines. notes: one line for each
    thing that was passed over. unclear: names that two columns have.
    """

    path: Path
    columns: dict[str, np.ndarray]
    units: dict[str, str]
    first_row: int
    notes: tuple[str, ...] = ()
    unclear: frozenset[str] = frozenset()

    def at(self, name: str) -> str:
        """Where a fault of a column is."""
        return f"{self.path}: column {name!r}"

    def column(self, name: str) -> np.ndarray:
        """A column by its name, with or without the unit behind it. Raises FileError."""
        bare, _ = named(name)
        if bare not in self.columns:
            raise FileError(
                f"{self.path}: no column {bare!r}; it has {', '.join(map(repr, self.columns))}"
            )
        if bare in self.unclear:
            raise FileError(f"{self.path}: two columns are named {bare!r}, with other samples")
        return self.columns[bare]

    def unit(self, name: str) -> str:
        """The unit that the file states for a column, or ''."""
        return self.units.get(named(name)[0], "")

    def kind(self, name: str) -> str:
        """What a column holds, by its first cell: `number`, `date` (or a time of a day), `text`."""
        values = self.column(name)
        if values.dtype.kind not in "OUT":
            return "date" if values.dtype.kind in "mM" else "number"
        first = str(next(iter(values), ""))
        if DATED.match(first):
            return "date"
        return "text" if np.isnan(pd.to_numeric(first, errors="coerce")) else "number"

    def numbers(self, name: str) -> np.ndarray:
        """A column as floats, NaN where it is empty. Raises FileError at the first text."""
        values = self.column(name)
        if values.dtype.kind in "fiub":
            numbers = values.astype(float)
        else:
            numbers = pd.to_numeric(pd.Series(values), errors="coerce").to_numpy(float)
            for row in np.flatnonzero(np.isnan(numbers) & ~pd.isna(values)):
                raise self.fault(row, name, "is not a number")
        for row in np.flatnonzero(np.abs(numbers) > 1e100):  # infinities, too
            raise self.fault(row, name, "is no measurement")
        return numbers

    def fault(self, row: int, name: str, what: str) -> FileError:
        """The error that a cell of a column is; row: its index."""
        cell = self.column(name)[row]
        value = repr(cell if isinstance(cell, str) else float(cell))[:60]
        hint = f"; {SAY_DECIMAL}" if DECIMAL_COMMA.fullmatch(str(cell)) else ""
        return FileError(
            f"{self.path}: row {row + self.first_row}, column {name!r}: {value} {what}{hint}"
        )


def read_table(
    path: str | Path, decimal: str | None = None, time: str | None = None, rows: int | None = None
) -> FileTable:
    """The columns of a file, by its suffix: .csv .txt .tsv .dat .xlsx .parquet .h5 .hdf5 .nc .mat.

    decimal: the decimal mark of text tables. time: the column of times, which tells their header
    from lines above it. Where these are None, the rows tell. rows: of text, so many at most. The
    `unit` of fields in a `datapackage.json` beside a file (Frictionless Data) counts as the file's
    own. Raises FileError.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    try:
        _check_file(path, suffix)
        if suffix in TEXT:
            table = _table(path, *read_text(partial(path.open, "rb"), decimal, time, rows))
        elif suffix == SHEET:
            text, notes = _sheet(path, decimal)
            content, first, more = read_text(lambda: io.BytesIO(text), ".", time, rows)
            table = _table(path, content, first, (*notes, *more))
        else:
            content, notes = _read_arrays(path, suffix)
            table = _table(path, content, 1, notes)
        if max(map(len, table.columns.values())) == 0:
            raise FileError("no rows of data")
        table.units.update(_described_units(path, table.units))
    except FileError as error:
        raise FileError(f"{path}: {error}") from error
    except PermissionError:
        raise
    except Exception as error:  # libraries raise many kinds where a file is damaged
        kind = "text table" if suffix in TEXT else f"{suffix[1:]} file"
        raise FileError(f"{path}: cannot be read: damaged, cut off, or no {kind}") from error
    return table


def _check_file(path: Path, suffix: str) -> None:
    if not path.is_file():
        raise FileError("not a file" if path.exists() else "no such file")
    if suffix not in (*TEXT, SHEET, *READERS):
        raise FileError(
            f"files {suffix or 'without a suffix'} are not read; save or export it as CSV, or as "
            f"one of {', '.join((*TEXT[1:], SHEET, *READERS))}"
        )
    size = path.stat().st_size
    if size == 0:
        raise FileError("the file is empty")
    if size > LARGEST:
        raise FileError(
            f"{size / 1e9:.1f} GB are more than {LARGEST / 1e9:.1f} GB; cut it in pieces"
        )


def _table(path: Path, content: list, first_row: int, notes: tuple[str, ...] = ()) -> FileTable:
    """content: header, values and unit, or None, of each column."""
    columns, units, unclear = {}, {}, set()
    for header, values, unit in content:
        name, own = named(header)
        if name in columns:
            if pd.Series(values).equals(pd.Series(columns[name])):
                notes += (f"column {name!r} is there twice, with the same samples",)
            else:
                unclear.add(name)
            continue
        columns[name] = values
        if unit or own:
            units[name] = unit or own
    return FileTable(path, columns, units, first_row, notes, frozenset(unclear))


def _sheet(path: Path, decimal: str | None) -> tuple[bytes, tuple[str, ...]]:
    """The longest sheet of an Excel file as CSV, and what was passed over. decimal: of texts."""

    def written(cell: object) -> object:
        if decimal == "," and isinstance(cell, str) and DECIMAL_COMMA.fullmatch(cell):
            return cell.replace(",", ".")
        return cell.isoformat() if hasattr(cell, "isoformat") else cell

    try:
        with warnings.catch_warnings(action="ignore"):  # of openpyxl, on styles and the like
            sheets = pd.read_excel(path, sheet_name=None, header=None, dtype=object)
    except ImportError:
        raise FileError(
            "Excel files need openpyxl: pip install openpyxl, or save it as CSV"
        ) from None
    name = max(sheets, key=lambda title: len(sheets[title]))
    frame = sheets[name].map(written)
    notes = (f"of {len(sheets)} sheets the longest, {name!r}, was read",)
    return frame.to_csv(index=False, header=False).encode(), notes if len(sheets) > 1 else ()


def _read_arrays(path: Path, suffix: str) -> tuple[list[tuple], tuple[str, ...]]:
    """Name, values and unit, or None, of the vectors in a file of arrays; what was passed over."""
    content, others = [], []
    for name, array, unit in arrays_in(path, suffix):
        vector = sum(n != 1 for n in array.shape) <= 1 and array.dtype.kind in "fiubMmUO"
        values = np.ravel(array[()]) if vector else array
        if values.dtype.kind == "O" and hasattr(next(iter(values), None), "isoformat"):
            values = np.array([str(time) for time in values], object)  # of a day
        if vector and all(isinstance(x, str | Number | None) for x in values[:1].tolist()):
            content.append((name, values, unit))
        else:
            others.append(f"{name} ({' x '.join(map(str, array.shape))})")
    if not content:
        raise FileError(
            "no column; each must be a vector of its own, and the file holds "
            f"{', '.join(others) or 'nothing'}"
        )
    notes = (f"no columns of numbers or text, left out: {', '.join(others)}",) if others else ()
    return content, notes


def _described_units(path: Path, own: Mapping[str, str]) -> dict[str, str]:
    """Units of columns in the `datapackage.json` beside a file; own: those in the file itself."""
    description = path.with_name("datapackage.json")
    if not description.is_file():
        return {}
    try:
        resources = json.loads(description.read_text(encoding="utf-8"))["resources"]
        found = {
            field["name"]: str(field["unit"])
            for of in resources
            if of.get("path") == path.name
            for field in of.get("schema", {}).get("fields", [])
            if "unit" in field
        }
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise FileError(f"{description}: not a data package: {error}") from error
    if differ := [name for name, unit in found.items() if own.get(name, unit) != unit]:
        raise FileError(f"column {differ[0]!r} has another unit in {description.name}")
    return found
