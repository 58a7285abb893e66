"""Arrays by name in files of instruments: Parquet, HDF5, NetCDF, MATLAB."""

from collections.abc import Iterator
from pathlib import Path

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
                yield name, item.asstr()[()] if text else item, unit


def _netcdf(path: Path) -> Iterator[tuple]:
    from scipy.io import netcdf_file

    with netcdf_file(path, "r", mmap=False) as file:
        for name, variable in file.variables.items():
            own = variable.data.astype(variable.data.dtype.newbyteorder("="))  # as pandas wants it
            yield name, own, getattr(variable, "units", b"").decode() or None


def _matlab(path: Path) -> Iterator[tuple]:
    from scipy.io import loadmat

    for name, value in loadmat(path).items():
        if not name.startswith("__"):
            yield name, np.asarray(value), None


READERS = {".parquet": _parquet, ".h5": _hdf5, ".hdf5": _hdf5, ".nc": _netcdf, ".mat": _matlab}
