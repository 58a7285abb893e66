"""What is varied of the lines, and in which pieces."""

from collections.abc import Mapping
from dataclasses import dataclass

from galloping.configuration import assessment

# Where a line has what a sweep can vary, for what is a key of its own there.
KEYS = {
    "wind_speed": (("wind", "speed"),),
    "tension": (("line", "tension"),),
    "damping_ratio": (("damping", "vertical"), ("damping", "horizontal")),
    "damping_vertical": (("damping", "vertical"),),
    "damping_horizontal": (("damping", "horizontal"),),
    "spacer_mass": (("spacers", "mass"),),
    "bundle_dimension": (("bundle", "dimension"),),
}


def without(line: Mapping, *parameters: str | None) -> dict:
    """A line without its own values of what is varied, on which nothing of a sweep depends."""
    gone = {place for parameter in parameters for place in KEYS.get(parameter, ())}
    return {
        section: {key: value for key, value in of.items() if (section, key) not in gone}
        if isinstance(of, Mapping)
        else of
        for section, of in line.items()
    }


@dataclass(frozen=True)
class Block:
    """What one job simulates: values of the first parameter, and one of the second of a map."""

    name: str
    values: tuple[float, ...]
    second: float | None = None


@dataclass(frozen=True)
class Sweep:
    """One parameter over its values, or two."""

    name: str
    parameter: str
    values: tuple[float, ...]
    second: str | None
    second_values: tuple[float, ...]

    @property
    def is_map(self) -> bool:
        return self.second is not None

    @property
    def ends(self) -> list[float]:
        """The first and the last value."""
        return [self.values[0], self.values[-1]]

    @property
    def blocks(self) -> tuple[Block, ...]:
        """Each keeps its name and file when the ranges grow: new values are added to it."""
        if not self.is_map:
            return (Block(self.parameter, self.values),)
        return tuple(
            Block(f"{self.second}_{value:.12g}", self.values, value) for value in self.second_values
        )


def sweep(name: str, configured: assessment.SweepSection) -> Sweep:
    """A sweep as configured, its ranges written out."""
    return Sweep(
        name,
        configured.parameter,
        _values(configured.values),
        configured.second,
        _values(configured.second_values) if configured.second_values else (),
    )


def _values(given: tuple[float, float, float]) -> tuple[float, ...]:
    first, last, step = given
    count = int((last - first) / step + 1e-9) + 1
    return tuple(round(first + k * step, 12) for k in range(count))
