"""Arrays by name in instrument files: Parquet, HDF5, NetCDF, MATLAB."""

import struct
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache, partial
from math import prod
from pathlib import Path
from typing import Any

import numpy as np

from galloping.readers import FileError

MAX_TABLE_BYTES = 2 * 1024**3  # bytes: a table that fits into the memory of a small machine
# Of a MAT-file of level 5: length of its header, type numbers of elements, of numbers and texts.
HEADER_BYTES = 128
MATRIX_TYPE, COMPRESSED_TYPE = 14, 15
VALUE_TYPES = {1, 2, 3, 4, 5, 6, 7, 9, 12, 13, 16, 17, 18}
MAX_DEPTH = 32  # levels of nested arrays


@dataclass(frozen=True)
class StoredArray:
    """Description of an array in a file, with a function that reads its values.

    kind: of the NumPy dtype.
    """

    name: str
    shape: tuple[int, ...]
    kind: str
    unit: str | None
    load: Callable[[], np.ndarray]

    @property
    def is_vector(self) -> bool:
        """Whether the array is a vector, or a scalar, of numbers, times or text."""
        return sum(n != 1 for n in self.shape) <= 1 and self.kind in "fiubMmUO"


def arrays_in(path: Path, suffix: str) -> Iterator[StoredArray]:
    """Iterate over descriptions of the arrays in a Parquet, HDF5, NetCDF or MATLAB file.

    suffix: a key of ARRAY_READERS; without effect if the file is HDF5, as newer NetCDF and
    MATLAB files.
    """
    import h5py

    return (_hdf5 if h5py.is_hdf5(path) else ARRAY_READERS[suffix])(path)


def _parquet(path: Path) -> Iterator[StoredArray]:
    from pyarrow import parquet, types

    with parquet.ParquetFile(path) as file:
        rows, schema = file.metadata.num_rows, file.schema_arrow
    check_size(8 * rows * len(schema), "arrays")
    # each distinct text is stored once, however many rows repeat it
    texts = [field.name for field in schema if types.is_string(field.type)]

    @cache
    def table() -> Any:
        return parquet.read_table(path, read_dictionary=texts)

    def load(k: int) -> np.ndarray:
        return table().column(k).to_pandas().to_numpy()

    for k, field in enumerate(schema):
        unit = (field.metadata or {}).get(b"unit")
        kind = "V" if types.is_nested(field.type) else "O"
        yield StoredArray(field.name, (rows,), kind, unit and unit.decode(), partial(load, k))


def _hdf5(path: Path) -> Iterator[StoredArray]:
    """Yield data sets, anywhere in an HDF5 or NetCDF-4 file, by their path in it.

    MATLAB stores the targets of references in cells and structure arrays in groups that begin with
    `#`, and text as numbers of a class `char`: neither contains columns.
    """
    import h5py

    with h5py.File(path, "r") as file:
        items: dict[str, Any] = {}
        file.visititems(items.__setitem__)
        for name, item in items.items():
            is_char = item.attrs.get("MATLAB_class") == b"char"
            if not isinstance(item, h5py.Dataset) or name.startswith("#") or is_char:
                continue
            units = np.ravel(item.attrs.get("units", item.attrs.get("unit", "")))
            unit = next(iter(units), "")
            unit = unit.decode() if isinstance(unit, bytes) else str(unit)
            text = h5py.check_string_dtype(item.dtype) and item.ndim == 1
            load = item.asstr().__getitem__ if text else partial(_read_dataset, item)
            kind = "O" if text else "V" if item.shape is None else item.dtype.kind
            yield StoredArray(name, item.shape or (), kind, unit, partial(load, ()))


def _read_dataset(item: Any, index: tuple) -> np.ndarray:
    return _unpack(item[index], item.attrs.get)


def _netcdf(path: Path) -> Iterator[StoredArray]:
    from scipy.io import netcdf_file

    with netcdf_file(path, "r", mmap=False) as file:
        for name, variable in file.variables.items():
            data = variable.data
            native = data.astype(data.dtype.newbyteorder("="))  # as pandas needs it
            attribute = partial(getattr, variable)
            unit = attribute("units", b"").decode() or None
            load = partial(_unpack, native, attribute)
            yield StoredArray(name, native.shape, native.dtype.kind, unit, load)


def _unpack(values: Any, attribute: Callable[[str, Any], Any]) -> np.ndarray:
    """Convert an array by its attributes, as NetCDF defines them: missing values, scale, offset.

    attribute: returns an attribute by name, or the default.
    """
    names = "_FillValue", "missing_value"
    codes = np.ravel([code for name in names for code in np.ravel(attribute(name, []))])
    scale = float(np.ravel(attribute("scale_factor", 1.0))[0])
    offset = float(np.ravel(attribute("add_offset", 0.0))[0])
    values = np.asarray(values)
    if values.dtype.kind not in "iuf":
        return values
    if values.dtype.kind == "f" and codes.dtype.kind in "iuf":
        codes = codes.astype(values.dtype)  # rounded like the values
    missing = np.isin(values, codes)
    if not missing.any() and (scale, offset) == (1.0, 0.0):
        return values
    return np.where(missing, np.nan, scale * values + offset)


def _matlab(path: Path) -> Iterator[StoredArray]:
    from scipy.io import loadmat, whosmat

    content = memoryview(path.read_bytes())
    order = {b"IM": "<", b"MI": ">"}.get(bytes(content[HEADER_BYTES - 2 : HEADER_BYTES]))
    if order:  # files of level 4 have none
        _check_elements(content[HEADER_BYTES:], order)
    check_size(8 * sum(prod(shape) for _, shape, _ in whosmat(path)), "arrays")
    for name, value in loadmat(path).items():
        if not name.startswith("__"):
            array = np.asarray(value)
            yield StoredArray(name, array.shape, array.dtype.kind, None, partial(np.asarray, array))


def _check_elements(content: memoryview, order: str, depth: int = 0) -> None:
    """Raise ValueError for data elements of unknown type or wrong size in a MAT-file of level 5.

    SciPy's reader takes the type of an element from the file and looks it up without a check that
    the type exists: a damaged file ends the process, without a message. order: of bytes, in the
    notation of `struct`.
    """
    if depth > MAX_DEPTH:
        raise ValueError(f"arrays more than {MAX_DEPTH} deep")
    offset = 0
    while offset + 8 <= len(content):
        kind, size = struct.unpack_from(f"{order}II", content, offset)
        offset += 8
        if kind >> 16:  # a small element, within its tag
            kind, size, end = kind & 0xFFFF, 0, offset
        else:
            end = offset + size + (-size % 8 if kind != COMPRESSED_TYPE else 0)
        if offset + size > len(content):
            raise ValueError(f"an element of {size} bytes where {len(content) - offset} are left")
        inner = content[offset : offset + size]
        if kind == COMPRESSED_TYPE:
            unpacked = zlib.decompressobj().decompress(inner, MAX_TABLE_BYTES)
            _check_elements(memoryview(unpacked), order, depth + 1)
        elif kind == MATRIX_TYPE:
            _check_elements(inner, order, depth + 1)
        elif kind not in VALUE_TYPES:
            raise ValueError(f"an element of type {kind}")
        offset = end


def check_size(n_bytes: int, contents: str = "") -> None:
    """Raise FileError if a file, or its contents, need more than 2 GiB of memory."""
    if n_bytes > MAX_TABLE_BYTES:
        of_contents = f" of {contents}" if contents else ""
        raise FileError(
            f"{n_bytes / 1e9:.1f} GB{of_contents} are more than {MAX_TABLE_BYTES / 1e9:.1f} GB; "
            "cut it in pieces"
        )


ARRAY_READERS = {
    ".parquet": _parquet, ".h5": _hdf5, ".hdf5": _hdf5, ".nc": _netcdf, ".mat": _matlab,
}  # fmt: skip
