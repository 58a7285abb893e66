"""Units of columns, in SI. A unit is never guessed."""

import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from types import MappingProxyType
from typing import Any

import numpy as np

from galloping.model.polynomial import Exponents, velocity_pairs
from galloping.readers.unit_definitions import DEFINITIONS, PREFIXES

AMOUNT = re.compile(r"((?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)?\s*(.*)", re.DOTALL)
BRACKETED_UNIT = re.compile(
    r"(?P<bare>.*\S)\s*(\[(?P<unit>[^\[\]]*)\]|[(（](?P<round>[^()（）]*)[)）])"
)
INNER_UNIT = re.compile(r"[(\[]([^()\[\]]*)[)\]]")  # a unit anywhere: `Position (m) Run #1`
EMPTY_MAPPING: Mapping[str, Any] = MappingProxyType({})
# a unit without brackets: `v, mm`, `v / mm` and `v in mm`
TRAILING_UNIT = re.compile(r"(?P<bare>.*[^\s,/])(?:\s*[,/]\s*|\s+in\s+)(?P<unit>[^\s,]+)")
# Units that need no brackets after a name. Other words after a comma are part of the name.
UNBRACKETED_UNITS = {
    *(f"{prefix}m" for prefix in ("", "c", "d", "m", "µ", "μ", "u")), "s", "ms", "min", "sec",
    *(f"{of}m/s{power}" for of in ("", "c", "m") for power in ("", "2", "^2", "²")), "ft", "inch",
    "metres", "meters", "metre", "meter", "seconds", "millimetres", "millimeters", "g_n",
}  # fmt: skip
SPELLINGS = (  # spellings of loggers, and their equivalents in pint
    (r"\bsek(unden?)?\b", "s"),
    (r"(?<=[a-zµμ])-(?=\d)", "^-"),
    (r"(?<=[a-zµμ])(?=\d)", "^"),
    (r"(?<=[a-z0-9])[.·](?=[a-z])", "*"),
    (r"\b([cmµμu]?m)s\^-([12])", r"\1/s^\2"),  # ms^-2 is m s^-2: nothing is measured per ms^2
)
# Valid units are factors with one exponent each: pint evaluates powers as Python does, and would
# not return from `m**9**9**9`.
MAX_UNIT_LENGTH = 40  # characters
FACTOR = r"(?:1|[^\W\d_][^\W\d]*|°[CF]?|%|Ω)(?:(?:\^|\*\*)?[-+]?\d{1,2}|[⁺⁻]?[⁰¹²³⁴-⁹])?"
EXPRESSION = re.compile(rf"[\s(]*{FACTOR}(?:[\s()*/.·]+{FACTOR})*[\s)]*")
# a number and a unit, such as `0.85 mm`
SCALED_UNIT = re.compile(r"(\d+\.?\d*(?:[eE][-+]?\d{1,3})?|\.\d+)\s*([^\W\d].*|[°%].*)")
TIME_SYMBOL = "t"  # in round brackets: `x (t)` is a function of time, not in tonnes
PIXELS = {"px", "pix", "pixel", "pixels"}
DIRECTION = {"q_v": "vertical", "q_w": "horizontal"}
MOTION_UNITS = ("m", "m/s", "m/s^2")  # units of displacements, velocities and accelerations
QUANTITIES = {  # meanings and units of the states of a span
    "d" * order + stem: (f"{direction} {kind}", MOTION_UNITS[order])
    for stem, direction in DIRECTION.items()
    for order, kind in enumerate(("displacement", "velocity", "acceleration"))
}
# Units of most columns: value in SI, exponents of m and s. Other units are converted by pint, which
# takes a quarter of a second to import.
USUAL_UNITS = {
    "1": (1.0, 0, 0), "s": (1.0, 0, 1), "mm": (1e-3, 1, 0), "m": (1.0, 1, 0), "m/s": (1.0, 1, -1),
    "m/s^2": (1.0, 1, -2),
}  # fmt: skip


class UnitError(ValueError):
    """Error raised for a unit that is missing, unknown or of another physical quantity."""


@cache
def _make_registry():
    from pint import UnitRegistry

    registry = UnitRegistry(None, autoconvert_offset_to_baseunit=True)
    registry.load_definitions(DEFINITIONS.splitlines())
    return registry


@cache
def _parse_unit(text: str):
    """Parse a unit as loggers spell it. Raises what pint raises, and ValueError for other texts."""
    import pint

    text = "" if text.strip() in ("1", "-", "") else text.strip()
    if len(text) > MAX_UNIT_LENGTH or (text and not EXPRESSION.fullmatch(text)):
        raise ValueError("no product of units")
    try:
        return _parse_with_usual_prefixes(text)
    except (pint.UndefinedUnitError, TypeError, ValueError):
        other = text.lower() if len(text) > 2 else text
        for pattern, spelling in SPELLINGS:
            other = re.sub(pattern, spelling, other)
        return _parse_with_usual_prefixes(other)


def _parse_with_usual_prefixes(text: str):
    """Parse a unit. Raises UndefinedUnitError for a prefix that the unit is not written with."""
    import pint

    parsed = _make_registry().parse_units(text)
    for prefix, unit in map(_split_prefix, parsed._units):
        if prefix and prefix not in PREFIXES.get(unit, ()):
            raise pint.UndefinedUnitError(text)
    return parsed


def _split_prefix(name: str) -> tuple[str, str]:
    """Split the name of a unit into its prefix, '' if it has none, and the rest."""
    return _make_registry().parse_unit_name(name)[0][:2]


def factor(unit: str, wanted: str) -> float:
    """Return the factor that converts values from a unit, such as `mm`, to an SI unit.

    unit: a unit of `unit_definitions`, after the size of one count of the instrument, if any, such
    as `0.85 mm`. `1` is a pure number. For an acceleration, `g`, `mg` and `G` are of gravity,
    `g_n`, never of a mass. wanted: a unit of SI. Raises UnitError if the unit is unknown or
    measures something else.
    """
    if {unit, wanted} <= USUAL_UNITS.keys() and USUAL_UNITS[unit][1:] == USUAL_UNITS[wanted][1:]:
        return USUAL_UNITS[unit][0]
    import pint

    size, name = _split_scale(unit)
    try:
        if wanted == "m/s^2":
            name = re.sub(r"ms\^?-2", "m/s^2", _as_gravity(name))
        return size * float(
            _make_registry().Quantity(1.0, _parse_unit(name)).to(_parse_unit(wanted)).magnitude
        )
    except pint.UndefinedUnitError as error:
        raise _unknown(unit, "mm, m/s^2 or g_n") from error
    except pint.DimensionalityError as error:
        raise UnitError(f"unit {unit!r} does not measure {wanted}") from error
    except Exception as error:  # pint's parser raises many kinds
        raise UnitError(f"unit {unit!r:.60} cannot be read") from error


def _split_scale(unit: str) -> tuple[float, str]:
    """Split a unit such as `0.85 mm`, the size of one count, into its number and the unit."""
    match = SCALED_UNIT.fullmatch(unit.strip())
    if match and (size := float(match[1])) and size < np.inf:
        return size, match[2].strip()
    return 1.0, unit


def _as_gravity(unit: str) -> str:
    """Return `g_n` or `mg_n` for `g`, `G` and `mg`, and other units unchanged."""
    return f"{unit.lower()}_n" if unit in ("g", "mg", "G") else unit


def is_scaled(unit: str) -> bool:
    """Decide whether a unit has a number before it, such as `0.85 mm`."""
    return SCALED_UNIT.fullmatch(unit.strip()) is not None


def is_pixel(unit: str) -> bool:
    """Decide whether the name of a unit means pixels of a camera, whose size is unknown."""
    return unit.casefold() in PIXELS


def _unknown(unit: str, examples: str) -> UnitError:
    if is_pixel(unit):
        return UnitError(
            f"unit {unit!r} is no length: say how many mm a pixel is, such as '0.85 mm'"
        )
    return UnitError(f"unit {unit!r:.60} is not known; must be such as {examples}")


def is_same_quantity(unit: str, wanted: str) -> bool:
    """Decide whether a unit is of the same physical quantity as an SI unit."""
    if unit in USUAL_UNITS:
        return USUAL_UNITS[unit][1:] == USUAL_UNITS[wanted][1:]
    try:
        return bool(unit) and factor(unit, wanted) > 0
    except UnitError:
        return False


def is_unit(text: str) -> bool:
    """Decide whether a text is a known physical unit, such as `mm`; a number alone is none."""
    if text in (*USUAL_UNITS, "G"):  # of gravity
        return text != "1"
    if text[:1].isdigit():
        return False
    try:
        return bool(_parse_unit(text)._units)
    except Exception:  # pint's parser raises many kinds
        return False


@cache
def split_header(header: str) -> tuple[str, str]:
    """Split a column header such as `v [mm]` into its name and its unit.

    `v (mm)` is split if that is a unit. Other forms are `v, mm`, `v / mm` and `v in mm`, for units
    of displacements, accelerations and times, and `v (mm) left`.
    """
    header = header.strip()
    if match := BRACKETED_UNIT.fullmatch(header):
        unit = (match["unit"] or match["round"] or "").strip()
        if match["unit"] is not None or (unit != TIME_SYMBOL and is_unit(unit)):
            return match["bare"], unit
    for match in INNER_UNIT.finditer(header):
        before, after = header[: match.start()].strip(), header[match.end() :].strip()
        if before and after and is_unit(match[1].strip()):
            return f"{before} {after}", match[1].strip()
    match = TRAILING_UNIT.fullmatch(header)
    if match and match["unit"] in UNBRACKETED_UNITS:
        return match["bare"], match["unit"]
    return header, ""


def unit_suffix(name: str) -> str:
    """Return the unit at the end of a column name such as `vertical_mm`, '' if there is none."""
    unit = re.split(r"[_\s]", name)[-1]
    return unit if unit != name and unit in UNBRACKETED_UNITS else ""


def parse_quantity(text: str | float, unit: str, target: str) -> float:
    """Convert a text such as `3 mm` to a number in the SI unit of a measured quantity.

    target: that quantity, such as `q_v`. unit: of the number if the text has none. Raises
    UnitError.
    """
    match = AMOUNT.fullmatch(str(text).strip())
    number, stated = match.groups() if match else (None, "")
    if not number:
        raise UnitError(f"{text!r} is not a number with a unit, such as '3 mm'")
    if stated and unit == "1":
        raise UnitError(f"{text!r} has a unit and the column has none; must be a number alone")
    return float(number) * state_si(stated or unit, target)[0]


def meaning(target: str) -> str:
    """Describe a quantity of a span in words: `q_v` is a vertical displacement.

    Returns '' if a span has no such quantity.
    """
    return QUANTITIES.get(target, ("", "1"))[0]


def is_span(states: Iterable[str]) -> bool:
    """Decide from their names whether states are those of a span of an overhead line."""
    return any(map(meaning, states))


def state_unit(name: str) -> str:
    """Return the SI unit of a state by its name: m for `q_v`, m/s for `dq_v`, `1` if unknown."""
    return QUANTITIES.get(name, ("", "1"))[1]


def plain_unit(name: str) -> str:
    """Return the SI unit of a state by its name, for printing: '' if dimensionless."""
    return state_unit(name).removeprefix("1")


def input_si(unit: str) -> tuple[float, str]:
    """Return the factor that converts an input's unit to SI, and the name of the SI unit.

    A unit that is SI already is unchanged, and one with an offset, such as degC. `g`, `G` and `mg`
    are of gravity here as well, since a mass drives nothing. Raises UnitError.
    """
    if unit in USUAL_UNITS and USUAL_UNITS[unit][0] == 1.0:
        return 1.0, unit
    size, name = _split_scale(unit)
    try:
        quantity = _make_registry().Quantity(1.0, _parse_unit(_as_gravity(name)))
        if not quantity._is_multiplicative:
            if size != 1.0:
                raise ValueError("a number times a unit that does not begin at zero")
            return 1.0, name
        coherent = _without_prefixes(quantity.units)
        base = quantity.to(coherent)
    except Exception as error:  # pint's parser raises many kinds
        raise _unknown(unit, "m/s, N or 1, which takes the numbers as they are") from error
    if base.magnitude == 1.0 and size == 1.0:
        return 1.0, name
    return size * float(base.magnitude), f"{base.units:~C}".replace("**", "^") or "1"


def _without_prefixes(units):
    """Return the coherent unit of the same kind: of mV it is V, of km/h m/s."""
    names = Counter()
    for name, power in units._units.items():
        names[_split_prefix(name)[1]] += power
    powers = {name: power for name, power in names.items() if power}
    plain = _make_registry().Unit(units._units.__class__(powers))
    one = _make_registry().Quantity(1.0, plain).to_base_units()
    return plain if one.magnitude == 1.0 else one.units


def state_si(unit: str, target: str) -> tuple[float, str]:
    """Return the factor that converts a channel's unit to SI, and the name of the SI unit.

    target: what the channel measures, such as `q_v`. States of a line have one SI unit, those of
    other systems any. Raises UnitError.
    """
    si = state_unit(target)
    return (factor(unit, si), si) if si != "1" else input_si(unit)


def coefficient_unit(
    state: str,
    exponents: Exponents,
    names: Sequence[str],
    inputs: Mapping[str, str] = EMPTY_MAPPING,
) -> str:
    """Derive the SI unit of a term's coefficient in the equation of a state, such as m^-1 s^-2.

    exponents: of a term, with its functions. names: of states and inputs. inputs: the unit of each,
    '' if unknown, which is written as [U].
    """
    states = tuple(name for name in names if name not in inputs)
    velocities = {states[k] for k in velocity_pairs(states).values()}

    def symbols(name: str) -> dict[str, int]:
        unit = state_unit(name)
        return {"s": -1} if unit == "1" and name in velocities else _unit_symbols(unit)

    powers = Counter({"m": 0, **symbols(state)})
    powers["s"] -= 1
    factors = list(zip(names, exponents, strict=False))
    degree = {"abs": 1, "inverse": -1}  # the value of another function is a pure number
    for function in exponents[len(names) :]:
        first = next(k for k, weight in enumerate(function.weights) if weight)
        factors.append((names[first], degree.get(function.name, 0)))
    for name, power in factors:
        if power and name in inputs:
            of_unit = _unit_symbols(inputs[name]) if inputs[name] else {f"[{name}]": 1}
        else:
            of_unit = symbols(name)
        powers.subtract({symbol: power * each for symbol, each in of_unit.items()})
    parts = [f"{symbol}^{power}" for symbol, power in powers.items() if power]
    return " ".join(parts).replace("^1 ", " ").removesuffix("^1") or "1"


def _unit_symbols(unit: str) -> dict[str, int]:
    if unit in USUAL_UNITS and USUAL_UNITS[unit][0] == 1.0:
        return dict(zip("ms", USUAL_UNITS[unit][1:], strict=True))
    try:
        parsed = _parse_unit(unit)
    except Exception:  # pint's parser raises many kinds; of a model of another version
        return {unit: 1}
    return {_make_registry().get_symbol(name): power for name, power in parsed._units.items()}
