"""The settings of a line: its conductors, spacers, ice, wind, release, and how it moves."""

from __future__ import annotations

from itertools import pairwise
from typing import Literal

from pydantic import ValidationInfo, field_validator, model_validator

from galloping.configuration.fields import (
    NAME_RULE,
    DampingRatio,
    MotionAmount,
    Name,
    Positive,
    Section,
    invalid,
    listing,
    one_of,
    parameter,
    real,
    section,
    selection,
    setting,
    show,
    triple,
    whole,
)
from galloping.physics.gusts import SPECTRA

Aerodynamic = real(ge=-1e4, le=1e4)  # an airfoil has 6 a radian; cubic terms reach some hundreds
LARGEST_SAG = 0.25  # of the span: beyond, the parabola is off by more than a tenth of the tension
# Of the continuous line: `galloping.physics.continuous`, which takes a second to import.
AERODYNAMICS = ("small_angle", "relative")


class ConductorSection(Section):
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


class BundleSection(Section):
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


class LineSection(Section):
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


class SpacersSection(Section):
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
                raise invalid(
                    f"{show(after)} comes after {show(before)}; must be strictly increasing"
                )
        return positions


class IceSection(Section):
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
            raise invalid("null is not allowed with reading 'custom'; must be a list of 3 numbers")
        if reading != "custom" and value is not None:
            raise invalid(
                f"{show(value)} is not allowed with reading {show(reading)}; "
                "must be null, or the reading custom"
            )
        return value


class WindSection(Section):
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


class DampingSection(Section):
    """Structural damping, as ratios to critical."""

    vertical: DampingRatio = parameter(
        0.005, "damping ratio of the vertical mode", "1", "zeta_v", "assumed"
    )
    horizontal: DampingRatio = parameter(
        0.005, "damping ratio of the horizontal mode", "1", "zeta_w", "assumed"
    )


class InitialStateSection(Section):
    """Where the trajectory starts."""

    q_v: MotionAmount = parameter(0.1, "vertical modal displacement", "m", "q_v(0)", "assumed")
    q_w: MotionAmount = parameter(0.1, "horizontal modal displacement", "m", "q_w(0)", "assumed")
    dq_v: MotionAmount = parameter(0, "vertical modal velocity", "m/s", "dq_v(0)", "assumed")
    dq_w: MotionAmount = parameter(0, "horizontal modal velocity", "m/s", "dq_w(0)", "assumed")


class GustsSection(Section):
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
    spectrum: one_of(tuple(SPECTRA)) = parameter(
        "von_karman", "spectrum of the wind speed", "", "S", "assumed"
    )


class TruthSection(Section):
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
    antisymmetric: MotionAmount = parameter(
        0, "first antisymmetric vertical mode at a quarter of the span, at each release", "m",
        "q_a(0)", "assumed",
    )  # fmt: skip
    gusts: GustsSection = section(GustsSection)
    sensors: selection(real(gt=0, lt=1)) = parameter(
        (0.25, 0.5, 0.75),
        "places of the sensors, in spans from the left end; as many sine modes are told apart, "
        "and the first of them is recorded",
        "1",
        "s_{}/l",
        "assumed",
    )

    @model_validator(mode="after")
    def _only_what_counts(self) -> TruthSection:
        if self.model != "continuous":
            for name in sorted(self.model_fields_set - {"model"}):
                if getattr(self, name) != getattr(TruthSection(), name):
                    raise invalid(
                        f"is not allowed with model {self.model}; must be left out, or the model "
                        "continuous",
                        name,
                    )
        return self


class CaseSection(Section):
    """One line in one wind."""

    conductor: ConductorSection = section(ConductorSection)
    bundle: BundleSection = section(BundleSection)
    line: LineSection = section(LineSection)
    spacers: SpacersSection = section(SpacersSection)
    ice: IceSection = section(IceSection)
    wind: WindSection = section(WindSection)
    damping: DampingSection = section(DampingSection)
    initial_state: InitialStateSection = section(InitialStateSection)
    releases: dict[Name, InitialStateSection] = setting(
        {},
        "further recordings of the same line, each released from a state of its own",
        rule=NAME_RULE,
    )
    truth: TruthSection = section(TruthSection)
    gravity: real(ge=0.1, le=100) = parameter(
        9.81, "gravitational acceleration", "m/s2", "g", "assumed", why="an asteroid to Jupiter"
    )

    @field_validator("spacers")
    @classmethod
    def _inside_the_span(cls, spacers: SpacersSection, info: ValidationInfo) -> SpacersSection:
        if line := info.data.get("line"):
            for position in spacers.positions:
                if position >= line.span:
                    raise invalid(
                        f"{show(position)} is beyond the span ({show(line.span)} m); "
                        f"must be > 0 and < {show(line.span)} m",
                        "positions",
                    )
        return spacers

    @model_validator(mode="after")
    def _hangs_as_a_shallow_cable(self) -> CaseSection:
        weight = self.conductor.mass * self.gravity
        sag = weight * self.line.span**2 / (8 * self.line.tension)
        if sag > LARGEST_SAG * self.line.span:
            least = weight * self.line.span / (8 * LARGEST_SAG)
            raise invalid(
                f"{show(self.line.tension)} gives a sag of {sag:.4g} m in a span of "
                f"{show(self.line.span)} m, which is no shallow cable; must be >= {least:.4g} N",
                "line",
                "tension",
            )
        return self


def paper_cases() -> dict[str, CaseSection]:
    """The two lines of the paper: tuned to internal resonance, and away from it."""
    wide = InitialStateSection(q_w=3)
    non_resonant = CaseSection(line=LineSection(tension=35000), releases={"wide": wide})
    return {"internal_resonance": CaseSection(), "non_resonant": non_resonant}
