"""Building blocks of the settings: strict types, and metadata of each key."""

import json
import re
from collections.abc import Sequence
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field
from pydantic_core import PydanticCustomError

DECIMAL = re.compile(r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?")
DIGITS = re.compile(r"[-+]?[0-9]{1,300}")  # written out: a float would round them


class Section(BaseModel):
    """Base class of settings sections: unknown keys and values of a wrong type are errors."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, validate_default=True)


def show(value: object) -> str:
    """Format a value as text of at most 60 characters, as a user would write it in YAML."""
    match value:
        case None | bool():
            text = json.dumps(value)
        case float():
            text = f"{value:.12g}"
        case tuple():  # only validated lists are tuples
            text = f"[{', '.join(map(show, value))}]"
        case _:
            text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def list_first(items: Sequence[str], most: int = 1) -> str:
    """List the first items as text, such as the files of a message, and count the others."""
    more = f" and {len(items) - most} more" if len(items) > most else ""
    return ", ".join(items[:most]) + more


def make_error(text: str, *below: str) -> PydanticCustomError:
    """Make the pydantic error of a failed check; `below`: the keys from its field to the fault."""
    return PydanticCustomError("invalid", "{text}", {"text": text, "below": below})


def _as_number(value: Any) -> Any:
    # YAML 1.1 wants a point and a signed exponent, so `1e-3` arrives as text; so does every number
    # inside the braces of `--config 'figures={"dpi": 100}'`.
    if isinstance(value, str) and DECIMAL.fullmatch(value):
        return float(value)
    return value


def _as_integer(value: Any) -> Any:
    if isinstance(value, str) and DIGITS.fullmatch(value):
        return int(value)
    value = _as_number(value)
    return int(value) if isinstance(value, float) and value.is_integer() else value


def _check_nonempty(values: tuple) -> tuple:
    if not values:
        raise make_error("[] is empty; must hold at least one")
    return values


def _check_distinct(values: tuple) -> tuple:
    written: dict[str, object] = {}
    for value in values:
        text = f"{value:.12g}" if isinstance(value, float) else str(value)  # as cells are named
        if text in written:
            other = written[text]
            if value == other:
                raise make_error(f"{show(value)} is given twice; must be distinct")
            raise make_error(f"{value!r} and {other!r} agree to twelve digits; must be distinct")
        written[text] = value
    return values


def real(**bounds: Any) -> Any:
    """Make the pydantic type of a finite float within bounds (gt, ge, lt, le)."""
    return Annotated[float, Field(allow_inf_nan=False, **bounds), BeforeValidator(_as_number)]


def whole(**bounds: Any) -> Any:
    """Make the pydantic type of an integer within bounds (gt, ge, lt, le)."""
    return Annotated[int, Field(**bounds), BeforeValidator(_as_integer)]


def one_of(names: tuple[str, ...]) -> Any:
    """Make the pydantic type of a text that must be one of `names`."""
    return Literal[names]


def listing(*items: Any) -> Any:
    """Make the pydantic type of a list from the types of its items.

    `...` after the type of an item allows any number of such items. YAML has no tuples, so only
    here a list is accepted as one.
    """
    types: Any = items
    return Annotated[tuple[types], Field(strict=False)]


def distinct(item: Any, **schema: int) -> Any:
    """Make the type of a list of different items; `schema` has further JSON schema entries."""
    unique = Field(strict=False, json_schema_extra={**schema, "uniqueItems": True})
    return Annotated[tuple[item, ...], unique, AfterValidator(_check_distinct)]


def selection(item: Any) -> Any:
    """Make the pydantic type of a list with at least one item and no two equal items."""
    # Not by min_length, which would not count invalid items.
    return Annotated[distinct(item, minItems=1), AfterValidator(_check_nonempty)]


def setting(default: Any, description: str, unit: str = "") -> Any:
    """Make a pydantic field of the settings from its default value, description and unit."""
    return Field(default, description=description, json_schema_extra={"unit": unit})


Name = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]{0,39}$")]
