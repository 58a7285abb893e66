"""What the columns of a file measure, told from their names and units in plain words."""

import json
import re
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from galloping.readers.units import DIRECTION, ORDERS, behind, meaning, measures, named

if TYPE_CHECKING:
    from galloping.readers.file_table import FileTable

# Stems of words, and whole words where short; English, German, and some Romance and Chinese ones.
TIMES = {"time", "zeit", "timestamp", "uhr", "elapsed", "temps", "tiempo", "时间"}
TIME_WORDS = {"t", "ts", "date", "datetime", "datum", "sec", "seconds"}
DIRECTIONS = {
    "v": ({"vertic", "vertik", "senkrecht", "heave", "垂直", "竖向"}, {"vert", "v", "qv", "av"}),
    "w": (
        {"horizont", "lateral", "transvers", "waagrecht", "waagerecht", "quer", "sway", "水平",
         "横向"},
        {"horiz", "w", "h", "qw", "aw", "ah"},
    ),
}  # fmt: skip
LETTERS = {"v", "w", "h"}  # a direction where the unit is a length, else perhaps a velocity
KINDS = (  # of a displacement, a velocity and an acceleration
    ({"displac", "auslenk", "verschieb", "位移"}, {"disp", "weg", "position", "amplitude", "q"}),
    ({"veloc", "geschwind", "vitesse", "速度"}, {"vel", "speed"}),
    ({"accel", "beschleun", "加速"}, {"acc", "a", "av", "aw", "ah"}),
)
OTHERS = (  # what is recorded beside the motion
    {"wind", "gust", "temp", "press", "druck", "humid", "feucht", "tension", "force", "kraft",
     "batt", "record", "counter", "index", "status", "quality", "angle", "winkel", "voltage"},
    {"ice", "eis", "load", "rain", "zug", "rn", "no", "nr", "id", "flag"},
)  # fmt: skip
UP, ACROSS = ({letter, f"d{letter}", f"a{letter}", f"acc{letter}"} for letter in "zy")
ROWS = 2000  # of a text file, that its columns are told from
APART = 0.01  # of their length, by which the times of two clocks may differ
NO_UNIT = "the file says no unit"
STATE = re.compile(r"(d{0,2})q_?([vw])", re.IGNORECASE)
DATED = re.compile(r"\d{1,4}[-/.]\d{1,2}[-/.]\d{1,4}|\d{1,2}:\d\d")


def _words(header: str) -> set[str]:
    parted = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", named(header)[0])
    return {word.casefold() for word in re.findall(r"[^\W\d_]+", parted)}


def _among(words: set[str], stems: set[str], whole: set[str] = frozenset()) -> bool:
    return bool(words & whole) or any(stem in word for word in words for stem in stems)


def is_time(header: str) -> bool:
    """Whether a column is one of times, by its name or its unit."""
    words = _words(header)
    return _among(words, TIMES, TIME_WORDS) and not _among(words, *OTHERS)


def target(header: str, unit: str = "") -> str:
    """What a column measures, as `q_v` or `ddq_w`, by its name and unit; '' where that is not told.

    unit: where the name has none.
    """
    name, own = named(header)
    unit = own or unit
    if state := STATE.fullmatch(name):
        return f"{state[1].lower()}q_{state[2].lower()}"
    words = _words(header)
    of = [axis for axis, (stems, whole) in DIRECTIONS.items() if _among(words, stems, whole)]
    if len(of) != 1 or _among(words, *OTHERS):
        return ""
    told = [k for k, si in enumerate(ORDERS) if measures(unit, si)]
    kind = {word for word in words if len(word) > 1 or not told}  # A may number a sensor
    said = [k for k, (stems, whole) in enumerate(KINDS) if _among(kind, stems, whole)]
    letter_alone = not _among(words, DIRECTIONS[of[0]][0], DIRECTIONS[of[0]][1] - LETTERS)
    if len(said) > 1 or (unit and not told) or (letter_alone and told == [1] and said != [1]):
        return ""
    if said and told and said != told:
        return ""
    return "d" * (said or told or [0])[0] + "q_" + of[0]


@dataclass(frozen=True)
class Proposal:
    """How a file may be read.

    columns: of the file, with their units or ''. time, channels: as in a mapping. doubts: by
    column, what is no more than a guess, or is not said.
    """

    columns: dict[str, str]
    time: dict
    channels: list[dict]
    doubts: dict[str, str]

    @property
    def states(self) -> list[str]:
        """Of a span, those that the channels tell of."""
        return states_of(channel["measures"] for channel in self.channels)

    def sure(self, file: str) -> list[dict]:
        """The channels, where the names of the columns tell them. Raises ValueError."""
        if not self.channels:
            has = (f"{name!r}" + f" [{unit}]" * bool(unit) for name, unit in self.columns.items())
            raise ValueError(
                f"{file}: no column is plainly a vertical or horizontal displacement or "
                f"acceleration; it has {', '.join(has)}; say what is measured, such as "
                "--measure 'q_v=COLUMN [mm]'"
            )
        measures = {channel["column"]: channel["measures"] for channel in self.channels}
        for column, doubt in self.doubts.items():
            if doubt != NO_UNIT:  # which whoever reads the column says
                unit = "" if self.columns.get(column) else " [mm]"
                raise ValueError(
                    f"{file}: what column {column!r} measures is not plain ({doubt}): say so, such "
                    f"as --measure '{measures.get(column, 'q_v')}={column}{unit}', or check and "
                    "edit the mapping that "
                    f"`galloping inspect {file} --write-map map.yaml` writes"
                )
        return self.channels

    def __str__(self) -> str:
        read = (
            f"{channel['column']!r} is read as the {meaning(channel['measures'])} "
            f"{channel['measures']}"
            for channel in self.channels
        )
        return ", ".join([*read, f"{self.time['column']!r} as the time"])

    def _unused(self) -> list[str]:
        used = {self.time["column"], *(channel["column"] for channel in self.channels)}
        others = [name for name in self.columns if name not in used]
        winds = [name for name in others if "wind" in " ".join(_words(name))]
        return [
            *(f"not used: {name}" for name in others if name not in winds),
            *(f"inputs: [{{name: U, column: {json.dumps(name)}}}]" for name in winds),
        ]

    def yaml(self, file: str, decimal: str | None) -> str:
        """The text of a mapping to check and edit."""

        def line(keys: dict, more: str = "") -> str:
            doubt = self.doubts.get(keys["column"], "")
            keys = keys | ({"unit": None} if NO_UNIT in doubt else {})
            said = ", ".join(filter(None, [more, doubt and f"CHECK: {doubt}"]))
            pairs = (f"{key}: {json.dumps(keys[key], ensure_ascii=False)}" for key in keys)
            return f"{{{', '.join(pairs)}}}" + (f"  # {said}" if said else "")

        return "\n".join(
            [
                f"# How the columns of {file} are read, told from their names: check each line.",
                f"time: {line(self.time)}",
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
        )


def states_of(targets: Iterable[str]) -> list[str]:
    """The states of a span that channels tell of: displacements, then velocities."""
    stems = {name.lstrip("d") for name in targets}
    own = [stem for stem in DIRECTION if stem in stems]
    return own + [f"d{stem}" for stem in own]


def proposal(
    table: "FileTable",
    units: Mapping[str, str],
    for_all: str | None,
    time: str | None,
    taken: Collection[str] = (),
) -> Proposal:
    """How a file may be read, by what its columns are called.

    units: that are said of columns; for_all: of all but the times. time: the column of times, where
    that is said. taken: columns of something else. What the names do not tell is guessed from the
    order of the columns, and doubted.
    Raises ValueError where no column can be one of times, or none one of the motion.
    """
    doubts: dict[str, str] = {}
    clock = clock_of(table, time, doubts)

    def said(name: str) -> str:
        return units.get(name) or (for_all if name != clock else "") or behind(name)

    def written(name: str, **measures: str) -> dict:
        unit = {"unit": said(name)} if said(name) and not table.unit(name) else {}
        return {"column": name, **measures, **unit}

    others = [
        name
        for name in table.columns
        if name != clock and name not in taken and table.kind(name) != "date"
    ]
    channels = [
        written(name, measures=measured)
        for name in others
        if (measured := target(name, units.get(name) or table.unit(name) or said(name)))
    ]
    for each in channels:
        same = [c["column"] for c in channels if c["measures"] == each["measures"]]
        if len(same) > 1:
            doubts[each["column"]] = (
                f"{' and '.join(map(repr, same))} are each the {meaning(each['measures'])}: keep "
                "the best, or give each its position"
            )
    if not channels:
        likely = [
            (name, order)
            for name in sorted(others, key=_by_axis)
            if table.kind(name) == "number" and not _among(_words(name), *OTHERS)
            if (order := _order(table.unit(name) or said(name))) is not None
        ]
        for stem, (name, order) in zip(DIRECTION, likely, strict=False):
            channels.append(written(name, measures="d" * order + stem))
            doubts[name] = "it could only be guessed, from its place among the columns"
    for name in (clock, *(each["column"] for each in channels)):
        if not (table.unit(name) or said(name) or (name == clock and table.kind(name) != "number")):
            doubts[name] = "; ".join(filter(None, [doubts.get(name), NO_UNIT]))
    columns = {name: table.unit(name) for name in table.columns}
    return Proposal(columns, written(clock), channels, doubts)


def _by_axis(name: str) -> tuple[bool, bool]:
    """Names with an upward axis z come before those with another one y, and these before others."""
    return not _words(name) & UP, not _words(name) & ACROSS


def _order(unit: str) -> int | None:
    """Of the derivative that a unit is one of: 0 of a displacement, as without a unit."""
    return next((k for k, si in enumerate(ORDERS) if not unit or measures(unit, si)), None)


def clock_of(table: "FileTable", said: str | None, doubts: dict[str, str]) -> str:
    """The column of times: where several may be, the one that tells most instants apart.

    Raises ValueError where there is none, and where two are clocks that run apart.
    """
    if said is not None:
        table.column(said)
        return named(said)[0]
    found = [
        name
        for name in table.columns
        if is_time(name) or table.kind(name) == "date" or measures(table.unit(name), "s")
    ]
    if not found:
        found = [name for name in table.columns if _increases(table, name)][:1]
        doubts |= dict.fromkeys(
            found, "it could only be guessed to be the time, as its values increase"
        )
    if not found:
        raise ValueError(
            f"{table.path}: no column of times; it has {', '.join(map(repr, table.columns))}; name "
            "it with --time, or add one"
        )
    clock = max(found, key=lambda name: len(pd.unique(table.columns[name])))
    alike = (name for name in found if table.unit(name) == table.unit(clock) != "")
    spans = {name: float(np.ptp(table.columns[name])) for name in alike if _increases(table, name)}
    for name, span in spans.items():
        if abs(span - spans.get(clock, span)) > APART * span:
            raise ValueError(
                f"{table.path}: the times {clock!r} and {name!r} run apart, over "
                f"{spans[clock]:.6g} and {span:.6g}: bring all samples to one clock, or say --time"
            )
    return clock


def _increases(table: "FileTable", name: str) -> bool:
    values = table.columns[name]
    rises = values.dtype.kind in "fiu" and len(values) > 1 and np.all(np.diff(values) > 0)
    return bool(rises) and not _among(_words(name), *OTHERS)
