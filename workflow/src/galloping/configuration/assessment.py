"""The settings of what is asked of lines: sweeps, measures, clearance, open parameters."""

from typing import Self

from pydantic import field_validator, model_validator

from galloping.configuration.keys import keys
from galloping.fields import Name, invalid, one_of, show

# What a sweep can vary: `galloping.cycles.family.PARAMETERS`.
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


class SweepSection(keys("sweep", parameter=one_of(SWEPT), second=one_of(SWEPT))):
    """One parameter of every line over a range, or two."""

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
    def _second_is_whole(self) -> Self:
        if (self.second is None) != (self.second_values is None):
            raise invalid(
                f"{show(self.second)} is not allowed beside second_values "
                f"{show(self.second_values)}; must both be given, or both be null",
                "second",
            )
        if self.second == self.parameter:
            raise invalid(f"{show(self.second)} is varied already; must be another", "second")
        return self


class MeasureSection(keys("measure", kind=one_of(tuple(MEASURES)))):
    """One measure against galloping."""

    @model_validator(mode="after")
    def _of_its_kind(self) -> Self:
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


class OpenParametersSection(keys("open_parameters")):
    """What the paper leaves open of its first line: values at which its claims are judged."""


class AssessmentSection(
    keys(
        "assessment",
        open_parameters=OpenParametersSection,
        measures=dict[Name, MeasureSection],
    )
):
    """What a line engineer asks of the lines: how far they gallop, and what stops them."""
