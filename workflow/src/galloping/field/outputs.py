"""What comes out of a user's recordings: tables, and a summary in plain words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from galloping.field import ambient
from galloping.field.advice import sentences as advised
from galloping.field.dynamics import Dynamics
from galloping.field.dynamics import sentences as moved
from galloping.field.excerpt import excerpts
from galloping.field.forecast import Forecast, HeldOut
from galloping.field.inputs import input_lines
from galloping.field.units import NONE, coefficient_unit
from galloping.identification.model import IdentifiedModel
from galloping.intervals import NORMAL_95
from galloping.polynomial import term_name
from galloping.recording import Recording
from galloping.storage import write_json

if TYPE_CHECKING:
    from galloping.field.summary import Summary

MODEL_COLUMNS = {  # with the unit of each
    "equation": "", "term": "", "coefficient": "of the row", "unit": "",
    "standard_error": "of the row", "low": "of the row", "high": "of the row", "verdict": "",
}  # fmt: skip
MEANING = {
    "ok": "The terms below are the right ones, and every absent one is smaller than its limit.",
    "not identifiable": "The model follows the recording, but the recording leaves open which "
    "terms there are: others would follow it as well.",
    "approximate": "No model of the library follows the recording to its noise; this one comes "
    "near, and its intervals are widened by what it misses.",
    "refused": "The recording gives no model that could be trusted.",
    "unjudged": "This method does not judge its model.",
}


def model_rows(identified: IdentifiedModel, units: Mapping[str, str] = NONE) -> list[dict]:
    """Rows of model.csv: one for each present term, and each absent one with a limit.

    An equation is named by the state whose derivative it gives, a term as pysindy names it. units:
    of inputs, by name.
    """
    model, rows = identified.model, []
    inputs = {name: units.get(name, "") for name in model.inputs}
    for i, state in enumerate(model.states):
        for j, term in enumerate(model.terms):
            value, error = model.coefficients[i, j], identified.standard_errors[i, j]
            limit = identified.detection_limits[i, j]
            present = np.isfinite(value) and value != 0
            if not present and not np.isfinite(limit):
                continue
            known = i in identified.known
            half = NORMAL_95 * error if present else limit
            rows.append(
                {
                    "equation": state,
                    "term": term_name(term, model.names),
                    "coefficient": float(value),
                    "unit": coefficient_unit(state, term, model.names, inputs),
                    "standard_error": float(error) if present else np.nan,
                    "low": float(value - half),
                    "high": float(value + half),
                    "verdict": "known" if known else "present" if present else "absent",
                }
            )
    return rows


def forecast_rows(predicted: Forecast) -> list[dict]:
    """Rows of forecast.csv: time and, for each channel, median and 90 % band."""
    rows = []
    for k, time in enumerate(predicted.time):
        row = {"time_s": float(time)}
        for i, name in enumerate(predicted.names):
            row[name] = float(predicted.median[k, i])
            row[f"{name}_low"] = float(predicted.low[k, i])
            row[f"{name}_high"] = float(predicted.high[k, i])
        rows.append(row)
    return rows


def describe_tables(folder: Path, tables: dict[str, dict[str, str]]) -> None:
    """Write the Frictionless `datapackage.json` of a folder.

    tables: for each CSV file its columns with their units.
    """
    resources = [
        {
            "name": Path(file).stem,
            "path": file,
            "schema": {
                "fields": [
                    {"name": name, **({"unit": unit} if unit else {})}
                    for name, unit in columns.items()
                ]
            },
        }
        for file, columns in tables.items()
    ]
    write_json(folder / "datapackage.json", {"name": "galloping", "resources": resources})


def summary_text(
    of: Summary,
    reports: Sequence[dict] = (),
    beside: tuple[str, Dynamics | None] | None = None,
) -> str:
    """summary.md: status and why, the equations, what the recordings cannot tell.

    reports: of `quality`, where the recordings come from files. beside: a name, and what is known
    of the line by that name.
    """
    found = of.found
    forced = found.is_forced
    meaning = ambient.MEANING[found.status] if forced else MEANING[found.status]
    lines = ["# Summary", "", f"**{found.verdict}.** {meaning}", ""]
    if forced and of.dynamics:
        lines += [*ambient.lines(found, of.dynamics), ""]
    lines += [line for caution in _cautions(of) for line in (f"**{caution}**", "")]
    if found.status != "refused":
        lines += ["## Equations", "", "```", *found.equations(), "```", ""]
    said = moved(of.dynamics) if of.dynamics and not forced else []
    if beside and beside[1]:
        said += [f"by case {beside[0]}, {sentence}" for sentence in moved(beside[1])]
    if said:
        lines += ["## The line", "", *(f"- {sentence}" for sentence in said), ""]
    if of.held_out:
        lines += ["## Forecast", "", _skill(of.held_out), ""]
    lines += ["## Recordings", ""]
    described = [report_lines(report) for report in reports]
    for head, *rest in described or [repr(each).splitlines() for each in of.recordings]:
        lines += [f"- {head}", *(f"  - {line.strip()}" for line in rest)]
    if not forced and (used := _used(of.recordings)):
        lines += ["", used]
    if found.status != "refused":
        lines += ["", "## What the recordings cannot tell", "", *_untold(found)]
    if further := advised(of.advice, found.status):
        lines += ["", "## Which recording would help most", "", *further]
    return "\n".join(lines) + "\n"


def _cautions(of: Summary) -> list[str]:
    """What must be known of the forecasts before any is used."""
    if of.untried:
        return [
            "Whether its forecasts hold is not known: without its last part the recording gives "
            f"none ({of.untried})."
        ]
    trial = of.held_out
    if trial is None:
        return []
    if not trial.useful:
        worse = [
            f"{name} (R2 {skill:.2f})"
            for name, skill, factor in zip(
                trial.forecast.names, trial.skill, trial.factors, strict=True
            )
            if np.isinf(factor)
        ]
        return [
            "It gives no forecast: the end of the recording, which was held out, is missed by more "
            f"than its mean misses it, in {', '.join(worse)}."
        ]
    return [
        f"Its forecasts are less sure than the model says: of {name} {100 * held:.0f} % of the "
        f"held-out samples lie in the 90 % band, where chance allows {100 * least:.0f} % or more; "
        f"all bands of {name} are {factor:.2g} times as wide, so that this one holds 90 %."
        for name, held, least, factor in zip(
            trial.forecast.names, trial.held, trial.forecast.chance, trial.factors, strict=True
        )
        if factor > 1.0
    ]


def _skill(of: HeldOut) -> str:
    said = [
        f"{name}: R2 {skill:.3f}, {100 * held:.0f} % of the samples inside the 90 % band"
        for name, skill, held in zip(of.forecast.names, of.skill, of.held, strict=True)
        if np.isfinite(skill)
    ]
    length = of.forecast.time[-1] - of.forecast.time[0]
    return f"The last {length:.0f} s, which were held out, were forecast: {'; '.join(said)}."


def _used(recordings: Sequence[Recording]) -> str:
    stretches = excerpts(list(recordings))
    if all(one is other for one, other in zip(stretches, recordings, strict=False)):
        return ""
    duration = sum(one.time[-1] - one.time[0] for one in recordings)
    share = 100 * sum(one.time[-1] - one.time[0] for one in stretches) / duration
    return (
        f"The model comes from {len(stretches)} stretches, {share:.2g} % of the time: those in "
        "which the motion grows or decays most, and those in which it is largest."
    )


def report_lines(report: dict) -> list[str]:
    """A report of `quality` as text: the file, then a line for each channel, note and problem."""
    sampling = report["sampling"]
    lines = [
        f"{report['file']}: {sampling['samples']} samples over {sampling['duration_s']:.1f} s "
        f"({sampling['rate_hz']:.3g} Hz), {sampling['gaps_total']} gaps"
    ]
    for column, channel in report["channels"].items():
        frequencies = ", ".join(f"{f:.3g}" for f in channel["dominant_frequencies_hz"])
        lines.append(
            f"  {column} measures {channel['measures']}: deviation "
            f"{channel['standard_deviation']:.3g}, noise {channel['noise']:.2g}, "
            f"{channel['missing_percent']:.1f} % missing, mostly at {frequencies or 'no'} Hz"
        )
    lines += [f"  {said}" for said in (*input_lines(report["inputs"]), *report["notes"])]
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
    return [
        "- What holds at other winds, and at motions much larger than those recorded",
        *scales,
        *room,
    ]
