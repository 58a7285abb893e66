"""The settings of a study: every key with its default, range, unit, source and meaning."""

from __future__ import annotations

from itertools import pairwise
from math import inf
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, ValidationInfo, create_model, field_validator, model_validator

from galloping.configuration.fields import (
    Section,
    distinct,
    listing,
    one_of,
    parameter,
    problem,
    real,
    section,
    selection,
    setting,
    show,
    triple,
    whole,
)
from galloping.identification.registry import METHODS, PROTOCOLS
from galloping.measurement.protocols import PROTOCOLS as ALL_PROTOCOLS
from galloping.trials.registry import KINDS

Positive = real(gt=0)
NonNegative = real(ge=0)
Aerodynamic = real(ge=-1e4, le=1e4)  # an airfoil has 6 a radian; cubic terms reach some hundreds
Motion = real(ge=-100, le=100)  # m, m/s: a tenth of where a motion counts as diverged
DampingRatio = real(ge=0, lt=1)
NoiseLevel = real(ge=0, lt=10)
Protocol = one_of(PROTOCOLS)
MethodName = one_of(tuple(method.name for method in METHODS))
CaseName = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]{0,39}$")]
NAME_RULE = "at most 40 lower-case letters, digits and '_', a letter first"
FolderName = Annotated[
    str,
    Field(pattern=r"^[A-Za-z0-9_][A-Za-z0-9_.-]*(/[A-Za-z0-9_][A-Za-z0-9_.-]*)*$", max_length=100),
]
FolderPath = Annotated[
    str, Field(pattern=r"^/?[A-Za-z0-9_.-]{1,255}(/[A-Za-z0-9_.-]{1,255})*$", max_length=1000)
]
# What a clone of the project holds beside its results.
OWN_FOLDERS = ("config", "tests", "workflow", "results/reference")

LARGEST_SAG = 0.25  # of the span: beyond, the parabola is off by more than a tenth of the tension
# What a sweep can vary: `galloping.cycles.line_family.PARAMETERS`.
SWEPT = (
    "wind_speed", "tension", "damping_ratio", "damping_vertical", "damping_horizontal", "span",
    "spacer_mass", "bundle_dimension", "ice_vertical_1", "ice_vertical_2", "ice_vertical_3",
    "ice_horizontal_1", "ice_horizontal_2", "ice_horizontal_3",
)  # fmt: skip
# Of the continuous line: `galloping.physics.continuous`, `galloping.physics.gusts`.
AERODYNAMICS = ("small_angle", "relative")
SPECTRA = ("von_karman", "kaimal")
# Measures against galloping and what they take: `galloping.physics.measures`.
MEASURES = {
    "tension": ("factor",),
    "damper": ("position", "coefficient"),
    "spacers": ("mass", "positions"),
    "pendulum": ("mass", "positions"),
    "ice_removal": (),
}
MOST_VALUES = 1000
RANGE_RULE = f"first below last, at most {MOST_VALUES} values"
WINDOW_SAMPLES = 10  # fewer show no amplitude
MAX_INTERVALS = 10_000_000  # a slip in a power of ten should not fill the memory


class Conductor(Section):
    """One sub-conductor."""

    mass: real(ge=0.01, le=100) = parameter(
        1.5,
        "mass per length of one sub-conductor",
        "kg/m",
        "m",
        "seed",
        why="a copper wire of 1.3 mm to the heaviest conductor under 30 cm of ice",
    )
    bending_stiffness: real(ge=0, le=1e6) = parameter(
        50,
        "bending stiffness of one sub-conductor",
        "N m2",
        "EI",
        "seed",
        why="a solid steel bar of 10 cm",
    )
    tensile_stiffness: real(ge=1e4, le=2e9) = parameter(
        3.0e7,
        "tensile stiffness of one sub-conductor",
        "N",
        "EA",
        "seed",
        note="printed 3.0e4, read in kN",
        why="a plastic wire of 2 mm to a solid steel bar of 10 cm",
    )


class Bundle(Section):
    """How many sub-conductors there are, and the size the wind sees."""

    subconductors: whole(ge=1, le=24) = parameter(
        4, "number of sub-conductors", "1", "n", "seed", why="twice the largest bundle in service"
    )
    dimension: real(ge=1e-3, le=10) = parameter(
        0.1104,
        "characteristic dimension of the bundle in the aerodynamic load",
        "m",
        "D",
        "assumed",
        note="4 conductors of 0.0276 m",
        why="a thin wire to a bundle as wide as a house",
    )


class Line(Section):
    """The span and how it hangs."""

    span: real(ge=1, le=10000) = parameter(
        300, "span length", "m", "l", "seed", why="the longest span of a power line is 5.4 km"
    )
    tension: real(ge=10, le=1e7) = parameter(
        25000,
        "horizontal tension of one sub-conductor",
        "N",
        "H",
        "seed",
        note="printed 25 kN, read per sub-conductor",
        rule="with a sag of at most a quarter of the span",
        why="above, what breaks a solid steel bar of 10 cm",
    )
    mode_shape: Literal["irvine", "sine"] = parameter(
        "irvine",
        "first vertical mode: of the sagging cable (irvine) or half a sine (sine)",
        "",
        "phi_v",
        "derived",
        note="the print has the Irvine parameter of one and the formula of the other",
    )


class Spacers(Section):
    """Point masses along the span."""

    mass: real(ge=0, le=1e4) = parameter(
        4.8, "mass of one spacer", "kg", "m_s", "seed", why="a hundred of the heaviest dampers"
    )
    positions: listing(Positive) = parameter(
        (75, 150, 225),
        "distances of the spacers from the left end",
        "m",
        "s_{}",
        "seed",
        rule="strictly increasing, inside the span",
    )

    @field_validator("positions")
    @classmethod
    def _increasing(cls, positions: tuple[float, ...]) -> tuple[float, ...]:
        for before, after in pairwise(positions):
            if after <= before:
                raise problem(
                    f"{show(after)} comes after {show(before)}; must be strictly increasing"
                )
        return positions


class Ice(Section):
    """Aerodynamic coefficients of the iced section."""

    reading: Literal["swapped", "milli", "custom"] = parameter(
        "swapped",
        "how the paper's disturbed coefficients are read: integer and fraction exchanged "
        "(swapped), times 1e-3 (milli), or given below (custom)",
        "",
        "beta, eta",
        "assumed",
        note="the digits are the paper's, the reading is ours",
    )
    vertical: triple(Aerodynamic) | None = parameter(
        None,
        "beta_1, beta_2, beta_3 of the vertical force",
        "1",
        "beta_{}",
        "assumed",
        rule="given exactly when the reading is custom",
    )
    horizontal: triple(Aerodynamic) | None = parameter(
        None,
        "eta_1, eta_2, eta_3 of the horizontal force",
        "1",
        "eta_{}",
        "assumed",
        rule="given exactly when the reading is custom",
    )

    @field_validator("vertical", "horizontal")
    @classmethod
    def _given_when_custom(cls, value: tuple | None, info: ValidationInfo) -> tuple | None:
        reading = info.data.get("reading", "custom" if value else None)
        if reading == "custom" and value is None:
            raise problem("null is not allowed with reading 'custom'; must be a list of 3 numbers")
        if reading != "custom" and value is not None:
            raise problem(
                f"{show(value)} is not allowed with reading {show(reading)}; "
                "must be null, or the reading custom"
            )
        return value


class Wind(Section):
    """The steady wind across the line."""

    speed: real(ge=0.1, le=120) = parameter(
        12,
        "horizontal wind speed",
        "m/s",
        "U",
        "assumed",
        why="below, the quasi-static angle is no longer small; no gust above 113 m/s was measured",
    )
    air_density: real(ge=0, le=2) = parameter(
        1.25, "air density", "kg/m3", "rho", "assumed", why="2 at -100 °C; 0 is a line in a vacuum"
    )


class Damping(Section):
    """Structural damping, as ratios to critical."""

    vertical: DampingRatio = parameter(
        0.005, "damping ratio of the vertical mode", "1", "zeta_v", "assumed"
    )
    horizontal: DampingRatio = parameter(
        0.005, "damping ratio of the horizontal mode", "1", "zeta_w", "assumed"
    )


class InitialState(Section):
    """Where the trajectory starts."""

    q_v: Motion = parameter(0.1, "vertical modal displacement", "m", "q_v(0)", "assumed")
    q_w: Motion = parameter(0.1, "horizontal modal displacement", "m", "q_w(0)", "assumed")
    dq_v: Motion = parameter(0, "vertical modal velocity", "m/s", "dq_v(0)", "assumed")
    dq_w: Motion = parameter(0, "horizontal modal velocity", "m/s", "dq_w(0)", "assumed")


class Gusts(Section):
    """The wind about its mean, the same along the span."""

    intensity: real(ge=0, le=0.5) = parameter(
        0,
        "standard deviation of the wind speed over its mean",
        "1",
        "I",
        "assumed",
        why="a hurricane in a city",
    )
    length_scale: real(ge=1, le=2000) = parameter(
        100, "integral length of the turbulence along the wind", "m", "L", "assumed"
    )
    spectrum: one_of(SPECTRA) = parameter(
        "von_karman", "spectrum of the wind speed", "", "S", "assumed"
    )


class Truth(Section):
    """What moves, and where it is observed."""

    model: Literal["two_mode", "continuous"] = parameter(
        "two_mode",
        "what recordings are made of: the paper's equations, or the partial differential equations "
        "on many modes, which no library contains",
        "",
        "truth",
        "assumed",
        rule="the other keys of truth need continuous",
    )
    modes: whole(ge=1, le=40) = parameter(
        9, "sine modes in each direction", "1", "N", "assumed", why="a wave of 15 m in 300 m"
    )
    aerodynamics: one_of(AERODYNAMICS) = parameter(
        "small_angle",
        "load of the paper (small_angle), or of the full relative wind (relative)",
        "",
        "F",
        "assumed",
    )
    drag: real(ge=0, le=10) = parameter(
        0, "static coefficient of the horizontal force", "1", "eta_0", "assumed"
    )
    antisymmetric: Motion = parameter(
        0, "first antisymmetric vertical mode at a quarter of the span, at each release", "m",
        "q_a(0)", "assumed",
    )  # fmt: skip
    gusts: Gusts = section(Gusts)
    sensors: selection(real(gt=0, lt=1)) = parameter(
        (0.25, 0.5, 0.75),
        "places of the sensors, in spans from the left end; as many sine modes are told apart, "
        "and the first of them is recorded",
        "1",
        "s_{}/l",
        "assumed",
    )

    @model_validator(mode="after")
    def _only_what_counts(self) -> Truth:
        if self.model != "continuous":
            for name in sorted(self.model_fields_set - {"model"}):
                if getattr(self, name) != getattr(Truth(), name):
                    raise problem("must be left out, or the model continuous", name)
        return self


class Case(Section):
    """One line in one wind."""

    conductor: Conductor = section(Conductor)
    bundle: Bundle = section(Bundle)
    line: Line = section(Line)
    spacers: Spacers = section(Spacers)
    ice: Ice = section(Ice)
    wind: Wind = section(Wind)
    damping: Damping = section(Damping)
    initial_state: InitialState = section(InitialState)
    releases: dict[CaseName, InitialState] = setting(
        {},
        "further recordings of the same line, each released from a state of its own",
        rule=NAME_RULE,
    )
    truth: Truth = section(Truth)
    gravity: real(ge=0.1, le=100) = parameter(
        9.81, "gravitational acceleration", "m/s2", "g", "assumed", why="an asteroid to Jupiter"
    )

    @field_validator("spacers")
    @classmethod
    def _inside_the_span(cls, spacers: Spacers, info: ValidationInfo) -> Spacers:
        if line := info.data.get("line"):
            for position in spacers.positions:
                if position >= line.span:
                    raise problem(
                        f"{show(position)} is beyond the span ({show(line.span)} m); "
                        f"must be > 0 and < {show(line.span)} m",
                        "positions",
                    )
        return spacers

    @model_validator(mode="after")
    def _hangs_as_a_shallow_cable(self) -> Case:
        weight = self.conductor.mass * self.gravity
        sag = weight * self.line.span**2 / (8 * self.line.tension)
        if sag > LARGEST_SAG * self.line.span:
            least = weight * self.line.span / (8 * LARGEST_SAG)
            raise problem(
                f"{show(self.line.tension)} gives a sag of {sag:.4g} m in a span of "
                f"{show(self.line.span)} m, which is no shallow cable; must be >= {least:.4g} N",
                "line",
                "tension",
            )
        return self


class Simulation(Section):
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
                raise problem(f"{given}; must be 100..{MAX_INTERVALS}")
            if abs(intervals - round(intervals)) > 1e-9 * intervals:
                raise problem(f"{given}; must be a whole number")
        return rate

    @field_validator("steady_window")
    @classmethod
    def _inside_the_record(cls, window: tuple[float, float], info: ValidationInfo) -> tuple:
        start, end = window
        duration = info.data.get("duration", end)
        if not start < end <= duration:
            raise problem(
                f"{show(window)} is not a window of the record; "
                f"must be increasing, 0..{show(duration)} s"
            )
        if (end - start) * info.data.get("sampling_rate", inf) < WINDOW_SAMPLES:
            raise problem(
                f"{show(window)} holds less than {WINDOW_SAMPLES} sampling intervals; "
                f"must hold {WINDOW_SAMPLES} or more"
            )
        return window


class Subsets(Section):
    """Random subsets of the record, to see how much data is needed."""

    level: NoiseLevel = setting(0.05, "noise level of the subsets", "1")
    points: selection(whole(ge=100)) = setting(
        (1000, 5000, 10000, 30000),
        "sizes of the subsets",
        "samples",
        rule="at most the samples of the record",
    )


class Measurement(Section):
    """What a recording keeps of the trajectory."""

    seed: whole(ge=0) = setting(20260130, "seed from which all noise is drawn", "1")
    replicates: whole(ge=1, le=10000) = setting(
        20, "independent realisations of the noise in a cell", "1"
    )
    protocols: selection(Protocol) = setting(
        PROTOCOLS,
        "what is measured: "
        + ", ".join(f"{protocol.meaning} ({protocol.name})" for protocol in ALL_PROTOCOLS),
    )
    levels: selection(NoiseLevel) = setting(
        (0, 0.01, 0.03, 0.05, 0.1, 0.15), "noise levels of the whole record", "1"
    )
    subsets: Subsets = section(Subsets)
    joint_levels: selection(NoiseLevel) = setting(
        (0.05,), "noise levels of all recordings of a case together, where it has releases", "1"
    )
    state_noise: Literal["relative", "absolute"] = setting(
        "relative",
        "protocols state and displacement: the level is a fraction of each state's standard "
        "deviation (relative), or the noise in SI units itself (absolute)",
    )


class Library(Section):
    """What models are found of, and how."""

    degree: whole(ge=1, le=5) = setting(3, "highest degree of the candidate library", "1")
    methods: selection(MethodName) = setting(
        tuple(m.name for m in METHODS if m.by_default), "identification methods"
    )


# with a section for each method that has settings
Identification = create_model(
    "Identification",
    __base__=Library,
    __doc__="How models are found.",
    **{m.name: (m.options, section(m.options)) for m in METHODS if m.options.model_fields},
)


class Recordings(Section):
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
    case: CaseName | None = setting(
        None, "case whose frequencies, damping and limit cycle are shown beside"
    )
    publish: bool = setting(False, "whether the files go into a publication of the study")


class Sweep(Section):
    """One parameter of every line over a range, or two."""

    parameter: one_of(SWEPT) = setting("wind_speed", "what is varied")
    values: triple(Positive) = setting(
        (1, 25, 1), "first and last value, and the step between them, in its unit", rule=RANGE_RULE
    )
    second: one_of(SWEPT) | None = setting(None, "what else is varied, for a map")
    second_values: triple(Positive) | None = setting(
        None, "the same of the second", rule=f"{RANGE_RULE}; given exactly when there is a second"
    )

    @field_validator("values", "second_values")
    @classmethod
    def _a_range(cls, values: tuple | None) -> tuple | None:
        if values is not None:
            first, last, step = values
            if not first < last or (last - first) / step > MOST_VALUES:
                raise problem(
                    f"{show(values)} is not a range: must be a first and a larger last value, and "
                    f"a step that gives at most {MOST_VALUES} values"
                )
        return values

    @model_validator(mode="after")
    def _second_is_whole(self) -> Sweep:
        if (self.second is None) != (self.second_values is None):
            raise problem("a map needs both second and second_values", "second")
        if self.second == self.parameter:
            raise problem(f"{show(self.second)} is varied already; must be another", "second")
        return self


class Measure(Section):
    """One measure against galloping."""

    kind: one_of(tuple(MEASURES)) = setting("ice_removal", "what is done")
    factor: real(gt=0, le=3) | None = setting(None, "of the tension", "1", rule="of `tension`")
    position: Positive | None = setting(
        None, "of a damper from the left end", "m", rule="of `damper`"
    )
    coefficient: Positive | None = setting(None, "of a damper", "N s/m", rule="of `damper`")
    mass: Positive | None = setting(
        None, "of each spacer or pendulum", "kg", rule="of `spacers` and `pendulum`"
    )
    positions: listing(Positive) | None = setting(
        None, "of spacers or pendulums from the left end", "m", rule="of `spacers` and `pendulum`"
    )

    @model_validator(mode="after")
    def _of_its_kind(self) -> Measure:
        given = {k for k, v in self.model_dump(exclude={"kind"}).items() if v is not None}
        wanted = set(MEASURES[self.kind])
        if given != wanted:
            keys = ", ".join(MEASURES[self.kind]) or "nothing else"
            raise problem(f"{self.kind} takes {keys}", "kind")
        return self


class Trial(Section):
    """Fits to many recordings whose truth is known."""

    kind: one_of(tuple(KINDS)) = setting("random_lines", "what is recorded and identified")
    seed: whole(ge=0) = setting(0, "seed from which lines, faults and noise are drawn", "1")
    replicates: whole(ge=1, le=100_000) = setting(
        20, "recordings of each case and cell, or random lines", "1"
    )
    batch: whole(ge=1) = setting(10, "replicates of a case that one job makes", "1")
    cases: selection(str) | None = setting(None, "lines, faults or systems, all by default")
    methods: selection(MethodName) | None = setting(
        None, "identification methods; by default ours, of systems beside those that it is to beat"
    )
    protocols: selection(Protocol) | None = setting(
        None, "what is measured", rule="of `default_line` and `random_lines`"
    )
    levels: selection(NoiseLevel) | None = setting(
        None, "noise levels, in standard deviations of each state", "1"
    )
    samples: selection(whole(ge=100)) | None = setting(
        None, "lengths of the recordings", "samples", rule="of `systems`"
    )

    @model_validator(mode="after")
    def _of_its_kind(self) -> Trial:
        kind = KINDS[self.kind]
        for key in ("protocols", "levels", "samples"):
            if getattr(self, key) is not None and key not in kind.options:
                raise problem(f"is no key of {self.kind}", key)
        for case in self.cases or ():
            if case not in kind.cases:
                raise problem(
                    f"unknown case {show(case)} of {self.kind}; allowed: {', '.join(kind.cases)}",
                    "cases",
                )
        return self


class OpenParameters(Section):
    """What the paper leaves open of its first line: values at which its claims are judged."""

    wind_speed: distinct(real(ge=0.1, le=120)) = setting((8, 10, 12, 14, 16), "wind speed", "m/s")
    damping_ratio: distinct(DampingRatio) = setting(
        (0.002, 0.005, 0.01), "damping ratio of both modes", "1"
    )
    bundle_dimension: distinct(real(ge=1e-3, le=10)) = setting(
        (0.0276, 0.0552, 0.1104, 0.4), "characteristic dimension of the bundle", "m"
    )
    initial_displacement: distinct(Motion) = setting(
        (0.01, 0.1, 0.5, 1), "release of both modes", "m"
    )


class Assessment(Section):
    """What a line engineer asks of the lines: how far they gallop, and what stops them."""

    design_wind: real(ge=0.1, le=120) = setting(
        12, "wind speed at which measures and clearances are judged", "m/s"
    )
    phase_distance: Annotated[tuple[NonNegative, NonNegative], Field(strict=False)] = setting(
        (0, 8), "horizontal and vertical distance of two phases at rest", "m"
    )
    clearance: Positive = setting(3, "least distance that two galloping phases must keep", "m")
    winds: selection(real(ge=0.1, le=120)) = setting(
        (8, 10, 12, 14, 16), "wind speeds that are predicted from identified models", "m/s"
    )
    open_parameters: OpenParameters = section(OpenParameters)
    measures: dict[CaseName, Measure] = setting(
        {},
        "measures that are compared, by name; without any, those of a usual size",
        rule=NAME_RULE,
    )


class Figures(Section):
    """How figures are drawn."""

    dpi: whole(ge=50, le=1200) = setting(200, "resolution of the PNG files", "px/inch")
    font_size: real(ge=4, le=24) = setting(8, "font size", "pt")


def paper_cases() -> dict[str, Case]:
    """The two lines of the paper: tuned to internal resonance, and away from it."""
    wide = InitialState(q_w=3)
    non_resonant = Case(line=Line(tension=35000), releases={"wide": wide})
    return {"internal_resonance": Case(), "non_resonant": non_resonant}


def paper_cases_in(settings: Settings) -> list[str]:
    """Names of the cases that are those of the paper, with the parameters of their line.

    Further releases are further recordings of the same line, and do not count.
    """
    paper = {name: case.model_copy(update={"releases": {}}) for name, case in paper_cases().items()}
    return [
        name
        for name, case in settings.cases.items()
        if case.model_copy(update={"releases": {}}) == paper.get(name)
    ]


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
    cases: dict[CaseName, Case] = Field(
        default_factory=paper_cases,
        description="the lines under study, by name",
        json_schema_extra={"rule": NAME_RULE},
    )
    simulation: Simulation = section(Simulation)
    measurement: Measurement = section(Measurement)
    identification: Identification = section(Identification)
    recordings: dict[CaseName, Recordings] = Field(
        default_factory=dict,
        description="recordings from the field, by name",
        json_schema_extra={"rule": NAME_RULE},
    )
    sweeps: dict[CaseName, Sweep] = Field(
        default_factory=lambda: {
            "wind": Sweep(),
            "resonance": Sweep(
                values=(4, 24, 2), second="tension", second_values=(15000, 45000, 3000)
            ),
        },
        description="parameters of the lines that are varied, by name",
        json_schema_extra={"rule": NAME_RULE},
    )
    assessment: Assessment = section(Assessment)
    trials: dict[CaseName, Trial] = Field(
        default_factory=dict,
        description="trials of what the identification claims, by name",
        json_schema_extra={"rule": NAME_RULE},
    )
    figures: Figures = section(Figures)

    @field_validator("results")
    @classmethod
    def _a_folder_of_its_own(cls, results: str) -> str:
        path = Path(results)
        for part in (path, *path.parents):
            if part.as_posix().lower() in OWN_FOLDERS:
                raise problem(f"{show(results)} is the project's own; must be another folder")
            if part.exists() and not part.is_dir():
                raise problem(f"{show(part.as_posix())} is a file; must be a folder, or not there")
        return results

    @field_validator("measurement")
    @classmethod
    def _subsets_fit_the_record(cls, measurement: Measurement, info: ValidationInfo) -> Measurement:
        if simulation := info.data.get("simulation"):
            for points in measurement.subsets.points:
                if points > simulation.samples:
                    raise problem(
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
                raise problem(
                    f"{show(identification.methods)} cannot use the recordings of protocol "
                    f"{', '.join(measurement.protocols)}; "
                    f"must hold one of {', '.join(m.name for m in METHODS if m.name in usable)}",
                    "methods",
                )
        return identification

    @model_validator(mode="after")
    def _something_to_study(self) -> Settings:
        if not (self.cases or self.trials):
            raise problem("there is none; must hold at least one, or there must be trials", "cases")
        return self

    @model_validator(mode="after")
    def _recordings_beside_cases(self) -> Settings:
        for name, recordings in self.recordings.items():
            if recordings.case is not None and recordings.case not in self.cases:
                raise problem(
                    f"{show(recordings.case)} is no case; must be one of {', '.join(self.cases)}",
                    "recordings",
                    name,
                    "case",
                )
        return self

    @model_validator(mode="after")
    def _results_apart_from_the_reference(self) -> Settings:
        if Path(self.results).resolve().is_relative_to(Path(self.reference).resolve()):
            raise problem(
                f"{show(self.results)} is in the folder of the reference, {show(self.reference)}; "
                "must be outside it",
                "results",
            )
        return self
