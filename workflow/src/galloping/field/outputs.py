"""What comes out of a user's recordings: tables, and a summary in plain words."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from galloping.field.forecast import Forecast
from galloping.field.units import coefficient_unit
from galloping.identification.model import IdentifiedModel
from galloping.intervals import NORMAL_95
from galloping.polynomial import term_name
from galloping.storage import write_json

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


def model_rows(identified: IdentifiedModel) -> list[dict]:
    """Rows of model.csv: one for each present term, and each absent one with a limit.

    An equation is named by the state whose derivative it gives, a term as pysindy names it.
    """
    model, rows = identified.model, []
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
                    "term": term_name(term, model.states),
                    "coefficient": float(value),
                    "unit": coefficient_unit(state, term, model.states),
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


def summary(
    identified: IdentifiedModel,
    reports: Sequence[dict],
    dynamics: Sequence[str],
    skill: str,
    used: str = "",
    further: Sequence[str] = (),
) -> str:
    """summary.md: status and why, the equations, what the recordings cannot tell.

    reports: of `quality`. dynamics: sentences on frequencies, damping, limit cycle. skill: of the
    forecast, a sentence. used: of the recordings, a sentence. further: lines on which further
    recording would help.
    """
    lines = ["# Summary", "", f"**{identified.verdict}.** {MEANING[identified.status]}", ""]
    if identified.status != "refused":
        lines += ["## Equations", "", "```", *identified.equations(), "```", ""]
    if dynamics:
        lines += ["## The line", "", *(f"- {sentence}" for sentence in dynamics), ""]
    if skill:
        lines += ["## Forecast", "", skill, ""]
    lines += ["## Recordings", ""]
    for report in reports:
        head, *rest = report_lines(report)
        lines += [f"- {head}", *(f"  - {line.strip()}" for line in rest)]
    if used:
        lines += ["", used]
    if identified.status != "refused":
        lines += ["", "## What the recordings cannot tell", "", *_untold(identified)]
    if further:
        lines += ["", "## Which recording would help most", "", *further]
    return "\n".join(lines) + "\n"


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
    lines += [f"  {note}" for note in report["notes"]]
    return lines + [f"  {p['column']}, row {p['row']}: {p['what']}" for p in report["problems"]]


def _untold(identified: IdentifiedModel) -> list[str]:
    """What the model does not say: other conditions, and the absent terms with most room."""
    model = identified.model
    limits = np.where(np.isfinite(identified.detection_limits), identified.detection_limits, -1.0)
    flat = np.argsort(-limits, axis=None)[:3]
    room = [
        f"- {term_name(model.terms[j], model.states)} in d({model.states[i]})/dt: absent, or as "
        f"large as {limits[i, j]:.3g} "
        f"{coefficient_unit(model.states[i], model.terms[j], model.states)}"
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
