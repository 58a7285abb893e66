"""Advice to engineers, the most useful first, and the meaning of findings."""

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

from galloping.identification.findings import Code, Finding
from galloping.identification.identified_model import IdentifiedModel
from galloping.identification.sentences import explain, join_words
from galloping.inspection.quality import make_finding
from galloping.readers.units import is_same_quantity, is_span

if TYPE_CHECKING:
    from galloping.summary.summarise import Summary

HELPS = {
    "wind": "the wind speed, recorded beside the motion (`--input`)",
    "places": "sensors at more places along the span, which separate its modes (`position` in a "
    "mapping)",
    "directions": "sensors in both directions",
    "longer": "a longer recording of motion that grows or dies out",
    "fewer": "fewer candidate terms (`--library`, `--degree`)",
    "clocks": "one clock for all sensors, and samples at regular times",
}
WIND, PLACES = HELPS["wind"], HELPS["places"]
# standard error of a coefficient, relative, above which a further recording is proposed
MIN_ERROR = 0.01


def list_advice(summary: "Summary", reports: Sequence[dict]) -> list[str]:
    """List advice on how to improve an identified model, the most useful first."""
    identified = summary.found
    problems = [make_finding(problem) for report in reports for problem in report["problems"]]
    span, units = is_span(identified.model.states), input_units(reports)
    helps = [more for _, more in meanings_and_advice(problems, span) if more]
    if identified.status == "refused" and (idle := _format_idle_columns(reports)):
        helps.insert(0, f"a model without {idle}, which has no motion of its own (`--states`)")
    if len({"q_v", "q_w"}.intersection(identified.model.states)) == 1:
        helps.append(
            "a sensor in the other direction: vertical and horizontal motion drive each other"
        )
    exact = identified.status == "ok"  # errors of other models do not decrease with more data
    findings = [each for each in identified.findings if exact or each.code != Code.RANDOM_FORCES]
    for _, more in meanings_and_advice(findings, span):
        helps += [more] if more and more not in " ".join(helps) else []
    advice = summary.advice
    if advice and advice.options and advice.standard_error > MIN_ERROR * abs(advice.coefficient):
        name, error = next(iter(advice.options.items()))
        helps.append(
            f"one more recording{' at the same wind speed' * span}, preferably {name}: the "
            "standard error of the least certain coefficient falls from "
            f"{relative_error_text(advice.standard_error, advice.coefficient)} to "
            f"{relative_error_text(error, advice.coefficient)}"
        )
    if span and identified.status == "approximate" and PLACES not in helps:
        helps.append(f"{PLACES}; a longer recording with the same sensors does not help, since "
                     "the unexplained motion does not average out")  # fmt: skip
    if not identified.model.inputs and WIND not in " ".join(helps):
        helps.append(f"{WIND}, in gusts or at several mean wind speeds: a steady wind does "
                     "not show the wind speed from which the line gallops")  # fmt: skip
    if identified.model.inputs or not span:  # which were recorded; no wind drives other systems
        helps = [each for each in helps if WIND not in each]
    measured = {one["measures"][-1] for report in reports for one in report["channels"].values()}
    if span and {"v", "w"} <= measured:
        helps = [each.replace("; " + HELPS["directions"], "") for each in helps]
    is_wind = may_be_wind(identified, units)
    for name in identified.model.inputs:
        if ends := identified.recorded(name):
            unit = shown_units(units).get(name, "")
            beyond = f"below {ends[0]:.3g} or above" if ends[0] < ends[1] else "other than"
            beyond = f"{beyond} {ends[1]:.3g} {unit}".rstrip()
            damping_hint = "; or the structural damping, measured in calm (`--known`)" * is_wind
            helps.append(
                f"recordings with {name} {beyond}, if the model is used there{damping_hint}"
            )
    return list(dict.fromkeys(helps))


def relative_error_text(error: float, coefficient: float) -> str:
    """Format a standard error relative to its coefficient, in percent if it is smaller."""
    share = error / abs(coefficient)
    return f"{100.0 * share:.2g} %" if share < 1.0 else f"{share:.2g} times the coefficient"


def _format_idle_columns(reports: Sequence[dict]) -> str:
    """Format the columns without a motion of their own, if there are others; '' if not."""
    idle = {
        problem["column"]
        for report in reports
        for problem in report["problems"]
        if problem["code"] in (Code.MOSTLY_NOISE, Code.SHOWN_TWICE)
    }
    others = {column for report in reports for column in report["channels"]} - idle
    return join_words(sorted(idle)) if idle and others else ""


def meanings_and_advice(findings: Iterable[Finding], is_span: bool = True) -> list[tuple[str, str]]:
    """Explain in words each finding that affects a model's status, with advice on what to do."""
    return explain(findings, True, is_span, HELPS)


def input_units(reports: Sequence[dict]) -> dict[str, str]:
    """Extract the unit of each input, by name, from data-quality reports."""
    return {one["name"]: one["unit"] for report in reports for one in report["inputs"].values()}


def shown_units(units: Mapping[str, str]) -> dict[str, str]:
    """Return units by name without those of dimensionless quantities, which have the unit `1`."""
    return {name: unit for name, unit in units.items() if unit != "1"}


def may_be_wind(found: IdentifiedModel, units: Mapping[str, str]) -> bool:
    """Decide whether the inputs of a span's model may be wind speeds, with the unit m/s."""
    return is_span(found.model.states) and all(
        is_same_quantity(units.get(name, "m/s"), "m/s") for name in found.model.inputs
    )
