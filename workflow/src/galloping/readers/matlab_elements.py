"""Check that a MAT-file of level 5 has only known elements, before SciPy reads it.

SciPy's reader takes the type of an element from the file and looks it up without a check that the
type exists: a damaged file ends the process, without a message.
"""

import struct
import zlib
from pathlib import Path

HEADER_BYTES = 128  # length of a file's header
MATRIX_TYPE, COMPRESSED_TYPE = 14, 15  # type numbers of elements
VALUE_TYPES = {1, 2, 3, 4, 5, 6, 7, 9, 12, 13, 16, 17, 18}  # type numbers of numbers and texts
MAX_DEPTH = 32  # levels of nested arrays


def check_elements(path: Path, largest: int) -> None:
    """Raise ValueError if a MATLAB file has data elements of unknown type or wrong size.

    Files of level 4 are not checked. largest: bytes that a compressed element may have.
    """
    content = memoryview(path.read_bytes())
    order = {b"IM": "<", b"MI": ">"}.get(bytes(content[HEADER_BYTES - 2 : HEADER_BYTES]))
    if order:
        _check(content[HEADER_BYTES:], order, largest, 0)


def _check(content: memoryview, order: str, largest: int, depth: int) -> None:
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
            unpacked = zlib.decompressobj().decompress(inner, largest)
            _check(memoryview(unpacked), order, largest, depth + 1)
        elif kind == MATRIX_TYPE:
            _check(inner, order, largest, depth + 1)
        elif kind not in VALUE_TYPES:
            raise ValueError(f"an element of type {kind}")
        offset = end
