"""From files to everything that is written about them: quality, model, fit, forecast, summary."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from galloping.field.forecast import Forecast, forecast
from galloping.field.mapping import Mapping
from galloping.field.outputs import describe_tables, forecast_rows, model_rows, summary
from galloping.field.project import recording
from galloping.field.quality import quality
from galloping.field.read import Series, read_series
from galloping.field.units import state_unit
from galloping.identification.model import IdentifiedModel
from galloping.recording import Recording
from galloping.storage import write_json, write_rows, write_text

HELD_OUT = 0.1  # of a recording, to try the forecast on
PERIODS = 6  # of the motion from which a forecast starts


@dataclass(frozen=True)
class Field:
    """Recordings of one system as they came from files.

    series, recordings, reports: one of each for each file; reports are those of `quality`.
    """

    mapping: Mapping
    series: tuple[Series, ...]
    recordings: tuple[Recording, ...]
    reports: tuple[dict, ...]

    @property
    def period(self) -> float:
        """Longest period of the motion, s, from the dominant frequencies of its channels."""
        frequencies = [
            channel["dominant_frequencies_hz"][0]
            for report in self.reports
            for channel in report["channels"].values()
            if channel["dominant_frequencies_hz"]
        ]
        if not frequencies:
            raise ValueError("no channel oscillates: there is no motion to identify")
        return 1.0 / min(frequencies)


@dataclass(frozen=True)
class Trial:
    """A forecast of what was held out, with what was measured there.

    skill: (n_states,) R2 of the median. held: (n_states,) share of the samples inside the band.
    """

    forecast: Forecast
    measured: np.ndarray
    skill: np.ndarray
    held: np.ndarray


def read_field(paths: Sequence[str | Path], mapping: Mapping) -> Field:
    """Files of one system. Raises FileError in one line."""
    series = tuple(read_series(path, mapping) for path in paths)
    return Field(
        mapping,
        series,
        tuple(recording(one, mapping) for one in series),
        tuple(quality(one, mapping) for one in series),
    )


def tried(
    field: Field, identify: Callable[[list[Recording]], IdentifiedModel], rng: np.random.Generator
) -> Trial | None:
    """Identify without the last part of the last recording, and forecast it.

    None where the shorter recordings give no model.
    """
    *others, last = field.recordings
    cut = int(np.searchsorted(last.time, last.time[-1] - HELD_OUT * np.ptp(last.time)))
    identified = identify([*others, last[:cut]])
    if identified.status == "refused":
        return None
    try:
        ahead = forecast(identified, last[:cut], last.time[cut:], PERIODS * field.period, rng)
    except ValueError:
        return None
    measured = last.values[cut:]
    inside = (measured >= ahead.low) & (measured <= ahead.high)
    known = np.isfinite(measured)
    rest = np.nansum((measured - ahead.median) ** 2, axis=0)
    spread = np.nansum((measured - np.nanmean(np.where(known, measured, np.nan), axis=0)) ** 2, 0)
    with np.errstate(invalid="ignore", divide="ignore"):
        return Trial(ahead, measured, 1.0 - rest / spread, inside.sum(0) / known.sum(0))


def write_outputs(
    folder: Path,
    field: Field,
    identified: IdentifiedModel,
    trial: Trial | None,
    ahead: Forecast | None,
    dynamics: Sequence[str],
) -> None:
    """All files of a folder, `summary.md` last."""
    states = identified.model.states
    write_json(folder / "quality.json", list(field.reports))
    identified.save(folder / "model.json")
    columns = [
        "equation",
        "term",
        "coefficient",
        "unit",
        "standard_error",
        "low",
        "high",
        "verdict",
    ]
    write_rows(folder / "model.csv", model_rows(identified), columns)
    tables = {"model.csv": dict.fromkeys(columns, "1")}
    parts = [part for part in (trial and trial.forecast, ahead) if part is not None]
    if parts:
        rows = [row for part in parts for row in forecast_rows(part, states)]
        write_rows(folder / "forecast.csv", rows)
        units = {f"{s}{end}": state_unit(s) for s in states for end in ("", "_low", "_high")}
        tables["forecast.csv"] = {"time_s": "s", **units}
    describe_tables(folder, tables)
    write_text(
        folder / "summary.md", summary(identified, field.reports, dynamics, _skill(trial, states))
    )


def _skill(trial: Trial | None, states: Sequence[str]) -> str:
    if trial is None:
        return ""
    said = [
        f"{state}: R2 {skill:.3f}, {100 * held:.0f} % of the samples inside the 90 % band"
        for state, skill, held in zip(states, trial.skill, trial.held, strict=True)
        if np.isfinite(skill)
    ]
    length = trial.forecast.time[-1] - trial.forecast.time[0]
    return f"The last {length:.0f} s, which were held out, were forecast: {'; '.join(said)}."
