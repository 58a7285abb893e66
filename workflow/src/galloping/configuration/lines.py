"""The settings of a line: its conductors, spacers, ice, wind, release, and how it moves."""

from itertools import pairwise
from typing import Self

from pydantic import ValidationInfo, field_validator, model_validator

from galloping.configuration.keys import keys
from galloping.fields import Name, invalid, one_of, show
from galloping.physics.gusts import SPECTRA

LineSection = keys("line", "The span and how it hangs.")
InitialStateSection = keys("initial_state", "Where the trajectory starts.")
GUSTS = keys(
    "gusts", "The wind about its mean, the same along the span.", spectrum=one_of(tuple(SPECTRA))
)
LARGEST_SAG = 0.25  # of the span: beyond, the parabola is off by more than a tenth of the tension


class SpacersSection(keys("spacers")):
    """Point masses along the span."""

    @field_validator("positions")
    @classmethod
    def _increasing(cls, positions: tuple[float, ...]) -> tuple[float, ...]:
        for before, after in pairwise(positions):
            if after <= before:
                raise invalid(
                    f"{show(after)} comes after {show(before)}; must be strictly increasing"
                )
        return positions


class IceSection(keys("ice")):
    """Aerodynamic coefficients of the iced section."""

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


class TruthSection(keys("truth", gusts=GUSTS)):
    """What moves, and where it is observed."""

    @model_validator(mode="after")
    def _only_what_counts(self) -> Self:
        if self.model != "continuous":
            for name in sorted(self.model_fields_set - {"model"}):
                if getattr(self, name) != getattr(TruthSection(), name):
                    raise invalid(
                        f"is not allowed with model {self.model}; must be left out, or the model "
                        "continuous",
                        name,
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
        releases=dict[Name, InitialStateSection],
        truth=TruthSection,
    )
):
    """One line in one wind."""

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
    def _hangs_as_a_shallow_cable(self) -> Self:
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
