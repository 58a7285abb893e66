"""Columns of numbers from the files of instruments: text, Parquet, HDF5, NetCDF, MATLAB."""

from __future__ import annotations

import csv
import json
import warnings
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

LARGEST = 2 * 1024**3  # bytes: a table of that size fits into the memory of a small machine
BINARY = {  # first bytes of what is no table, whatever its name
    b"PK\x03\x04": "a zip archive",
    b"\x1f\x8b": "a gzip archive",
    b"\x80": "a pickle, which is never loaded",
    b"\x7fELF": "a program",
    b"%PDF": "a PDF document",
}


class FileError(ValueError):
    """A file that cannot be used as it is; the message is one line that begins with its name."""


@dataclass(frozen=True)
class FileTable:
    """Columns of one file.

    columns: (n,) arrays by name: of floats, or of text (times in ISO 8601). units: by column, where
    the file says them. first_row: number of the first row of data, as an editor counts lines.
    """

    path: Path
    columns: dict[str, np.ndarray]
    units: dict[str, str]
    first_row: int

    def column(self, name: str) -> np.ndarray:
        """A column by name. Raises FileError where the file does not have it."""
        if name not in self.columns:
            raise FileError(
                f"{self.path}: no column {name!r}; it has {', '.join(map(repr, self.columns))}"
            )
        return self.columns[name]

    def numbers(self, name: str) -> np.ndarray:
        """A column as floats, NaN where it is empty. Raises FileError at the first text."""
        values = self.column(name)
        if values.dtype.kind in "fiub":
            numbers = values.astype(float)
        else:
            numbers = pd.to_numeric(pd.Series(values), errors="coerce").to_numpy(float)
            text = np.flatnonzero(np.isnan(numbers) & ~pd.isna(values))
            if len(text):
                raise FileError(self._at(text[0], name, values[text[0]], "is not a number"))
        huge = np.flatnonzero(np.abs(numbers) > 1e100)  # infinities, too
        if len(huge):
            raise FileError(self._at(huge[0], name, float(numbers[huge[0]]), "is no measurement"))
        return numbers

    def _at(self, row: int, name: str, value: object, what: str) -> str:
        hint = ""
        if isinstance(value, str) and value.replace(",", "", 1).strip("+-").isdigit():
            hint = "; with a decimal comma say --decimal , (decimal: ',' in a mapping)"
        return (
            f"{self.path}: row {row + self.first_row}, column {name!r}: {value!r:.60} {what}{hint}"
        )


def read_table(path: str | Path, decimal: str = ".") -> FileTable:
    """The columns of a file, by its suffix: .csv .txt .tsv .dat .parquet .h5 .hdf5 .nc .mat.

    decimal: the decimal mark of text tables. The `unit` of fields in a `datapackage.json` beside a
    file (Frictionless Data) counts as the file's own. Raises FileError.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in READERS:
        raise FileError(f"{path}: suffix {suffix!r} is not one of {', '.join(READERS)}")
    if not path.exists():
        raise FileError(f"{path}: no such file")
    if not path.is_file():
        raise FileError(f"{path}: not a file")
    size = path.stat().st_size
    if size == 0:
        raise FileError(f"{path}: the file is empty")
    if size > LARGEST:
        raise FileError(
            f"{path}: {size / 1e9:.1f} GB are more than {LARGEST / 1e9:.1f} GB; cut it in pieces"
        )
    try:
        table = READERS[suffix](path, decimal)
    except FileError:
        raise
    except (ValueError, OSError, KeyError, TypeError, NotImplementedError) as error:
        raise FileError(f"{path}: cannot be read: {str(error).splitlines()[0]}") from error
    lengths = {len(column) for column in table.columns.values()}
    if not table.columns or max(lengths) == 0:
        raise FileError(f"{path}: no rows of data")
    return FileTable(
        path, table.columns, {**table.units, **_described_units(path)}, table.first_row
    )


def _read_text(path: Path, decimal: str) -> FileTable:
    size = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(65536)
    for magic, kind in BINARY.items():
        if head.startswith(magic):
            raise FileError(f"{path}: this is {kind}, not a text table")
    if b"\0" in head:
        raise FileError(f"{path}: not a text table in UTF-8 (it holds zero bytes)")
    try:
        lines = head.decode("utf-8-sig").splitlines()
    except UnicodeDecodeError as error:
        whole = size <= len(head) or error.start < len(head) - 4
        if whole:  # else a character that the end of the head cuts
            raise FileError(
                f"{path}: byte {error.start} is not UTF-8; save the file as UTF-8"
            ) from error
        lines = head[: error.start].decode("utf-8-sig").splitlines()
    comments = 0
    while comments < len(lines) and (not lines[comments].strip() or lines[comments][0] == "#"):
        comments += 1
    if comments == len(lines):
        raise FileError(f"{path}: no header")
    separator = _separator(lines[comments])
    header = next(csv.reader([lines[comments]], delimiter=separator or " ", skipinitialspace=True))
    header = [name.strip() for name in header]
    if all(_is_number(name, decimal) for name in header):
        raise FileError(f"{path}: the first row must name the columns; it is {header[0]}, ...")
    units = {_bare(name): unit for name in header if (unit := _unit_in_name(name))}
    header = [_bare(name) for name in header]
    repeated = [name for name, count in Counter(header).items() if count > 1]
    if repeated:
        raise FileError(f"{path}: two columns are named {repeated[0]!r}")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", pd.errors.ParserWarning)
            frame = pd.read_csv(
                path, sep=separator or r"\s+", decimal=decimal, skiprows=comments + 1, names=header,
                index_col=False, encoding="utf-8-sig", skipinitialspace=True, low_memory=False,
            )  # fmt: skip
    except pd.errors.ParserWarning as error:
        raise FileError(
            f"{path}: rows have more cells than the {len(header)} columns of the header; decimal "
            "commas need another separator between columns"
        ) from error
    except UnicodeDecodeError as error:
        byte = error.object[error.start]
        raise FileError(f"{path}: byte {byte:#x} is not UTF-8; save the file as UTF-8") from error
    return FileTable(path, {n: frame[n].to_numpy() for n in header}, units, comments + 2)


def _separator(line: str) -> str | None:
    """The separator of a header, None for white space."""
    counts = {mark: line.count(mark) for mark in ",;\t"}
    best = max(counts, key=counts.get)
    return best if counts[best] else None


def _is_number(text: str, decimal: str) -> bool:
    try:
        float(text.replace(decimal, "."))
    except ValueError:
        return False
    return True


def _unit_in_name(name: str) -> str | None:
    """`mm` of a column that is named `v [mm]`."""
    head, bracket, rest = name.partition("[")
    return rest.removesuffix("]").strip() if bracket and head and rest.endswith("]") else None


def _bare(name: str) -> str:
    """`v` of a column that is named `v [mm]`."""
    return name.partition("[")[0].strip() if _unit_in_name(name) else name


def _read_parquet(path: Path, _: str) -> FileTable:
    from pyarrow import parquet

    table = parquet.read_table(path)
    units = {
        field.name: field.metadata[b"unit"].decode()
        for field in table.schema
        if field.metadata and b"unit" in field.metadata
    }
    columns = {
        name: column.to_numpy()
        for name, column in zip(table.column_names, table.columns, strict=True)
    }
    return FileTable(path, columns, units, 1)


def _read_hdf5(path: Path, _: str) -> FileTable:
    """One-dimensional data sets, anywhere in an HDF5 or NetCDF-4 file, by their path in it."""
    import h5py

    columns, units = {}, {}

    def take(name: str, item: object) -> None:
        if isinstance(item, h5py.Dataset) and item.ndim == 1 and item.dtype.kind in "fiuSO":
            values = item.asstr()[()] if item.dtype.kind in "SO" else item[()]
            columns[name] = np.asarray(values)
            for key in ("units", "unit"):
                if isinstance(item.attrs.get(key), (str, bytes)):
                    unit = item.attrs[key]
                    units[name] = unit.decode() if isinstance(unit, bytes) else unit

    with h5py.File(path, "r") as file:
        file.visititems(take)
    return FileTable(path, columns, units, 1)


def _read_netcdf(path: Path, decimal: str) -> FileTable:
    with path.open("rb") as file:
        classic = file.read(3) == b"CDF"
    if not classic:
        return _read_hdf5(path, decimal)
    from scipy.io import netcdf_file

    columns, units = {}, {}
    with netcdf_file(path, "r", mmap=False) as file:
        for name, variable in file.variables.items():
            if variable.data.ndim == 1:
                columns[name] = np.array(variable.data)
                if hasattr(variable, "units"):
                    units[name] = variable.units.decode()
    return FileTable(path, columns, units, 1)


def _read_matlab(path: Path, decimal: str) -> FileTable:
    with path.open("rb") as file:
        if b"MATLAB 7.3" in file.read(128):
            return _read_hdf5(path, decimal)
    from scipy.io import loadmat

    content = loadmat(path, squeeze_me=True)
    columns = {
        name: np.atleast_1d(value)
        for name, value in content.items()
        if not name.startswith("__")
        and np.ndim(value) <= 1
        and np.asarray(value).dtype.kind in "fiuU"
    }
    return FileTable(path, columns, {}, 1)


READERS = {
    **dict.fromkeys((".csv", ".txt", ".tsv", ".dat"), _read_text),
    ".parquet": _read_parquet,
    **dict.fromkeys((".h5", ".hdf5"), _read_hdf5),
    ".nc": _read_netcdf,
    ".mat": _read_matlab,
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
