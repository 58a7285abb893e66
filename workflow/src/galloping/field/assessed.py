"""An assessment of a model in words, and as rows of a table."""

from collections.abc import Mapping

import numpy as np

from galloping.field.assess import Assessment, Condition, Mode
from galloping.field.dynamics import Value
from galloping.field.units import state_unit
from galloping.field.wording import ENDS, in_words


def assessment_text(of: Assessment, units: Mapping[str, str]) -> str:
    """A line for each thing that there is. units: of inputs, by name."""
    lines, unit = [], units.get(of.along, "")
    for condition in of.conditions:
        held = ", ".join(
            f"{k} = {v:g} {units.get(k, '')}".rstrip() for k, v in condition.at.items()
        )
        lines.append(f"At {held}:" if held else "The model by itself:")
        lines += [f"  {line}" for line in _condition_lines(condition)]
    for onset in of.onsets:
        what = "begin to grow above" if onset.begins else "cease to grow above"
        where = f"{of.along} = {_said(onset.value, unit)}"
        lines.append(f"Small motions about rest {what} {where}, at {onset.frequency:.3g} Hz")
    if of.along and not of.onsets:
        low, high = of.span
        lines.append(f"No onset between {of.along} = {low:g} and {high:g} {unit}".rstrip())
    return "\n".join([*lines, *of.notes])


def _condition_lines(of: Condition) -> list[str]:
    lines = []
    for number, rest in enumerate(of.equilibria, start=1):
        places = ", ".join(f"{k} = {_said(v, _unit(k))}" for k, v in rest.place.items())
        lines.append(f"rest {number}, {'' if rest.stable else 'un'}stable: {places}")
        lines += [f"  {_mode_line(mode)}" for mode in rest.modes]
    for number, cycle in enumerate(of.cycles, start=1):
        halves = ", ".join(f"{k} ± {_said(v, _unit(k))}" for k, v in cycle.half_range.items())
        some = f"; {100 * cycle.found:.0f} % of the draws have it" if cycle.found < 1.0 else ""
        lines.append(
            f"limit cycle {number}, {'' if cycle.stable else 'un'}stable: {halves}, period "
            f"{_said(cycle.period, 's')}{some}"
        )
    none = [] if of.equilibria else ["no rest near the motion"]
    ends = [] if of.cycles else [ENDS.get(kind, kind) for kind in of.ends]
    return [*none, *lines, *ends]


def _mode_line(mode: Mode) -> str:
    grows = ": it grows" if mode.damping.value < 0 else ""
    if mode.frequency.value == 0.0:
        what = "decays" if mode.damping.value > 0 else "grows"
        size = _scaled(mode.damping, 1.0 if mode.damping.value > 0 else -1.0)
        return f"{mode.state} {what} at {_said(size, '1/s')}"
    damping = _said(_scaled(mode.damping, 100.0), "% of critical")
    frequency = _said(mode.frequency, "Hz")
    return f"{mode.state} oscillates at {frequency}, net damping {damping}{grows}"


def _scaled(of: Value, by: float) -> Value:
    low, high = sorted((by * of.low, by * of.high))
    return Value(by * of.value, low, high)


def _said(of: Value, unit: str) -> str:
    """A value with its interval, if it has one, to the digits that it tells."""
    if np.isnan(of.low):
        return f"{of.value:.4g} {unit}".rstrip()
    if np.isinf(of.low) or np.isinf(of.high):
        ends = [f"{end:.4g}" if np.isfinite(end) else "beyond the range"
                for end in (of.low, of.high)]  # fmt: skip
        return f"{of.value:.4g} {unit} ({ends[0]} to {ends[1]})"
    return in_words(of, unit).replace("  ", " ").rstrip()


def _unit(name: str) -> str:
    return "" if state_unit(name) == "1" else state_unit(name)


def assessment_rows(of: Assessment, units: Mapping[str, str]) -> list[dict]:
    """A row for each value: inputs, then what, number, stable, quantity, value, low, high, unit."""
    rows = []
    for condition in of.conditions:
        for number, rest in enumerate(condition.equilibria, start=1):
            values = [(f"place of {k}", value, _unit(k)) for k, value in rest.place.items()]
            for k, mode in enumerate(rest.modes, start=1):
                if mode.frequency.value:
                    values.append((f"frequency of mode {k} ({mode.state})", mode.frequency, "Hz"))
                    values.append((f"damping of mode {k} ({mode.state})", mode.damping, ""))
                else:
                    values.append((f"decay of mode {k} ({mode.state})", mode.damping, "1/s"))
            rows += _rows(condition.at, "rest", number, rest.stable, values)
        for number, cycle in enumerate(condition.cycles, start=1):
            values = [(f"half range of {k}", v, _unit(k)) for k, v in cycle.half_range.items()]
            values.append(("period", cycle.period, "s"))
            rows += _rows(condition.at, "limit cycle", number, cycle.stable, values)
    for number, onset in enumerate(of.onsets, start=1):
        at = dict.fromkeys(of.conditions[0].at, np.nan)
        unit = units.get(of.along, "")
        rows += _rows(at, "onset", number, not onset.begins, [(of.along, onset.value, unit)])
    return rows


def _rows(
    at: Mapping[str, float], what: str, number: int, stable: bool, values: list[tuple]
) -> list[dict]:
    return [
        {
            **at, "what": what, "number": number, "stable": stable, "quantity": quantity,
            "value": value.value, "low": value.low, "high": value.high, "unit": unit,
        }
        for quantity, value, unit in values
    ]  # fmt: skip
