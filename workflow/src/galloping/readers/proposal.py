"""Proposed mapping of a file, by the names, units and values of its columns."""

import json
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np
import pandas as pd

from galloping.readers.columns import (
    derivative_order,
    is_beside_motion,
    is_count,
    is_no_direction,
    is_time,
    measured_quantity,
    quantity_by_name_alone,
    split_words,
)
from galloping.readers.file_table import FileTable
from galloping.readers.hints import likely_unit, measure_option, unit_in_name, unit_options
from galloping.readers.units import (
    DIRECTION,
    MOTION_UNITS,
    is_pixel,
    is_same_quantity,
    is_unit,
    meaning,
    split_header,
    state_unit,
    unit_suffix,
)

PROPOSAL_ROWS = 2000  # rows of a text file that are read to interpret its columns
CLOCK_TOLERANCE = 0.01  # relative difference of the durations by two clocks
AXIS_NAMES = [{axis, f"d{axis}", f"a{axis}", f"acc{axis}"} for axis in "zy"]  # up, then across
RATE_WORDS = {"fs", "fsamp", "rate", "samplerate", "samplingrate", "framerate", "fps", "hz"}
INTERVAL_WORDS = {"dt", "ts", "interval"}  # sampling intervals, s


@dataclass(frozen=True)
class Doubt:
    """Reason why the interpretation of a column is uncertain, and what to specify instead.

    cause: why the reading is uncertain; '' if only the unit is missing. remedy: what to specify
    instead, with options to copy. lacks_unit: whether the file has no unit.
    """

    cause: str = ""
    remedy: str = ""
    lacks_unit: bool = False

    def __str__(self) -> str:
        return "; ".join(filter(None, [self.cause, "the file says no unit" * self.lacks_unit]))


@dataclass(frozen=True)
class Proposal:
    """Proposed interpretation of the columns of a file, with what is uncertain in it.

    columns: of the file. content: description of the file's contents. time: as in a mapping; None
    if the times are those of rows at a rate. channels: as in a mapping. doubts: by column, what is
    guessed or missing.
    """

    columns: tuple[str, ...]
    content: str
    time: dict | None
    channels: list[dict]
    doubts: dict[str, Doubt] = field(default_factory=dict)

    @property
    def clock(self) -> str | None:
        """Name of the column of times, None if there is none."""
        return self.time["column"] if self.time else None

    @property
    def states(self) -> list[str]:
        """Names of the states of a span that the proposed channels measure."""
        return list_states(channel["measures"] for channel in self.channels)

    def check_sure(self, file: str, columns: Iterable[str | None]) -> None:
        """Raise ValueError if the interpretation of one of the columns is only guessed."""
        for column in columns:
            doubt = self.doubts.get(column or "")
            if doubt and doubt.cause:
                raise ValueError(f"{file}: {doubt.cause}; {doubt.remedy}")

    def sure_channels(self, file: str) -> list[dict]:
        """Return the channels; raise ValueError if the column names do not determine them."""
        if not self.channels:
            raise ValueError(
                f"{file}: no column is plainly a vertical or horizontal displacement or "
                f"acceleration; it has {self.content}; say what is measured, such as "
                "--measure 'q_v=COLUMN [mm]'"
            )
        self.check_sure(file, [each["column"] for each in self.channels])
        return self.channels

    def __str__(self) -> str:
        parts = [
            f"{channel['column']!r} is read as the {meaning(channel['measures'])} "
            f"{channel['measures']}"
            for channel in self.channels
        ]
        return ", ".join(parts + ([f"{self.clock!r} as the time"] if self.clock else []))

    def _unused(self) -> list[str]:
        used = {self.clock, *(channel["column"] for channel in self.channels)}
        others = [name for name in self.columns if name not in used]
        winds = [name for name in others if "wind" in " ".join(split_words(name))]
        return [
            *(f"not used: {name}" for name in others if name not in winds),
            *(f"inputs: [{{name: U, column: {json.dumps(name)}}}]" for name in winds),
        ]

    def yaml(self, file: str, decimal: str | None, rate: float | None) -> str:
        """Format the proposal as YAML text, which the user checks and edits."""

        def line(keys: dict, more: str = "") -> str:
            doubt = self.doubts.get(keys["column"], Doubt())
            keys = keys | ({"unit": None} if doubt.lacks_unit else {})
            comment = ", ".join(filter(None, [more, str(doubt) and f"CHECK: {doubt}"]))
            pairs = (f"{key}: {json.dumps(keys[key], ensure_ascii=False)}" for key in keys)
            return f"{{{', '.join(pairs)}}}" + (f"  # {comment}" if comment else "")

        lines = [
            f"# How the columns of {file} are read, by their names: check each line.",
            *([f"time: {line(self.time)}"] if self.time else []),
            *([f"rate: {rate:g}"] if rate else []),
            *([f"decimal: {json.dumps(decimal)}"] if decimal else []),
            "# Displacements of the span's first mode, in m, and their rates, the velocities:",
            f"states: [{', '.join(self.states)}]",
            "# measures: a state, or d and a state for its rate; ddq_v is an acceleration.",
            "# Also position (m along the span, then with span: on a line of its own),",
            "# delay (s), noise (such as 3 mm), scale: unknown, offset: known.",
            "channels:",
            *(f"  - {line(each, meaning(each['measures']))}" for each in self.channels),
            *(f"# {each}" for each in self._unused()),
            "",
        ]
        return "\n".join(lines)


def list_states(targets: Iterable[str]) -> list[str]:
    """Return the states of a span for measured quantities, such as q_v and dq_v for `ddq_v`.

    Displacements come before velocities.
    """
    stems = {name.lstrip("d") for name in targets}
    displacements = [stem for stem in DIRECTION if stem in stems]
    return displacements + [f"d{stem}" for stem in displacements]


def propose(
    table: FileTable,
    units: Mapping[str, str],
    for_all: str | None,
    time: str | None,
    taken: Collection[str] = (),
    rate: float | None = None,
) -> Proposal:
    """Propose what each column of a file measures, from the names, units and values.

    What the names do not determine is guessed from the order of the columns, and has a doubt.
    units: specified units of columns. for_all: specified unit of all columns but the times. time:
    specified column of times, whose unit may follow its name. taken: columns of other quantities
    than the motion. rate: samples per second; times are then those of rows, or of a column that
    counts samples. Raises ValueError if no column can contain times, or two have different clocks.
    """
    doubts: dict[str, Doubt] = {}
    clock = find_clock(table, time, doubts, rate, f"name it with --time, or {_hint_rate(table)}")

    if clock and time:
        units = {clock: split_header(time)[1], **units}

    def unit_of(name: str) -> str:
        beside_file = (for_all if name != clock else "") or unit_suffix(name)
        return units.get(name) or table.unit(name) or beside_file

    def as_entry(name: str, **measured: str) -> dict:
        unit = unit_of(name)
        return {"column": name, **measured} | ({"unit": unit} if unit != table.unit(name) else {})

    length = len(table.columns[clock]) if clock else max(map(len, table.columns.values()))
    others = [
        name
        for name, values in table.columns.items()
        if name != clock and name not in taken and len(values) == length
        if not is_time(name) and (name in table.unclear or table.kind(name) != "date")
    ]
    order = {name: derivative_order(name, unit_of(name)) for name in others}
    channels = [
        as_entry(name, measures=quantity)
        for name in others
        if (quantity := measured_quantity(name, unit_of(name)))
        if not is_no_direction(name, [n for n in others if order[n] == order[name]], table.columns)
    ]
    for each in channels:
        same = [c["column"] for c in channels if c["measures"] == each["measures"]]
        if len(same) > 1:
            cause = f"{' and '.join(map(repr, same))} are each the {meaning(each['measures'])}"
            remedy = "say which one counts, or give each its position: "
            remedy += measure_option(each["measures"], each["column"])
            doubts[each["column"]] = Doubt(cause, remedy)
    for name in others:
        if quantity := quantity_by_name_alone(name, unit_of(name)):
            channels.append({"column": name, "measures": quantity})
            doubts[name] = _doubt_unit_against_name(name, quantity, unit_of(name))
    if not channels:
        clear = [name for name in others if name not in table.unclear]
        for quantity, name in _guess_channels(table, clear, unit_of).items():
            channels.append(as_entry(name, measures=quantity))
            unit = "" if table.unit(name) else unit_of(name) or _guess_unit(table, name, clear)
            doubts[name] = Doubt(
                f"the name of column {name!r} does not say what it measures, which could only be "
                "guessed from its place among the columns",
                f"say so, such as {measure_option(quantity, name, unit)}, or check and edit the "
                f"mapping that `galloping inspect {table.path} --write-map map.yaml` writes",
            )
    for name in (clock, *(each["column"] for each in channels)):
        if name is None or unit_of(name):
            continue
        if name == clock and (rate is not None or table.kind(name) != "number"):
            continue
        doubt = doubts.get(name, Doubt())
        doubts[name] = Doubt(doubt.cause, doubt.remedy, lacks_unit=True)
    times = as_entry(clock) if clock else None
    return Proposal(tuple(table.columns), table.content, times, channels, doubts)


def _doubt_unit_against_name(name: str, quantity: str, unit: str) -> Doubt:
    si_unit, why = state_unit(quantity), "a pixel is no length"
    if not is_pixel(unit):
        why = f"unit {unit!r} measures something else" if is_unit(unit) else f"{unit!r} is no unit"
    return Doubt(
        f"column {name!r} is the {meaning(quantity)} by its name, and {why}",
        f"say what one of its numbers is, such as {unit_options([(name, f'2.5 m{si_unit}')])}, or "
        "say with --measure which columns count",
    )


def _guess_channels(table: FileTable, names: Iterable[str], unit_of) -> dict[str, str]:
    """Guess which columns measure the motion, the vertical one first: by their axes and order.

    A constant column is no motion.
    """
    by_axis = sorted(
        names, key=lambda name: [split_words(name).isdisjoint(axis) for axis in AXIS_NAMES]
    )
    likely = [
        (name, order)
        for name in by_axis
        if table.kind(name) == "number" and not is_beside_motion(name) and not is_count(name)
        if (order := derivative_order(name, unit_of(name))) is not None
        if len(pd.unique(table.columns[name])) > 1
    ]
    return {
        "d" * order + stem: name for stem, (name, order) in zip(DIRECTION, likely, strict=False)
    }


def _guess_unit(table: FileTable, name: str, others: Iterable[str]) -> str:
    order = derivative_order(name, "") or 0
    alike = [each for each in others if derivative_order(each, "") == order and each != name]
    numbers = [table.numbers(each) for each in (name, *alike) if table.kind(each) == "number"]
    return unit_in_name(name, MOTION_UNITS[order]) or likely_unit(order, numbers[0], numbers[1:])


def find_clock(
    table: FileTable,
    specified: str | None,
    doubts: dict[str, Doubt],
    rate: float | None = None,
    remedy: str = "name it with --time, or add one",
) -> str | None:
    """Find the column of times in a file, or the sample counter if a sampling rate is given.

    Of several it is the one with most distinct times. A guess is noted in `doubts`. Raises
    ValueError if there is none, or if two have different clocks.
    """
    if specified is not None:
        table.column(specified)
        return split_header(specified)[0]
    if rate is not None:
        counts = (name for name in table.columns if is_count(name) and _is_counter(table, name))
        return next(counts, None)
    clocks = [
        name
        for name in table.columns
        if is_time(name)
        or is_same_quantity(table.unit(name), "s")
        or (name not in table.unclear and table.kind(name) == "date")
    ]
    if not clocks:
        clocks = [name for name in table.columns if _is_increasing(table, name)][:1]
        if clocks:
            doubts[clocks[0]] = _doubt_clock(table, clocks[0])
    if not clocks:
        raise ValueError(f"{table.path}: no column of times; it has {table.content}; {remedy}")
    clock = max(clocks, key=lambda name: len(pd.unique(table.columns[name])))
    _check_clocks(table, clock, clocks)
    return clock


def _check_clocks(table: FileTable, clock: str, names: Iterable[str]) -> None:
    """Raise ValueError if another column of times has another duration or begin than the clock.

    Durations of columns without a unit may differ, as their units may. The begins are compared only
    if the durations agree and the names share a word: `uptime` may count from another moment.
    """
    if not _is_increasing(table, clock):
        return
    clock_times, unit = table.columns[clock].astype(float), table.unit(clock)
    for name in names:
        if table.unit(name) != unit or not _is_increasing(table, name):
            continue
        times, how = table.columns[name].astype(float), ""
        shares_word = not split_words(name).isdisjoint(split_words(clock))
        span, late = np.ptp(times), abs(times[0] - clock_times[0])
        if abs(span - np.ptp(clock_times)) > CLOCK_TOLERANCE * span:
            how = f"run apart, over {np.ptp(clock_times):.6g} and {span:.6g}" if unit else ""
        elif np.median(np.diff(clock_times)) < late < span and shares_word:
            how = f"begin {late:.6g} apart"
        if how:
            raise ValueError(
                f"{table.path}: the times {clock!r} and {name!r} {how}: bring all samples to one "
                f"clock, or say which counts, --time {clock!r}"
            )


def _doubt_clock(table: FileTable, name: str) -> Doubt:
    rate = _hint_rate(table)
    if table.is_headless:
        last = len(table.columns)
        return Doubt(
            f"no row names the columns, which are 1 to {last} by their place",
            f"say what they hold, such as --time {name} --unit {name}=s --measure 'q_v={last} [m]'"
            + f", or {rate}" * _is_counter(table, name),
        )
    if _is_counter(table, name):
        return Doubt(f"no column is plainly the time, and {name!r} counts samples", rate)
    return Doubt("no column is plainly the time", f"say --time {name!r} or so, or {rate}")


def _hint_rate(table: FileTable) -> str:
    return f"say the sampling rate in Hz, such as --rate {_find_rate(table)} (rate: in a mapping)"


def _find_rate(table: FileTable) -> str:
    """Return the sampling rate that a number of the file has by its name, else 25."""
    for name, value in table.scalars.items():
        bare = "".join(split_words(name))
        inverse = 1.0 / value if bare in INTERVAL_WORDS and value else np.nan
        rate = value if bare in RATE_WORDS else inverse
        if 0.0 < rate < np.inf:
            return f"{rate:g}"
    return "25"


def _is_increasing(table: FileTable, name: str) -> bool:
    values = table.columns[name]
    rises = values.dtype.kind in "fiu" and len(values) > 1 and np.all(np.diff(values) > 0)
    return bool(rises) and (is_count(name) or not is_beside_motion(name))


def _is_counter(table: FileTable, name: str) -> bool:
    """Decide whether a column has whole numbers that mostly rise by one."""
    values = table.columns[name]
    if values.dtype.kind not in "fiu":
        return False
    numbers = values[np.isfinite(values)]
    whole = len(numbers) > 1 and np.all(numbers == np.round(numbers))
    return bool(whole and np.median(np.diff(numbers)) == 1)
