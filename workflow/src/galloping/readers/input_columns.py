"""Inputs of the motion: from columns of a file to functions of time."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from galloping.readers import FileError
from galloping.readers.file_table import FileTable
from galloping.readers.mapping import InputColumn
from galloping.recording.samples import INTERPOLATIONS, MAX_INTERPOLATED_STEPS, Input

# rows with the same value if a logger repeats the samples of a slower instrument
MIN_ROWS_PER_SAMPLE = 2


def read_inputs(
    table: FileTable, columns: Sequence[InputColumn], time: np.ndarray, values: np.ndarray
) -> dict[str, Input]:
    """Make the inputs of a recording, as functions of time, from columns of a file.

    values: (n, n_inputs), at the rows of the file. Rows between the samples of a slower instrument,
    empty or repeated, are no gaps and no samples, unless the input is held. If the mapping does not
    specify the interpolation of an input, it is held if it stays constant and then jumps anywhere,
    else smooth, and has the other kinds as its alternatives. Raises FileError if a column has fewer
    than two samples.
    """
    inputs = {}
    for column, samples in zip(columns, values.T, strict=True):
        finite_samples = samples[np.isfinite(samples)]
        if len(finite_samples) < 2:
            raise FileError(f"{table.label(column.column)} has {len(finite_samples)} samples")
        kinds = {kind: _make_input(column, time, samples, kind) for kind in INTERPOLATIONS}
        likely = column.between or ("zero" if _is_staircase(finite_samples) else "cubic")
        others = tuple(kinds[kind] for kind in INTERPOLATIONS if kind != likely)
        alternatives = () if column.between else others
        inputs[column.name] = replace(kinds[likely], alternatives=alternatives)
    return inputs


def _make_input(column: InputColumn, time: np.ndarray, values: np.ndarray, between: str) -> Input:
    """Make an input with one kind of interpolation. values: (n,), NaN if missing."""
    finite_rows = np.flatnonzero(np.isfinite(values))
    if between != "zero" and count_rows_per_sample(values[finite_rows]) > 1:
        finite_rows = finite_rows[np.append(True, np.diff(values[finite_rows]) != 0)]
    steps = np.diff(time[finite_rows])
    is_kept = np.zeros(len(values), bool)
    is_kept[finite_rows] = True
    for k in np.flatnonzero(steps > MAX_INTERPOLATED_STEPS * np.median(steps)):
        is_kept[finite_rows[k] : finite_rows[k + 1]] = True
    return Input(time[is_kept] - column.delay, values[is_kept], between, column.error)


def _is_staircase(values: np.ndarray) -> bool:
    """Decide whether values (n,) are mostly constant, and jump independently of the last value.

    The mean square of such jumps is twice the variance of the values. One jump suffices.
    """
    changes = values[np.append(True, np.diff(values) != 0)]
    jumps = np.diff(changes)
    stays = 2 * len(changes) < len(values)
    return stays and len(jumps) > 0 and np.mean(jumps**2) > np.var(changes)


def count_rows_per_sample(values: np.ndarray) -> int:
    """Determine in how many rows a logger repeats each sample of a slower instrument.

    It is 1 if values (n,) are not constant for a fixed number of rows.
    """
    runs = np.diff(np.flatnonzero(np.append(True, np.diff(values) != 0)))
    if len(runs) < MIN_ROWS_PER_SAMPLE or (usual := np.median(runs)) < MIN_ROWS_PER_SAMPLE:
        return 1
    return int(usual) if np.mean(runs % usual == 0) > 0.9 else 1
