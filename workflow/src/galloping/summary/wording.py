"""Text of summaries, for engineers: values and lists for the templates beside this module."""

import re
from collections.abc import Collection, Mapping, Sequence
from functools import cache
from importlib.resources import files
from math import floor, isfinite, isinf, isnan, log10
from typing import TYPE_CHECKING, Any

import numpy as np
from jinja2 import Environment, StrictUndefined, Template

from galloping.behaviour.dynamics import EXTRAPOLATION_RATIO, MIN_DAMPING_RATIO, Value
from galloping.identification.findings import Code
from galloping.identification.identified_model import IdentifiedModel
from galloping.identification.sentences import join_words
from galloping.inspection.noticed import envelope_rows, write_sentences
from galloping.readers.units import is_span, meaning, plain_unit
from galloping.recording.samples import Recording
from galloping.summary.advice import (
    input_units,
    list_advice,
    may_be_wind,
    meanings_and_advice,
    relative_error_text,
    shown_units,
)
from galloping.summary.numbers import (
    PERCENT,
    Estimate,
    HeldOutChannel,
    RecordedMotion,
    SummaryNumbers,
    SystemEstimates,
    is_damping_undetermined,
    is_linearly_undamped,
    is_undamped,
)

if TYPE_CHECKING:
    from galloping.behaviour.assessment import Assessment, Condition
    from galloping.behaviour.dynamics import Dynamics
    from galloping.summary.summarise import Summary

MOTION_ENDS = {
    "rest": "the motion dies out",
    "forced": "random forces keep it moving",
    "irregular": "some motions do not settle within the simulated time",
    "stopped": "where the motion ends is unknown: it is too fast to be simulated",
}
DIVERGENCE_TEXT = "in simulation the motion diverges"
STATUS_SENTENCES = {
    "ok": "the model explains the recording down to the noise of its sensors",
    "not identifiable": "the model explains the recording, but models with other terms do as well",
    "approximate": "the model follows the recording approximately, with errors larger than the "
    "noise",
    "refused": "no model can be trusted",
    "unjudged": "the method does not assess its model",
}
# words for the interpolation of an input, by its setting
INTERPOLATION_WORDS = {"zero": "held", "linear": "linear", "cubic": "smooth"}
TECHNICAL_TITLE = "## Technical part"
PARTS_DIFFER = Code.PARTS_DIFFER, Code.FREQUENCY_CHANGES, Code.DAMPING_CHANGES
UNIT_FINDINGS = Code.UNIT_UNLIKELY, Code.TIME_UNIT_UNLIKELY
MAX_DIGITS = 4  # digits of a printed number: summary.json has all
TWO_DIGIT_LIMIT = 3.55  # half an interval, as 1 to 9.99, below which two digits are printed
PLAIN_RANGE = 1e-3, 1e6  # range of numbers that are printed without a power of ten
MAX_DAMPING_WIDTH = 12.0  # rad: width of a damping's interval times phase of the recorded motion
MAX_PROBLEMS = 5  # problems of samples that are listed before the technical part


def render_summary(
    summary: "Summary", numbers: SummaryNumbers, reports: Sequence[dict] = ()
) -> str:
    """Render the text of summary.md: results, their reliability, advice and technical details.

    numbers: those collected from the summary. reports: of `quality`, if the recordings come from
    files.
    """
    identified, dynamics, last = summary.found, summary.dynamics, summary.recordings[-1]
    problems = [
        escape_markdown(f"{report['file']}, from row {p['row']} on: {p['what']}")
        for report in reports
        for p in report["problems"]
    ]
    described = [*map(report_text, reports)] or [*map(repr, summary.recordings)]
    unused = [f"{name!r} of {report['file']}" for report in reports
              for name in report.get("unused_motion", ())]  # fmt: skip
    of_span, units = is_span(identified.model.states), input_units(reports)
    extra = [one.name for one in identified.further_modes]
    line = "the line" if of_span else "the system"
    values = {
        "summary": summary, "found": identified, "known": dynamics, "numbers": numbers,
        "trial": summary.held_out, "ends": MOTION_ENDS, "technical": TECHNICAL_TITLE,
        "most_problems": MAX_PROBLEMS,
        "refused": identified.status == "refused",
        "in_short": STATUS_SENTENCES[identified.status],
        "winds": _range_to_assess(identified) if may_be_wind(identified, units) else "",
        "sure": bool(np.any(identified.standard_errors > 0.0)),
        "of_span": of_span,
        "conditions": _conditions(identified, units),
        "condition": _condition(numbers),
        "line": line,
        "gallop": "gallop" if of_span else "sustain oscillations by itself",
        "gallops": "gallops" if of_span else "sustains oscillations by itself",
        "exact": [name for name in identified.model.inputs if not last.inputs[name].error],
        "held": [name for name in identified.model.inputs if last.inputs[name].between == "zero"],
        "odd": any(p["code"] in UNIT_FINDINGS for report in reports for p in report["problems"]),
        "repeats": identified.has_finding(Code.MOTION_REPEATS),
        "rested": identified.has_finding(Code.RELEASED, Code.CAME_TO_REST),
        "mixed": identified.has_finding(*PARTS_DIFFER),
        "margins": _margins(dynamics, summary.recordings, identified)
        if identified.is_forced and dynamics else [],
        "meanings": [
            re.sub("(?<=[Tt])he line", line[1:], why)
            for why, _ in meanings_and_advice(identified.findings, of_span)
            if why
        ],
        "problems": problems,
        "helps": list_advice(summary, reports),
        "described": [re.sub(r"\n\s*", "\n  - ", escape_markdown(text)) for text in described],
        "unused": escape_markdown(join_words(unused)) if unused else "",
        "small": _describe_modes(dynamics, numbers.system, extra)
        if dynamics and numbers.system else {},
        "beyond": _beyond_recorded(numbers),
        "degrees": _further_degrees(identified),
        "noticed": list(
            write_sentences(
                identified.findings, identified.further_modes, dynamics.damping if dynamics else ()
            )
        ),
        "envelope": list(envelope_rows(identified.envelope)),
    }  # fmt: skip
    text = _template("summary.md").render(values)
    text = re.sub(r"(?<=\S)( *\n {4,})+|(?<=[.:]) {2,}", " ", text)
    text = re.sub(r"^ {4,}| +$", "", text, flags=re.MULTILINE)
    return re.sub(r"\n{3,}", "\n\n", text).strip() + "\n"


def escape_markdown(text: str) -> str:
    """Escape the Markdown markup in a text, such as the name of a file.

    Names of files and columns may contain anything.
    """
    return re.sub(r"([\\`*<>\[\]|]|(?<!\w)_|_(?!\w))", r"\\\1", text)


def report_text(report: dict) -> str:
    """Format a data-quality report as text, with a line per channel, input, note and problem."""
    return _template("quality.txt").render(report=report).rstrip()


def assessment_text(
    assessment: "Assessment", units: Mapping[str, str], *, is_detailed: bool = True
) -> str:
    """Format as text the galloping onset, and growth and limit cycles at each input value.

    units: of inputs, by name. is_detailed: whether equilibria, modes and unstable limit cycles
    follow.
    """
    values = {"assessment": assessment, "units": shown_units(units), "is_detailed": is_detailed}
    return _template("assessment.txt").render(values).rstrip()


def _growth(condition: "Condition") -> str:
    """Describe whether small motions about the equilibrium nearest to the motion grow."""
    if not condition.equilibria:
        return "no equilibrium near the motion"
    dampings = [mode.damping for mode in condition.equilibria[0].modes]
    if any(one.value < 0.0 and not one.high > 0.0 for one in dampings):
        return "small motions grow"
    if any(max(abs(one.low), abs(one.high)) < MIN_DAMPING_RATIO for one in dampings):
        return "small motions have no linear damping"
    may = any(one.value <= 0.0 or one.low < 0.0 for one in dampings)
    return "small motions may grow" if may else "small motions die out"


def _range_to_assess(identified: IdentifiedModel) -> str:
    """Format a range of a model's single input to assess, as `--at U=9.69:14.5`."""
    names = identified.model.inputs
    if len(names) != 1 or not (ends := identified.recorded(names[0])):
        return ""
    low, high = ends
    if low == high:
        return f"`--at {names[0]}=A:B`, the range from A to B"
    return f"`--at {names[0]}={low:.3g}:{high:.3g}`, the recorded range"


def _conditions(identified: IdentifiedModel, units: Mapping[str, str]) -> str:
    """Describe the conditions, besides the motion, in which a model is valid."""
    if may_be_wind(identified, units):
        return "winds and "
    return (
        f"values of {join_words(identified.model.inputs)} and " if identified.model.inputs else ""
    )


def _condition(numbers: SummaryNumbers) -> str:
    """Describe where properties of the system are computed: at the means of its inputs."""
    means = numbers.system.at if numbers.system else {}
    if not means:
        return "As recorded"
    values = join_words(
        [f"{name} = {mean.value:.3g} {mean.unit}".rstrip() for name, mean in means.items()]
    )
    return f"At {values}, {'its mean' if len(means) == 1 else 'their means'}"


@cache
def _template(name: str) -> Template:
    environment = Environment(undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    environment.filters |= {
        "between_in_words": INTERPOLATION_WORDS.get,
        "bullets": lambda lines: "\n".join(f"- {line}" for line in lines),
        "cells": lambda estimate: " | ".join(_cells(estimate)),
        "digits": lambda number, state="", count=3: (
            f"{number:.{count}g} {plain_unit(state)}".strip()
        ),
        "end": lambda kind: MOTION_ENDS.get(kind.partition(":")[0], DIVERGENCE_TEXT),
        "escape": escape_markdown,
        "extent": extent_in_words,
        "growth": _growth,
        "join_words": join_words,
        "meaning": meaning,
        "errors": _describe_errors,
        "name": _name,
        "range_digits": lambda values, least=3: _range_digits(
            values["lowest"], values["highest"], least
        ),
        "relative_error": lambda error, advice: relative_error_text(error, advice.coefficient),
        "quantity": _quantity_text,
        "sentence": lambda text: text[:1].upper() + text[1:],
        "short": lambda number, unit="": f"{number:.3g} {unit}".rstrip(),
        "shown_damping": _damping_cells,
        "unit": plain_unit,
        "whole": lambda number: f"{number:.0f}",
        "words": in_words,
    }
    environment.tests |= {
        "damping_undetermined": is_damping_undetermined,
        "finite": isfinite,
        "linearly_undamped": is_linearly_undamped,
        "undamped": is_undamped,
    }
    text = files(__package__).joinpath(f"{name}.jinja").read_text(encoding="utf-8")
    return environment.from_string(text)


# --- numbers ---


def in_words(estimate: Estimate) -> str:
    """Format a value and its interval as text, with the digits that the interval justifies."""
    number, interval = _cells(estimate)
    return number + (f" ({interval})" if interval else "")


def _cells(estimate: Estimate) -> tuple[str, str]:
    value, low, high, unit = estimate.value, estimate.low, estimate.high, estimate.unit
    if isinf(value) or isnan(low) or isnan(high):
        return f"{value:.3g} {unit}".strip(), "interval unknown"
    if isinf(low) or isinf(high):
        ends = [f"{end:.3g}" if isfinite(end) else "beyond the range" for end in (low, high)]
        return f"{value:.3g} {unit}".strip(), " to ".join(ends)
    largest = max(abs(value), abs(low), abs(high))
    least = floor(log10(largest)) + 1 - MAX_DIGITS if largest else 0
    half, power = (high - low) / 2.0, least
    if half > 0.0:
        first = floor(log10(half))
        power = max(first - (half / 10.0**first < TWO_DIGIT_LIMIT), least)
    number, *ends = _at_place((value, low, high), power)
    text = f"{number} {unit}".strip()
    if ends[0] == ends[1]:
        return text, f"narrower than {10.0**power:g} {unit}".rstrip() if half else ""
    return text, " to ".join(ends)


def _at_place(numbers: Sequence[float], last_power: int) -> list[str]:
    """Format numbers to one power of ten, with a common exponent if they are large or small."""
    largest = max(map(abs, numbers))
    if not largest or PLAIN_RANGE[0] <= largest < PLAIN_RANGE[1]:
        return [f"{round(number, -last_power) + 0.0:.{max(-last_power, 0)}f}" for number in numbers]
    power = floor(log10(largest))
    decimals = max(power - last_power, 0)
    heads = [f"{number / 10.0**power + 0.0:.{decimals}f}" for number in numbers]
    return [f"{head}e{power:+03d}" if float(head) else "0" for head in heads]


def extent_in_words(motion: RecordedMotion) -> str:
    """Format a recorded range as text of three or more digits, such as `-0.95 to 1.09 m`."""
    largest = float(f"{max(abs(motion.low), abs(motion.high)):.3g}")
    power = floor(log10(largest)) + 1 - _range_digits(motion.low, motion.high) if largest else 0
    return f"{' to '.join(_at_place((motion.low, motion.high), power))} {motion.unit}".rstrip()


def _range_digits(low: float, high: float, least: int = 3) -> int:
    """Count the significant digits in which the ends of a range differ, even far from zero."""
    if not low < high:
        return least
    largest = max(abs(low), abs(high))
    return max(floor(log10(largest)) - floor(log10(high - low)) + 2, least)


def _quantity_text(quantity: Value, unit: str, factor: float = 1.0) -> str:
    """Format a value times a factor with its interval, if any, to the digits that it determines."""
    estimate = Estimate.from_value(quantity, unit, factor)
    if isnan(estimate.low):
        return f"{estimate.value:.4g} {unit}".rstrip()
    return in_words(estimate)


def _damping_cells(damping: Estimate) -> str:
    """Format a net damping that may be zero, with the interval of undetected damping."""
    value, interval = _cells(damping)
    if abs(damping.value) < 100.0 * MIN_DAMPING_RATIO:
        return f"none found, in {damping.unit} | {interval}"
    return f"{value} | {interval}"


# --- words ---


def _name(state: str) -> str:
    """Return `vertical` for q_v; for other systems the state."""
    return meaning(state).partition(" ")[0] or state


def _describe_modes(
    dynamics: "Dynamics", system: SystemEstimates, of_further: Collection[str]
) -> dict[str, Any]:
    """Describe small motions about the equilibrium, its place, and the limit cycle."""
    damped = {
        state: value
        for state, value in dynamics.damping.items()
        if isfinite(value.value) and state not in of_further
    }
    least = min(damped, key=lambda state: damped[state].value, default="")
    unit, lowest = PERCENT + " damping", damped.get(least)
    return {
        "damped": damped,
        "unsure": [
            state
            for state, value in damped.items()
            if abs(value.value) < MIN_DAMPING_RATIO
            or isnan(value.low + value.high)
            or value.low < -MIN_DAMPING_RATIO < MIN_DAMPING_RATIO < value.high
        ],
        "untold": any(isnan(value.low + value.high) for value in damped.values()),
        "growing": [
            f"{_growing_name(one.name)} double in {_doubling(one.doubling_time)}"
            for one in system.small_motions
            if one.doubling_time is not None
        ],
        "least": least,
        "margin": Estimate.from_value(lowest, unit, 100.0) if lowest else None,
        "halves": [f"±{in_words(v)} {_name(s)}" for s, v in system.limit_cycle.items()],
        "places": ", ".join(f"{s} = {in_words(v)}" for s, v in system.rest.items()),
        "still": "\n".join(
            f"{state} does not oscillate by itself."
            for state, value in dynamics.frequencies.items()
            if isnan(value.value)
        ),
    }


def _growing_name(state: str) -> str:
    return f"{_name(state)} ones" if meaning(state) else f"those of {_name(state)}"


def _doubling(time: Estimate) -> str:
    if isfinite(time.low) and isfinite(time.high):
        return in_words(time)
    # the motion may not grow at all
    value, least = (float(f"{number:.2g}") for number in (time.value, min(time.low, time.high)))
    return f"{value:g} s (at least {least:g} s)"


def _beyond_recorded(numbers: SummaryNumbers) -> list[str]:
    """Describe how far a limit cycle exceeds the recorded motion, by coordinate, if it does."""
    if not (system := numbers.system):
        return []
    half = {one.name: (one.high - one.low) / 2.0 for one in numbers.recorded}
    for one in system.small_motions:
        omega = 2.0 * np.pi * one.natural_frequency.value
        for rate, order in ((f"d{one.name}", 1), (f"dd{one.name}", 2)):
            if rate in half:  # of a displacement that was not measured
                half.setdefault(one.name, half[rate] / omega**order)
    return [
        f"{value.value / half[name]:.2g} times the recorded {_name(name)} amplitude"
        for name, value in system.limit_cycle.items()
        if half.get(name) and value.value > EXTRAPOLATION_RATIO * half[name]
    ]


def _further_degrees(identified: IdentifiedModel) -> str:
    """Format the degrees of missing terms that intervals of small motions include, '' for none."""
    if not len(identified.extrapolation_shift):
        return ""
    n = len(identified.model.states)
    degree = max(sum(term[:n]) for term in identified.model.terms)
    return f"{degree + 1} and {degree + 2}"


def _margins(
    dynamics: "Dynamics", recordings: Sequence[Recording], identified: IdentifiedModel
) -> list[str]:
    """Describe whether modes under random forces also gallop."""
    states, length = identified.model.states, sum(np.ptp(one.time) for one in recordings)
    margins = []
    for name, damping in dynamics.damping.items():
        is_state = name in states
        is_of_one_size = not is_state or all(
            _is_of_one_size(one.values[:, states.index(name)]) for one in recordings
        )
        phase = 2.0 * np.pi * dynamics.frequencies[name].value * length
        margin = _margin(damping, phase, is_of_one_size)
        margins.append(f"{_name(name)}{' motion' * is_state} {margin}")
    return margins


def _is_of_one_size(values: np.ndarray) -> bool:
    """Decide whether a channel (n,) moves as far in each third of it, to a factor of e."""
    thirds = np.array_split(values[np.isfinite(values)], 3)
    sizes = [np.std(part) for part in thirds if len(part)]
    return not sizes or max(sizes) <= np.e * min(sizes)


def _margin(damping: Value, phase: float, is_of_one_size: bool) -> str:
    """Describe whether a mode gallops, as far as its net damping determines.

    phase: rad, of its oscillations during the recording. A mode that meanwhile neither grows nor
    decays by a factor of e is no response to random forces.
    """
    width = (damping.high - damping.low) * phase
    is_steady = abs(damping.value) * phase < 1.0 and width < MAX_DAMPING_WIDTH
    if is_steady and is_of_one_size:
        return (
            "has a nearly constant amplitude, like a mode near the onset of galloping, one that a "
            "machine drives, or settled galloping"
        )
    if damping.low > 0.0:
        return f"does not: at least {100 * damping.low:.2g} % of critical damping remains"
    if damping.high < 0.0:
        return "does: small motions grow"
    return "may: the recording is too short to show whether small motions grow"


def _describe_errors(channels: Sequence[HeldOutChannel]) -> str:
    """Describe the errors of a forecast, by channel; none for random forces."""
    noise = [_motion_of(one.name) for one in channels if one.is_noise]
    missed = [
        f"{one.missed_percent:.3g} % for {_motion_of(one.name)}"
        for one in channels
        if not one.is_noise and isfinite(one.missed_percent)
    ]
    error = "Relative to the standard deviation of the recording, the root-mean-square error was"
    parts = [f"{error} {join_words(missed)}"] if missed else []
    parts += [f"No motion larger than the noise was left of {join_words(noise)}"] if noise else []
    return ". ".join(parts)


def _motion_of(name: str) -> str:
    """Return `the vertical motion` for q_v; for other systems the state."""
    words = meaning(name).replace("displacement", "motion")
    return f"the {words}" if words else name
