"""Channels of a file, checked and in SI units, with notes on all corrections."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import combinations
from pathlib import Path

import numpy as np

from galloping.arrays import finest_step
from galloping.fields import list_first
from galloping.identification.inputs import MIN_SAMPLES
from galloping.progress_reports import passing
from galloping.readers import MAX_LISTED_NAMES, FileError
from galloping.readers.columns import measured_quantity, quantity_by_name_alone
from galloping.readers.file_table import MAX_NAME_LENGTH, FileTable, read_table
from galloping.readers.hints import (
    is_clock_reading,
    likely_input_unit,
    likely_time_unit,
    likely_unit,
    unit_in_name,
    unit_options,
)
from galloping.readers.input_columns import count_rows_per_sample, read_inputs
from galloping.readers.mapping import Channel, ColumnMapping, InputColumn, TimeColumn
from galloping.readers.times import compute_seconds, find_instants, sort_samples
from galloping.readers.units import (
    BRACKETED_UNIT,
    MOTION_UNITS,
    TIME_SYMBOL,
    UnitError,
    input_si,
    parse_quantity,
    split_header,
    state_si,
    state_unit,
)
from galloping.recording.samples import Input
from galloping.recording.shared_rows import find_shared_rows

MISSING_CODES = (  # values of either sign that loggers write for missing samples
    99, 999, 9999, 99999, 999999, 9999999, 99.9, 99.99, 999.9, 999.99, 999.25, 9999.9, 9999.99,
    6999, 7999, 32767, 32768,
)  # fmt: skip
MIN_FILL_VALUE = 1e10  # smallest fill value of missing samples; 1e20 is usual
MIN_STUCK_RATIO = 20  # length of a run of one value of a stuck sensor over nearly all other runs
# share of such a run in which all other sensors also rest: above, the motion rests
JOINT_REST_SHARE = 0.9
MAX_REST_SPEED = 0.35  # speed over the usual speed of a motion that comes to rest or begins
CORRELATION_MARGIN = 1e-9  # largest 1 - correlation of two copies of a channel
MAX_WRAP_RATIO = 4.0  # step of an angle over the end of a turn, over its largest other step
FULL_TURNS = {"rad": (2.0 * np.pi,), "1": (360.0, 2.0 * np.pi)}  # full turns by unit of an angle
COLUMN_HINTS = {  # hints on a missing column, by its kind
    TimeColumn: "--time names the column of the times (time: in a mapping)",
    InputColumn: "an input has a column of its name, or of that in --input NAME=COLUMN",
    Channel: "--measure STATE=COLUMN says which column measures what (channels: in a mapping)",
}
HINT_FOR_MODEL = "columns have the names of the model's inputs; --time names that of the times"


@dataclass(frozen=True)
class Series:
    """Channels and inputs of one file on a common time axis, in SI units.

    time: (n,) s since `start`, strictly increasing. start: ISO 8601 or ''. values: (n, n_channels)
    NaN where missing, in the order of the mapping's channels. rows: (n,) row of each sample in the
    file. notes: a line for each correction. noise: (n_channels,) known deviation of a sample, NaN
    where unknown. inputs: by name, on the same time axis. units: of the inputs, by name. unused:
    ignored columns. unused_motion: those of them that measure motion of a span, by their names.
    origin: s, the first time by the clock of the file, of dates since 1970.
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
        """Note that lists the ignored columns of the file, '' if there are none."""
        names = list_first([f"{name:.{MAX_NAME_LENGTH}}" for name in self.unused], MAX_LISTED_NAMES)
        more = "to use a wind among them, add --input U=COLUMN"
        return f"columns that are not used: {names}; {more}" if names else ""


def _is_for_model(mapping: ColumnMapping) -> bool:
    """Decide whether a file contains nothing but the inputs of a model, by their names."""
    return not mapping.channels and all(one.column == one.name for one in mapping.inputs)


def read_series(path: str | Path, mapping: ColumnMapping) -> Series:
    """Read a file to channels in SI units; raise FileError if the file is unusable.

    Rows out of order are sorted, repeated ones dropped if they agree; both are noted.
    """
    passing(Path(path).name)
    table = read_table(path, mapping.decimal, mapping.time.column if mapping.time else None)
    for each in mapping.columns:
        try:
            table.column(each.column)
        except FileError as error:
            if split_header(each.column)[0] in table.columns:
                raise
            hint = HINT_FOR_MODEL if _is_for_model(mapping) else COLUMN_HINTS[type(each)]
            raise FileError(f"{error}; {hint}") from None
    instants = None
    if mapping.time and mapping.rate is None:
        instants = find_instants(table, mapping.time)
    _check_units(table, mapping, mapping.rate is None and instants is None)
    time, start, origin = compute_seconds(table, mapping, instants)
    notes, columns, units = list(table.notes), [], {}
    measured: tuple[Channel | InputColumn, ...] = (*mapping.channels, *mapping.inputs)
    for one in measured:
        of_file = table.column(one.column).dtype
        column, codes = _replace_codes(table.numbers(one.column), of_file)
        notes += [
            f"column {one.column!r}: {count} samples of {code:g}, a code for missing ones, were "
            "left out"
            for code, count in codes.items()
        ]
        if len(column) != len(time):
            clock = f"the times {mapping.time.column!r} have" if mapping.time else "the others have"
            raise FileError(
                f"{table.label(one.column)} has {len(column)} rows, {clock} {len(time)}"
            )
        if isinstance(one, Channel):
            if of_file.kind == "b":
                raise FileError(
                    f"{table.label(one.column)} contains true and false, and no measured motion"
                )
            to_state = partial(state_si, target=one.measures)
            scale, unit = table.convert(one.column, one.unit, to_state)
            if unit != state_unit(one.measures):
                notes.append(
                    f"column {one.column!r} is read in {unit}; numbers of {one.measures} are "
                    "printed without this unit"
                )
        else:
            scale, unit = table.convert(one.column, one.unit, input_si)
            units[one.name] = unit
        for turn in FULL_TURNS.get(unit, ()):
            column, n_wraps = unwrap_angle(column, turn / scale)
            if n_wraps:
                notes.append(
                    f"column {one.column!r} is an angle that starts again after {turn / scale:g}, "
                    f"{n_wraps} times: unwrapped"
                )
        columns.append(scale * column)
    for k, stuck in enumerate(_find_stuck(columns[: len(mapping.channels)])):
        if stuck.any():
            columns[k] = np.where(stuck, np.nan, columns[k])
            name, row = mapping.channels[k].column, np.argmax(stuck) + table.first_row
            notes.append(
                f"column {name!r}: {stuck.sum()} samples of a sensor that was stuck, from row "
                f"{row} on, were left out"
            )
    for measures in dict.fromkeys(channel.measures for channel in mapping.channels):
        group = [channel for channel in mapping.channels if channel.measures == measures]
        if len(group) > 1 and all(channel.position is None for channel in group):
            names = list_first([repr(channel.column) for channel in group], MAX_LISTED_NAMES)
            notes.append(f"columns {names} are averaged as {measures}: they have no position")
    rows = np.arange(len(time)) + table.first_row
    time, values, rows, more = sort_samples(table, time, np.column_stack(columns), rows)
    n_channels = len(mapping.channels)
    inputs = read_inputs(table, mapping.inputs, time, values[:, n_channels:])
    values = values[:, :n_channels]
    if len(time) < MIN_SAMPLES and n_channels:
        raise FileError(f"{table.path}: {len(time)} rows are fewer than the {MIN_SAMPLES} needed")
    for channel, column in zip(mapping.channels, values.T, strict=True):
        if (repeats := _find_repeats(column)).any():
            column[repeats] = np.nan
            more.append(
                f"column {channel.column!r} repeats each sample of a slower sensor: "
                f"{repeats.sum()} repetitions were left out"
            )
        samples = column[np.isfinite(column)]
        if len(samples) < MIN_SAMPLES:
            raise FileError(
                f"{table.label(channel.column)} has {len(samples)} samples, fewer than the "
                f"{MIN_SAMPLES} needed"
            )
        if np.ptp(samples) == 0:
            raise FileError(
                f"{table.label(channel.column)} is {samples[0]:g} throughout: the sensor did not "
                "work"
            )
    _check_distinct(table, mapping, values)
    noise = np.array([_known_noise(table, channel) for channel in mapping.channels])
    used_columns = {split_header(each.column)[0] for each in mapping.columns}
    unused = tuple(name for name in table.columns if name not in used_columns)
    of_motion = tuple(
        name
        for name in unused
        if measured_quantity(name, table.unit(name))
        or quantity_by_name_alone(name, table.unit(name))
    )
    return Series(
        table.path, time, start, values, rows, (*notes, *more), noise, inputs, units, unused,
        of_motion, origin,
    )  # fmt: skip


def unwrap_angle(values: np.ndarray, turn: float) -> tuple[np.ndarray, int]:
    """Remove the jumps of a full turn from samples of an angle, and count these jumps.

    Jumps are removed if all samples are within one turn and reach both of its ends, and if the
    steps over the end, minus a turn, are like the others. The angle of a valve that opens by more
    than half a turn does not wrap. values: (n,) NaN where missing. turn: a full turn in the unit of
    the values. Returns the angle without jumps, (n,), shifted by whole turns so that its median is
    within half a turn of zero, or the values if they do not wrap; and the number of jumps that were
    removed.
    """
    is_finite = np.isfinite(values)
    angle = values[is_finite]
    steps = np.abs(np.diff(angle))
    jumps = steps > turn / 2.0
    if not jumps.any() or jumps.all() or np.ptp(angle) > turn * (1.0 + 1e-9):
        return values, 0
    largest = steps[~jumps].max()
    over = np.abs(turn - steps[jumps]).max()
    if turn - np.ptp(angle) > 2.0 * largest or over > MAX_WRAP_RATIO * largest:
        return values, 0
    unwrapped = np.unwrap(angle, period=turn)
    continuous = values.copy()
    continuous[is_finite] = unwrapped - turn * np.round(np.median(unwrapped) / turn)
    return continuous, int(jumps.sum())


def _check_distinct(table: FileTable, mapping: ColumnMapping, values: np.ndarray) -> None:
    """Refuse two channels of different quantities whose samples are the same up to a factor."""
    for a, b in combinations(range(values.shape[1]), 2):
        first, second = mapping.channels[a], mapping.channels[b]
        both = np.isfinite(values[:, a] + values[:, b])
        if first.measures == second.measures or both.sum() < MIN_SAMPLES:
            continue
        deviations = values[both][:, (a, b)] - values[both][:, (a, b)].mean(axis=0)
        size = np.linalg.norm(deviations, axis=0)
        if size.all() and np.prod(deviations / size, axis=1).sum() > 1.0 - CORRELATION_MARGIN:
            raise FileError(
                f"{table.path}: columns {first.column!r} and {second.column!r} hold the same "
                f"samples, and cannot measure both {first.measures} and {second.measures}"
            )


def check_no_shared_rows(series: Sequence[Series]) -> None:
    """Check that no file repeats rows of another file; raise FileError if one does."""
    if shared := find_shared_rows([one.values for one in series]):
        first, second, row = shared
        raise FileError(
            f"{series[second].path}: row {series[second].rows[row]} and those after it are also in "
            f"{series[first].path}: a recording counts once"
        )


def _find_stuck(columns: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Find samples, (n,) boolean of each column, at which a sensor is stuck.

    They repeat the one before, in a run MIN_STUCK_RATIO times as long as nearly all others, unless
    the sensor rests. It rests together with the other columns, or from the first sample on, or it
    slows down before and speeds up after. A column with a single value is not stuck.
    """
    is_repeated = [_find_held(values) for values in columns]
    all_rest = np.all(is_repeated, axis=0) & (len(is_repeated) > 1)
    stuck_samples = []
    for values, repeats in zip(columns, is_repeated, strict=True):
        stuck = repeats.copy()
        edges = np.flatnonzero(np.diff(np.r_[False, repeats, False].astype(int)))
        for first, end in edges.reshape(-1, 2):
            alone = not all_rest[first:end].mean() > JOINT_REST_SHARE
            first_of_all = first <= 1 and len(is_repeated) == 1
            if not alone or first_of_all or _is_slow(values, int(first) - 1, int(end)):
                stuck[first:end] = False
        stuck_samples.append(stuck)
    return stuck_samples


def _find_held(values: np.ndarray) -> np.ndarray:
    """Find samples that repeat the one before in a long run, (n,) boolean."""
    changes = np.append(True, np.diff(values) != 0.0)
    runs = np.diff(np.append(np.flatnonzero(changes), len(values)))
    least = MIN_STUCK_RATIO * np.quantile(runs, 0.99, method="lower")
    length = np.repeat(runs, runs)
    return ~changes & (length >= max(least, MIN_STUCK_RATIO)) & (len(runs) > 1)


def _find_repeats(values: np.ndarray) -> np.ndarray:
    """Find samples, (n,) boolean, that only repeat those of a slower sensor.

    A motion that is merely resolved coarsely changes by the finest step.
    """
    finite_rows = np.flatnonzero(np.isfinite(values))
    steps, repeats = np.diff(values[finite_rows]), np.zeros(len(values), bool)
    rows = count_rows_per_sample(values[finite_rows])
    if rows > 1 and np.median(np.abs(steps[steps != 0.0])) > 1.5 * finest_step(values):
        edges = np.flatnonzero(np.append(True, steps != 0.0))
        runs = np.diff(edges, append=len(finite_rows))
        position = np.arange(len(finite_rows)) - np.repeat(edges, runs)
        n_rows = np.repeat(np.maximum(np.round(runs / rows), 1), runs)  # samples of a run
        repeats[finite_rows] = (position % rows > 0) | (position >= rows * n_rows)
    return repeats


def _is_slow(values: np.ndarray, first: int, end: int) -> bool:
    """Decide whether values (n,) change slowly before sample `first` and after sample `end`."""
    speed = np.abs(np.diff(values))
    width = max(min((end - first) // 4, len(speed) // 50), 4)
    usual = np.convolve(np.nan_to_num(speed), np.ones(width) / width, mode="valid")
    most = MAX_REST_SPEED * np.quantile(usual, 0.95)
    sides = speed[max(first - width, 0) : first], speed[end - 1 : end - 1 + width]
    return all(np.nanmean(side) <= most for side in sides if np.isfinite(side).any())


def _replace_codes(values: np.ndarray, of_file: np.dtype) -> tuple[np.ndarray, dict[float, int]]:
    """Replace codes for missing samples, such as -9999, by NaN, and count them.

    A code is a value that loggers use for this purpose, and farther from all others than these are
    from each other. of_file: type of the numbers in the file, which may have rounded the codes.
    """
    codes = np.asarray(MISSING_CODES, of_file if of_file.kind == "f" else float)
    distinct_values, counts = np.unique(values[np.isfinite(values)], return_counts=True)
    fill = np.abs(distinct_values) >= MIN_FILL_VALUE
    is_code = np.isin(np.abs(distinct_values), codes) | (fill & (fill.sum() == 1))
    others = distinct_values[~is_code]
    if not is_code.any() or not len(others):
        return values, {}
    is_code &= np.abs(distinct_values - (others[0] + others[-1]) / 2) > 1.5 * np.ptp(others)
    counts_by_code = dict(
        zip(distinct_values[is_code].tolist(), counts[is_code].tolist(), strict=True)
    )
    return np.where(np.isin(values, distinct_values[is_code]), np.nan, values), counts_by_code


def _check_units(table: FileTable, mapping: ColumnMapping, of_time: bool) -> None:
    """Refuse columns without a unit, all of them in one line. of_time: whether times need one."""

    def lacks(one: TimeColumn | Channel | InputColumn) -> bool:
        return not (one.unit or table.unit(one.column))

    bare: list[tuple[str, str]] = []
    if of_time and mapping.time and lacks(mapping.time):
        name = mapping.time.column
        times = table.numbers(name)
        if is_clock_reading(times):
            raise FileError(
                f"{table.label(name)} has no unit, and its numbers look like times of a day, "
                "HHMMSS; write them with colons, such as 12:30:00"
            )
        bare.append((name, unit_in_name(name, "s") or likely_time_unit(times)))
    for one in filter(lacks, mapping.channels):
        si = state_unit(one.measures)
        alike = [each.column for each in mapping.channels if state_unit(each.measures) == si]
        bare.append((one.column, _likely_unit(table, one.column, si, alike)))
    bare += [(one.column, likely_input_unit(one.column)) for one in filter(lacks, mapping.inputs)]
    if bare:
        names, several = ", ".join(repr(name) for name, _ in bare), len(bare) > 1
        options = f"add {unit_options(bare)} if that is right (unit: in a mapping), or "
        options = "" if _is_for_model(mapping) else options
        raise FileError(
            f"{table.path}: column{'s' * several} {names} {'have' if several else 'has'} no unit; "
            f"{options}write the unit behind the column's name, in []"
        )


def _likely_unit(table: FileTable, name: str, si: str, alike: Sequence[str]) -> str:
    """Guess the unit of a channel from its name, else from its samples and those of columns alike.

    Raises FileError if the name ends in brackets that contain no unit.
    """
    if si not in MOTION_UNITS:
        return "1"
    if unit := unit_in_name(name, si):
        return unit
    if (match := BRACKETED_UNIT.fullmatch(name)) and match["round"] not in (None, TIME_SYMBOL):
        raise FileError(
            f"{table.label(name)} has no unit: {match['round']!r} is no unit; say what one number "
            f"is, such as {unit_options([(name, f'2.5 m{si}')])}"
        )
    return likely_unit(MOTION_UNITS.index(si), table.numbers(name), map(table.numbers, alike))


def _known_noise(table: FileTable, channel: Channel) -> float:
    if channel.noise is None:
        return np.nan
    unit = channel.unit or table.unit(channel.column)
    try:
        noise = parse_quantity(channel.noise, unit, channel.measures)
        if not 0.0 < noise < np.inf:
            raise UnitError(f"{channel.noise}; must be above 0")
    except UnitError as error:
        raise FileError(f"{table.path}: noise of column {channel.column!r}: {error}") from error
    return noise
