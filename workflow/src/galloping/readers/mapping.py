"""Mapping of a file's columns: states or their rates, units, places along the span."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationError,
    field_validator,
    model_validator,
)

from galloping.configuration.yaml_file import read
from galloping.fields import show
from galloping.model.terms import parse_known, parse_library
from galloping.readers.file_table import read_table
from galloping.readers.proposal import PROPOSAL_ROWS, Proposal, list_states, propose
from galloping.readers.units import split_header

PROBLEM_TEXTS = {  # instead of messages of pydantic that name types of Python
    "extra_forbidden": "there is no such key",
    "tuple_type": "must be a list",
    "model_type": "must be a section of keys",
    "too_short": "must hold at least 1",
    "float_type": "must be a number",
    "float_parsing": "must be a number",
    "string_type": "must be text",
}
MAX_PROBLEMS = 3  # problems listed in a message
NAME = re.compile(r"[^\W\d]\w*")
PERCENT = re.compile(r"\s*(\d+\.?\d*|\.\d+)\s*%\s*")
NUMBER = re.compile(r"(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?")


class MappingError(ValueError):
    """Error raised for an invalid description of the columns of a file."""


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)

    @field_validator("*", mode="before")
    @classmethod
    def _refuse_truth_value(cls, given: object) -> object:
        if isinstance(given, bool):  # pydantic would convert it to 0 or 1
            raise ValueError(f"{show(given)}: must be no truth value")
        return given


Texts = Annotated[  # one or several
    tuple[str, ...],
    BeforeValidator(lambda given: given if isinstance(given, list | tuple) else (given,)),
]


class TimeColumn(_Section):
    """Name and unit of the column of times in a file.

    unit: s, ms, min, ..., or none if the times are ISO 8601. With a `rate` of the mapping it counts
    samples, and has no unit.
    """

    column: str
    unit: str | None = None


class Channel(_Section):
    """Column of a file that measures a state of the system or a state's time derivative.

    measures: a state, or `d` and the name of one: its rate (`ddq_v`, an acceleration). position: m
    along the span, of a sensor on a line. delay: s by which the column lags behind the time. scale:
    `unknown` if a camera's scale is to be determined from an accelerometer. offset: whether a rate
    has no constant offset and slow drift, which accelerometers do; `unknown` by default. noise:
    standard deviation of a sample if it is known, such as `3 mm`; a number alone is in the unit of
    the column.
    """

    column: str
    measures: str
    unit: str | None = None
    position: float | None = Field(default=None, ge=0)
    delay: float = Field(default=0.0, ge=-3600, le=3600)
    scale: Literal["known", "unknown"] = "known"
    offset: Literal["known", "unknown"] = "unknown"
    noise: str | float | None = None


class InputColumn(_Section):
    """Column of a file with an input that drives the motion, such as the wind speed.

    name: in the library, by default that of the column. between, error: as of `recording.Input`;
    error may be text such as `2 %`, and an unspecified `between` is determined from the motion.
    delay: s by which the column lags behind the time.
    """

    column: str
    name: str = ""
    unit: str | None = None
    between: Literal["zero", "linear", "cubic"] | None = None
    error: float = Field(default=0.0, ge=0.0, lt=1.0)
    delay: float = Field(default=0.0, ge=-3600, le=3600)

    @model_validator(mode="before")
    @classmethod
    def _expand_text(cls, given: object) -> object:
        """Expand a text to the name of a column, and convert an error in percent."""
        keys = {"column": given} if isinstance(given, str) else given
        if not isinstance(keys, dict):
            return keys
        column, unit = split_header(str(keys.get("column", "")))
        keys = {"name": column, **({"unit": unit} if unit else {}), **keys}
        if match := PERCENT.fullmatch(str(keys.get("error", ""))):
            keys["error"] = float(match[1]) / 100
        return keys


class ColumnMapping(_Section):
    """Description of which columns of a file are times, states and inputs, with their units.

    time: the column of times. With a `rate`, samples per second, it is the column that counts
    samples; without such a column every row is a sample. states: of the system; a state named dX is
    the rate of X. inputs: that drive it. span: m, if channels have positions. decimal: the decimal
    mark of text files, by default found from their rows. library, known, random_force: as the
    command's options of these names.
    """

    time: TimeColumn | None = None
    rate: float | None = Field(default=None, gt=0, le=1e9)
    states: tuple[str, ...] = Field(min_length=1, max_length=12)
    channels: tuple[Channel, ...] = Field(min_length=1)
    inputs: tuple[InputColumn, ...] = ()
    library: Texts = ()
    known: Texts = ()
    random_force: Texts = ()
    span: float | None = Field(default=None, gt=0)
    decimal: Literal[".", ","] | None = None

    @model_validator(mode="after")
    def _check_consistency(self) -> "ColumnMapping":
        inputs = self.input_names
        for section, names in (("states", self.states), ("inputs", inputs)):
            for name in names:
                if not NAME.fullmatch(name):
                    raise ValueError(
                        f"{section}: {name!r} is not a name, which is letters, digits and _; say "
                        "what column it is: --measure q_v=COLUMN, --input U=COLUMN"
                    )
                if section == "inputs" and name in self.states:
                    raise ValueError(f"inputs: {name} is a state; name the input otherwise")
                if names.count(name) > 1:
                    raise ValueError(f"{section}: {name} is named twice")
        if self.time is None and self.rate is None:
            raise ValueError("time: is missing; name its column, or say the sampling rate (rate:)")
        if self.time and self.time.unit and self.rate:
            raise ValueError(
                f"rate: column {self.time.column!r} has a unit, {self.time.unit}, and counts no "
                "samples; must have one of both"
            )
        columns = [one.column for one in self.columns]
        for column in columns:
            if columns.count(column) > 1:
                raise ValueError(f"column {column!r} is named twice")
        for channel in self.channels:
            self.target(channel)
            if channel.position is None:
                continue
            if self.span is None:
                raise ValueError(
                    f"channels: {channel.column!r} has a position, so the mapping needs the span"
                )
            if not 0 < channel.position < self.span:
                raise ValueError(
                    f"channels: position {channel.position:g} m of {channel.column!r} is not "
                    f"inside the span of {self.span:g} m"
                )
        if self.library:
            parse_library(self.library, self.states, inputs)
        for text in self.known:
            parse_known(text, self.states, inputs)
        self.check_random_force(self.random_force, "random_force")
        return self

    def check_random_force(self, names: Sequence[str], key: str) -> None:
        """Raise ValueError unless the coordinates under random forces are states, or `all`.

        key: the option or key that names them, for the message.
        """
        for name in names:
            if name not in self.states and tuple(names) != ("all",):
                raise ValueError(f"{key}: {name!r}; must be all, or among {', '.join(self.states)}")

    def with_between(self, kinds: Mapping[str, str]) -> "ColumnMapping":
        """Return a copy that sets the interpolation of inputs where it is unspecified."""
        inputs = tuple(
            one.model_copy(update={"between": one.between or kinds.get(one.name)})
            for one in self.inputs
        )
        return self.model_copy(update={"inputs": inputs})

    @property
    def columns(self) -> tuple[TimeColumn | Channel | InputColumn, ...]:
        """All columns that are read: times, channels and inputs."""
        times = (self.time,) if self.time else ()
        return (*times, *self.channels, *self.inputs)

    @property
    def input_names(self) -> tuple[str, ...]:
        """Names of the inputs in the model, in the order of `inputs`."""
        return tuple(one.name for one in self.inputs)

    def target(self, channel: Channel) -> tuple[int, bool]:
        """Return the index of the state of a channel, and whether its derivative is measured."""
        if channel.measures in self.states:
            return self.states.index(channel.measures), False
        if channel.measures[:1] == "d" and channel.measures[1:] in self.states:
            return self.states.index(channel.measures[1:]), True
        raise ValueError(
            f"channels: {channel.column!r} measures {channel.measures!r}, which is neither a state "
            f"({', '.join(self.states)}) nor d and the name of one"
        )


SECTIONS: dict[object, type[_Section]] = {  # by their keys in a ColumnMapping
    "time": TimeColumn, "channels": Channel, "inputs": InputColumn,
}  # fmt: skip


def validate_mapping(content: object) -> ColumnMapping:
    """Convert nested dicts to a ColumnMapping; raise MappingError if they are invalid.

    The message has one line per problem.
    """
    try:
        return ColumnMapping.model_validate(content)
    except ValidationError as error:
        problems = {problem["loc"]: problem for problem in error.errors()}
    inner = {place[:1] for place in problems if len(place) > 1}
    lines = [
        _describe_problem(problem) for place, problem in problems.items() if place not in inner
    ]
    more = [f"and {len(lines) - MAX_PROBLEMS} more problems"] if len(lines) > MAX_PROBLEMS else []
    raise MappingError("\n".join([*lines[:MAX_PROBLEMS], *more]))


def _describe_problem(problem: Mapping[str, Any]) -> str:
    location = ".".join(str(key) for key in problem["loc"] if key not in ("str", "float"))
    message = problem["msg"].removeprefix("Value error, ")
    if problem["type"] == "value_error":
        return f"{location}: {message}" if location else message
    if problem["type"] == "missing":
        return f"{location}: is missing"
    message = PROBLEM_TEXTS.get(problem["type"]) or message.replace("Input should", "must")
    if problem["type"] == "extra_forbidden":
        section = SECTIONS.get(problem["loc"][0], ColumnMapping)
        message += f"; allowed: {', '.join(section.model_fields)}"
    return f"{location or 'mapping'}: {problem['input']!r:.60}: {message}"


def read_mapping(path: str | Path) -> ColumnMapping:
    """Read the description of the columns of recording files from a YAML file.

    Raises MappingError or ConfigurationError, whose lines begin with the file's name.
    """
    try:
        return validate_mapping(read(path))
    except MappingError as error:
        raise MappingError(f"{path}: {error}") from error


def parse_channel(text: str) -> dict:
    """Parse a text such as `q_v=mid[mm]@150` (state, column, unit, position) to a dict.

    Unit and position are optional. Returns plain values. Raises MappingError if the text has
    another form.
    """
    measures, _, source = text.partition("=")
    header, separator, position = source.partition("@")
    column, unit = split_header(header)
    if not measures.strip() or not column or (separator and not position.strip()):
        raise MappingError(
            f"--measure {text!r}: expected STATE=COLUMN[UNIT]@POSITION, such as q_v=mid[mm]@150"
        )
    if separator and not NUMBER.fullmatch(position.strip()):
        raise MappingError(f"--measure {text!r}: position {position!r} is not a number of metres")
    channel = {"measures": measures.strip(), "column": column, "unit": unit, "position": position}
    return {key: value.strip() for key, value in channel.items() if value}


def parse_input(text: str, between: str | None = None) -> dict:
    """Parse a text such as `U=wind[m/s] +- 2 %` (input, column, unit, error) to a dict.

    All but the name of the input are optional. Returns plain values. Raises MappingError if the
    text has another form.
    """
    body, separator, error = text.partition("+-")
    name, equals, header = body.partition("=")
    column, unit = split_header(header if equals else name)
    percent = PERCENT.fullmatch(error)
    if not name.strip() or not column or bool(separator) != bool(percent):
        raise MappingError(
            f"--input {text!r}: expected NAME=COLUMN[UNIT] +- ERROR %, such as U or "
            "'U=wind[m/s] +- 2 %'"
        )
    name = name.strip() if equals else column
    keys = {"name": name, "column": column, "unit": unit, "error": error.strip()}
    return {key: value for key, value in {**keys, "between": between}.items() if value}


def _split_units(texts: Sequence[str]) -> tuple[dict[str, str], str | None]:
    """Parse units of columns, `COLUMN=UNIT`, and that of all others but the time, or None."""
    for_all, *more = [text for text in texts if "=" not in text] or [""]
    if more:
        raise MappingError(f"--unit: {for_all} and {more[0]}; must be one for all, or COLUMN=UNIT")
    return _parse_by_column("unit", [text for text in texts if "=" in text]), for_all or None


def _parse_by_column(option: str, texts: Sequence[str]) -> dict[str, str]:
    """Map the name of each column to the text in `COLUMN=TEXT`, values of an option."""
    by_column = dict(text.partition("=")[::2] for text in texts)
    if len(by_column) < len(texts) or "" in by_column.values():
        wanted = "must be one for each column, COLUMN=VALUE"
        raise MappingError(f"--{option}: {', '.join(texts)}; {wanted}")
    return by_column


def propose_mapping(file: str, options: Mapping[str, Any], taken: Sequence[str] = ()) -> Proposal:
    """Read a file, and propose what each column measures, from the names of the columns.

    options: as of `determine_mapping`. taken: columns of other quantities than the motion.
    """
    time = options["time_column"]
    table = read_table(file, options["decimal"], time, PROPOSAL_ROWS)
    return propose(table, *_split_units(options["units"]), time, taken, options["rate"])


def determine_mapping(file: str, options: Mapping[str, Any]) -> tuple[ColumnMapping, str]:
    """Determine what the columns of a file are from command-line options, else from their names.

    options: all of the command's options for columns, by name, None or () if they are not given.
    The second result describes how columns are read by their names alone, else ''.
    """
    if options["map_file"]:
        if any(given not in (None, ()) for name, given in options.items() if name != "map_file"):
            raise MappingError("--map stands alone: leave out all other options of columns")
        return read_mapping(options["map_file"]), ""
    channels = [parse_channel(text) for text in options["measures"]]
    driving = [parse_input(text, options["between"]) for text in options["inputs"]]
    by_column, for_all = _split_units(options["units"])
    proposal = propose_mapping(file, options, [one["column"] for one in driving])
    proposal.check_sure(file, [proposal.clock])
    states = [name.strip() for name in options["states"].split(",")] if options["states"] else []
    states, channels, reading = _choose_channels(file, proposal, states, channels)
    if not states:
        raise MappingError("--states: name the states of the system, such as x,y,z")
    if for_all:
        channels = [{"unit": for_all, **channel} for channel in channels]
    time = dict(proposal.time) if proposal.time else None
    _set_for_columns("unit", by_column, [*([time] if time else []), *channels, *driving])
    _set_for_columns("noise", _parse_by_column("noise", options["noises"]), channels)
    _set_for_columns("delay", _parse_by_column("delay", options["delays"]), [*channels, *driving])
    content = {"time": time, "states": states, "channels": channels, "inputs": driving}
    content |= {key: options[key] for key in ("decimal", "span", "rate")}
    return validate_mapping(content), reading


def _choose_channels(
    file: str, proposal: Proposal, states: list[str], channels: list[dict]
) -> tuple[list[str], list[dict], str]:
    """Choose states and channels, and describe how columns are read by their names alone.

    proposal: by the names of the columns. states, channels: those that the command names. Raises
    ValueError if names of columns must determine the channels, and do not.
    """
    if channels:
        return states or list_states(one["measures"] for one in channels), channels, ""
    named = [name for name in states if name in proposal.columns]
    if named and all(name in named or name[1:] in named for name in states):
        return states, [{"column": name, "measures": name} for name in named], ""
    if set(states) <= set(list_states(("q_v", "q_w"))):
        return states or proposal.states, proposal.sure_channels(file), f"{file}: {proposal}"
    return states, [{"column": name, "measures": name} for name in states], ""


def _set_for_columns(key: str, values: Mapping[str, str], columns: Sequence[dict]) -> None:
    """Set `key` of columns, in place, to the values of an option, by name.

    Raises MappingError for the name of none of the columns.
    """
    for column, value in values.items():
        matches = [one for one in columns if one["column"] == column]
        if not matches:
            raise MappingError(f"--{key}: no column {column!r} is measured")
        for one in matches:
            one[key] = value
