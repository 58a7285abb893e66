"""Settings of a study; `keys/keys.csv` describes each key."""
# mypy: disable-error-code="misc"
# (`keys` makes the base classes of sections when this module is imported)

from collections.abc import Sequence
from inspect import signature
from itertools import pairwise, product
from math import inf
from os.path import lexists
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import (
    AfterValidator,
    Field,
    ValidationError,
    ValidationInfo,
    create_model,
    field_validator,
    model_validator,
)

from galloping.configuration.keys import keys
from galloping.configuration.kinds import (
    INPUT_METHODS,
    KINDS,
    PAPER,
    PUBLISHED_DURATIONS,
    WIND_CASES,
    equal_effort,
)
from galloping.cycles.family import PARAMETERS
from galloping.fields import Name, make_error, one_of, selection, setting, show
from galloping.identification.registry import METHODS
from galloping.line import measures
from galloping.line.gusts import SPECTRA
from galloping.paper.unknowns import FIRST_READING
from galloping.recording.measurement import PROTOCOLS

LineSection = keys("line", "The span and how it hangs.")
GUSTS = keys(
    "gusts", "The wind about its mean, the same along the span.", spectrum=one_of(tuple(SPECTRA))
)
# sag over span; above, a parabola gives the tension with errors of more than a tenth
MAX_SAG_RATIO = 0.25


class InitialStateSection(keys("initial_state")):
    """Initial modal displacements and velocities of a simulated motion."""


class SpacersSection(keys("spacers")):
    """Mass and positions of the spacers along the span."""

    @field_validator("positions")
    @classmethod
    def _check_increasing(cls, positions: tuple[float, ...]) -> tuple[float, ...]:
        for before, after in pairwise(positions):
            if after <= before:
                raise make_error(
                    f"{show(after)} comes after {show(before)}; must be strictly increasing"
                )
        return positions


class IceSection(keys("ice")):
    """Aerodynamic coefficients of the iced conductors."""

    @field_validator("vertical", "horizontal")
    @classmethod
    def _check_custom_coefficients(cls, value: tuple | None, info: ValidationInfo) -> tuple | None:
        reading = info.data.get("reading", "custom" if value else None)
        if reading == "custom" and value is None:
            raise make_error(
                "null is not allowed with reading 'custom'; must be a list of 3 numbers"
            )
        if reading != "custom" and value is not None:
            raise make_error(
                f"{show(value)} is not allowed with reading {show(reading)}; "
                "must be null, or the reading custom"
            )
        return value


class TruthSection(keys("truth", gusts=GUSTS)):
    """Model that is simulated as the true system, and the positions of its sensors."""

    @model_validator(mode="after")
    def _check_keys_of_model(self) -> Self:
        if self.model != "continuous":
            for name in sorted(self.model_fields_set - {"model"}):
                if getattr(self, name) != getattr(TruthSection(), name):
                    raise make_error(
                        f"is not allowed with model {self.model}; must be left out, or the model "
                        "continuous",
                        name,
                    )
        if self.antisymmetric and self.modes < 2:
            raise make_error(
                f"{show(self.antisymmetric)} is not allowed with {self.modes} mode; must be 0, or "
                "modes 2 or more",
                "antisymmetric",
            )
        return self


class CaseSection(
    keys(
        "case",
        conductor=keys("conductor", "One sub-conductor."),
        bundle=keys("bundle", "How many sub-conductors there are, and the size the wind sees."),
        line=LineSection,
        spacers=SpacersSection,
        ice=IceSection,
        wind=keys("wind", "The steady wind across the line."),
        damping=keys("damping", "Structural damping, as ratios to critical."),
        initial_state=InitialStateSection,
        initial_states=dict[Name, InitialStateSection],
        truth=TruthSection,
    )
):
    """One case of a study: an overhead line, its wind and its initial states."""

    @model_validator(mode="after")
    def _check_shallow_cable(self) -> Self:
        span = show(self.line.span)
        for position in self.spacers.positions:
            if position >= self.line.span:
                text = f"{show(position)} is beyond the span ({span} m); must be > 0 and < {span} m"
                raise make_error(text, "spacers", "positions")
        weight, tension = self.conductor.mass * self.gravity, self.line.tension
        sag = weight * self.line.span**2 / (8 * tension)
        if sag > MAX_SAG_RATIO * self.line.span:
            text = (
                f"a tension of {show(tension)} N gives a sag of {sag:.4g} m in a span of {span} m, "
                "which is no shallow cable; the tension must be >= "
                f"{weight * self.line.span / (8 * MAX_SAG_RATIO):.4g} N, or the span "
                f"<= {8 * MAX_SAG_RATIO * tension / weight:.4g} m"
            )
            raise make_error(text, "line", "tension")
        return self


def paper_cases() -> dict[str, CaseSection]:
    """Make the settings of the reproduced paper's two lines, with and without resonance."""
    wide = InitialStateSection(q_w=3)
    non_resonant = CaseSection(line=LineSection(tension=35000), initial_states={"wide": wide})
    return {"internal_resonance": CaseSection(), "non_resonant": non_resonant}


ProtocolName = one_of(tuple(protocol.name for protocol in PROTOCOLS))
MethodName = one_of(tuple(method.name for method in METHODS))
FolderName = Annotated[
    str,
    Field(pattern=r"^[A-Za-z0-9_][A-Za-z0-9_.-]*(/[A-Za-z0-9_][A-Za-z0-9_.-]*)*$", max_length=100),
]
FolderPath = Annotated[
    str,
    Field(
        pattern=r"^/?[A-Za-z0-9_.-]{1,255}(/[A-Za-z0-9_.-]{1,255})*$",
        max_length=1000,
        json_schema_extra={
            "rule": "a path of letters, digits, '_', '-' and '.', from the root or the working "
            "folder"
        },
    ),
]


def _refuse_folder(path: str) -> str:
    if Path(path).is_dir():
        raise make_error(f"{show(path)} is a folder; must be a file")
    return path


FilePath = Annotated[FolderPath, AfterValidator(_refuse_folder)]
# folders of the project's clone that cannot contain results
PROJECT_FOLDERS = (
    "config", "docs", "examples", "profiles", "results/reference", "tests", "workflow",
)  # fmt: skip

MIN_WINDOW_INTERVALS = 10  # sampling intervals in a steady window; fewer show no amplitude
MAX_SAMPLING_INTERVALS = 10_000_000  # in a simulation; more are likely a mistake

PARAMETER_NAME = one_of(tuple(PARAMETERS))
MAX_SWEEP_VALUES = 1000  # values of a swept parameter


class SimulationSection(keys("simulation")):
    """Duration, sampling rate and steady window of the simulation of each case."""

    @property
    def samples(self) -> int:
        """Number of samples of a simulation, both ends included."""
        return round(self.duration * self.sampling_rate) + 1

    @field_validator("sampling_rate")
    @classmethod
    def _check_number_of_samples(cls, rate: float, info: ValidationInfo) -> float:
        if duration := info.data.get("duration"):
            intervals = duration * rate
            text = f"{show(rate)} gives {show(intervals)} sampling intervals in {show(duration)} s"
            if not 100 <= intervals <= MAX_SAMPLING_INTERVALS:
                raise make_error(f"{text}; must be 100..{MAX_SAMPLING_INTERVALS}")
            if abs(intervals - round(intervals)) > 1e-9 * intervals:
                raise make_error(f"{text}; must be a whole number")
        return rate

    @field_validator("steady_window")
    @classmethod
    def _check_window(cls, window: tuple[float, float], info: ValidationInfo) -> tuple:
        start, end = window
        duration = info.data.get("duration", end)
        if not start < end <= duration:
            raise make_error(
                f"{show(window)} is not a window of the record; "
                f"must be increasing, 0..{show(duration)} s"
            )
        if (end - start) * info.data.get("sampling_rate", inf) < MIN_WINDOW_INTERVALS:
            raise make_error(
                f"{show(window)} has less than {MIN_WINDOW_INTERVALS} sampling intervals; "
                f"must have {MIN_WINDOW_INTERVALS} or more"
            )
        return window


class MeasurementSection(
    keys(
        "measurement",
        subsets=keys("subsets", "Random subsets of the record, to see how much data is needed."),
    )
):
    """Measurement setups and noise levels of the simulated recordings."""

    protocols: selection(ProtocolName) = setting(  # type: ignore[valid-type]
        tuple(protocol.name for protocol in PROTOCOLS if protocol.by_default),
        "what is measured: "
        + ", ".join(f"{protocol.meaning} ({protocol.name})" for protocol in PROTOCOLS),
    )


class LibrarySection(keys("library")):
    """Candidate terms of the models, and the identification methods."""

    methods: selection(MethodName) = setting(  # type: ignore[valid-type]
        tuple(m.name for m in METHODS if m.by_default), "identification methods"
    )


method_sections: Any = {
    m.name: (m.options, Field(default_factory=m.options)) for m in METHODS if m.options.model_fields
}
Identification = create_model(
    "Identification", __base__=LibrarySection, __doc__="How models are found.", **method_sections
)


class RecordingsSection(keys("recordings", files=FilePath, mapping=FilePath, known=str, case=Name)):
    """Files with measured recordings of one system, and how a model is identified from them."""

    @field_validator("publish")
    @classmethod
    def _check_published_files(cls, publish: bool, info: ValidationInfo) -> bool:
        for file in info.data.get("files", ()) if publish else ():
            if file.startswith(("/", ".")) or ".." in Path(file).parts:
                raise make_error(
                    f"{show(file)} cannot be published; must be below the working folder"
                )
        return publish


class TrialSection(
    keys("trial", kind=one_of(tuple(KINDS)), cases=str, methods=MethodName, protocols=ProtocolName)
):
    """Trials of identification methods on many recordings whose true model is known."""

    @model_validator(mode="after")
    def _check_keys_of_kind(self) -> Self:
        kind = KINDS[self.kind]
        for key in ("protocols", "levels", "samples", "durations"):
            if getattr(self, key) is not None and key not in kind.options:
                options = ", ".join(kind.options) or "none"
                raise make_error(f"is no key of {self.kind}; its own keys: {options}", key)
        for case in self.cases or ():
            if case not in kind.cases:
                raise make_error(
                    f"unknown case {show(case)} of {self.kind}; allowed: {', '.join(kind.cases)}",
                    "cases",
                )
        for method in self.methods or ():
            if kind.usable and method not in kind.usable:
                text = f"{show(method)} is no method of {self.kind}"
                raise make_error(f"{text}; allowed: {', '.join(kind.usable)}", "methods")
        for case in self.cases or kind.cases:
            if case in WIND_CASES and not {*(self.methods or INPUT_METHODS)} & {*INPUT_METHODS}:
                text = f"{show(self.methods)} cannot use the wind of {show(case)}"
                raise make_error(f"{text}; must have one of {', '.join(INPUT_METHODS)}", "methods")
            for duration in self.durations or ():
                most = PUBLISHED_DURATIONS.get(case, duration)
                if duration > most:
                    raise make_error(
                        f"{duration:g} is not allowed; of {case} at most {most:g}", "durations"
                    )
        return self


class SweepSection(keys("sweep", parameter=PARAMETER_NAME, second=PARAMETER_NAME)):
    """Range over which one or two parameters of every line are varied."""

    @field_validator("values", "second_values")
    @classmethod
    def _check_range(cls, values: tuple | None) -> tuple | None:
        if values is not None:
            first, last, step = values
            steps = (last - first) / step if step > 0 else 0.0
            if not 1 - 1e-9 <= steps <= MAX_SWEEP_VALUES:
                raise make_error(
                    f"{show(values)} is not a range: must be a first and a larger last value, and "
                    f"a step that gives 2 to {MAX_SWEEP_VALUES} values"
                )
        return values

    @model_validator(mode="after")
    def _check_second_parameter(self) -> Self:
        if (self.second is None) != (self.second_values is None):
            raise make_error(
                f"{show(self.second)} is not allowed beside second_values "
                f"{show(self.second_values)}; must both be given, or both be null",
                "second",
            )
        if self.second == self.parameter:
            raise make_error(f"{show(self.second)} is varied already; must be another", "second")
        return self


class MeasureSection(keys("measure", kind=one_of(tuple(measures.MEASURE_KINDS)))):
    """Settings of one measure against galloping, such as a damper."""

    @model_validator(mode="after")
    def _check_keys_of_kind(self) -> Self:
        given = {k for k, v in self.model_dump(exclude={"kind"}).items() if v is not None}
        needed = signature(measures.MEASURE_KINDS[self.kind]).parameters
        if given != set(needed):
            here = ", ".join(sorted(given)) or "no other key"
            keys = ", ".join(needed) or "no other key"
            raise make_error(f"{self.kind} is given with {here}; must be with {keys}", "kind")
        if self.positions is not None and not self.positions:
            raise make_error("is empty; must have one position or more", "positions")
        return self

    @property
    def places(self) -> tuple[float, ...]:
        """Positions of the measure along the span, m."""
        return self.positions or (() if self.position is None else (self.position,))


AssessmentSection = keys(
    "assessment",
    "Assessment of galloping: amplitudes, clearance, and measures against it.",
    open_parameters=keys(
        "open_parameters",
        "What the paper leaves open of its first line: values at which its claims are judged.",
    ),
    measures=dict[Name, MeasureSection],
)


def _default_sweeps() -> dict[str, SweepSection]:
    second = {"second": "tension", "second_values": (15000, 45000, 3000)}
    return {"wind": SweepSection(), "resonance": SweepSection(values=(4, 24, 2), **second)}


def _check_changed_case(
    case: CaseSection, changes: Sequence[tuple[str, str, float]], sweep: str
) -> None:
    """Raise a pydantic error, under the key of a sweep, if a case is invalid with other values.

    changes: the parameters of the sweep, each with the sweep's key of its values, and a value.
    """
    changed = case.model_dump()
    for parameter, key, value in changes:
        changed = PARAMETERS[parameter].at(changed, value)
        try:
            CaseSection.model_validate(changed)
        except ValidationError as error:
            fault = error.errors(include_url=False)[0]["msg"]
            text = f"{show(value)} as {parameter}: {fault[:1].lower()}{fault[1:]}"
            raise make_error(text, "sweeps", sweep, key) from None


class Settings(
    keys(
        "study",
        results=FolderName,
        reference=FolderPath,
        cases=(dict[Name, CaseSection], paper_cases),
        simulation=SimulationSection,
        measurement=MeasurementSection,
        identification=Identification,
        recordings=dict[Name, RecordingsSection],
        sweeps=(dict[Name, SweepSection], _default_sweeps),
        assessment=AssessmentSection,
        trials=dict[Name, TrialSection],
        figures=keys("figures", "How figures are drawn."),
    )
):
    """All settings of a study."""

    @model_validator(mode="after")
    def _check_swept_cases(self) -> Self:
        for (name, sweep), case in product(self.sweeps.items(), self.cases.values()):
            ends = [[(sweep.parameter, "values", end) for end in sweep.values[:2]]]
            if sweep.second:
                ends.append(
                    [(sweep.second, "second_values", end) for end in sweep.second_values[:2]]
                )
            for changes in product(*ends):
                _check_changed_case(case, changes, name)
        return self

    @field_validator("results")
    @classmethod
    def _check_results_folder(cls, results: str) -> str:
        path = Path(results)
        for part in (path, *path.parents):
            if part.as_posix().lower() in PROJECT_FOLDERS:
                raise make_error(f"{show(results)} is the project's own; must be another folder")
            if lexists(part) and not part.is_dir():
                text = f"{show(part.as_posix())} is a file or a broken link"
                raise make_error(f"{text}; must be a folder, or not there")
        return results

    @model_validator(mode="after")
    def _check_whole_study(self) -> Self:
        """Check that sections that are valid in themselves fit together."""
        if not (self.cases or self.trials):
            raise make_error("there is none; there must be a case or a trial", "cases")
        samples = self.simulation.samples
        for points in self.measurement.subsets.points:
            if points > samples:
                text = f"{points} is larger than the record ({samples} samples)"
                raise make_error(text, "measurement", "subsets", "points")
        methods, protocols = self.identification.methods, self.measurement.protocols
        usable = [m.name for m in METHODS if set(m.protocols) & set(protocols)]
        if not set(usable) & set(methods):
            text = f"{show(methods)} cannot use the recordings of protocol {', '.join(protocols)}"
            text += f"; must have one of {', '.join(usable)}"
            raise make_error(text, "identification", "methods")
        for name, recordings in self.recordings.items():
            if recordings.case is not None and recordings.case not in self.cases:
                text = f"{show(recordings.case)} is no case; must be one of {', '.join(self.cases)}"
                raise make_error(text, "recordings", name, "case")
        paper_trials = {n: t for n, t in self.trials.items() if KINDS[t.kind].table == PAPER}
        first = FIRST_READING.name  # with which all others are compared
        compared = equal_effort(list(paper_trials))
        if paper_trials and not any(
            first in (paper_trials[name].cases or KINDS[PAPER].cases) for name in compared
        ):
            text = (
                f"{', '.join(compared)} of kind {PAPER}; at least one must have the case {first!r}"
            )
            raise make_error(text, "trials")
        for name, case in self.cases.items():
            for label, measure in self.assessment.measures.items():
                for place in measure.places:
                    if not 0 < place < case.line.span:
                        text = f"{show(place)} m is outside the span of {name}; must be inside "
                        text += f"0..{show(case.line.span)} m"
                        raise make_error(text, "assessment", "measures", label)
        if Path(self.results).resolve().is_relative_to(Path(self.reference).resolve()):
            text = f"{show(self.results)} is in the folder of the reference, {show(self.reference)}"
            raise make_error(f"{text}; must be outside it", "results")
        return self
