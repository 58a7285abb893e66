"""What recordings and their model tell, in the words of an engineer.

The templates beside have the sentences, and here are the values and lists in them.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from importlib.resources import files
from math import floor, log, log10
from typing import TYPE_CHECKING

import numpy as np
from jinja2 import Environment, StrictUndefined, Template

from galloping.field.dynamics import ROUNDING, Dynamics, Value
from galloping.field.excerpts import excerpts
from galloping.field.following import Sensed, without_outliers
from galloping.field.forecast import HeldOut
from galloping.field.helps import (
    is_span,
    listed,
    may_be_wind,
    plain_reasons,
    shown_units,
    units_in,
    what_helps,
)
from galloping.field.quality import peaks_of, spectrum
from galloping.identification.likelihood.verdict import REPEATS
from galloping.identification.model import IdentifiedModel
from galloping.identification.random_forces.tracking import Forces
from galloping.polynomial import term_name, velocity_pairs
from galloping.readers.units import coefficient_unit, meaning, plain_unit
from galloping.recording import Recording

if TYPE_CHECKING:
    from galloping.field.assessment import Assessment
    from galloping.field.summary import Summary

ENDS = {
    "rest": "the motion dies out",
    "forced": "random forces keep it moving",
    "irregular": "the motion never repeats, or settles too slowly to tell",
    "stopped": "the model does not tell where the motion ends: it is too fast to be followed",
}
RUNS_AWAY = "in simulation the motion runs away"
TECHNICAL = "## Technical part"
PARTS = r"parts of the recording .* do not share one model"  # of a reason
LEAST = 1e-6  # width of an interval that is said, in its value
STEADY = 12.0  # such factors, that the interval of a damping holds
MOST_PROBLEMS = 5  # of samples, that are told before the technical part


def summary_text(
    of: "Summary", reports: Sequence[dict] = (), beside: tuple[str, Dynamics | None] | None = None
) -> str:
    """summary.md: what was found, how far to believe it, what would help most; technical part.

    reports: of `quality`, where the recordings come from files. beside: a name, and what is known
    of the line by that name.
    """
    found, known, trial = of.found, of.dynamics, of.held_out
    problems = [
        escape_markdown(f"{report['file']}, {p['column']}, from row {p['row']} on: {p['what']}")
        for report in reports
        for p in report["problems"]
    ]
    described = [*map(report_text, reports)] or [*map(repr, of.recordings)]
    unused = [f"{name!r} of {report['file']}" for report in reports
              for name in report.get("unused_motion", ())]  # fmt: skip
    of_span, units = is_span(found), units_in(reports)
    line = "the line" if of_span else "the system"
    values = {
        "of": of, "found": found, "known": known, "trial": trial, "ends": ENDS,
        "rounding": ROUNDING, "technical": TECHNICAL, "most_problems": MOST_PROBLEMS,
        "refused": found.status == "refused",
        "sure": bool(np.any(found.standard_errors > 0.0)),
        "of_span": of_span,
        "units": shown_units(units),
        "conditions": _conditions(found, units),
        "line": line,
        "gallop": "gallop" if of_span else "oscillate by itself",
        "gallops": "gallops" if of_span else "oscillates by itself",
        "exact": [n for n in found.model.inputs if not of.recordings[-1].inputs[n].error],
        "held": [n for n in found.model.inputs if of.recordings[-1].inputs[n].between == "zero"],
        "odd": any("is the unit" in problem for problem in problems),
        "repeats": REPEATS in found.reason,
        "mixed": re.search(PARTS, found.reason),
        "recorded": list(_recorded(of.recordings, found.diagnostics.get("below"))),
        **_of_forces(found, known, of.recordings),
        "meanings": [
            re.sub("(?<=[Tt])he line", line[1:], why)
            for why, _ in plain_reasons(found.reason, of_span)
            if why
        ],
        "problems": problems,
        "helps": what_helps(of, reports),
        "beside": beside if beside and beside[1] else None,
        "described": [re.sub(r"\n\s*", "\n  - ", escape_markdown(text)) for text in described],
        "unused": escape_markdown(listed(unused)) if unused else "",
        **(_of_small(known) if known else {}),
        **(_of_trial(trial) if trial else {}),
        **_of_stretches(of.recordings, found),
        **_untold(found, units),
    }  # fmt: skip
    text = _template("summary.md").render(values)
    text = re.sub(r"(?<=\S)( *\n {4,})+|(?<=[.:]) {2,}", " ", text)
    text = re.sub(r"^ {4,}| +$", "", text, flags=re.MULTILINE)
    return re.sub(r"\n{3,}", "\n\n", text).strip() + "\n"


def escape_markdown(text: str) -> str:
    """Escape what would be markup: names of files and columns may hold anything."""
    return re.sub(r"([\\`*<>\[\]|]|(?<!\w)_|_(?!\w))", r"\\\1", text)


def report_text(report: dict) -> str:
    """A report of `quality`: the file, then a line for each channel, input, note and problem."""
    return _template("quality.txt").render(report=report).rstrip()


def assessment_text(of: "Assessment", units: Mapping[str, str]) -> str:
    """A line for each thing that there is. units: of inputs, by name."""
    return _template("assessment.txt").render(of=of, units=shown_units(units)).rstrip()


def _conditions(found: IdentifiedModel, units: Mapping[str, str]) -> str:
    """What beside motions a model holds for: such winds, or values of inputs, as were recorded."""
    if may_be_wind(found, units):
        return "winds and "
    return f"values of {listed(found.model.inputs)} and " if found.model.inputs else ""


@cache
def _template(name: str) -> Template:
    environment = Environment(undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    environment.filters |= {
        "bullets": lambda lines: "\n".join(f"- {line}" for line in lines),
        "cells": lambda of, unit, factor=1.0: " | ".join(_cells(of, unit, factor)),
        "digits": lambda number, state="": f"{number:.3g} {plain_unit(state)}".strip(),
        "end": lambda kind: RUNS_AWAY if kind.startswith("diverged") else ENDS.get(kind, kind),
        # whether a motion of any size goes on as it is
        "keeps": lambda known: all(abs(v.value) < ROUNDING for v in known.damping.values()),
        "listed": listed,
        "meaning": meaning,
        "name": _name,
        "said": _said,
        "sentence": lambda text: text[:1].upper() + text[1:],
        "unit": plain_unit,
        "words": in_words,
    }
    text = files(__package__).joinpath(f"{name}.jinja").read_text(encoding="utf-8")
    return environment.from_string(text)


def in_words(of: Value, unit: str, factor: float = 1.0) -> str:
    """A value times a factor with its interval, to the digits that it tells."""
    number, interval = _cells(of, unit, factor)
    return number + (f" ({interval})" if interval else "")


def _cells(of: Value, unit: str, factor: float = 1.0) -> tuple[str, str]:
    """A value with its unit, and its interval."""
    value, low, high = (factor * number for number in (of.value, of.low, of.high))
    if high - low <= LEAST * abs(value):
        number, interval = f"{value:.5g}", ""
    elif not np.isfinite(low):
        number, interval = f"{value:.3g}", "interval unknown"
    else:
        digits = max(0, 1 - floor(log10((high - low) / 2)))
        number, interval = f"{value:.{digits}f}", f"{low:.{digits}f} to {high:.{digits}f}"
    return f"{number} {unit}".strip(), interval


def _name(state: str) -> str:
    """`vertical`, of q_v; of other systems the state."""
    return meaning(state).partition(" ")[0] or state


def _of_small(known: Dynamics) -> dict:
    """What small motions about rest do, and the places and sizes that are told with them."""
    damped = {state: value for state, value in known.damping.items() if np.isfinite(value.value)}
    return {
        "damped": damped,
        "unsure": [
            state
            for state, value in damped.items()
            if abs(value.value) < ROUNDING or value.low < -ROUNDING < ROUNDING < value.high
        ],
        "growing": [
            f"{_name(state)} ones double in {_doubling(known.frequencies[state], value)}"
            for state, value in damped.items()
            if value.value < -ROUNDING and not value.high > ROUNDING
        ],
        "least": min(damped, key=lambda state: damped[state].value, default=""),
        "halves": [
            f"±{in_words(v, plain_unit(s))} {_name(s)}" for s, v in known.half_range.items()
        ],
        "places": ", ".join(f"{s} = {in_words(v, plain_unit(s))}" for s, v in known.rest.items()),
        "still": "\n".join(
            f"{state} does not oscillate by itself."
            for state, value in known.frequencies.items()
            if np.isnan(value.value)
        ),
    }


def _of_forces(
    found: IdentifiedModel, known: Dynamics | None, recordings: Sequence[Recording]
) -> dict:
    """How strong random forces are, a row of the table, and whether modes gallop besides."""
    if not found.is_forced:
        return {"forces": ""}
    margins, states = known.damping.items() if known else (), found.model.states
    of_mass = ", for each kg of modal mass" if is_span(found) else ""
    length = sum(np.ptp(one.time) for one in recordings)
    return {
        "forces": f"| random forces{of_mass} | {_strengths(found, known)} |  |",
        "margins": [
            f"{_name(name)}{' motion' * (name in states)} "
            + _margin(
                damping,
                2.0 * np.pi * known.frequencies[name].value * length,
                all(
                    _is_of_one_size(one.values[:, states.index(name)])
                    for one in recordings
                    if name in states
                ),
            )
            for name, damping in margins
        ],
    }


def _is_of_one_size(values: np.ndarray) -> bool:
    """Whether a channel (n,) moves as far in each third of it, to a factor of e."""
    thirds = np.array_split(values[np.isfinite(values)], 3)
    sizes = [np.std(part) for part in thirds if len(part)]
    return not sizes or max(sizes) <= np.e * min(sizes)


def _margin(damping: Value, turned: float, is_of_one_size: bool) -> str:
    """Whether a mode gallops, as far as its net damping tells.

    turned: rad, by its swings while it was recorded. What then neither grows nor dies out, by a
    factor of e, is no answer to random forces.
    """
    is_steady = abs(damping.value) * turned < 1.0 and (damping.high - damping.low) * turned < STEADY
    if is_steady and is_of_one_size:
        return "swings steadily, as what a machine drives, or galloping that has settled"
    if damping.low > 0.0:
        return f"does not, at least {100 * damping.low:.2g} % of critical damping is left"
    if damping.high < 0.0:
        return "does, small motions grow"
    return "may, the recording is too short to tell whether small motions grow"


def _strengths(found: IdentifiedModel, of: Dynamics | None) -> str:
    """The one-sided spectra of the forces, at the frequency of the coordinate that each moves."""
    states, forces = found.model.states, Forces.of(found)
    said = []
    for i, velocity in velocity_pairs(states).items():
        frequency = of.frequencies[states[i]].value if of else np.nan
        density = forces.density(2.0 * np.pi * frequency)[velocity, velocity]
        if density > 0.0:
            unit = f"{plain_unit('d' + states[velocity]).replace('^2', '²')} per √Hz".lstrip()
            said.append(f"{states[i]} {np.sqrt(2.0 * density):.3g} {unit}")
    lasting = ", ".join(f"{1.0 / forces.rates[i]:.2g} s" for i in forces.places)
    return ", ".join(said) + (f", slow ones that last {lasting} included" if lasting else "")


def _doubling(frequency: Value, damping: Value) -> str:
    """The time in which a motion that grows doubles."""
    own, *ends = (
        log(2.0) / (2.0 * np.pi * frequency.value * -ratio) if ratio < 0 else np.inf
        for ratio in (damping.value, damping.low, damping.high)
    )
    if not np.isfinite(ends).all():  # as far as is told, motions may not grow at all
        return f"{float(f'{own:.2g}'):g} s (at least {float(f'{min(ends):.2g}'):g} s)"
    return in_words(Value(own, *ends), "s")


def _recorded(
    recordings: Sequence[Recording], below: float | None
) -> Iterator[tuple[str, str, float, float | None]]:
    """Of each channel its name, unit, half range, and the frequency of most of its motion, Hz.

    Outliers are left out. below: Hz, beyond which the recordings have nothing left, None where they
    are whole.
    """
    slow = f" below {below:.3g} Hz" if below else ""
    channels: dict[str, list[tuple[np.ndarray, np.ndarray]]] = {}
    for own in recordings:
        sensed = Sensed.by(own)
        for name, values in zip(sensed.names, sensed.samples(without_outliers(own)).T, strict=True):
            known, parts = np.isfinite(values), channels.setdefault(name, [])
            if np.count_nonzero(known) > 1:
                parts.append((own.time[known], values[known]))
    for name, parts in channels.items():
        if parts:
            size = np.ptp(np.concatenate([values for _, values in parts])) / 2
            time, longest = max(parts, key=lambda part: len(part[0]))
            frequency, share = spectrum(time, longest, float(np.median(np.diff(time))))
            peaks = peaks_of(share)[1]
            pace = float(frequency[peaks[0]]) if len(peaks) else None
            yield (meaning(name) or name) + slow, plain_unit(name), float(size), pace


def _of_trial(of: HeldOut) -> dict:
    """How a forecast of the end of a recording went, which was hidden from the method."""
    ahead = of.forecast
    factors = dict(zip(ahead.names, of.factors, strict=True))
    length = ahead.time[-1] - ahead.time[0]
    told = [
        (name, skill, held, least)
        for name, skill, held, least in zip(
            ahead.names, of.skill, 100 * of.held, ahead.chance, strict=True
        )
        if np.isfinite(skill)
    ]
    where = f" of the longest stretch, up to {ahead.time[-1]:.0f} s," if of.index < -1 else ""
    return {
        "held_seconds": f"{length:.0f}" if length >= 1.0 else f"{length:.1g}",
        "of_longest": where,
        "missed": [
            f"{100 * np.sqrt(1.0 - min(skill, 1.0)):.0f} % of {_motion_of(name)}"
            for name, skill, *_ in told
        ],
        "inside": [f"{held:.0f}" for *_, held, _ in told],
        "worse": [_name(name) for name, factor in factors.items() if np.isinf(factor)],
        "wider": {name: f for name, f in factors.items() if of.useful and f > 1.0},
        "skills": [
            f"{name}: R2 {skill:.3f}, {held:.0f} % of the samples inside the 90 % band (chance "
            f"allows {100 * least:.0f} % or more)"
            for name, skill, held, least in told
        ],
    }


def _motion_of(name: str) -> str:
    """`the vertical motion`, of q_v; of other systems the state."""
    said = meaning(name).replace("displacement", "motion")
    return f"the {said}" if said else name


def _of_stretches(recordings: Sequence[Recording], found: IdentifiedModel) -> dict:
    """How many parts of the recordings were used, and their share of the time; 0 for the whole."""
    own = recordings if found.is_forced else excerpts(list(recordings))
    if all(one is other for one, other in zip(own, recordings, strict=False)):
        return {"stretches": 0}
    used, whole = (sum(np.ptp(one.time) for one in of) for of in (own, recordings))
    return {"stretches": len(own), "share": 100 * used / whole}


def _untold(identified: IdentifiedModel, units: Mapping[str, str]) -> dict:
    """What the model does not say: other conditions, and the absent terms with most room.

    units: of inputs, by name.
    """
    model = identified.model
    limits = np.where(np.isfinite(identified.detection_limits), identified.detection_limits, -1.0)
    flat = np.argsort(-limits, axis=None)[:3]
    inputs = dict.fromkeys(model.inputs, "") | units
    room = [
        f"{term_name(model.terms[j], model.names)} in d({model.states[i]})/dt: absent, or as large "
        f"as {limits[i, j]:.3g} "
        f"{coefficient_unit(model.states[i], model.terms[j], model.names, inputs)}"
        for i, j in zip(*np.unravel_index(flat, limits.shape), strict=True)
        if limits[i, j] > 0
    ]
    scales = [
        f"The scale of {name.removeprefix('scale_')}: it was told from its rate, as {value:.4g} "
        "times the true one"
        for name, value in identified.diagnostics.items()
        if name.startswith("scale_")
    ]
    return {"inputs": model.inputs, "untold": [*scales, *room]}


def _said(of: Value, unit: str, factor: float = 1.0) -> str:
    """A value times a factor with its interval, if it has one, to the digits that it tells."""
    if factor < 0.0:
        of, factor = Value(-of.value, -of.high, -of.low), -factor
    value = f"{factor * of.value:.4g} {unit}".rstrip()
    if np.isnan(of.low):
        return value
    if np.isinf([of.low, of.high]).any():
        ends = [f"{factor * end:.4g}" if np.isfinite(end) else "beyond the range"
                for end in (of.low, of.high)]  # fmt: skip
        return f"{value} ({ends[0]} to {ends[1]})"
    return in_words(of, unit, factor)
