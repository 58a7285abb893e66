"""From a file and its mapping to a recording of states, and a list of what was mended."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations, pairwise
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.lib.stride_tricks import sliding_window_view

from galloping.identification.inputs import FEWEST
from galloping.passes import passing
from galloping.readers import FileError
from galloping.readers.angles import unwrap_angle
from galloping.readers.columns import contradicted_target, target
from galloping.readers.file_table import FileTable, read_table
from galloping.readers.hints import (
    likely_input_unit,
    likely_time_unit,
    likely_unit,
    unit_options,
)
from galloping.readers.mapping import Channel, ColumnMapping, InputColumn, TimeColumn
from galloping.readers.units import (
    ORDERS,
    UnitError,
    amount,
    factor,
    input_si,
    is_scaled,
    named,
    state_si,
    state_unit,
)
from galloping.recording import BETWEEN, INTERPOLATED, Input

CODES = (  # that loggers write for a missing sample, of either sign
    99, 999, 9999, 99999, 999999, 9999999, 99.9, 99.99, 999.9, 999.99, 999.25, 9999.9, 9999.99,
    6999, 7999, 32767, 32768,
)  # fmt: skip
LEAST_FILL = 1e10  # of what files are filled with, such as 1e20, where nothing was measured
HELD = 2  # rows, that a logger repeats a slower sample for at least
STUCK = 20  # times as long as nearly all runs of one value is that of a sensor that was stuck
SAME = 1e-9  # less than full correlation, of two channels that are one
ALIKE, VARIED = 20, 5  # rows of a block, and values in it, that no two recordings share by chance
DAYS = (
    "%d.%m.%Y", "%d.%m.%y", "%Y/%m/%d", "%d/%m/%Y", "%m/%d/%Y", "%d-%m-%Y", "%m-%d-%Y", "%m/%d/%y",
    "%d/%m/%y", "%d-%b-%Y",
)  # fmt: skip
HOURS = [f"%{hours}.%f{half}" for hours, half in (("H:%M:%S", ""), ("I:%M:%S", " %p"))]
HOURS += [hours.replace(".%f", ":%f") for hours in HOURS]
WHOLE = r"(?<![:\d])(\d\d?:\d\d:\d\d)(?![.:\d])"  # seconds, which may stand among fractions of them
FORMS = [f"{day} {hour}" for day in DAYS for hour in HOURS] + HOURS
TURNS = {"rad": (2.0 * np.pi,), "1": (360.0, 2.0 * np.pi)}  # of an angle, by the unit of a column
HINTS = {  # where a column is missing, by what it is of
    TimeColumn: "--time names the column of the times (time: in a mapping)",
    InputColumn: "an input has a column of its name, or of that in --input NAME=COLUMN",
    Channel: "--measure STATE=COLUMN says which column measures what (channels: in a mapping)",
}


@dataclass(frozen=True)
class Series:
    """The channels of one file on one time axis, in SI units.

    Attributes
    ----------
    path : Path
        The file.
    time : ndarray of shape (n,)
        s since `start`, strictly increasing.
    start : str
        ISO 8601 or ''.
    values : ndarray of shape (n, n_channels)
        NaN where missing, in the order of the mapping's channels.
    rows : ndarray of shape (n,)
        Row of each sample in the file.
    notes : tuple of str
        A line for each thing that was mended.
    noise : ndarray of shape (n_channels,)
        Known deviation of a sample, NaN where unknown.
    inputs : mapping
        By name, on the same time axis.
    units : mapping
        Units of the inputs, by name.
    unused : tuple of str
        Columns that were left aside.
    unused_motion : tuple of str
        Those of them that measure motion of a span, by their names.
    origin : float
        s, the first time by the clock of the file, of dates since 1970.
    """

    path: Path
    time: np.ndarray
    start: str
    values: np.ndarray
    rows: np.ndarray
    notes: tuple[str, ...]
    noise: np.ndarray
    inputs: Mapping[str, Input]
    units: Mapping[str, str]
    unused: tuple[str, ...]
    unused_motion: tuple[str, ...]
    origin: float

    @property
    def unused_note(self) -> str:
        """A line about the columns that were left aside, '' if there are none."""
        left = ", ".join(self.unused)
        more = "a wind among them is named by --input U=COLUMN"
        return f"columns that are not used: {left}; {more}" if left else ""


def read_series(path: str | Path, mapping: ColumnMapping) -> Series:
    """Read and check a file. Raises FileError where it is unusable, in one line.

    Rows out of order are sorted, repeated ones dropped where they agree; both are noted.
    """
    passing(Path(path).name)
    table = read_table(path, mapping.decimal, mapping.time and mapping.time.column)
    for one in (*mapping.clocks, *mapping.channels, *mapping.inputs):
        try:
            table.column(one.column)
        except FileError as error:
            raise FileError(f"{error}; {HINTS[type(one)]}") from None
    instants = _instants(table, mapping.time) if mapping.rate is None else None
    _check_units(table, mapping, mapping.rate is None and instants is None)
    time, start, origin = _seconds(table, mapping, instants)
    notes, columns, units = list(table.notes), [], {}
    for one in (*mapping.channels, *mapping.inputs):
        column, codes = _without_codes(table.numbers(one.column))
        notes += [
            f"column {one.column!r}: {count} samples of {code:g}, a code for missing ones, were "
            "left out"
            for code, count in codes.items()
        ]
        if isinstance(one, Channel) and (stuck := _stuck(column)).any():
            column = np.where(stuck, np.nan, column)
            notes.append(
                f"column {one.column!r}: {stuck.sum()} samples of a sensor that was stuck, from "
                f"row {np.argmax(stuck) + table.first_row} on, were left out"
            )
        if len(column) != len(time):
            of = f"the times {mapping.time.column!r} have" if mapping.time else "the others have"
            raise FileError(f"{table.at(one.column)} has {len(column)} rows, {of} {len(time)}")
        if isinstance(one, Channel):
            to_state = partial(state_si, target=one.measures)
            scale, unit = _to_si(table, one.column, one.unit, to_state)
            if unit != state_unit(one.measures):
                notes.append(
                    f"column {one.column!r} is taken in {unit}; numbers of {one.measures} stand "
                    "without that unit"
                )
        else:
            scale, unit = _to_si(table, one.column, one.unit, input_si)
            units[one.name] = unit
        for turn in TURNS.get(unit, ()):
            column, n_wraps = unwrap_angle(column, turn / scale)
            if n_wraps:
                notes.append(
                    f"column {one.column!r} is an angle that starts again after {turn / scale:g}, "
                    f"{n_wraps} times: unwrapped"
                )
        columns.append(scale * column)
    rows = np.arange(len(time)) + table.first_row
    time, values, rows, more = _in_order(table, time, np.column_stack(columns), rows)
    measured = len(mapping.channels)
    inputs = inputs_of(table, mapping.inputs, time, values[:, measured:])
    values = values[:, :measured]
    if len(time) < FEWEST and measured:
        raise FileError(f"{table.path}: {len(time)} rows are fewer than the {FEWEST} needed")
    for channel, column in zip(mapping.channels, values.T, strict=True):
        known = column[np.isfinite(column)]
        if len(known) < FEWEST:
            raise FileError(
                f"{table.at(channel.column)} has {len(known)} samples, fewer than the {FEWEST} "
                "needed"
            )
        if np.ptp(known) == 0:
            raise FileError(
                f"{table.at(channel.column)} is {known[0]:g} throughout: the sensor did not work"
            )
    _check_distinct(table, mapping, values)
    noise = np.array([_known_noise(table, channel) for channel in mapping.channels])
    used = {named(c.column)[0] for c in (*mapping.clocks, *mapping.channels, *mapping.inputs)}
    unused = tuple(name for name in table.columns if name not in used)
    of_motion = tuple(
        name
        for name in unused
        if target(name, table.unit(name)) or contradicted_target(name, table.unit(name))
    )
    return Series(
        table.path, time, start, values, rows, (*notes, *more), noise, inputs, units, unused,
        of_motion, origin,
    )  # fmt: skip


def _in_order(
    table: FileTable, time: np.ndarray, values: np.ndarray, rows: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[str]]:
    """Times, values and rows with times that increase, and a note of each thing that was mended."""
    notes = []
    timeless = ~np.isfinite(time)
    if timeless.any():
        notes.append(f"{timeless.sum()} rows without a time were left out, row {rows[timeless][0]}")
        time, values, rows = time[~timeless], values[~timeless], rows[~timeless]
    if (moved := _restarted(time)) is not None:
        back = rows[np.flatnonzero(np.diff(time) < 0)[0] + 1]
        notes.append(
            f"the clock starts again in row {back}: what follows is a recording of its own"
        )
        time = moved
    late = np.flatnonzero(np.diff(time) < 0) + 1
    if len(late):
        notes.append(f"{len(late)} times go back, first in row {rows[late[0]]}: sorted")
        order = np.argsort(time, kind="stable")
        time, values, rows = time[order], values[order], rows[order]
    again = np.flatnonzero(np.diff(time) == 0) + 1
    if len(again):
        of_time = pd.DataFrame(values).groupby(time)
        differ = of_time.nunique().gt(1).any(axis=1)
        strange = again[differ[time[again]]]
        if len(strange):
            raise FileError(
                f"{table.path}: row {rows[strange[0]]}: a time that was there before, with other "
                "values: a clock with a coarse step, where each row needs a time of its own, or "
                "two recordings, where each needs a file of its own"
            )
        notes.append(f"{len(again)} repeated rows were dropped, first row {rows[again[0]]}")
        values = of_time.first().to_numpy()
        time, rows = (np.delete(each, again) for each in (time, rows))
    return time, values, rows, notes


def _restarted(time: np.ndarray) -> np.ndarray | None:
    """Times (n,) of a file in which the clock starts again, the parts one after the other.

    Between two parts there is a gap as long as all before. None where the clock does not start
    again: where rows are out of order, or parts that do not overlap.
    """
    edges = [0, *(np.flatnonzero(np.diff(time) < 0) + 1), len(time)]
    parts = [time[a:b] for a, b in pairwise(edges)]
    ordered = sorted(parts, key=lambda part: part[0])
    overlap = any(after[0] <= before[-1] for before, after in pairwise(ordered))
    if not overlap or min(map(len, parts)) < FEWEST:
        return None
    moved = [parts[0]]
    for part in parts[1:]:
        end = moved[-1][-1]
        moved.append(part - part[0] + end + (end - time[0]))
    return np.concatenate(moved)


def _check_distinct(table: FileTable, mapping: ColumnMapping, values: np.ndarray) -> None:
    """Refuse two channels of different quantities whose samples are the same up to a factor."""
    for a, b in combinations(range(values.shape[1]), 2):
        first, second = mapping.channels[a], mapping.channels[b]
        both = np.isfinite(values[:, a] + values[:, b])
        if first.measures == second.measures or both.sum() < FEWEST:
            continue
        deviations = values[both][:, (a, b)] - values[both][:, (a, b)].mean(axis=0)
        size = np.linalg.norm(deviations, axis=0)
        if size.all() and np.prod(deviations / size, axis=1).sum() > 1.0 - SAME:
            raise FileError(
                f"{table.path}: columns {first.column!r} and {second.column!r} hold the same "
                f"samples, and cannot measure both {first.measures} and {second.measures}"
            )


def check_apart(series: Sequence[Series]) -> None:
    """Refuse files of which one repeats another, whole or in part.

    Raises FileError where ALIKE rows in a row of one file are also in another one.
    """
    known: dict[bytes, Series] = {}
    for one in series if len(series) > 1 else ():
        blocks = sliding_window_view(one.values, ALIKE, axis=0)
        for k, block in enumerate(blocks):
            other = known.get(block.tobytes())
            if other is not None and max(len(np.unique(column)) for column in block) > VARIED:
                raise FileError(
                    f"{one.path}: row {one.rows[k]} and those after it are also in {other.path}: "
                    "a recording counts once"
                )
        known |= {block.tobytes(): one for block in blocks[::ALIKE]}


def _instants(table: FileTable, time: TimeColumn) -> pd.DatetimeIndex | pd.TimedeltaIndex | None:
    """Dates or times of a day of a file; None where they, or most of a column of text, are numbers.

    Raises FileError where a day cannot be told from a month, and for what is no time.
    """
    name, column = time.column, table.column(time.column)
    if column.dtype.kind in "mM":
        return pd.Index(column)
    if column.dtype.kind not in "OUT" or time.unit is not None:
        return None
    text = pd.Series(column).astype("string").str.strip().str.replace(",", ".")
    text = text.str.replace(WHOLE, r"\1.0", regex=True)
    if pd.to_numeric(text, errors="coerce").notna().sum() >= text.notna().sum() / 2:
        return None
    first = text.dropna()[:1]
    found = [pd.to_datetime(text, format="ISO8601", utc=True, errors="coerce")]
    if found[0].isna().all():
        forms = [form for form in FORMS
                 if pd.to_datetime(first, format=form, errors="coerce").notna().all()]  # fmt: skip
        found += [pd.to_datetime(text, format=form, errors="coerce") for form in forms]
    most = max(stamps.notna().sum() for stamps in found)
    found = [stamps for stamps in found if stamps.notna().sum() == most]
    strange = np.flatnonzero(text.notna() & found[0].isna())
    if len(strange):
        what = "is neither a number nor a time, such as 2026-01-31T12:00:00.04"
        raise table.fault(strange[0], name, what)
    if any(not (stamps - stamps.min()).equals(found[0] - found[0].min()) for stamps in found):
        raise table.fault(0, name, "may be day or month first; write dates as 2026-01-31")
    stamps = pd.DatetimeIndex(found[0])
    if ":" in first.iloc[0][:3]:  # without a date: they go on after midnight
        days = np.cumsum(np.diff(stamps, prepend=stamps[:1]) < -pd.Timedelta(hours=12))
        stamps += pd.to_timedelta(days, "D")
    return stamps


def _counted(table: FileTable, mapping: ColumnMapping) -> np.ndarray:
    """Return the times of samples at the rate of a mapping, s, by their count or by their rows."""
    if mapping.time is None:
        first = (*mapping.channels, *mapping.inputs)[0]
        return np.arange(len(table.column(first.column))) / mapping.rate
    name = mapping.time.column
    if unit := table.unit(name):
        raise FileError(
            f"{table.at(name)} has the unit {unit} and counts no samples; leave out the rate"
        )
    counts = table.numbers(name)
    for row in np.flatnonzero(np.isfinite(counts) & (counts != np.round(counts))):
        raise table.fault(row, name, "is no count of samples; leave out the rate")
    return counts / mapping.rate


def _seconds(
    table: FileTable, mapping: ColumnMapping, times: pd.Index | None
) -> tuple[np.ndarray, str, float]:
    """Times in s since the first, when that was, if the file says it, and on which second."""
    if mapping.rate is not None:
        values = _counted(table, mapping)
        if not np.isfinite(values).any():
            raise FileError(f"{table.at(mapping.time.column)} is empty")
        return values - np.nanmin(values), "", float(np.nanmin(values))
    name = mapping.time.column
    if isinstance(times, pd.DatetimeIndex) and times.notna().any():
        first = times.min()
        seconds = np.asarray((times - first).total_seconds(), float)
        return seconds, first.isoformat(), first.timestamp()
    if isinstance(times, pd.TimedeltaIndex):
        values = times.total_seconds().to_numpy(float)
    elif times is not None:
        values = np.full(len(times), np.nan)
    else:
        values = table.numbers(name) * _to_si(
            table, name, mapping.time.unit, partial(factor, wanted="s")
        )
    if not np.isfinite(values).any():
        raise FileError(f"{table.at(name)} is empty")
    return values - np.nanmin(values), "", float(np.nanmin(values))


def _stuck(values: np.ndarray) -> np.ndarray:
    """(n,) boolean: samples that repeat the one before, in a row that is STUCK times as long as
    nearly all others. Of a column that is one value throughout none are.
    """
    changes = np.append(True, np.diff(values) != 0.0)
    runs = np.diff(np.append(np.flatnonzero(changes), len(values)))
    least = STUCK * np.quantile(runs, 0.99, method="lower")
    length = np.repeat(runs, runs)
    return ~changes & (length >= max(least, STUCK)) & (len(runs) > 1)


def _without_codes(values: np.ndarray) -> tuple[np.ndarray, dict[float, int]]:
    """Values with NaN in place of codes for missing samples, such as -9999, and their counts.

    A code is a value that loggers use as one, and further from all others than these are from each
    other.
    """
    known, counts = np.unique(values[np.isfinite(values)], return_counts=True)
    fill = np.abs(known) >= LEAST_FILL
    used = np.isin(np.abs(known), CODES) | (fill & (fill.sum() == 1))
    others = known[~used]
    if not used.any() or not len(others):
        return values, {}
    used &= np.abs(known - (others[0] + others[-1]) / 2) > 1.5 * np.ptp(others)
    codes = dict(zip(known[used].tolist(), counts[used].tolist(), strict=True))
    return np.where(np.isin(values, known[used]), np.nan, values), codes


def _check_units(table: FileTable, mapping: ColumnMapping, of_time: bool) -> None:
    """Refuse columns without a unit, all of them in one line. of_time: whether times need one."""

    def lacks(one: TimeColumn | Channel | InputColumn) -> bool:
        return not (one.unit or table.unit(one.column))

    bare: list[tuple[str, str]] = []
    if of_time and lacks(mapping.time):
        name = mapping.time.column
        bare.append((name, likely_time_unit(table.numbers(name))))
    for one in filter(lacks, mapping.channels):
        values, si = table.numbers(one.column), state_unit(one.measures)
        is_known = si in ORDERS
        bare.append((one.column, likely_unit(ORDERS.index(si), values) if is_known else "1"))
    bare += [(one.column, likely_input_unit(one.column)) for one in filter(lacks, mapping.inputs)]
    if bare:
        names, several = ", ".join(repr(name) for name, _ in bare), len(bare) > 1
        raise FileError(
            f"{table.path}: column{'s' * several} {names} {'have' if several else 'has'} no unit; "
            f"add {unit_options(bare)}, or whatever they are in (unit: in a mapping), or write it "
            "behind the column's name, in []"
        )


def _to_si(table: FileTable, column: str, said: str | None, convert: Callable):
    """What a column is multiplied by to be in SI, as `convert` tells it from the unit.

    That is the unit that is said, or that of the file, which must not differ. What is said stands
    where it is `1`, which takes numbers as they are, and where the file has another name than that
    of a unit, such as `counts`.
    """
    at, own = table.at(column), table.unit(column).split(" since ")[0]
    try:
        if not said and is_scaled(own):  # as `50 mm`, which may be the range of a sensor
            raise UnitError(f"unit {own!r:.60} is a number of units; say what one count is")
        found = convert(said or own)
    except UnitError as error:
        raise FileError(f"{at}: {error}") from error
    with suppress(UnitError):
        if said not in (None, "1") and own and convert(own) != found:
            raise FileError(
                f"{at} is in {own} by the file and in {said} by the mapping; must be the same"
            )
    return found


def _known_noise(table: FileTable, channel: Channel) -> float:
    if channel.noise is None:
        return np.nan
    unit = channel.unit or table.unit(channel.column)
    try:
        noise = amount(channel.noise, unit, channel.measures)
        if not 0.0 < noise < np.inf:
            raise UnitError(f"{channel.noise}; must be above 0")
    except UnitError as error:
        raise FileError(f"{table.path}: noise of column {channel.column!r}: {error}") from error
    return noise


def inputs_of(
    table: FileTable, columns: Sequence[InputColumn], time: np.ndarray, values: np.ndarray
) -> dict[str, Input]:
    """Inputs by name, from values (n, n_inputs) at the rows of a file.

    Rows between the samples of a slower instrument, empty or repeated, are no gaps and no samples,
    unless the input is held. Where the mapping does not say what an input is between its samples,
    it is held if it stays and then jumps anywhere, else smooth, and has the other kinds as its
    alternatives. Raises FileError where a column holds fewer than two samples.
    """
    found = {}
    for column, own in zip(columns, values.T, strict=True):
        known = np.flatnonzero(np.isfinite(own))
        if len(known) < 2:
            raise FileError(f"{table.at(column.column)} has {len(known)} samples")
        kinds = {kind: _input_of(column, time, own, kind) for kind in BETWEEN}
        likely = column.between or ("zero" if _is_staircase(own[known]) else "cubic")
        others = () if column.between else tuple(kinds[kind] for kind in BETWEEN if kind != likely)
        found[column.name] = replace(kinds[likely], alternatives=others)
    return found


def _input_of(column: InputColumn, time: np.ndarray, values: np.ndarray, between: str) -> Input:
    """An input that is held, linear or smooth between its samples. values: (n,), NaN if missing."""
    known = np.flatnonzero(np.isfinite(values))
    if between != "zero":
        known = known[_fresh(values[known])]
    steps = np.diff(time[known])
    kept = np.zeros(len(values), bool)
    kept[known] = True
    for k in np.flatnonzero(steps > INTERPOLATED * np.median(steps)):
        kept[known[k] : known[k + 1]] = True
    return Input(time[kept] - column.delay, values[kept], between, column.error)


def _is_staircase(values: np.ndarray) -> bool:
    """Whether values (n,) mostly stay, and jump as far as if the last one told nothing of the next:
    such jumps are twice the variance of the values in the mean square. One jump is enough.
    """
    changes = values[np.append(True, np.diff(values) != 0)]
    jumps = np.diff(changes)
    stays = 2 * len(changes) < len(values)
    return stays and len(jumps) > 0 and np.mean(jumps**2) > np.var(changes)


def _fresh(values: np.ndarray) -> np.ndarray:
    """(n,) boolean: the samples of a slower instrument that a logger did not merely repeat.

    All where values do not stay for a fixed number of rows.
    """
    fresh = np.append(True, np.diff(values) != 0)
    runs = np.diff(np.flatnonzero(fresh))
    if len(runs) < HELD or np.median(runs) < HELD:
        return np.ones(len(values), bool)
    regular = runs % np.median(runs) == 0
    return fresh if regular.mean() > 0.9 else np.ones(len(values), bool)
