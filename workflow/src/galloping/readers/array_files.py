"""Arrays by name in files of instruments: Parquet, HDF5, NetCDF, MATLAB."""

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np


def arrays_in(path: Path, suffix: str) -> Iterator[tuple]:
    """Name, array and unit, or None, of each array in a file.

    suffix: of READERS, for files that are no HDF5, as new ones of NetCDF and MATLAB are.
    """
    import h5py

    return (_hdf5 if h5py.is_hdf5(path) else READERS[suffix])(path)


def _parquet(path: Path) -> Iterator[tuple]:
    from pyarrow import parquet

    table = parquet.read_table(path)
    for field, column in zip(table.schema, table.columns, strict=True):
        unit = (field.metadata or {}).get(b"unit")
        yield field.name, column.to_numpy(), unit and unit.decode()


def _hdf5(path: Path) -> Iterator[tuple]:
    """Data sets, anywhere in an HDF5 or NetCDF-4 file, by their path in it."""
    import h5py

    with h5py.File(path, "r") as file:
        found = []
        file.visititems(lambda name, item: found.append((name, item)))
        for name, item in found:
            if isinstance(item, h5py.Dataset):
                told = np.ravel(item.attrs.get("units", item.attrs.get("unit", "")))
                unit = next(iter(told), "")
                unit = unit.decode() if isinstance(unit, bytes) else str(unit)
                text = h5py.check_string_dtype(item.dtype) and item.ndim == 1
                yield name, item.asstr()[()] if text else _unpacked(item, item.attrs.get), unit


def _netcdf(path: Path) -> Iterator[tuple]:
    from scipy.io import netcdf_file

    with netcdf_file(path, "r", mmap=False) as file:
        for name, variable in file.variables.items():
            own = variable.data.astype(variable.data.dtype.newbyteorder("="))  # as pandas wants it
            about = partial(getattr, variable)
            yield name, _unpacked(own, about), about("units", b"").decode() or None


def _unpacked(values: Any, about: Callable[[str, Any], Any]) -> Any:
    """An array as its attributes say, by the conventions of NetCDF: what is missing, scale, offset.

    values: an array, or a data set. about: a value of an attribute by name, or else the default.
    """
    gone = np.ravel([*np.ravel(about("_FillValue", [])), *np.ravel(about("missing_value", []))])
    scale = float(np.ravel(about("scale_factor", 1.0))[0])
    offset = float(np.ravel(about("add_offset", 0.0))[0])
    if values.dtype.kind not in "iuf":
        return values
    missing = np.isin(values, gone)
    if not missing.any() and (scale, offset) == (1.0, 0.0):
        return values
    return np.where(missing, np.nan, scale * np.asarray(values) + offset)


def _matlab(path: Path) -> Iterator[tuple]:
    from scipy.io import loadmat

    for name, value in loadmat(path).items():
        if not name.startswith("__"):
            yield name, np.asarray(value), None


READERS = {".parquet": _parquet, ".h5": _hdf5, ".hdf5": _hdf5, ".nc": _netcdf, ".mat": _matlab}
