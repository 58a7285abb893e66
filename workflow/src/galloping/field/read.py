"""From a file and its mapping to a recording of states, and a list of what was mended."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from galloping.field.mapping import Channel, ColumnMapping
from galloping.field.tables import FileError, FileTable, read_table
from galloping.field.units import UnitError, amount, factor, state_unit

FEWEST = 100  # samples: fewer hold no oscillation that could be told from noise


@dataclass(frozen=True)
class Series:
    """The channels of one file on one time axis, in SI units.

    path: the file. time: (n,) s since `start`, strictly increasing. start: ISO 8601 or ''.
    noise: (n_channels,) known deviation of a sample, NaN where unknown.
    values: (n, n_channels), NaN where missing, in the order of the mapping's channels. rows: (n,)
    row of each sample in the file. notes: one line for each thing that was mended.
    """

    path: Path
    time: np.ndarray
    start: str
    values: np.ndarray
    rows: np.ndarray
    notes: tuple[str, ...]
    noise: np.ndarray


def read_series(path: str | Path, mapping: ColumnMapping) -> Series:
    """Read and check a file. Raises FileError where it is unusable, in one line.

    Rows out of order are sorted, repeated ones dropped where they agree; both are noted.
    """
    table = read_table(path, mapping.decimal)
    time, start = _seconds(table, mapping)
    columns = [_in_si(table, channel) for channel in mapping.channels]
    for channel, column in zip(mapping.channels, columns, strict=True):
        if len(column) != len(time):
            raise FileError(
                f"{table.path}: column {channel.column!r} has {len(column)} rows, the times "
                f"{mapping.time.column!r} have {len(time)}"
            )
    values = np.column_stack(columns)
    rows = np.arange(len(time)) + table.first_row
    notes = []
    timeless = ~np.isfinite(time)
    if timeless.any():
        notes.append(f"{timeless.sum()} rows without a time were left out, row {rows[timeless][0]}")
        time, values, rows = time[~timeless], values[~timeless], rows[~timeless]
    if np.any(np.diff(time) < 0):
        late = np.flatnonzero(np.diff(time) < 0) + 1
        notes.append(f"{len(late)} times go back, first in row {rows[late[0]]}: sorted")
        order = np.argsort(time, kind="stable")
        time, values, rows = time[order], values[order], rows[order]
    again = np.flatnonzero(np.diff(time) == 0) + 1
    if len(again):
        differ = np.any(
            (values[again] != values[again - 1]) & np.isfinite(values[again] + values[again - 1]),
            axis=1,
        )
        if differ.any():
            row = rows[again[differ][0]]
            raise FileError(
                f"{table.path}: row {row}: a time that was there before, with other values: a "
                "clock with a coarse step, or two recordings in one file"
            )
        notes.append(f"{len(again)} repeated rows were dropped, first row {rows[again[0]]}")
        merged = np.where(np.isnan(values[again - 1]), values[again], values[again - 1])
        values[again - 1] = merged
        keep = np.ones(len(time), bool)
        keep[again] = False
        time, values, rows = time[keep], values[keep], rows[keep]
    for channel, column in zip(mapping.channels, values.T, strict=True):
        known = column[np.isfinite(column)]
        if not len(known):
            raise FileError(f"{table.path}: column {channel.column!r} is empty")
        if len(known) < FEWEST <= len(time):
            raise FileError(
                f"{table.path}: column {channel.column!r} has {len(known)} samples, fewer than the "
                f"{FEWEST} needed"
            )
        if np.ptp(known) == 0:
            raise FileError(
                f"{table.path}: column {channel.column!r} is {known[0]:g} throughout: the sensor "
                "did not work"
            )
    if len(time) < FEWEST:
        raise FileError(f"{table.path}: {len(time)} rows are fewer than the {FEWEST} needed")
    noise = np.array([_known_noise(table, channel) for channel in mapping.channels])
    return Series(table.path, time, start, values, rows, tuple(notes), noise)


def _seconds(table: FileTable, mapping: ColumnMapping) -> tuple[np.ndarray, str]:
    """Times in s since the first, and when that was, if the file says it."""
    column = table.column(mapping.time.column)
    if column.dtype.kind == "M":
        stamps = pd.DatetimeIndex(column)
    elif column.dtype.kind in "OUT" and mapping.time.unit is None:
        try:
            stamps = pd.to_datetime(pd.Series(column), format="ISO8601", utc=True)
        except (ValueError, TypeError) as error:
            reason = str(error).splitlines()[0].split(", at position")[0]
            raise FileError(
                f"{table.path}: column {mapping.time.column!r} holds neither numbers nor ISO 8601 "
                f"times: {reason}"
            ) from error
        stamps = pd.DatetimeIndex(stamps)
    else:
        unit = mapping.time.unit or table.units.get(mapping.time.column, "").split(" since ")[0]
        values = table.numbers(mapping.time.column) * _factor(table, mapping.time.column, unit, "s")
        if not np.isfinite(values).any():
            raise FileError(f"{table.path}: column {mapping.time.column!r} is empty")
        return values - np.nanmin(values), ""
    first = stamps.min()
    return np.asarray((stamps - first).total_seconds(), float), first.isoformat()


def _in_si(table: FileTable, channel: Channel) -> np.ndarray:
    unit = channel.unit or table.units.get(channel.column, "")
    wanted = state_unit(channel.measures)
    return table.numbers(channel.column) * _factor(table, channel.column, unit, wanted)


def _known_noise(table: FileTable, channel: Channel) -> float:
    if channel.noise is None:
        return np.nan
    unit = channel.unit or table.units.get(channel.column, "")
    try:
        noise = amount(channel.noise, unit, state_unit(channel.measures))
    except UnitError as error:
        raise FileError(f"{table.path}: noise of column {channel.column!r}: {error}") from error
    if not 0.0 < noise < np.inf:
        raise FileError(
            f"{table.path}: noise of column {channel.column!r}: {channel.noise}; must be above 0"
        )
    return noise


def _factor(table: FileTable, column: str, unit: str, wanted: str) -> float:
    if not unit:
        raise FileError(
            f"{table.path}: column {column!r} has no unit; add --unit {column}={wanted}, or "
            "whatever it is in, or write it behind the name of the column, in brackets"
        )
    try:
        return factor(unit, wanted)
    except UnitError as error:
        raise FileError(f"{table.path}: column {column!r}: {error}") from error
