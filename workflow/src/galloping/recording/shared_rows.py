"""Rows of samples that two recordings share, because one of them is given twice."""

from collections.abc import Sequence

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

# rows in a block that two recordings do not share by chance, and most distinct values of each of
# its columns with which they may
BLOCK_ROWS, MAX_CHANCE_VALUES = 20, 5


def find_shared_rows(recordings: Sequence[np.ndarray]) -> tuple[int, int, int] | None:
    """Find rows that two recordings share, in a run of at least twice BLOCK_ROWS.

    recordings: (n, n_columns) samples of each. Returns the index of the first recording, that of
    the second, and the first shared row of the second. Blocks of rows in which no column has more
    than MAX_CHANCE_VALUES different values are ignored.
    """
    index_by_block: dict[bytes, int] = {}
    for k, values in enumerate(recordings if len(recordings) > 1 else ()):
        if len(values) < BLOCK_ROWS:
            continue
        blocks = sliding_window_view(values, BLOCK_ROWS, axis=0)
        for row, block in enumerate(blocks):
            other = index_by_block.get(block.tobytes())
            if other is not None and any(
                len(np.unique(column)) > MAX_CHANCE_VALUES for column in block
            ):
                return other, k, row
        index_by_block |= {block.tobytes(): k for block in blocks[::BLOCK_ROWS]}
    return None
