"""What would help most, in the words of an engineer, and what a verdict's reason means."""

import csv
import re
from collections.abc import Iterable, Mapping, Sequence
from importlib.resources import files
from typing import TYPE_CHECKING

from galloping.field.quality import MOVES, QUIET, SHOWN, SIGN, SWAPPED
from galloping.identification.model import IdentifiedModel
from galloping.readers.units import meaning

if TYPE_CHECKING:
    from galloping.field.summary import Summary

PROBLEMS = (  # part of what is wrong with samples, and what would help
    ("is the unit", "the right units: the recorded motion is none that a span has"),
    (SIGN, "the right sign of that acceleration"),
    (SWAPPED, "a check of which column is vertical"),
    ("less than 10 periods", "a longer recording, of ten periods of the motion or more"),
    ("less than 10 samples", "a higher sampling rate, of ten samples in a period or more"),
    (QUIET, "a larger motion, or better sensors"),
    ("no samples for", "sensors that record without gaps, at the same times"),
    ("jumps by", "a sensor whose zero holds still"),
    (MOVES, "what was recorded before the mean moved, and after it, each by itself"),
    ("the mean drifts", "a sensor whose zero holds still"),
    ("clipped", "a sensor with a larger range"),
    ("different values", "a sensor of finer resolution"),
)
HELPS = {
    "wind": "the wind speed, recorded beside the motion (`--input`)",
    "places": "sensors at more places along the span, which tell its modes apart (`position` in a "
    "mapping)",
    "directions": "sensors in both directions",
    "fewer": "fewer candidate terms (`--library`, `--degree`)",
    "clocks": "one clock for all sensors, and samples at regular times",
}
WIND, PLACES = HELPS["wind"], HELPS["places"]
KNOWN = 0.01  # standard error of a coefficient that no further recording needs to tell better


def what_helps(of: "Summary", reports: Sequence[dict]) -> list[str]:
    """What would help, that which helps most first."""
    said = [problem["what"] for report in reports for problem in report["problems"]]
    span, units = is_span(of.found), units_in(reports)
    helps = [help_ for part, help_ in PROBLEMS if any(part in what for what in said)]
    if of.found.status == "refused" and (alone := _alone(reports)):
        helps.insert(0, f"a model without {alone}, which has no motion of its own (`--states`)")
    if len({"q_v", "q_w"}.intersection(of.found.model.states)) == 1:
        helps.append(
            "a sensor of the other direction: vertical and horizontal motion drive each other"
        )
    for _, more in plain_reasons(of.found.reason, span):
        helps += [more] if more and more not in " ".join(helps) else []
    advice = of.advice
    if advice and advice.options and advice.error > KNOWN * abs(advice.coefficient):
        name, error = advice.options[0]
        helps.append(
            f"one more recording{' at the same wind' * span}, best of {name}: the coefficient that "
            f"is known worst would then be known to {advice.percent(error)} instead of "
            f"{advice.percent(advice.error)}"
        )
    if of.found.status == "approximate" and PLACES not in helps:
        helps.append(f"{PLACES}; more of the same kind would not, for what the model misses is no "
                     "noise that averages out")  # fmt: skip
    if not of.found.model.inputs and WIND not in " ".join(helps):
        helps.append(f"{WIND}, in several winds: one wind alone does not tell at which wind "
                     "galloping begins")  # fmt: skip
    if of.found.model.inputs or not span:  # which were recorded; no wind drives other systems
        helps = [each for each in helps if WIND not in each]
    if span and _both_directions(reports):
        helps = [each.replace("; " + HELPS["directions"], "") for each in helps]
    if not span:
        helps = [
            each.replace(HELPS["directions"], HELPS["fewer"])
            for each in helps
            if PLACES not in each
        ]
    for name in of.found.model.inputs:
        if ends := of.found.recorded(name):
            unit = shown_units(units).get(name, "")
            beyond = f"below {ends[0]:.3g} or above {ends[1]:.3g} {unit}".rstrip()
            known = "; or a known damping (`--known`)" if may_be_wind(of.found, units) else ""
            helps.append(f"recordings with {name} {beyond}, if the model is to hold there{known}")
    return list(dict.fromkeys(helps))


def _both_directions(reports: Sequence[dict]) -> bool:
    """Whether the sensors of a span measure its vertical and its horizontal motion."""
    measured = {one["measures"][-1] for report in reports for one in report["channels"].values()}
    return {"v", "w"} <= measured


def _alone(reports: Sequence[dict]) -> str:
    """The columns without a motion of their own, where there are others; '' where not."""
    idle = {
        problem["column"]
        for report in reports
        for problem in report["problems"]
        if problem["what"].startswith((QUIET, SHOWN))
    }
    others = {column for report in reports for column in report["channels"]} - idle
    return listed(sorted(idle)) if idle and others else ""


def plain_reasons(reason: str, of_span: bool = True) -> list[tuple[str, str]]:
    """What the parts of a verdict's reason mean, and what would help; none where it has none.

    Those that weigh more come first, as in `reasons.csv`. That the model is inadequate, the last of
    all, is said where nothing tells more. of_span: whether what is in <> in that file is said, or
    what is behind a bar in it.
    """
    text = files(__package__).joinpath("reasons.csv").read_text(encoding="utf-8")
    side = 0 if of_span else 1
    known, fitting = list(csv.DictReader(text.splitlines())), {}
    for clause in reason.split("; "):
        for k, row in enumerate(known):
            if match := re.search(row["pattern"], clause):
                meant, help_ = (
                    match.expand(re.sub("<(.*?)>", lambda of: _side(of[1], side), row[key]))
                    for key in ("meaning", "help")
                )
                fitting.setdefault(k, (meant, help_.format(**HELPS)))
                break
    found = [fitting[k] for k in sorted(fitting)]
    return found[:-1] if len(found) > 1 and len(known) - 1 in fitting else found


def _side(text: str, side: int) -> str:
    """What is before (0) or behind (1) the bar in a text; nothing is behind where there is none."""
    return f"{text}|".split("|")[side]


def units_in(reports: Sequence[dict]) -> dict[str, str]:
    """Units of inputs, by name, from reports of `quality`."""
    return {one["name"]: one["unit"] for report in reports for one in report["inputs"].values()}


def shown_units(units: Mapping[str, str]) -> dict[str, str]:
    """Units to be written behind numbers, those of pure ones left out."""
    return {name: unit for name, unit in units.items() if unit != "1"}


def may_be_wind(found: IdentifiedModel, units: Mapping[str, str]) -> bool:
    """Whether what drives a span may be the wind, as far as units tell."""
    return is_span(found) and all(units.get(n, "m/s") == "m/s" for n in found.model.inputs)


def is_span(found: IdentifiedModel) -> bool:
    """Whether a model is of a span, by the names of its states."""
    return any(map(meaning, found.model.states))


def listed(parts: Iterable[str]) -> str:
    """`a, b and c`; there must be one at least."""
    *most, last = parts
    return f"{', '.join(most)} and {last}" if most else last
