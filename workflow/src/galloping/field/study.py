"""From files to everything that is written about them: quality, model, fit, forecast, summary."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from galloping import __version__
from galloping.field.advice import Advice, advice
from galloping.field.advice import sentences as advised
from galloping.field.dynamics import Dynamics, dynamics, expected, sentences
from galloping.field.equations import known_model
from galloping.field.excerpt import excerpts
from galloping.field.forecast import (
    Following,
    Forecast,
    Sensed,
    first_guess,
    forecast,
    simulator_of,
)
from galloping.field.mapping import ColumnMapping
from galloping.field.outputs import (
    MODEL_COLUMNS,
    describe_tables,
    forecast_rows,
    model_rows,
    summary,
)
from galloping.field.project import recording
from galloping.field.quality import PERIODS as PERIODS_HELD
from galloping.field.quality import quality
from galloping.field.read import Series, read_series
from galloping.field.units import state_unit
from galloping.identification.model import IdentifiedModel
from galloping.importing import imported
from galloping.polynomial import PolynomialModel, library
from galloping.recording import Recording
from galloping.storage import write_json, write_rows, write_text

HELD_OUT = 0.1  # of a recording, to try the forecast on,
MOST_HELD_OUT = 30  # periods of the motion, and so many samples of it
MOST_SAMPLES = 5000
PERIODS = 6  # of the motion from which a forecast starts
POINTS = 600  # of a drawn motion
DPI, FONT_SIZE = 150, 8
FIELD_METHODS = {
    name: f"galloping.identification.likelihood.{name}:{name}"
    for name in ("maximum_likelihood", "weak_gls")
}


@dataclass(frozen=True)
class Field:
    """Recordings of one system as they came from files.

    series, recordings, reports: one of each for each file; reports are those of `quality`.
    """

    mapping: ColumnMapping
    series: tuple[Series, ...]
    recordings: tuple[Recording, ...]
    reports: tuple[dict, ...]

    @property
    def period(self) -> float:
        """Longest period of the motion, s, from the dominant frequencies of its channels.

        Of each the first of which the recording holds PERIODS_HELD periods: slower ones are drifts
        of the mean, which come with a motion that grows.
        """
        frequencies = []
        for report in self.reports:
            least = PERIODS_HELD / report["sampling"]["duration_s"]
            for channel in report["channels"].values():
                dominant = channel["dominant_frequencies_hz"]
                frequencies += ([f for f in dominant if f >= least] or dominant)[:1]
        if not frequencies:
            files = ", ".join(str(report["file"]) for report in self.reports)
            raise ValueError(f"{files}: no channel oscillates: there is no motion to identify")
        return 1.0 / min(frequencies)


@dataclass(frozen=True)
class HeldOut:
    """A forecast of what was held out.

    skill: (n_sensed,) R2 of the median. held: (n_sensed,) share of the samples inside the band.
    """

    forecast: Forecast
    skill: np.ndarray
    held: np.ndarray


@dataclass(frozen=True)
class Findings:
    """What is told of a model beside itself; nothing of a refused one.

    shown: as `stretches` gives them. further: which recording would help. beside: a case by name.
    """

    trial: HeldOut | None = None
    ahead: Forecast | None = None
    shown: Sequence[tuple[np.ndarray, np.ndarray]] = ()
    of_line: Dynamics | None = None
    further: Advice | None = None
    beside: tuple[str, Dynamics] | None = None

    @property
    def forecasts(self) -> list[Forecast]:
        """Of what was held out, and after the recording."""
        return [
            part for part in (self.trial and self.trial.forecast, self.ahead) if part is not None
        ]


def read_field(paths: Sequence[str | Path], mapping: ColumnMapping) -> Field:
    """Files of one system. Raises FileError in one line."""
    series = tuple(read_series(path, mapping) for path in paths)
    return Field(
        mapping,
        series,
        tuple(recording(one, mapping) for one in series),
        tuple(quality(one, mapping) for one in series),
    )


@dataclass(frozen=True)
class Question:
    """What is asked of recordings.

    degree: of the polynomial library. method: a name of FIELD_METHODS. known: equations as text, as
    in `equations.known_model`. seed: of the draws of intervals and forecasts.
    """

    degree: int = 3
    method: str = "maximum_likelihood"
    known: tuple[str, ...] = ()
    seed: int = 0


STEPS = ("identify", "hold out", "forecast", "draw")


def analyse(
    paths: Sequence[str | Path],
    mapping: ColumnMapping,
    question: Question,
    folder: Path,
    advance: Callable[[str], object] = lambda _: None,
    beside: tuple[str, PolynomialModel] | None = None,
) -> IdentifiedModel:
    """From files of one system to everything in `folder`, written when all of it is made.

    advance: told the name of each of the `STEPS` when it is done. beside: a name and a model of the
    line that the summary compares with. Raises ValueError, in one line, for files or a question
    that make no sense; a recording without a model is no error.
    """
    field = read_field(paths, mapping)
    terms = library(len(mapping.states), question.degree)
    known, known_states = known_model(question.known, mapping.states, terms)
    method = imported(FIELD_METHODS[question.method])
    rng = np.random.default_rng(question.seed)

    def fitted(recordings: list[Recording]) -> IdentifiedModel:
        return method(excerpts(recordings), terms, known, known_states)

    identified = fitted(list(field.recordings))
    advance("identify")
    findings = Findings()
    if identified.status != "refused":
        trial = tried(field, fitted, rng)
        advance("hold out")
        last = field.recordings[-1]
        window = PERIODS * field.period
        step = max(float(np.median(np.diff(last.time))), window / MOST_SAMPLES)
        try:
            ahead = forecast(
                identified, last, last.time[-1] + np.arange(step, window, step), window, rng
            )
        except ValueError:
            ahead = None
        advance("forecast")
        findings = Findings(
            trial,
            ahead,
            stretches(identified, last, window),
            dynamics(identified, rng),
            advice(identified, last, field.period),
            beside and (beside[0], expected(beside[1], identified)),
        )
    write_outputs(folder, field, identified, findings)
    write_figures(folder, field, findings)
    advance("draw")
    return identified


def tried(
    field: Field, identify: Callable[[list[Recording]], IdentifiedModel], rng: np.random.Generator
) -> HeldOut | None:
    """Identify without the last part of the last recording, and forecast it.

    None where the shorter recordings give no model.
    """
    *others, last = field.recordings
    length = min(HELD_OUT * np.ptp(last.time), MOST_HELD_OUT * field.period)
    cut = int(np.searchsorted(last.time, last.time[-1] - length))
    shown = slice(cut, None, 1 + (len(last.time) - cut) // MOST_SAMPLES)
    identified = identify([*others, last[:cut]])
    if identified.status == "refused":
        return None
    try:
        ahead = forecast(identified, last[:cut], last.time[shown], PERIODS * field.period, rng)
    except ValueError:
        return None
    measured = Sensed.by(last).samples(last)[shown]
    known = np.isfinite(measured)
    inside = (measured >= ahead.low) & (measured <= ahead.high)
    counts = known.sum(axis=0)
    rest = np.nansum((measured - ahead.median) ** 2, axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = np.nansum(measured, axis=0) / counts
        spread = np.nansum((measured - mean) ** 2, axis=0)
        return HeldOut(ahead, 1.0 - rest / spread, inside.sum(axis=0) / counts)


def stretches(
    identified: IdentifiedModel, recording: Recording, length: float
) -> list[tuple[np.ndarray, np.ndarray]]:
    """The model's motion through the begin, the middle and the end of a recording.

    Times (n,) and channels (n, n_sensed) of each stretch of `length` s through which the model can
    be followed; it starts where it then follows the samples best.
    """
    time = recording.time
    simulator = simulator_of(identified.model)
    sensed = Sensed.by(recording)
    samples, sigma = sensed.samples(recording), sensed.noise(identified)
    motions = []
    for share in (0.0, 0.5, 1.0):
        begin = time[0] + share * max(np.ptp(time) - length, 0.0)
        first, end = np.searchsorted(time, (begin, begin + length))
        own = time[first:end]
        if len(own) < 2:
            continue
        follow = Following(simulator, sensed, own, sigma)
        guess = first_guess(recording, first)
        start = follow.start(identified.model, guess, samples[first:end])
        if start is not None:
            smooth = np.linspace(own[0], own[-1], POINTS)
            motions.append((smooth, follow.motion(identified.model, start, smooth)))
    return motions


def write_outputs(
    folder: Path,
    field: Field,
    identified: IdentifiedModel,
    findings: Findings,
) -> None:
    """The tables, the model and `summary.md`."""
    states = identified.model.states
    write_json(folder / "quality.json", list(field.reports))
    identified.save(
        folder / "model.json",
        units={state: state_unit(state) for state in states},
        versions={"galloping": __version__},
    )
    write_rows(folder / "model.csv", model_rows(identified), list(MODEL_COLUMNS))
    tables = {"model.csv": MODEL_COLUMNS}
    rows = [row for part in findings.forecasts for row in forecast_rows(part)]
    channels = Sensed.by(field.recordings[-1]).names
    units = {f"{s}{end}": state_unit(s) for s in channels for end in ("", "_low", "_high")}
    tables["forecast.csv"] = {"time_s": "s", **units}
    write_rows(folder / "forecast.csv", rows, list(tables["forecast.csv"]))
    describe_tables(folder, tables)
    text = summary(
        identified,
        field.reports,
        dynamics=_dynamics(findings),
        skill=_skill(findings.trial),
        used=_used(field.recordings),
        further=advised(findings.further, identified.status),
    )
    write_text(folder / "summary.md", text)


def write_figures(
    folder: Path,
    field: Field,
    findings: Findings,
) -> None:
    """quality, fit and forecast, as SVG and PNG."""
    from galloping.figures import field as figures  # matplotlib
    from galloping.figures.write import write_figure

    last = field.recordings[-1]
    shown = findings.shown
    length = np.ptp(shown[0][0]) if shown else 0.0
    drawn = {
        "quality": lambda: figures.draw_quality(field.series, field.reports, field.mapping),
        "fit": lambda: figures.draw_fit(last, shown),
        "forecast": lambda: figures.draw_forecast(last, findings.forecasts, last.time[-1], length),
    }
    for name, draw in drawn.items():
        write_figure(folder / f"{name}.svg", folder / f"{name}.png", draw, DPI, FONT_SIZE)


def _dynamics(findings: Findings) -> list[str]:
    said = sentences(findings.of_line) if findings.of_line else []
    if findings.beside and findings.beside[1]:
        name, of_case = findings.beside
        said += [f"by case {name}, {sentence}" for sentence in sentences(of_case)]
    return said


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


def _skill(trial: HeldOut | None) -> str:
    if trial is None:
        return ""
    said = [
        f"{name}: R2 {skill:.3f}, {100 * held:.0f} % of the samples inside the 90 % band"
        for name, skill, held in zip(trial.forecast.names, trial.skill, trial.held, strict=True)
        if np.isfinite(skill)
    ]
    length = trial.forecast.time[-1] - trial.forecast.time[0]
    return f"The last {length:.0f} s, which were held out, were forecast: {'; '.join(said)}."
