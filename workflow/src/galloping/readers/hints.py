"""Plausible units and options for the names and values of columns, for messages to copy."""

import re
from collections.abc import Iterable, Sequence
from shlex import quote

import numpy as np

from galloping.readers.columns import split_words
from galloping.readers.units import is_same_quantity

STANDARD_GRAVITY = 9.80665  # m/s^2
GRAVITIES = {"m/s^2": 1.0, "mm/s^2": 1e-3, "cm/s^2": 1e-2, "g": STANDARD_GRAVITY,
             "mg": 1e-3 * STANDARD_GRAVITY}  # fmt: skip
GRAVITY_TOLERANCE = 0.03  # relative error of the mean of an accelerometer that measures gravity
MAX_SPAN_MOTION = 20.0  # m: range from the lowest to the highest point of a galloping span
UNIX_TIMES = 3.2e8, 4.1e9  # s since 1970: the years 1980 to 2100
# the same years in days since 1900, as in spreadsheets, and since the year 0, as in MATLAB
DATES_IN_DAYS = ((29_221, 73_051), (723_181, 767_011))
MIN_STEP, MAX_STEP = 1e-5, 10.0  # s: limits of plausible sampling intervals
TIME_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "d": 86_400.0}
WIND_WORDS = {"wind", "gust", "u", "speed"}


def unit_in_name(name: str, wanted: str) -> str:
    """Return the last word of a name, in any case, if it is a unit of a quantity, else ''.

    wanted: the SI unit of the quantity.
    """
    for word in re.findall(r"[^\s_()（）]+", name)[1:][-1:]:
        for unit in (word, word.casefold()):
            if is_same_quantity(unit, wanted):
                return unit
    return ""


def is_clock_reading(times: np.ndarray) -> bool:
    """Decide whether numbers are times of a day, HHMMSS, which jump by 40 after each minute.

    times: (n,).
    """
    times = times[np.isfinite(times)]
    minutes, seconds = np.divmod(times, 100.0)
    hours, minutes = np.divmod(minutes, 100.0)
    elapsed = np.diff(3600.0 * hours + 60.0 * minutes + seconds)
    is_time = np.all((hours >= 0) & (hours < 24) & (minutes < 60) & (seconds < 60))
    return bool(is_time and np.diff(times).max(initial=0) > elapsed.max(initial=0) + 39.0)


def likely_time_unit(times: np.ndarray) -> str:
    """Guess the unit of times from the size of their values and steps.

    It is a unit in which times are present dates, else one in which their steps are plausible.
    times: (n,) numbers.
    """
    times = np.unique(times[np.isfinite(times)])
    if len(times) < 2:
        return "s"
    first, step = float(times[0]), float(np.median(np.diff(times)))
    for unit, size in TIME_UNITS.items():
        if UNIX_TIMES[0] <= first * size <= UNIX_TIMES[1] and unit != "d":
            return unit
    if any(low <= first <= high for low, high in DATES_IN_DAYS) and step * 86_400.0 <= MAX_STEP:
        return "d"
    plausible = (unit for unit, size in TIME_UNITS.items() if MIN_STEP <= step * size <= MAX_STEP)
    return next(plausible, "s")


def likely_unit(order: int, values: np.ndarray, alike: Iterable[np.ndarray] = ()) -> str:
    """Guess the unit of a displacement, velocity or acceleration from its samples.

    order: of the derivative, 0 for a displacement, 2 for an acceleration. values: (n,). alike:
    columns of the same instrument; one of three accelerometers shows gravity as its mean.
    """
    if order == 1:
        return "m/s"
    if order == 0:
        known = values[np.isfinite(values)]
        return "mm" if len(known) and np.ptp(known) > MAX_SPAN_MOTION else "m"
    for one in (values, *alike):
        mean = abs(np.nanmean(one)) if np.isfinite(one).any() else 0.0
        errors = {u: abs(mean * size / STANDARD_GRAVITY - 1.0) for u, size in GRAVITIES.items()}
        if min(errors.values()) < GRAVITY_TOLERANCE:
            return min(errors, key=errors.__getitem__)
    return "m/s^2"


def likely_input_unit(name: str) -> str:
    """Guess the unit of an input from its name: of a wind m/s, else `1` (no conversion)."""
    return (unit_in_name(name, "m/s") or "m/s") if split_words(name) & WIND_WORDS else "1"


def measure_option(target: str, column: str, unit: str = "") -> str:
    """Format the option that says what a column measures, such as `--measure 'q_v=mid [mm]'`."""
    text = f"{target}={column}" + f" [{unit}]" * bool(unit)
    return "--measure " + (quote(text) if "'" in text else f"'{text}'")


def unit_options(units: Sequence[tuple[str, str]]) -> str:
    """Format the options for the units of columns, such as `--unit time=s --unit mid=mm`."""
    return " ".join(f"--unit {quote(f'{name}={unit}')}" for name, unit in units)
