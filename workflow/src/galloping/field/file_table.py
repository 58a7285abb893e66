"""Columns of numbers from the files of instruments: text, Excel, Parquet, HDF5, NetCDF, MATLAB."""

import io
import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from numbers import Number
from pathlib import Path

import numpy as np
import pandas as pd

from galloping.field.columns import DATED
from galloping.field.text import DECIMAL_COMMA, SAY_DECIMAL, TextError, read_text
from galloping.field.units import named

LARGEST = 2 * 1024**3  # bytes: a table of that size fits into the memory of a small machine


class FileError(ValueError):
    """A file that cannot be used as it is; the message is one line that begins with its name."""


@dataclass(frozen=True)
class FileTable:
    """Columns of one file.

    columns: (n,) arrays by name: of floats, or of text (times in ISO 8601). units: by column, where
    the file says them. first_row: number of the first row of data, as an editor counts lines.
    notes: one line for each thing that was passed over.
    """

    path: Path
    columns: dict[str, np.ndarray]
    units: dict[str, str]
    first_row: int
    notes: tuple[str, ...] = ()
    unclear: frozenset[str] = frozenset()

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

    def is_numeric(self, name: str) -> bool:
        """Whether a column is one of numbers."""
        values = self.column(name)
        if values.dtype.kind in "OUT":
            return bool(pd.to_numeric(pd.Series(values[:1]), errors="coerce").notna().all())
        return values.dtype.kind in "fiu"

    def dated(self, name: str) -> bool:
        """Whether a column is one of dates, or of times of a day."""
        values = self.column(name)
        if values.dtype.kind in "OUT":
            return DATED.match(str(next(iter(values), ""))) is not None
        return values.dtype.kind in "mM"

    def numbers(self, name: str) -> np.ndarray:
        """A column as floats, NaN where it is empty. Raises FileError at the first text."""
        values = self.column(name)
        if values.dtype.kind in "fiub":
            numbers = values.astype(float)
        else:
            numbers = pd.to_numeric(pd.Series(values), errors="coerce").to_numpy(float)
            text = np.flatnonzero(np.isnan(numbers) & ~pd.isna(values))
            if len(text):
                raise self.fault(text[0], name, "is not a number")
        huge = np.flatnonzero(np.abs(numbers) > 1e100)  # infinities, too
        if len(huge):
            raise self.fault(huge[0], name, "is no measurement")
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
    if not path.exists():
        raise FileError(f"{path}: no such file")
    if not path.is_file():
        raise FileError(f"{path}: not a file")
    if suffix not in (*TEXT, SHEET, *READERS):
        raise FileError(
            f"{path}: files {suffix or 'without a suffix'} are not read; save or export it as CSV, "
            f"or as one of {', '.join((*TEXT[1:], SHEET, *READERS))}"
        )
    size = path.stat().st_size
    if size == 0:
        raise FileError(f"{path}: the file is empty")
    if size > LARGEST:
        raise FileError(
            f"{path}: {size / 1e9:.1f} GB are more than {LARGEST / 1e9:.1f} GB; cut it in pieces"
        )
    try:
        if suffix in TEXT:
            table = _table(path, *read_text(partial(path.open, "rb"), decimal, time, rows))
        elif suffix == SHEET:
            text, notes = _sheet(path)
            content, first, more = read_text(lambda: io.BytesIO(text), ".", time, rows)
            table = _table(path, content, first, (*notes, *more))
        else:
            table = _read_arrays(path, READERS[suffix])
    except FileError:
        raise
    except TextError as error:
        raise FileError(f"{path}: {error}") from error
    except Exception as error:  # libraries raise many kinds where a file is damaged
        kind = "text table" if suffix in TEXT else f"{suffix[1:]} file"
        raise FileError(f"{path}: cannot be read: damaged, cut off, or no {kind}") from error
    if max(map(len, table.columns.values())) == 0:
        raise FileError(f"{path}: no rows of data")
    described = _described_units(path)
    for name in sorted(table.units.keys() & described.keys()):
        if table.units[name] != described[name]:
            raise FileError(
                f"{path}: column {name!r} is in {table.units[name]} by the file and in "
                f"{described[name]} by datapackage.json; must be the same"
            )
    table.units.update(described)
    return table


def _table(path: Path, content: list, first_row: int, notes: tuple[str, ...] = ()) -> FileTable:
    """content: header, values and unit, or None, of each column."""
    columns, units, unclear = {}, {}, set()
    for header, values, unit in content:
        name, own = named(header)
        if name in columns:
            same = pd.Series(values).equals(pd.Series(columns[name]))
            unclear |= set() if same else {name}
            notes += (f"column {name!r} is there twice, with the same samples",) if same else ()
            continue
        columns[name] = values
        if unit or own:
            units[name] = unit or own
    return FileTable(path, columns, units, first_row, notes, frozenset(unclear))


def _sheet(path: Path) -> tuple[bytes, tuple[str, ...]]:
    """The first sheet of an Excel file that holds a table, as CSV, and what was passed over."""
    try:
        import openpyxl
    except ImportError:
        raise FileError(
            f"{path}: Excel files are read with openpyxl: pip install openpyxl, or save it as CSV"
        ) from None
    book = openpyxl.load_workbook(path, read_only=True, data_only=True)
    sheets = {sheet.title: list(sheet.iter_rows(values_only=True)) for sheet in book.worksheets}
    name = max(sheets, key=lambda title: len(sheets[title]), default="")
    if not sheets or len(sheets[name]) < 2:
        raise FileError(f"{path}: no sheet holds a table")
    frame = pd.DataFrame(sheets[name], dtype=object).map(
        lambda cell: cell.isoformat() if hasattr(cell, "isoformat") else cell
    )
    notes = (f"of {len(sheets)} sheets the longest, {name!r}, was read",)
    return frame.to_csv(index=False, header=False).encode(), notes if len(sheets) > 1 else ()


def _read_arrays(path: Path, reader: Callable[[Path], Iterator[tuple]]) -> FileTable:
    """The vectors of a file; `reader` yields name, array and unit, or None, of what it holds."""
    content, others = [], []
    for name, array, unit in reader(path):
        vector = sum(n != 1 for n in array.shape) <= 1 and array.dtype.kind in "fiubMmUO"
        values = np.ravel(array[()]) if vector else array
        if vector and all(isinstance(x, str | Number | None) for x in values[:1].tolist()):
            content.append((name, values, unit))
        else:
            others.append(f"{name} ({' x '.join(map(str, array.shape))})")
    if not content:
        raise FileError(
            f"{path}: no column; each must be a vector of its own, and the file holds "
            f"{', '.join(others) or 'nothing'}"
        )
    return _table(path, content, 1)


def _parquet_items(path: Path) -> Iterator[tuple]:
    from pyarrow import parquet

    table = parquet.read_table(path)
    for field, column in zip(table.schema, table.columns, strict=True):
        unit = (field.metadata or {}).get(b"unit")
        yield field.name, column.to_numpy(), unit and unit.decode()


def _hdf5_items(path: Path) -> Iterator[tuple]:
    """Data sets, anywhere in an HDF5 or NetCDF-4 file, by their path in it."""
    import h5py

    with h5py.File(path, "r") as file:
        found = []
        file.visititems(lambda name, item: found.append((name, item)))
        for name, item in found:
            if isinstance(item, h5py.Dataset):
                unit = np.ravel(item.attrs.get("units", item.attrs.get("unit", "")))[0]
                unit = unit.decode() if isinstance(unit, bytes) else str(unit)
                text = h5py.check_string_dtype(item.dtype) and item.ndim == 1
                yield name, item.asstr()[()] if text else item, unit


def _netcdf_items(path: Path) -> Iterator[tuple]:
    with path.open("rb") as file:
        classic = file.read(3) == b"CDF"
    if not classic:
        yield from _hdf5_items(path)
        return
    from scipy.io import netcdf_file

    with netcdf_file(path, "r", mmap=False) as file:
        for name, variable in file.variables.items():
            own = variable.data.astype(variable.data.dtype.newbyteorder("="))  # as pandas wants it
            yield name, own, getattr(variable, "units", b"").decode() or None


def _matlab_items(path: Path) -> Iterator[tuple]:
    with path.open("rb") as file:
        hdf5 = b"MATLAB 7.3" in file.read(128)
    if hdf5:
        yield from _hdf5_items(path)
        return
    from scipy.io import loadmat

    for name, value in loadmat(path).items():
        if not name.startswith("__"):
            yield name, np.asarray(value), None


TEXT, SHEET = (".csv", ".txt", ".tsv", ".dat", ".asc"), ".xlsx"
READERS = {
    ".parquet": _parquet_items,
    ".h5": _hdf5_items,
    ".hdf5": _hdf5_items,
    ".nc": _netcdf_items,
    ".mat": _matlab_items,
}


def _described_units(path: Path) -> dict[str, str]:
    """Units of a file's fields in the `datapackage.json` beside it."""
    description = path.with_name("datapackage.json")
    if not description.is_file():
        return {}
    try:
        resources = json.loads(description.read_text(encoding="utf-8"))["resources"]
        return {
            field["name"]: field["unit"]
            for resource in resources
            if resource.get("path") == path.name
            for field in resource.get("schema", {}).get("fields", [])
            if "unit" in field
        }
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise FileError(f"{description}: not a data package: {error}") from error
