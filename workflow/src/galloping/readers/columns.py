"""Interpretation of column names: a time, a motion in a direction, or another quantity."""

import re
from collections.abc import Collection, Iterable, Set

from galloping.readers.units import MOTION_UNITS, is_same_quantity, split_header

# stems of words, and whole words if they are short: English, German, some Romance and Chinese words
TIME_STEMS = {"time", "zeit", "uhr", "elapsed", "temps", "tiempo", "时间"}
# words that contain the stem `time` and do not mean time
TIME_LOOKALIKES = re.compile("altimet|[cd]entimet|[cd]ecimet|sentimet|centime")
TIMES_LIKE_TEMPERATURE = {"temps", "tempo"}  # French and Italian words for time
TIME_WORDS = TIMES_LIKE_TEMPERATURE | {"t", "ts", "date", "datum", "sec", "seconds"}
DIRECTIONS = {
    "v": ({"vertic", "vertik", "senkrecht", "heave", "垂直", "竖向"}, {"vert", "v", "qv", "av"}),
    "w": (
        {"horizont", "horisont", "orizzont", "lateral", "transvers", "waagrecht", "waagerecht",
         "quer", "sway", "水平", "横向"},
        {"horiz", "hor", "horz", "lat", "trans", "w", "h", "qw", "aw", "ah"},
    ),
}  # fmt: skip
DIRECTION_LETTERS = {"v", "w", "h"}  # directions if the unit is a length, else maybe velocities
SHORT_WORDS = DIRECTION_LETTERS | {"lat", "trans"}  # ambiguous alone: `lat` may be a latitude
KINDS = (  # stems and words of displacements, velocities and accelerations
    ({"displ", "auslenk", "verschieb", "位移"},
     {"disp", "weg", "position", "pos", "amplitude", "q"}),
    ({"veloc", "geschwind", "vitesse", "速度"}, {"vel", "speed"}),
    ({"accel", "beschleun", "加速"}, {"acc", "a", "av", "aw", "ah"}),
)  # fmt: skip
OTHER_QUANTITIES = (  # stems and words of quantities other than the motion in two directions
    {"wind", "gust", "temp", "press", "druck", "humid", "feucht", "tension", "force", "kraft",
     "batt", "record", "counter", "index", "status", "quality", "angle", "winkel", "voltage",
     "strain", "dehn", "stress", "spannung", "moment", "torque", "tilt", "neig", "rotat", "inclin",
     "longitud", "längs", "axial", "current", "strom"},
    {"ice", "eis", "load", "rain", "zug", "rn", "no", "nr", "id", "flag", "long", "lon", "pitch",
     "roll", "yaw", "msl"},
)  # fmt: skip
COUNT_WORDS = {"frame", "frames", "bild", "sample", "samples", "index", "count", "counter", "scan",
          "sequence", "point", "record", "nr", "no", "n", "rn"}  # fmt: skip
STATE = re.compile(r"(d{0,2})q_?([vw])", re.IGNORECASE)
DATE_PATTERN = re.compile(r"\d{1,4}[-/.]\d{1,2}[-/.]\d{1,4}|\d{1,2}:\d\d")


def split_words(header: str) -> set[str]:
    """Split the name of a column into its words in lower case, without numbers and unit.

    Chinese 加速度, an acceleration, becomes 加速: 速度 alone is a velocity.
    """
    spaced = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", split_header(header)[0]).replace("加速度", "加速")
    return {word.casefold() for word in re.findall(r"[^\W\d_]+", spaced)}


def _has_word(words: set[str], stems: set[str], whole: Set[str] = frozenset()) -> bool:
    return bool(words & whole) or any(stem in word for word in words for stem in stems)


def is_time(header: str) -> bool:
    """Decide from its name whether a column contains times."""
    is_labview = split_header(header)[0] == "X_Value"
    words = {word for word in split_words(header) if not TIME_LOOKALIKES.search(word)}
    return is_labview or (_has_word(words, TIME_STEMS, TIME_WORDS) and not is_beside_motion(header))


def is_count(header: str) -> bool:
    """Decide from its name whether a column counts the samples."""
    return bool(split_words(header) & COUNT_WORDS)


def is_beside_motion(header: str) -> bool:
    """Decide from its name whether a column measures another quantity than the motion."""
    return _has_word(split_words(header) - TIMES_LIKE_TEMPERATURE, *OTHER_QUANTITIES)


def derivative_order(header: str, unit: str) -> int | None:
    """Determine whether a column is a displacement (0), a velocity (1) or an acceleration (2).

    It follows from its unit or, if it has none, from its name; None if its unit is of another
    quantity.
    """
    if unit:
        return next((k for k, si in enumerate(MOTION_UNITS) if is_same_quantity(unit, si)), None)
    words = split_words(header)
    kinds = [order for order, kind in enumerate(KINDS) if _has_word(words, *kind)]
    return kinds[0] if len(kinds) == 1 else 0


def measured_quantity(header: str, unit: str = "") -> str:
    """Determine which motion a column measures, such as `q_v` (vertical), by its name and unit.

    header: name of the column, with or without its unit. unit: of the column if the header has
    none. Returns '' if name and unit do not determine a direction and a kind of motion, or
    contradict each other.
    """
    name, own_unit = split_header(header)
    unit = own_unit or unit
    if state := STATE.fullmatch(name):
        return f"{state[1].lower()}q_{state[2].lower()}"
    axis, kinds, word = _direction_and_kinds(header, unit)
    orders = [k for k, si in enumerate(MOTION_UNITS) if is_same_quantity(unit, si)]
    is_contradicted = kinds and orders and kinds != orders
    if not axis or len(kinds) > 1 or (unit and not orders) or is_contradicted:
        return ""
    is_short = not kinds and word in SHORT_WORDS
    if is_short and (orders == [1] or (not orders and word not in DIRECTION_LETTERS)):
        return ""
    return "d" * (kinds or orders or [0])[0] + "q_" + axis


def quantity_by_name_alone(header: str, unit: str = "") -> str:
    """Return the motion that a column's name indicates if its unit contradicts that, else ''."""
    name, own_unit = split_header(header)
    axis, kinds, word = _direction_and_kinds(name, "")
    is_clear = axis and (kinds or word not in SHORT_WORDS)
    is_contradicted = (own_unit or unit) and not measured_quantity(header, unit)
    return measured_quantity(name) if is_clear and is_contradicted else ""


def is_no_direction(header: str, alike: Collection[str], names: Iterable[str]) -> bool:
    """Decide whether the letter of a name is no direction, by the names of other columns.

    v and w beside u are axes; h without a vertical motion is a height, if its name says no velocity
    or acceleration; beside the height hMSL of a satellite receiver, hAcc and vAcc are accuracies.
    alike: names of columns of the same kind. names: of all columns.
    """
    _, kinds, letter = _direction_and_kinds(header, "")
    if letter not in DIRECTION_LETTERS:
        return False
    if re.fullmatch("[hv]Acc", split_header(header)[0]):
        return any(split_header(name)[0] == "hMSL" for name in names)
    axis_u = re.sub(r"(?i)(?<![^\W\d_])[vw](?![^\W\d_])", lambda v: "uU"[v[0].isupper()], header)
    is_height = (
        letter == "h"
        and kinds in ([], [0])
        and not any(_direction_and_kinds(name, "")[0] == "v" for name in names)
    )
    is_axis = letter != "h" and axis_u != header and axis_u in alike
    return is_height or is_axis


def _direction_and_kinds(header: str, unit: str) -> tuple[str, list[int], str]:
    """Determine direction and kinds of motion from the words of a name.

    The direction is `v` or `w`, '' if it is unclear; then come the orders of derivatives, and the
    weakest word for the direction: a letter, a short word, or '' for a plain one.
    """
    words = split_words(header)
    axes = [axis for axis, (stems, whole) in DIRECTIONS.items() if _has_word(words, stems, whole)]
    if len(axes) != 1 or _has_word(words, *OTHER_QUANTITIES):
        return "", [], ""
    stems, whole = DIRECTIONS[axes[0]]
    is_plain = _has_word(words, stems, whole - SHORT_WORDS)
    weakest = (
        "" if is_plain else min(words & whole, key=lambda word: (word in DIRECTION_LETTERS, word))
    )
    has_kind = {word for word in words if len(word) > 1 or not unit}  # A may number a sensor
    kinds = [order for order, kind in enumerate(KINDS) if _has_word(has_kind, *kind)]
    return axes[0], kinds, weakest
