"""Times of samples in seconds, in order: from dates, numbers with a unit, or a sample count."""

from functools import partial
from itertools import pairwise

import numpy as np
import pandas as pd

from galloping.identification.inputs import MIN_SAMPLES
from galloping.readers import FileError
from galloping.readers.columns import is_time
from galloping.readers.file_table import FileTable
from galloping.readers.mapping import ColumnMapping, TimeColumn
from galloping.readers.units import UnitError, factor

DAY_FORMATS = (
    "%d.%m.%Y", "%d.%m.%y", "%Y/%m/%d", "%d/%m/%Y", "%m/%d/%Y", "%d-%m-%Y", "%m-%d-%Y", "%m/%d/%y",
    "%d/%m/%y", "%y/%m/%d", "%y-%m-%d", "%d-%m-%y", "%m-%d-%y", "%d-%b-%Y", "%d-%b-%y", "%d %b %Y",
)  # fmt: skip
MAX_RATE_ERROR = 0.01  # share by which a nominal rate may differ from that of a clock
UNDATED_YEAR = 1900  # year of times without date; dates in this year or before have no known day
HOUR_FORMATS = [f"%{hours}.%f{half}" for hours, half in (("H:%M:%S", ""), ("I:%M:%S", " %p"))]
HOUR_FORMATS += [hours.replace(".%f", ":%f") for hours in HOUR_FORMATS]
WHOLE_SECONDS = r"(?<![:\d])(\d\d?:\d\d:\d\d)(?![.:\d])"  # a time among others with fractions
ZONE_PATTERN = r":\d\d[^+\-Z]*(?:Z|[+-]\d\d(?::?\d\d)?)$"  # time zone at the end of a time
TIME_FORMATS = [f"{day} {hour}" for day in DAY_FORMATS for hour in HOUR_FORMATS] + HOUR_FORMATS


def find_instants(
    table: FileTable, time: TimeColumn
) -> pd.DatetimeIndex | pd.TimedeltaIndex | None:
    """Parse a file's column of dates or times of day; return None if it contains numbers.

    Raises FileError if a day cannot be distinguished from a month, and for anything but a time.
    """
    name, column = time.column, table.column(time.column)
    if column.dtype.kind in "mM":
        return pd.Index(column)
    if column.dtype.kind not in "OUT" or time.unit is not None:
        return None
    text = pd.Series(column).astype("string").str.strip().str.replace(",", ".")
    text = text.str.replace(WHOLE_SECONDS, r"\1.0", regex=True)
    if pd.to_numeric(text, errors="coerce").notna().sum() >= text.notna().sum() / 2:
        return None
    first = text.dropna()[:1]
    dates = [pd.to_datetime(text, format="ISO8601", utc=True, errors="coerce")]
    if not text.str.contains(ZONE_PATTERN).any():
        dates[0] = dates[0].dt.tz_localize(None)
    if dates[0].isna().all():
        forms = [form for form in TIME_FORMATS
                 if pd.to_datetime(first, format=form, errors="coerce").notna().all()]  # fmt: skip
        dates += [pd.to_datetime(text, format=form, errors="coerce") for form in forms]
    n_most = max(stamps.notna().sum() for stamps in dates)
    dates = [stamps for stamps in dates if stamps.notna().sum() == n_most]
    strange = np.flatnonzero(text.notna() & dates[0].isna())
    if len(strange):
        what = "is neither a number nor a time, such as 2026-01-31T12:00:00.04"
        raise table.cell_error(int(strange[0]), name, what)
    if any(not (stamps - stamps.min()).equals(dates[0] - dates[0].min()) for stamps in dates):
        raise table.cell_error(0, name, "may be day or month first; write dates as 2026-01-31")
    stamps = pd.DatetimeIndex(dates[0])
    if any(not stamps.equals(pd.DatetimeIndex(other)) for other in dates):  # the day is unknown
        stamps -= pd.Timestamp(UNDATED_YEAR + 200, 1, 1) - pd.Timestamp(UNDATED_YEAR, 1, 1)
    if ":" in first.iloc[0][:3]:  # without a date: they go on after midnight
        days = np.cumsum(np.diff(stamps, prepend=stamps[:1]) < -pd.Timedelta(hours=12))
        stamps += pd.to_timedelta(days, "D")
    _check_fractions(table, name, stamps)
    return stamps


def _check_fractions(table: FileTable, name: str, stamps: pd.DatetimeIndex) -> None:
    """Refuse times whose milliseconds lack leading zeros: `12:00:00.40` comes before `.120`."""
    steps = np.diff(stamps.dropna().asi8)
    if not steps.min(initial=0) < 0 < steps.max(initial=0):
        return
    text = pd.Series(table.column(name)).astype("string")
    fractions = text.str.extract(r":\d\d:\d\d[.:,](\d+)", expand=False)
    if fractions.str.len().nunique() > 1:
        for row in np.flatnonzero(fractions.str.fullmatch(r"\d+0").fillna(False)):
            what = "is among times that go back, with fractions of a second of other lengths"
            raise table.cell_error(int(row), name, f"{what}; write milliseconds as three digits")


def compute_seconds(
    table: FileTable, mapping: ColumnMapping, times: pd.Index | None
) -> tuple[np.ndarray, str, float]:
    """Convert the column of times of a file to seconds since the first sample.

    Returns the seconds, the first time as a date, '' if the times have none, and the first time in
    the clock of the file, s.
    """
    name = mapping.time.column if mapping.time else ""  # a rate alone has no empty column
    if mapping.rate is not None:
        values = _count_times(table, mapping, mapping.rate)
    elif isinstance(times, pd.DatetimeIndex) and times.notna().any():
        first = times.min()
        seconds = np.asarray((times - first).total_seconds(), float)
        dated = first.isoformat() if first.year > UNDATED_YEAR else ""
        return seconds, dated, first.timestamp()
    elif isinstance(times, pd.TimedeltaIndex):
        values = times.total_seconds().to_numpy(float)
    elif times is not None:
        values = np.full(len(times), np.nan)
    else:
        unit = mapping.time.unit if mapping.time else None
        values = table.numbers(name) * table.convert(name, unit, partial(factor, wanted="s"))
    if not np.isfinite(values).any():
        raise FileError(f"{table.label(name)} is empty")
    return values - np.nanmin(values), "", float(np.nanmin(values))


def _count_times(table: FileTable, mapping: ColumnMapping, rate: float) -> np.ndarray:
    """Compute the times of samples, s, at a rate, 1/s, by their count or by their rows."""
    if mapping.time is None:
        _check_rate(table, rate)
        return np.arange(len(table.column(mapping.columns[0].column))) / rate
    name = mapping.time.column
    if unit := table.unit(name):
        raise FileError(
            f"{table.label(name)} has the unit {unit} and counts no samples; leave out the rate"
        )
    counts = table.numbers(name)
    for row in np.flatnonzero(np.isfinite(counts) & (counts != np.round(counts))):
        raise table.cell_error(int(row), name, "is no count of samples; leave out the rate")
    return counts / rate


def _check_rate(table: FileTable, rate: float) -> None:
    """Raise FileError if a column of times with a unit shows another rate than the given one.

    Times of a coarse clock, in which several samples have the same time, are not compared. Where
    times are rounded, their mean step is right; where samples are missing, their median step is.
    """
    for name in filter(is_time, table.columns):
        try:
            steps = np.diff(table.numbers(name) * factor(table.unit(name), wanted="s"))
        except (FileError, UnitError):
            continue
        if len(steps) == 0 or not np.all(steps > 0.0):
            continue
        step = float(np.median(steps))
        if min(abs(step * rate - 1.0), abs(steps.mean() * rate - 1.0)) > MAX_RATE_ERROR:
            raise FileError(
                f"{table.label(name)} has a sample every {step:.4g} s, and the rate is {rate:g} "
                "Hz; leave out the rate, or the column"
            )


def sort_samples(
    table: FileTable, time: np.ndarray, values: np.ndarray, rows: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[str]]:
    """Sort samples by time and drop repeated rows; also return a note on each correction."""
    notes = []
    timeless = ~np.isfinite(time)
    if timeless.any():
        notes.append(f"{timeless.sum()} rows without a time were left out, row {rows[timeless][0]}")
        time, values, rows = time[~timeless], values[~timeless], rows[~timeless]
    if (joined := _join_restarts(time)) is not None:
        back = rows[np.flatnonzero(np.diff(time) < 0)[0] + 1]
        notes.append(
            f"the clock starts again in row {back}: what follows is a recording of its own"
        )
        time = joined
    backward = np.flatnonzero(np.diff(time) < 0) + 1
    if len(backward):
        more = f" and {len(backward) - 1} more" if len(backward) > 1 else ""
        notes.append(f"times go back in row {rows[backward[0]]}{more}: rows were sorted by time")
        order = np.argsort(time, kind="stable")
        time, values, rows = time[order], values[order], rows[order]
    repeated = np.flatnonzero(np.diff(time) == 0) + 1
    if len(repeated):
        of_time = pd.DataFrame(values).groupby(time)
        has_conflict = of_time.nunique().gt(1).any(axis=1)
        strange = repeated[has_conflict[time[repeated]]]
        if len(strange):
            raise FileError(
                f"{table.path}: row {rows[strange[0]]} has a time that was there before, and other "
                "values; if the clock is coarse, say --rate; if these are two recordings, put each "
                "in a file of its own"
            )
        notes.append(f"{len(repeated)} repeated rows were dropped, first row {rows[repeated[0]]}")
        values = of_time.first().to_numpy(copy=True)
        time, rows = (np.delete(each, repeated) for each in (time, rows))
    return time, values, rows, notes


def _join_restarts(time: np.ndarray) -> np.ndarray | None:
    """Concatenate the parts of a file, times (n,), in which the clock restarts.

    Between two parts there is a gap as long as all before. None if the clock does not restart: if
    fewer than MIN_SAMPLES rows are out of order, or parts do not overlap.
    """
    edges = [0, *(np.flatnonzero(np.diff(time) < 0) + 1), len(time)]
    parts = [time[a:b] for a, b in pairwise(edges)]
    ordered = sorted(parts, key=lambda part: part[0])
    overlap = max((np.sum(one >= other[0]) for one, other in pairwise(ordered)), default=0)
    if overlap < MIN_SAMPLES or min(map(len, parts)) < MIN_SAMPLES:
        return None
    joined = [parts[0]]
    for part in parts[1:]:
        end = joined[-1][-1]
        joined.append(part - part[0] + end + (end - time[0]))
    return np.concatenate(joined)
