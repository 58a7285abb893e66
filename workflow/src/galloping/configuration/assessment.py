"""The settings of what is asked of lines: sweeps, measures, clearance, open parameters."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, field_validator, model_validator

from galloping.configuration.fields import (
    NAME_RULE,
    DampingRatio,
    MotionAmount,
    Name,
    NonNegative,
    Positive,
    Section,
    distinct,
    invalid,
    listing,
    one_of,
    real,
    section,
    selection,
    setting,
    show,
    triple,
)

# What a sweep can vary: `galloping.cycles.line_family.PARAMETERS`.
SWEPT = (
    "wind_speed", "tension", "damping_ratio", "damping_vertical", "damping_horizontal", "span",
    "spacer_mass", "bundle_dimension", "ice_vertical_1", "ice_vertical_2", "ice_vertical_3",
    "ice_horizontal_1", "ice_horizontal_2", "ice_horizontal_3",
)  # fmt: skip
# Measures against galloping and what they take: `galloping.physics.measures`.
MEASURES = {
    "tension": ("factor",),
    "damper": ("position", "coefficient"),
    "spacers": ("mass", "positions"),
    "pendulum": ("mass", "positions"),
    "ice_removal": (),
}
MOST_VALUES = 1000
RANGE_RULE = f"first below last, 2 to {MOST_VALUES} values"


class SweepSection(Section):
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
            if not (first < last and 1 - 1e-9 <= (last - first) / step <= MOST_VALUES):
                raise invalid(
                    f"{show(values)} is not a range: must be a first and a larger last value, and "
                    f"a step that gives 2 to {MOST_VALUES} values"
                )
        return values

    @model_validator(mode="after")
    def _second_is_whole(self) -> SweepSection:
        if (self.second is None) != (self.second_values is None):
            raise invalid(
                f"{show(self.second)} is not allowed beside second_values "
                f"{show(self.second_values)}; must both be given, or both be null",
                "second",
            )
        if self.second == self.parameter:
            raise invalid(f"{show(self.second)} is varied already; must be another", "second")
        return self


class MeasureSection(Section):
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
    def _of_its_kind(self) -> MeasureSection:
        given = {k for k, v in self.model_dump(exclude={"kind"}).items() if v is not None}
        wanted = set(MEASURES[self.kind])
        if given != wanted:
            keys = ", ".join(MEASURES[self.kind]) or "nothing"
            here = ", ".join(sorted(given)) or "nothing"
            raise invalid(f"{self.kind} beside {here}; must stand beside {keys}", "kind")
        if self.positions is not None and not self.positions:
            raise invalid("is empty; must hold one place or more", "positions")
        return self

    @property
    def places(self) -> tuple[float, ...]:
        """Where on the span it is, m."""
        return self.positions or (() if self.position is None else (self.position,))


class OpenParametersSection(Section):
    """What the paper leaves open of its first line: values at which its claims are judged."""

    wind_speed: distinct(real(ge=0.1, le=120)) = setting((8, 9, 10, 12, 14), "wind speed", "m/s")
    damping_vertical: distinct(DampingRatio) = setting(
        (0.002, 0.005, 0.008), "damping ratio of the vertical mode", "1"
    )
    damping_horizontal: distinct(DampingRatio) = setting(
        (0.002, 0.005, 0.008), "damping ratio of the horizontal mode", "1"
    )
    bundle_dimension: distinct(real(ge=1e-3, le=10)) = setting(
        (0.0552, 0.1104, 0.2208), "characteristic dimension of the bundle", "m"
    )
    release_vertical: distinct(MotionAmount) = setting((0.1, 0.5, 1), "release in q_v", "m")
    release_horizontal: distinct(MotionAmount) = setting((0.1, 0.5, 1), "release in q_w", "m")
    threshold: distinct(Positive) = setting(
        (0.001, 0.002, 0.003, 0.004), "threshold of the paper's method", "1"
    )


class AssessmentSection(Section):
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
    open_parameters: OpenParametersSection = section(OpenParametersSection)
    measures: dict[Name, MeasureSection] = setting(
        {},
        "measures that are compared, by name; without any, those of a usual size",
        rule=NAME_RULE,
    )
