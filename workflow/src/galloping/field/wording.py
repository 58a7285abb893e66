"""What recordings and their model tell, in the words of an engineer: the text of `summary.md`."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from math import floor, log, log10
from typing import TYPE_CHECKING

import numpy as np

from galloping.field import ambient
from galloping.field.advice import Advice
from galloping.field.dynamics import ROUNDING, Dynamics, Value
from galloping.field.excerpt import excerpts
from galloping.field.forecast import HeldOut, Sensed
from galloping.field.inputs import input_lines
from galloping.field.quality import peaks_of, spectrum
from galloping.field.reasons import PARTS, PLACES, PROBLEMS, WIND, plain_reasons
from galloping.field.units import coefficient_unit, meaning, state_unit
from galloping.identification.model import IdentifiedModel
from galloping.polynomial import term_name
from galloping.recording import Recording

if TYPE_CHECKING:
    from galloping.field.summary import Summary

MEANING = {
    "ok": "The equations below follow the recording down to the noise of its sensors, and no other "
    "terms do as well: its numbers can be used, within their intervals, for winds and motions like "
    "those recorded.",
    "not identifiable": "The model follows the recording down to the noise of its sensors, so what "
    "it says of motions like the recorded ones can be used; but the recording leaves open which "
    "terms the equations have: with others, much smaller or larger motions would be different, by "
    "more than the intervals say.",
    "approximate": "No equations of this kind follow the recording exactly, and these come near: "
    "take them for how far and how fast the line moves, within the intervals, which are widened by "
    "what the model misses, and read no meaning into single terms.",
    "refused": "No equations could be found that may be trusted, so there are no damping, no "
    "amplitude in the end and no forecast; what is said above comes from the samples alone.",
    "unjudged": "This method does not judge its model, and nothing here says whether it holds.",
}
ENDS = {
    "rest": "the motion dies out",
    "forced": "random forces keep it moving",
    "irregular": "the motion never repeats, or settles too slowly to tell",
}
TECHNICAL = "## Technical part"
KNOWN = 0.01  # standard error of a coefficient that no further recording needs to tell better
MOST_PROBLEMS = 5  # of samples, that are told before the technical part


def summary_text(
    of: Summary,
    reports: Sequence[dict] = (),
    beside: tuple[str, Dynamics | None] | None = None,
) -> str:
    """summary.md: what was found, how far to believe it, what would help most; technical part.

    reports: of `quality`, where the recordings come from files. beside: a name, and what is known
    of the line by that name.
    """
    found, known = of.found, of.dynamics
    forces = [ambient.row(found, known)] if found.is_forced else []
    parts = {
        "# Summary": [],
        "## What was found": [
            _unlikely(reports) + _outcome(of),
            "",
            *_table(known, of.recordings, forces),
        ],
        "## How far it may be believed": _belief(of, reports),
        "## What would help most": [f"- {each}" for each in _helps(of, reports)],
        TECHNICAL: [f"**{found.verdict}**"],
    }
    if found.status != "refused":
        parts["### Equations"] = ["```", *found.equations(), "```"]
    said = _about_rest(known) if known else []
    if beside and beside[1]:
        said += [f"By case {beside[0]}:", "", *_table(beside[1], ())]
    if said:
        parts["### The line"] = said
    if of.held_out or of.untried:
        parts["### Forecast"] = [_skill(of.held_out) if of.held_out else f"None: {of.untried}."]
    described = [report_lines(report) for report in reports]
    parts["### Recordings"] = [
        line
        for head, *rest in described or [repr(each).splitlines() for each in of.recordings]
        for line in (f"- {head}", *(f"  - {each.strip()}" for each in rest))
    ] + ([] if found.is_forced else _used(of.recordings))
    if found.status != "refused":
        parts["### What the recordings cannot tell"] = _untold(found)
    if of.advice:
        parts["### Further recordings"] = _options(of.advice)
    if not parts["## What would help most"]:
        del parts["## What would help most"]
    return "\n\n".join("\n\n".join([head, *_block(lines)]) for head, lines in parts.items()) + "\n"


def _block(lines: Sequence[str]) -> list[str]:
    return ["\n".join(lines).strip("\n")] if lines else []


def in_words(of: Value, unit: str, factor: float = 1.0) -> str:
    """A value times a factor with its interval, to the digits that it tells."""
    number, interval = _numbers(of, factor)
    return f"{number} {unit}".strip() + (f" ({interval})" if interval else "")


def _numbers(of: Value, factor: float = 1.0) -> tuple[str, str]:
    value, low, high = (factor * number for number in (of.value, of.low, of.high))
    if low == high:
        return f"{value:.5g}", ""
    if not np.isfinite(low):
        return f"{value:.3g}", "interval unknown"
    digits = max(0, 1 - floor(log10((high - low) / 2))) if high > low else 6
    return f"{value:.{digits}f}", f"{low:.{digits}f} to {high:.{digits}f}"


def _name(state: str) -> str:
    """`vertical`, of q_v; of other systems the state."""
    return meaning(state).partition(" ")[0] or state


def _unit(state: str) -> str:
    return state_unit(state).removeprefix("1")


def _and(parts: Iterable[str]) -> str:
    *most, last = parts
    return f"{', '.join(most)} and {last}" if most else last


def _unlikely(reports: Sequence[dict]) -> str:
    odd = any("is the unit" in each["what"] for one in reports for each in one["problems"])
    return "**Check the units first: no span moves as this recording says.** " * odd


def _outcome(of: Summary) -> str:
    """In a sentence or two: whether the line gallops, and where that ends."""
    if of.dynamics:
        mixed = re.search(PARTS, of.found.reason) is not None
        first = "The line was not the same all through the recording; this is of its mean. "
        if of.found.is_forced:
            return ambient.outcome(of.dynamics)
        return first * mixed + _of_line(of.dynamics)
    if of.found.status == "refused":
        return "The recording gives no model of the line; what it shows by itself:"
    return "A model was found; its equations are below."


def _of_line(known: Dynamics) -> str:
    if not known.rest:
        return (
            "The model has no position of rest inside the motion, and so no natural frequencies "
            f"and no damping. {_end(known)}"
        )
    damped = {state: value for state, value in known.damping.items() if np.isfinite(value.value)}
    grow = {s: v for s, v in damped.items() if v.value < -ROUNDING}
    unsure = [s for s, v in damped.items() if v.low < -ROUNDING and v.high > ROUNDING]
    of_span = any(map(meaning, damped))
    line, gallop, gallops = (
        ("the line", "gallop", "gallops")
        if of_span
        else ("the system", "oscillate by itself", "oscillates by itself")
    )
    if not damped:
        return f"No small motion oscillates. {_end(known)}"
    if unsure:
        return (
            f"**Whether small {_and(map(_name, unsure))} motions grow or die out is not told**: "
            f"the interval of their damping holds zero, so {line} may be near its onset. "
            f"{_end(known)}"
        )
    if grow:
        pace = _and(f"{_name(s)} ones double in {_doubling(known.frequencies[s], v)}"
                    for s, v in grow.items())  # fmt: skip
        return f"**As recorded, {line} {gallops}**: small motions grow, {pace}. {_end(known)}"
    if _keeps(known):
        return (
            f"**As recorded, small motions of {line} neither grow nor die out**: no damping was "
            "found, and nothing that would change how far it moves."
        )
    if known.kind == "cycle":
        return (
            f"**As recorded, small motions of {line} die out, and larger ones go on**: it "
            f"{gallops} where something pushes it far enough. {_end(known)}"
        )
    least = min(damped, key=lambda state: damped[state].value)
    margin = in_words(damped[least], "% of critical damping", 100)
    return (
        f"**As recorded, {line} does not {gallop}**: small motions die out. Its margin is the net "
        f"damping of the {_name(least)} motion, {margin}: it would {gallop} where the wind takes "
        "that much more." + ("" if known.kind in ENDS else f" {_end(known)}")
    )


def _keeps(known: Dynamics) -> bool:
    """Whether a motion of any size goes on as it is."""
    return all(abs(value.value) < ROUNDING for value in known.damping.values())


def _doubling(frequency: Value, damping: Value) -> str:
    """The time in which a motion that grows doubles."""
    own, *ends = (
        log(2.0) / (2.0 * np.pi * frequency.value * -ratio) if ratio < 0 else np.inf
        for ratio in (damping.value, damping.low, damping.high)
    )
    return in_words(Value(own, *ends), "s")


def _end(of: Dynamics) -> str:
    if of.kind != "cycle":
        untold = "the model does not tell where the motion ends: in simulation it runs away"
        said = ENDS.get(of.kind, untold)
        return said[0].upper() + said[1:] + "."
    halves = _and(
        f"±{in_words(half, _unit(state))} {_name(state)}" for state, half in of.half_range.items()
    )
    sure = "" if of.period else "; nothing tells how sure that is, for it was not computed exactly"
    return f"In a steady wind it settles on a motion that repeats, a limit cycle: {halves}{sure}."


def _table(
    known: Dynamics | None,
    recordings: Sequence[Recording],
    more: Sequence[tuple[str, str, str]] = (),
) -> list[str]:
    """Rows of what was recorded and found, with 95 % intervals."""
    rows = []
    if recordings:
        names = Sensed.by(recordings[-1]).names
        for k, name in enumerate(names):
            size, pace = _recorded(recordings, k)
            if np.isfinite(size):
                what = f"{meaning(name) or name} {name}".removesuffix(f" {name}") or name
                rows.append((f"{what}, recorded", f"±{size:.3g} {_unit(name)}", ""))
                if known is None and np.isfinite(pace):
                    rows.append((f"{what}, frequency of most of it", f"{pace:.3g} Hz", ""))
    if known:
        rows += [
            (f"{name}, at the mean of which is what follows", f"{value:.4g}", "")
            for name, value in known.at.items()
        ]
        for state in known.half_range or known.frequencies:
            own = _name(state)
            frequency, damping = known.frequencies[state], known.damping[state]
            if np.isfinite(frequency.value):
                rows.append((f"{own}: natural frequency", *_cells(frequency, "Hz")))
                none = abs(damping.value) < ROUNDING
                rows.append(
                    (f"{own}: net damping", *(("none found", "") if none
                     else _cells(damping, "% of critical", 100)))
                )  # fmt: skip
            if state in known.half_range and not _keeps(known):
                size, interval = _cells(known.half_range[state], _unit(state))
                rows.append((f"{own}: amplitude in the end", f"±{size}", interval))
        if known.period and not _keeps(known):
            rows.append(("period in the end", *_cells(known.period, "s")))
    rows += more
    if not rows:
        return []
    lines = [f"| {' | '.join(row)} |" for row in rows]
    return ["| | | 95 % interval |", "| --- | --- | --- |", *lines]


def _cells(of: Value, unit: str, factor: float = 1.0) -> tuple[str, str]:
    number, interval = _numbers(of, factor)
    return f"{number} {unit}".strip(), interval


def _recorded(recordings: Sequence[Recording], k: int) -> tuple[float, float]:
    """Half of the range of a channel, and the frequency of most of its motion, Hz."""
    channels = [
        (own.time[known], values[known])
        for own in recordings
        for values in [Sensed.by(own).samples(own)[:, k]]
        if np.count_nonzero(known := np.isfinite(values)) > 1
    ]
    if not channels:
        return np.nan, np.nan
    values = np.concatenate([values for _, values in channels])
    time, longest = max(channels, key=lambda channel: len(channel[0]))
    frequency, share = spectrum(time, longest, float(np.median(np.diff(time))))
    peaks = peaks_of(share)[1]
    return float(np.ptp(values) / 2), float(frequency[peaks[0]]) if len(peaks) else np.nan


def _about_rest(of: Dynamics) -> list[str]:
    if not of.rest:
        return ["The model has no position of rest inside the motion, so no natural frequencies."]
    places = ", ".join(f"{s} = {in_words(value, _unit(s))}" for s, value in of.rest.items())
    still = [state for state, value in of.frequencies.items() if np.isnan(value.value)]
    return [
        f"Small motions are those about the position of rest that is recorded, {places}; net "
        "damping is that of the line less what the wind puts in.",
        *(f"{state} does not oscillate by itself." for state in still),
    ]


def _belief(of: Summary, reports: Sequence[dict]) -> list[str]:
    why = " ".join(why for why, _ in plain_reasons(of.found.reason) if why)
    meanings = ambient.MEANING if of.found.is_forced else MEANING
    lines = [f"**{of.found.status}**: {meanings[of.found.status]}" + (f" {why}" if why else "")]
    lines += [
        line
        for said in [*_tried(of.held_out, of.found.is_forced), *_cautions(of)]
        for line in ("", said)
    ]
    problems = [
        f"- {report['file']}, {p['column']}, from row {p['row']} on: {p['what']}"
        for report in reports
        for p in report["problems"]
    ]
    if problems:
        more = len(problems) - MOST_PROBLEMS
        lines += ["", "What is odd about the samples:", "", *problems[:MOST_PROBLEMS]]
        lines += [f"- and {more} more, below"] if more > 0 else []
    return lines


def _tried(of: HeldOut | None, forced: bool) -> list[str]:
    """How a forecast of the end of the recording went, which was hidden from the method."""
    if of is None or not of.useful:
        return []
    length = of.forecast.time[-1] - of.forecast.time[0]
    told = [
        (meaning(name).replace("displacement", "motion") or name, skill, held)
        for name, skill, held in zip(of.forecast.names, of.skill, of.held, strict=True)
        if np.isfinite(skill)
    ]
    missed = _and(
        f"{100 * np.sqrt(1.0 - min(skill, 1.0)):.0f} % of the {name}" for name, skill, _ in told
    )
    held = _and(f"{100 * share:.0f}" for *_, share in told)
    return [
        f"As a test the last {length:.0f} s were hidden from the method and forecast from the "
        f"rest: the forecast missed {missed}, and its 90 % band held {held} % of the samples."
        + " Nothing foretells random forces."
        * forced
    ]


def _cautions(of: Summary) -> list[str]:
    """What must be known of the forecasts before any is used."""
    if of.untried:
        return [
            "**Whether its forecasts hold is not known**: without its last part the recording "
            "gives none."
        ]
    trial = of.held_out
    if trial is None:
        return []
    each = list(zip(trial.forecast.names, trial.held, trial.factors, strict=True))
    if not trial.useful:
        worse = _and(_name(name) for name, _, factor in each if np.isinf(factor))
        return [
            "**It gives no forecast**: the end of the recording, hidden as a test, was missed by "
            f"more than a line at rest would miss it, in the {worse} motion."
        ]
    return [
        f"**Its forecasts are less sure than the model says**: {_name(name)}, all bands are "
        f"{factor:.2g} times as wide as the model's, so that the hidden end lies in them as it "
        "should."
        for name, _, factor in each
        if factor > 1.0
    ]


def _helps(of: Summary, reports: Sequence[dict]) -> list[str]:
    """What would help, that which helps most first."""
    said = [problem["what"] for report in reports for problem in report["problems"]]
    helps = [help_ for part, help_ in PROBLEMS if any(part in what for what in said)]
    for _, more in plain_reasons(of.found.reason):
        helps += [more] if more and more not in " ".join(helps) else []
    advice = of.advice
    if advice and advice.options and advice.error > KNOWN * abs(advice.coefficient):
        name, error = advice.options[0]
        now, then = (100.0 * e / abs(advice.coefficient) for e in (advice.error, error))
        helps.append(
            f"of one more recording at the same wind, best {name}: the term known worst would then "
            f"be known to {then:.2g} % instead of {now:.2g} %"
        )
    if of.found.status == "approximate" and PLACES not in helps:
        helps.append(f"{PLACES}; more of the same kind would not, for what the model misses is no "
                     "noise that averages out")  # fmt: skip
    if not of.found.model.inputs and WIND not in " ".join(helps):
        helps.append(f"{WIND}, in several winds: one wind alone does not tell at which wind "
                     "galloping begins")  # fmt: skip
    if of.found.model.inputs:  # which were recorded
        helps = [each for each in helps if WIND not in each]
    return list(dict.fromkeys(helps))


def _options(of: Advice) -> list[str]:
    share = 100.0 / abs(of.coefficient)
    return [
        f"The term known worst is {of.term}: {of.coefficient:.3g} {of.unit}, standard error "
        f"{share * of.error:.2g} %. After one more recording of {of.duration:.0f} s at the same "
        "wind it would be:",
        "",
        *(f"- {name}: {share * error:.2g} %" for name, error in of.options),
    ]


def _skill(of: HeldOut) -> str:
    said = [
        f"{name}: R2 {skill:.3f}, {100 * held:.0f} % of the samples inside the 90 % band (chance "
        f"allows {100 * least:.0f} % or more)"
        for name, skill, held, least in zip(
            of.forecast.names, of.skill, of.held, of.forecast.chance, strict=True
        )
        if np.isfinite(skill)
    ]
    length = of.forecast.time[-1] - of.forecast.time[0]
    return f"The last {length:.0f} s, which were held out: {'; '.join(said)}."


def _used(recordings: Sequence[Recording]) -> list[str]:
    stretches = excerpts(list(recordings))
    if all(one is other for one, other in zip(stretches, recordings, strict=False)):
        return []
    duration = sum(one.time[-1] - one.time[0] for one in recordings)
    share = 100 * sum(one.time[-1] - one.time[0] for one in stretches) / duration
    return [
        "",
        f"The model comes from {len(stretches)} stretches, {share:.2g} % of the time: those in "
        "which the motion grows or decays most, and those in which it is largest.",
    ]


def report_lines(report: dict) -> list[str]:
    """A report of `quality` as text: the file, then a line for each channel, note and problem."""
    sampling = report["sampling"]
    gaps = sampling["gaps_total"]
    lines = [
        f"{report['file']}: {sampling['samples']} samples over {sampling['duration_s']:.1f} s "
        f"({sampling['rate_hz']:.3g} Hz), {gaps or 'no'} gap{'' if gaps == 1 else 's'}"
    ]
    for column, channel in report["channels"].items():
        target = channel["measures"]
        unit = _unit(target)
        frequencies = ", ".join(f"{f:.3g}" for f in channel["dominant_frequencies_hz"])
        lowest, highest, noise = (
            f"{channel[key]:.3g} {unit}".strip() for key in ("lowest", "highest", "noise")
        )
        lines.append(
            f"  {column} measures {target}{', the ' * bool(meaning(target))}{meaning(target)}: "
            f"{lowest} to {highest}, noise {noise}, {channel['missing_percent']:.1f} % missing, "
            f"mostly at {frequencies or 'no'} Hz"
        )
    lines += [f"  {line}" for line in input_lines(report.get("inputs", {}))]
    lines += [f"  {note}" for note in report["notes"]]
    return lines + [f"  {p['column']}, row {p['row']}: {p['what']}" for p in report["problems"]]


def _untold(identified: IdentifiedModel) -> list[str]:
    """What the model does not say: other conditions, and the absent terms with most room."""
    model = identified.model
    limits = np.where(np.isfinite(identified.detection_limits), identified.detection_limits, -1.0)
    flat = np.argsort(-limits, axis=None)[:3]
    inputs = dict.fromkeys(model.inputs, "")
    room = [
        f"- {term_name(model.terms[j], model.names)} in d({model.states[i]})/dt: absent, or as "
        f"large as {limits[i, j]:.3g} "
        f"{coefficient_unit(model.states[i], model.terms[j], model.names, inputs)}"
        for i, j in zip(*np.unravel_index(flat, limits.shape), strict=True)
        if limits[i, j] > 0
    ]
    scales = [
        f"- The scale of {name.removeprefix('scale_')}: it was told from its rate, as {value:.4g} "
        "times the true one"
        for name, value in identified.diagnostics.items()
        if name.startswith("scale_")
    ]
    others = f"values of {_and(model.inputs)} that were not" if model.inputs else "other winds"
    return [
        f"- What holds at {others}, and at motions much larger than those recorded",
        *scales,
        *room,
    ]
