"""Units of columns, in SI. A unit is never guessed."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from functools import cache
from types import MappingProxyType

AMOUNT = re.compile(r"((?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)?\s*(.*)", re.DOTALL)
WITH_UNIT = re.compile(r"(?P<bare>.*\S)\s*(\[(?P<unit>[^\[\]]*)\]|\((?P<round>[^()]*)\))")
NONE = MappingProxyType({})
LENGTH_OF_ORDER = {0: "m", 1: "m/s", 2: "m/s^2"}


class UnitError(ValueError):
    """A unit that is missing, unknown or of the wrong kind; one line."""


@cache
def _registry():
    from pint import UnitRegistry

    registry = UnitRegistry(autoconvert_offset_to_baseunit=True)
    return registry


def factor(unit: str, wanted: str) -> float:
    """What values in `unit` are multiplied by to be in `wanted`, an SI unit.

    `1` is a pure number. `g` is gram in SI; for accelerations write `g_n`. Raises UnitError.
    """
    import pint

    try:
        source = _registry().parse_units("" if unit in ("1", "-", "") else unit)
        target = _registry().parse_units("" if wanted in ("1", "") else wanted)
        return float(_registry().Quantity(1.0, source).to(target).magnitude)
    except pint.UndefinedUnitError as error:
        raise UnitError(f"unit {unit!r} is not known; must be such as mm, m/s^2 or g_n") from error
    except pint.DimensionalityError as error:
        hint = "; an acceleration of gravity is written g_n" if unit == "g" else ""
        if wanted == "1":
            hint = "; the displacements of a line are the states q_v and q_w"
        raise UnitError(f"unit {unit!r} does not measure {wanted}{hint}") from error
    except Exception as error:  # pint's parser raises many kinds
        raise UnitError(f"unit {unit!r} cannot be read") from error


def is_unit(text: str) -> bool:
    """Whether a text is a unit of something, such as `mm`; a number alone is none."""
    try:
        return text[:1].isalpha() and bool(_registry().parse_units(text).dimensionality)
    except Exception:  # pint's parser raises many kinds
        return False


def named(header: str) -> tuple[str, str]:
    """Name and unit of a column from its header: `v [mm]`, or `v (mm)` where that is a unit."""
    match = WITH_UNIT.fullmatch(header.strip())
    if match and (match["unit"] is not None or is_unit(match["round"])):
        return match["bare"], (match["unit"] or match["round"] or "").strip()
    return header.strip(), ""


def amount(text: str | float, unit: str, wanted: str) -> float:
    """A number in `wanted`, an SI unit, from text such as `3 mm`; without a unit it is in `unit`.

    Raises UnitError.
    """
    number, own = AMOUNT.fullmatch(str(text).strip()).groups()
    if not number:
        raise UnitError(f"{text!r} is not a number with a unit, such as '3 mm'")
    return float(number) * factor(own or unit, wanted)


def state_unit(name: str) -> str:
    """The SI unit of a state of a line, by its name: q_v m, dq_v m/s, ddq_v m/s^2; else `1`."""
    stem = name.lstrip("d")
    if stem in ("q_v", "q_w"):
        return LENGTH_OF_ORDER.get(len(name) - len(stem), "1")
    return "1"


def input_si(unit: str) -> tuple[float, str]:
    """What values of an input are multiplied by, and the unit that they are in then, one of SI.

    A unit of SI by itself stays, and one that does not begin at zero, such as degC. Raises
    UnitError.
    """
    try:
        own = _registry().Quantity(1.0, "" if unit in ("1", "-") else unit)
        if not own._is_multiplicative:
            return 1.0, unit
        base = own.to_base_units()
    except Exception as error:  # pint's parser raises many kinds
        raise UnitError(f"unit {unit!r} is not known; must be such as m/s, N or 1") from error
    if base.magnitude == 1.0:
        return 1.0, unit
    return float(base.magnitude), f"{base.units:~C}".replace("**", "^") or "1"


def coefficient_unit(
    state: str, exponents: Sequence[int], names: Sequence[str], inputs: Mapping[str, str] = NONE
) -> str:
    """SI unit of a term's coefficient in the equation of a state, such as m^-1 s^-2, or `1`.

    names: of states and inputs, as many as exponents. inputs: the unit of each, '' where it is not
    known: it then stands as [U].
    """
    metres, seconds = _dimension(state)
    powers = Counter(m=metres, s=seconds - 1)
    for name, power in zip(names, exponents, strict=True):
        if power and name in inputs:
            own = _symbols(inputs[name]) if inputs[name] else {f"[{name}]": 1}
        else:
            own = dict(zip("ms", _dimension(name), strict=True))
        powers.subtract({symbol: power * each for symbol, each in own.items()})
    parts = [f"{symbol}^{power}" for symbol, power in powers.items() if power]
    return " ".join(parts).replace("^1 ", " ").removesuffix("^1") or "1"


def _symbols(unit: str) -> dict[str, int]:
    """Powers of the symbols in a unit."""
    parsed = _registry().parse_units("" if unit == "1" else unit)
    return {_registry().get_symbol(name): power for name, power in parsed._units.items()}


def _dimension(name: str) -> tuple[int, int]:
    """Powers of m and s of a state."""
    return {"1": (0, 0), "m": (1, 0), "m/s": (1, -1), "m/s^2": (1, -2)}[state_unit(name)]
