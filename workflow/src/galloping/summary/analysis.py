"""Analysis of files: quality, model, fit, forecast, summary."""

import copy
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import chain
from pathlib import Path

import numpy as np

from galloping import __version__
from galloping.behaviour.dynamics import Dynamics, Surroundings, expected_dynamics
from galloping.behaviour.following import Sensed
from galloping.identification.findings import Code, Finding
from galloping.identification.identified_model import IdentifiedModel
from galloping.identification.inputs import validated_problem
from galloping.identification.preparation.interpolation import (
    choose_interpolants,
    with_interpolants,
)
from galloping.identification.prior_knowledge import PRIOR, as_coefficients
from galloping.identification.work import limit_work
from galloping.inspection.excerpts import excerpts, identify_excerpts
from galloping.inspection.quality import inspect_recording, make_finding
from galloping.model.polynomial import Exponents, PolynomialModel, polynomial_library
from galloping.model.terms import known_model, parse_library
from galloping.progress_reports import part, passing
from galloping.readers.mapping import ColumnMapping
from galloping.readers.recordings import (
    MAX_SILENT_PERIODS,
    MIN_PART_PERIODS,
    make_recording,
    note_missing_inputs,
    split_recording,
)
from galloping.readers.series import Series, check_no_shared_rows, read_series
from galloping.readers.units import state_unit
from galloping.recording.samples import Recording, typical_inputs
from galloping.storage import write_json, write_rows, write_text
from galloping.summary.csv_rows import MODEL_COLUMNS, forecast_rows, model_rows
from galloping.summary.numbers import compute_numbers
from galloping.summary.summarise import METHODS, Summary, longest_period, summarise_with
from galloping.summary.terminal import SEARCH_SHARE, json_text
from galloping.summary.wording import INTERPOLATION_WORDS, escape_markdown, render_summary

CHANNEL_FAULTS = (  # faults that may explain why no model was found
    Code.CLIPPED, Code.CHANNEL_JUMPS, Code.MEAN_MOVES, Code.MOSTLY_NOISE, Code.SHOWN_TWICE,
)  # fmt: skip


@dataclass(frozen=True)
class Field:
    """Recordings of one system read from files, with a data-quality report for each file.

    series, reports: one for each file; reports are those of `quality`. recordings: of all files in
    their order, those with long gaps in parts; names: of them.
    """

    mapping: ColumnMapping
    series: tuple[Series, ...]
    recordings: tuple[Recording, ...]
    names: tuple[str, ...]
    reports: tuple[dict, ...]

    @property
    def between(self) -> dict[str, str]:
        """Interpolation between samples (`zero`, `linear` or `cubic`) of each input, by name."""
        return {name: one.between for name, one in self.series[0].inputs.items()}

    def with_interpolants(self, kinds: Mapping[str, str]) -> "Field":
        """Return a copy with other interpolation of the inputs, noted in the reports."""
        reports = copy.deepcopy(self.reports)
        for report in reports:
            for one in report["inputs"].values():
                if one["between"] != kinds.get(one["name"], one["between"]):
                    one["between"] = kinds[one["name"]]
                    report["notes"].append(
                        f"input {one['name']} is {INTERPOLATION_WORDS[one['between']]} between its "
                        "samples, as the motion shows"
                    )
        series = tuple(with_interpolants(one, kinds) for one in self.series)
        recordings = tuple(with_interpolants(one, kinds) for one in self.recordings)
        return replace(self, series=series, recordings=recordings, reports=reports)

    @property
    def faults(self) -> list[Finding]:
        """Faults of channels that may explain why no model was identified.

        These are channels that are cut off, jump, are mostly noise, or have no motion of their own.
        """
        return [
            replace(one, subject=escape_markdown(f"{one.subject} of {report['file']}"))
            for report in self.reports
            for problem in report["problems"]
            if (one := make_finding(problem)).code in CHANNEL_FAULTS
        ]


def read_field(paths: Sequence[str | Path], mapping: ColumnMapping) -> Field:
    """Read and check files with recordings of one system; raise FileError if one is unusable."""
    with part("read", until=0.05):
        series = tuple(read_series(path, mapping) for path in paths)
    check_no_shared_rows(series)
    reports = tuple(inspect_recording(one, mapping) for one in series)
    whole = [make_recording(one, mapping) for one in series]
    period = longest_period(whole)
    recordings: list[Recording] = []
    names: list[str] = []
    for one, of_file, report in zip(series, whole, reports, strict=True):
        parts = split_recording(of_file, period)
        report["notes"] += note_missing_inputs(of_file)
        if one.unused:
            report["notes"].append(one.unused_note)
        report["unused_motion"] = list(one.unused_motion)
        if len(parts) > 1 or len(parts[0].time) < len(of_file.time):
            kept = sum(np.ptp(each.time) for each in parts)
            report["notes"].append(
                f"divided at gaps longer than a period of {period:.3g} s, or than "
                f"{MAX_SILENT_PERIODS} periods of one sensor alone: {len(parts)} recordings of "
                f"{MIN_PART_PERIODS} periods or more, {kept:.4g} s in all"
            )
        recordings += parts
        names += [
            escape_markdown(one.path.name)
            + (f" from {each.time[0]:.4g} s" if len(parts) > 1 else "")
            for each in parts
        ]
    return Field(mapping, series, tuple(recordings), tuple(names), reports)


@dataclass(frozen=True)
class FieldQuestion:
    """Options of an identification: candidate terms, method, seed and prior knowledge.

    degree: of the polynomial library of states and inputs, if neither `library` nor the mapping has
    another. method: a name of METHODS. library, known: texts, as in `terms`; those of the mapping
    are known besides. seed: of the draws of intervals and forecasts. random_force: names of
    coordinates under random forces, or all; if there are none those of the mapping count, else they
    are determined from the motion.
    """

    degree: int = 3
    method: str = "maximum_likelihood"
    known: tuple[str, ...] = ()
    seed: int = 0
    library: tuple[str, ...] = ()
    random_force: tuple[str, ...] = ()

    def terms(self, mapping: ColumnMapping) -> tuple[tuple[Exponents, ...], np.ndarray | None]:
        """Parse the candidate terms, and the equations in which each of them may occur.

        Returns both as `terms.parse_library` does. Raises ValueError for what is no library, and if
        it lacks an input.
        """
        inputs = mapping.input_names
        texts = self.library or mapping.library
        if not texts:
            return polynomial_library(len(mapping.states) + len(inputs), self.degree), None
        terms, allowed = parse_library(texts, mapping.states, inputs)
        for k, name in enumerate(inputs, start=len(mapping.states)):
            if not any(term[k] for term in terms):
                raise ValueError(f"input {name} is in no term of the library {' + '.join(texts)}")
        return terms, allowed


def analyse(
    field: Field,
    question: FieldQuestion,
    folder: Path,
    beside: tuple[str, PolynomialModel] | None = None,
) -> IdentifiedModel:
    """Identify a model from recordings, and write results, report and figures to a folder.

    beside: a name and a model of the line that the summary compares with. Raises ValueError, in one
    line, for invalid files or questions; a recording without a model is no error.
    """
    field, summary = identify_field(field, question)
    case = None
    if beside and summary.found.status != "refused":
        identified = summary.found.at(typical_inputs(summary.found.model.inputs, field.recordings))
        around = Surroundings.of(field.recordings)
        case = beside[0], expected_dynamics(beside[1], identified, around)
    with part("write", until=1.0):
        write_outputs(folder, field, summary, case)
        write_figures(folder, field, summary)
    return summary.found


def identify_field(field: Field, question: FieldQuestion) -> tuple[Field, Summary]:
    """Identify and test one model from recordings; return the recordings and a summary.

    Returns the recordings, with the interpolation of inputs decided; and the model, refused if
    there is none, with properties of the system. Raises ValueError, in one line, for invalid files
    or questions.
    """
    mapping = field.mapping
    terms, allowed = question.terms(mapping)
    inputs = mapping.input_names
    texts = (*mapping.known, *question.known)
    check_inputs_informative(field.series, terms, len(mapping.states), bool(texts))
    model, known_states, single = known_model(texts, mapping.states, terms, inputs)
    coefficients = list(chain.from_iterable(map(as_coefficients, single)))
    if any(one.alternatives for one in field.recordings[0].inputs.values()):
        stretches = excerpts(list(field.recordings))
        problem = validated_problem(
            stretches, terms, model, known_states, PRIOR, coefficients, allowed
        )
        field = field.with_interpolants(choose_interpolants(problem, stretches))
    method, given = METHODS[question.method], field.recordings
    options: dict[str, object] = {}
    if forced := question.random_force or mapping.random_force:
        options["forced"] = () if forced == ("all",) else forced
    if coefficients:
        options["coefficients"] = coefficients
    if allowed is not None:
        options["allowed"] = allowed
    if question.method != "maximum_likelihood" and options:
        raise ValueError(
            f"--method {question.method}: takes no single known coefficient, no terms of some "
            "equations alone and no random forces; maximum_likelihood does"
        )

    def identify(recordings: Sequence[Recording]) -> IdentifiedModel:
        return identify_excerpts(method, list(recordings), terms, model, known_states, **options)

    with limit_work(given):
        with part("identify", until=SEARCH_SHARE):
            identified = identify(given)
        with part("summarise", until=0.8):
            summary = summarise_with(
                identified, given, identify, question.seed, names=field.names,
                faults=field.faults, are_one=len(field.series) == 1,
            )  # fmt: skip
    return field, summary


def check_inputs_informative(
    series: Sequence[Series], terms: Sequence[Exponents], n_states: int, is_known: bool
) -> None:
    """Raise ValueError if an input is constant, or crosses zero although terms divide by it.

    series: of all files. terms: exponents of states and inputs. is_known: whether coefficients are
    known, such as a structural damping, beside which the effect of a constant input is determined.
    """
    for k, name in enumerate(series[0].inputs, start=n_states):
        values = np.concatenate([one.inputs[name].values for one in series])
        least, most = np.nanmin(values), np.nanmax(values)
        if least == most and not is_known:
            raise ValueError(
                f"{series[0].path}: input {name} is {least:g} throughout: the effect of a "
                "constant input cannot be determined; leave it out, or state what is known of the "
                "system without it (`--known`)"
            )
        if least <= 0.0 <= most and any(term[k] < 0 for term in terms):
            raise ValueError(
                f"{series[0].path}: input {name} crosses zero, from {least:g} to {most:g}, and "
                f"the library divides by it; leave out the terms with /{name}"
            )


def write_outputs(
    folder: Path, field: Field, summary: Summary, beside: tuple[str, Dynamics | None] | None
) -> None:
    """Write the model, its tables, the data-quality reports and the summary to a folder.

    beside: as of `compute_numbers`.
    """
    identified, inputs = summary.found, dict(field.series[0].units)
    states = identified.model.states
    write_json(folder / "quality.json", list(field.reports))
    identified.save(
        folder / "model.json",
        units={state: state_unit(state) for state in states} | inputs,
        between=field.between,
        versions={"galloping": __version__},
    )
    channels = Sensed.by(field.recordings[-1]).names
    units = {f"{s}{end}": state_unit(s) for s in channels for end in ("", "_low", "_high")}
    tables = {"model.csv": MODEL_COLUMNS, "forecast.csv": {"time_s": "s", **units}}
    ahead = [row for part in summary.forecasts for row in forecast_rows(part)]
    write_rows(folder / "model.csv", model_rows(identified, inputs), list(MODEL_COLUMNS))
    write_rows(folder / "forecast.csv", ahead, list(tables["forecast.csv"]))
    write_json(folder / "datapackage.json", _describe_package(tables))
    numbers = compute_numbers(summary, field.reports, beside)
    write_text(folder / "summary.json", json_text(asdict(numbers), indent=2) + "\n")
    write_text(folder / "summary.md", render_summary(summary, numbers, field.reports))


def _describe_package(tables: Mapping[str, Mapping[str, str]]) -> dict:
    """Make the Frictionless description of CSV files: columns of each with their units."""
    resources = []
    for file, columns in tables.items():
        fields = [{"name": n, "unit": unit} if unit else {"name": n} for n, unit in columns.items()]
        resources.append({"name": Path(file).stem, "path": file, "schema": {"fields": fields}})
    return {"name": "galloping", "resources": resources}


def write_figures(folder: Path, field: Field, summary: Summary) -> None:
    """Draw data quality, model fit and forecast, and write the figures as SVG and PNG."""
    from galloping.figures.style import write_figure
    from galloping.summary import drawing  # matplotlib

    drawn = {
        "quality": lambda: drawing.draw_quality(field.series, field.reports, field.mapping),
        "fit": summary.draw_fit,
        "forecast": summary.draw_forecast,
    }
    for name, draw in drawn.items():
        passing(f"draw {name}")
        svg, png = folder / f"{name}.svg", folder / f"{name}.png"
        write_figure(svg, png, draw, drawing.DPI, drawing.FONT_SIZE)
