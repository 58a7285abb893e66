"""Units of columns, in SI. A unit is never guessed."""

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from functools import cache
from types import MappingProxyType

AMOUNT = re.compile(r"((?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)?\s*(.*)", re.DOTALL)
WITH_UNIT = re.compile(r"(?P<bare>.*\S)\s*(\[(?P<unit>[^\[\]]*)\]|[(（](?P<round>[^()（）]*)[)）])")
NONE = MappingProxyType({})
BEHIND = re.compile(r"(?P<bare>.*[^\s,/])\s*[,/]\s*(?P<unit>[^\s,]+)")  # `v, mm` and `v / mm`
# Of those a file may say without brackets: other words behind a comma are part of a name.
PLAIN = {
    *(f"{prefix}m" for prefix in ("", "c", "d", "m", "µ", "μ", "u")), "s", "ms", "min", "sec",
    *(f"{of}m/s{power}" for of in ("", "c", "m") for power in ("", "2", "^2", "²")), "ft", "inch",
    "metres", "meters", "metre", "meter", "seconds", "millimetres", "millimeters", "g_n",
}  # fmt: skip
SPELLINGS = (  # as loggers write units, and as pint reads them
    (r"\bsek(unden?)?\b", "s"),
    (r"(?<=[a-zµμ])-(?=\d)", "^-"),
    (r"(?<=[a-zµμ])(?=\d)", "^"),
    (r"(?<=[a-z0-9])[.·](?=[a-z])", "*"),
    (r"\b([cmµμu]?m)s\^-([12])", r"\1/s^\2"),  # ms^-2 is m s^-2: nothing is measured per ms^2
)
DIRECTION = {"q_v": "vertical", "q_w": "horizontal"}
KIND = ("displacement", "velocity", "acceleration")
ORDERS = ("m", "m/s", "m/s^2")  # the units of these
# What most columns are in: the value in SI and the powers of m and s. pint is asked about all
# else; it takes a quarter of a second to load.
USUAL = {
    "1": (1.0, 0, 0), "s": (1.0, 0, 1), "mm": (1e-3, 1, 0), "m": (1.0, 1, 0), "m/s": (1.0, 1, -1),
    "m/s^2": (1.0, 1, -2),
}  # fmt: skip


class UnitError(ValueError):
    """A unit that is missing, unknown or of the wrong kind; one line."""


@cache
def _registry():
    from pint import UnitRegistry

    return UnitRegistry(autoconvert_offset_to_baseunit=True)


@cache
def _parsed(text: str):
    """A unit of pint, from the spellings of loggers. Raises what pint raises."""
    import pint

    text = "" if text.strip() in ("1", "-", "") else text.strip()
    try:
        return _registry().parse_units(text)
    except (pint.UndefinedUnitError, TypeError, ValueError):
        other = text.lower() if len(text) > 2 else text
        for pattern, spelling in SPELLINGS:
            other = re.sub(pattern, spelling, other)
        return _registry().parse_units(other)


def factor(unit: str, wanted: str) -> float:
    """What values in `unit` are multiplied by to be in `wanted`, an SI unit.

    `1` is a pure number. `g` and `mg`, of an acceleration, are of that of gravity, `g_n`: no mass
    is one. Raises UnitError.
    """
    if unit in USUAL and USUAL[unit][1:] == USUAL[wanted][1:]:
        return USUAL[unit][0]
    import pint

    try:
        if wanted == "m/s^2" and unit in ("g", "mg"):
            unit += "_n"
        source = _parsed(re.sub(r"ms\^?-2", "m/s^2", unit) if wanted == "m/s^2" else unit)
        return float(_registry().Quantity(1.0, source).to(_parsed(wanted)).magnitude)
    except pint.UndefinedUnitError as error:
        raise UnitError(f"unit {unit!r} is not known; must be such as mm, m/s^2 or g_n") from error
    except pint.DimensionalityError as error:
        raise UnitError(f"unit {unit!r} does not measure {wanted}") from error
    except Exception as error:  # pint's parser raises many kinds
        raise UnitError(f"unit {unit!r} cannot be read") from error


def measures(unit: str, wanted: str) -> bool:
    """Whether a unit is one of what `wanted`, an SI unit, measures."""
    if unit in USUAL:
        return USUAL[unit][1:] == USUAL[wanted][1:]
    try:
        return bool(unit) and factor(unit, wanted) > 0
    except UnitError:
        return False


def is_unit(text: str) -> bool:
    """Whether a text is a unit of something, such as `mm`; a number alone is none."""
    try:
        return text[:1].isalpha() and (text in USUAL or bool(_parsed(text).dimensionality))
    except Exception:  # pint's parser raises many kinds
        return False


@cache
def named(header: str) -> tuple[str, str]:
    """Name and unit of a column from its header: `v [mm]`, or `v (mm)` where that is a unit.

    As well `v, mm` and `v / mm`, of the units that displacements, accelerations and times have.
    """
    header = header.strip()
    match = WITH_UNIT.fullmatch(header)
    if match and (match["unit"] is not None or is_unit(match["round"])):
        return match["bare"], (match["unit"] or match["round"] or "").strip()
    match = BEHIND.fullmatch(header)
    if match and match["unit"] in PLAIN:
        return match["bare"], match["unit"]
    return header, ""


def behind(name: str) -> str:
    """The unit at the end of a name such as `vertical_mm`, or ''."""
    unit = re.split(r"[_\s]", name)[-1]
    return unit if unit != name and unit in PLAIN else ""


def amount(text: str | float, unit: str, target: str) -> float:
    """A number in SI from text such as `3 mm`, of a channel that measures `target`.

    unit: of the number where the text has none. Raises UnitError.
    """
    number, own = AMOUNT.fullmatch(str(text).strip()).groups()
    if not number:
        raise UnitError(f"{text!r} is not a number with a unit, such as '3 mm'")
    if own and unit == "1":
        raise UnitError(f"{text!r} has a unit and the column has none; must be a number alone")
    return float(number) * state_si(own or unit, target)[0]


def meaning(target: str) -> str:
    """In words, what is measured: of `q_v` a vertical displacement; '' where no span has it."""
    stem = target.lstrip("d")
    order = len(target) - len(stem)
    return f"{DIRECTION[stem]} {KIND[order]}" if stem in DIRECTION and order < len(KIND) else ""


def state_unit(name: str) -> str:
    """The SI unit of a state of a line, by its name: q_v m, dq_v m/s, ddq_v m/s^2; else `1`."""
    stem = name.lstrip("d")
    order = len(name) - len(stem)
    return ORDERS[order] if stem in DIRECTION and order < len(ORDERS) else "1"


def plain_unit(name: str) -> str:
    """The same to be written behind a number: '' for a pure one."""
    return state_unit(name).removeprefix("1")


def input_si(unit: str) -> tuple[float, str]:
    """What values of an input are multiplied by, and the unit that they are in then, one of SI.

    A unit of SI by itself stays, and one that does not begin at zero, such as degC. `g` and `mg`
    are of gravity here as well: a mass drives nothing. Raises UnitError.
    """
    unit += "_n" * (unit in ("g", "mg"))
    if unit in USUAL and USUAL[unit][0] == 1.0:
        return 1.0, unit
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


def state_si(unit: str, target: str) -> tuple[float, str]:
    """What values of a channel that measures `target` are multiplied by, and their unit then.

    That is the unit of SI of a line's states; those of other systems may have any. Raises
    UnitError.
    """
    si = state_unit(target)
    return (factor(unit, si), si) if si != "1" else input_si(unit)


def coefficient_unit(
    state: str, exponents: Sequence[int], names: Sequence[str], inputs: Mapping[str, str] = NONE
) -> str:
    """SI unit of a term's coefficient in the equation of a state, such as m^-1 s^-2, or `1`.

    exponents: of a term, with its functions. names: of states and inputs. inputs: the unit of each,
    '' where it is not known: it then stands as [U].
    """
    _, metres, seconds = USUAL[state_unit(state)]
    powers = Counter(m=metres, s=seconds - 1)
    factors = list(zip(names, exponents, strict=False))
    degree = {"abs": 1, "inverse": -1}  # the value of another function is a pure number
    for function in exponents[len(names) :]:
        first = next(k for k, weight in enumerate(function.weights) if weight)
        factors.append((names[first], degree.get(function.name, 0)))
    for name, power in factors:
        if power and name in inputs:
            own = _symbols(inputs[name]) if inputs[name] else {f"[{name}]": 1}
        else:
            own = _symbols(state_unit(name))
        powers.subtract({symbol: power * each for symbol, each in own.items()})
    parts = [f"{symbol}^{power}" for symbol, power in powers.items() if power]
    return " ".join(parts).replace("^1 ", " ").removesuffix("^1") or "1"


def _symbols(unit: str) -> dict[str, int]:
    if unit in USUAL and USUAL[unit][0] == 1.0:
        return dict(zip("ms", USUAL[unit][1:], strict=True))
    parsed = _registry().parse_units(unit)
    return {_registry().get_symbol(name): power for name, power in parsed._units.items()}
