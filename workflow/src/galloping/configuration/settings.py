"""The settings of a study: every key with its default, range, unit, source and meaning."""

from __future__ import annotations

from math import inf
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, ValidationInfo, create_model, field_validator, model_validator

from galloping.configuration.assessment import AssessmentSection, SweepSection
from galloping.configuration.fields import (
    NAME_RULE,
    Name,
    NoiseLevel,
    NonNegative,
    Section,
    invalid,
    listing,
    real,
    section,
    selection,
    setting,
    show,
    whole,
)
from galloping.configuration.lines import CaseSection, paper_cases
from galloping.configuration.trials import MethodName, ProtocolName, TrialSection
from galloping.identification.registry import METHODS
from galloping.measurement.protocols import PROTOCOLS

FolderName = Annotated[
    str,
    Field(pattern=r"^[A-Za-z0-9_][A-Za-z0-9_.-]*(/[A-Za-z0-9_][A-Za-z0-9_.-]*)*$", max_length=100),
]
FolderPath = Annotated[
    str, Field(pattern=r"^/?[A-Za-z0-9_.-]{1,255}(/[A-Za-z0-9_.-]{1,255})*$", max_length=1000)
]
# What a clone of the project holds beside its results.
OWN_FOLDERS = ("config", "tests", "workflow", "results/reference")

WINDOW_SAMPLES = 10  # fewer show no amplitude
MAX_INTERVALS = 10_000_000  # a slip in a power of ten should not fill the memory


class SimulationSection(Section):
    """The record that is simulated for each case."""

    duration: real(ge=1e-3, le=1e7) = setting(300, "length of the record", "s")
    sampling_rate: real(ge=1e-4, le=1e6) = setting(
        100,
        "samples per second",
        "Hz",
        rule=f"duration times rate a whole number, 100..{MAX_INTERVALS}",
    )
    steady_window: Annotated[tuple[NonNegative, NonNegative], Field(strict=False)] = setting(
        (200, 300),
        "start and end of the steady state, where amplitudes are read",
        "s",
        rule=f"increasing, inside the record, {WINDOW_SAMPLES} sampling intervals or more",
    )

    @property
    def samples(self) -> int:
        """Number of samples of a record, both ends included."""
        return round(self.duration * self.sampling_rate) + 1

    @field_validator("sampling_rate")
    @classmethod
    def _whole_number_of_samples(cls, rate: float, info: ValidationInfo) -> float:
        if duration := info.data.get("duration"):
            intervals = duration * rate
            given = f"{show(rate)} gives {show(intervals)} sampling intervals in {show(duration)} s"
            if not 100 <= intervals <= MAX_INTERVALS:
                raise invalid(f"{given}; must be 100..{MAX_INTERVALS}")
            if abs(intervals - round(intervals)) > 1e-9 * intervals:
                raise invalid(f"{given}; must be a whole number")
        return rate

    @field_validator("steady_window")
    @classmethod
    def _inside_the_record(cls, window: tuple[float, float], info: ValidationInfo) -> tuple:
        start, end = window
        duration = info.data.get("duration", end)
        if not start < end <= duration:
            raise invalid(
                f"{show(window)} is not a window of the record; "
                f"must be increasing, 0..{show(duration)} s"
            )
        if (end - start) * info.data.get("sampling_rate", inf) < WINDOW_SAMPLES:
            raise invalid(
                f"{show(window)} holds less than {WINDOW_SAMPLES} sampling intervals; "
                f"must hold {WINDOW_SAMPLES} or more"
            )
        return window


class SubsetsSection(Section):
    """Random subsets of the record, to see how much data is needed."""

    level: NoiseLevel = setting(0.05, "noise level of the subsets", "1")
    points: selection(whole(ge=100)) = setting(
        (1000, 5000, 10000, 30000),
        "sizes of the subsets",
        "samples",
        rule="at most the samples of the record",
    )


class MeasurementSection(Section):
    """What a recording keeps of the trajectory."""

    seed: whole(ge=0) = setting(20260130, "seed from which all noise is drawn", "1")
    replicates: whole(ge=1, le=10000) = setting(
        20, "independent realisations of the noise in a cell", "1"
    )
    paper_draws: whole(ge=1, le=100000) = setting(
        200, "independent draws of the paper's study by its own method, for its claims", "1"
    )
    protocols: selection(ProtocolName) = setting(
        tuple(protocol.name for protocol in PROTOCOLS if protocol.by_default),
        "what is measured: "
        + ", ".join(f"{protocol.meaning} ({protocol.name})" for protocol in PROTOCOLS),
    )
    levels: selection(NoiseLevel) = setting(
        (0, 0.01, 0.03, 0.05, 0.1, 0.15), "noise levels of the whole record", "1"
    )
    subsets: SubsetsSection = section(SubsetsSection)
    joint_levels: selection(NoiseLevel) = setting(
        (0.05,), "noise levels of all recordings of a case together, where it has releases", "1"
    )
    state_noise: Literal["relative", "absolute"] = setting(
        "relative",
        "protocols of sensors: the level is a fraction of the standard deviation of what each "
        "measures (relative), or the noise in SI units itself (absolute)",
    )


class LibrarySection(Section):
    """What models are found of, and how."""

    degree: whole(ge=1, le=5) = setting(3, "highest degree of the candidate library", "1")
    methods: selection(MethodName) = setting(
        tuple(m.name for m in METHODS if m.by_default), "identification methods"
    )


# with a section for each method that has settings
Identification = create_model(
    "Identification",
    __base__=LibrarySection,
    __doc__="How models are found.",
    **{m.name: (m.options, section(m.options)) for m in METHODS if m.options.model_fields},
)


class RecordingsSection(Section):
    """Recordings of one system, in files of its instruments."""

    files: selection(FolderPath) = setting((), "files, all read by one mapping", rule="each a path")
    mapping: FolderPath = setting(
        "mapping.yaml",
        "file that says what the columns measure, as examples/span.yaml does",
        rule="a path of letters, digits, '_', '-' and '.', from the root or the working folder",
    )
    degree: whole(ge=1, le=5) = setting(3, "largest degree of the polynomial library", "1")
    method: Literal["maximum_likelihood", "weak_gls"] = setting(
        "maximum_likelihood", "how the model is found"
    )
    known: listing(str) = setting(
        (), "known equations, SI units", rule="such as [dq_w=-9.2 q_w - 0.03 dq_w]"
    )
    seed: whole(ge=0) = setting(0, "seed of the draws behind intervals and forecasts", "1")
    case: Name | None = setting(
        None, "case whose frequencies, damping and limit cycle are shown beside", rule=NAME_RULE
    )
    publish: bool = setting(False, "whether the files go into a publication of the study")

    @field_validator("publish")
    @classmethod
    def _below_the_working_folder(cls, publish: bool, info: ValidationInfo) -> bool:
        for file in info.data.get("files", ()) if publish else ():
            if file.startswith(("/", ".")) or ".." in Path(file).parts:
                raise invalid(f"{show(file)} cannot be published; must be below the working folder")
        return publish


class FiguresSection(Section):
    """How figures are drawn."""

    dpi: whole(ge=50, le=1200) = setting(200, "resolution of the PNG files", "px/inch")
    font_size: real(ge=4, le=24) = setting(8, "font size", "pt")


class Settings(Section):
    """A study."""

    results: FolderName = setting(
        "results",
        "folder that a run writes",
        rule="a relative path of at most 100 letters, digits, '_', '-' and '.', no part starting "
        "with '.', outside the project's own folders and `reference`",
    )
    reference: FolderPath = setting(
        "results/reference",
        "folder of the numbers that the tables are compared with, if it is there",
        rule="a path of letters, digits, '_', '-' and '.', from the root or the working folder",
    )
    cases: dict[Name, CaseSection] = Field(
        default_factory=paper_cases,
        description="the lines under study, by name",
        json_schema_extra={"rule": NAME_RULE},
    )
    simulation: SimulationSection = section(SimulationSection)
    measurement: MeasurementSection = section(MeasurementSection)
    identification: Identification = section(Identification)
    recordings: dict[Name, RecordingsSection] = Field(
        default_factory=dict,
        description="recordings from the field, by name",
        json_schema_extra={"rule": NAME_RULE},
    )
    sweeps: dict[Name, SweepSection] = Field(
        default_factory=lambda: {
            "wind": SweepSection(),
            "resonance": SweepSection(
                values=(4, 24, 2), second="tension", second_values=(15000, 45000, 3000)
            ),
        },
        description="parameters of the lines that are varied, by name",
        json_schema_extra={"rule": NAME_RULE},
    )
    assessment: AssessmentSection = section(AssessmentSection)
    trials: dict[Name, TrialSection] = Field(
        default_factory=dict,
        description="trials of what the identification claims, by name",
        json_schema_extra={"rule": NAME_RULE},
    )
    figures: FiguresSection = section(FiguresSection)

    @field_validator("results")
    @classmethod
    def _a_folder_of_its_own(cls, results: str) -> str:
        path = Path(results)
        for part in (path, *path.parents):
            if part.as_posix().lower() in OWN_FOLDERS:
                raise invalid(f"{show(results)} is the project's own; must be another folder")
            if part.exists() and not part.is_dir():
                raise invalid(f"{show(part.as_posix())} is a file; must be a folder, or not there")
        return results

    @field_validator("measurement")
    @classmethod
    def _subsets_fit_the_record(
        cls, measurement: MeasurementSection, info: ValidationInfo
    ) -> MeasurementSection:
        if simulation := info.data.get("simulation"):
            for points in measurement.subsets.points:
                if points > simulation.samples:
                    raise invalid(
                        f"{points} is larger than the record ({simulation.samples} samples)",
                        "subsets",
                        "points",
                    )
        return measurement

    @field_validator("identification")
    @classmethod
    def _something_to_identify(
        cls, identification: Identification, info: ValidationInfo
    ) -> Identification:
        if measurement := info.data.get("measurement"):
            usable = {m.name for m in METHODS if set(m.protocols) & set(measurement.protocols)}
            if not usable & set(identification.methods):
                raise invalid(
                    f"{show(identification.methods)} cannot use the recordings of protocol "
                    f"{', '.join(measurement.protocols)}; "
                    f"must hold one of {', '.join(m.name for m in METHODS if m.name in usable)}",
                    "methods",
                )
        return identification

    @model_validator(mode="after")
    def _something_to_study(self) -> Settings:
        if not (self.cases or self.trials):
            raise invalid("there is none; must hold at least one, or there must be trials", "cases")
        return self

    @model_validator(mode="after")
    def _recordings_beside_cases(self) -> Settings:
        for name, recordings in self.recordings.items():
            if recordings.case is not None and recordings.case not in self.cases:
                raise invalid(
                    f"{show(recordings.case)} is no case; must be one of {', '.join(self.cases)}",
                    "recordings",
                    name,
                    "case",
                )
        return self

    @model_validator(mode="after")
    def _measures_inside_the_spans(self) -> Settings:
        for name, case in self.cases.items():
            for label, measure in self.assessment.measures.items():
                for place in measure.places:
                    if not 0 < place < case.line.span:
                        raise invalid(
                            f"{show(place)} m is outside the span of {name}; "
                            f"must be inside 0..{show(case.line.span)} m",
                            "assessment",
                            "measures",
                            label,
                        )
        return self

    @model_validator(mode="after")
    def _results_apart_from_the_reference(self) -> Settings:
        if Path(self.results).resolve().is_relative_to(Path(self.reference).resolve()):
            raise invalid(
                f"{show(self.results)} is in the folder of the reference, {show(self.reference)}; "
                "must be outside it",
                "results",
            )
        return self
