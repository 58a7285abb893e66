"""What is varied of the lines, and which recordings trials make, in the pieces that jobs make.

A piece keeps its name and file when more is asked for: what is new comes in pieces of its own.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass

from galloping.configuration.kinds import KINDS, Kind
from galloping.configuration.settings import SweepSection, TrialSection
from galloping.identification.registry import BY_NAME, Method

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
        """New values are added to the file of each."""
        if not self.is_map:
            return (Block(self.parameter, self.values),)
        return tuple(
            Block(f"{self.second}_{value:.12g}", self.values, value) for value in self.second_values
        )


def sweep(name: str, configured: SweepSection) -> Sweep:
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


@dataclass(frozen=True)
class Batch:
    """What one job tries: replicates of one case."""

    name: str
    case: str
    replicates: range


@dataclass(frozen=True)
class Trial:
    """One trial. options: keywords of the kind's function, in plain values."""

    name: str
    kind: Kind
    seed: int
    replicates: int
    batch: int
    cases: tuple[str, ...]
    methods: tuple[Method, ...]
    options: Mapping[str, list]

    @property
    def batches(self) -> tuple[Batch, ...]:
        """Named by their case and replicates."""
        starts = range(0, self.replicates, self.batch)
        parts = [range(k, min(k + self.batch, self.replicates)) for k in starts]
        return tuple(
            Batch(f"{_file_name(case)}_{part[0]}_to_{part[-1]}", case, part)
            for case in self.cases
            for part in parts
        )


def trial(name: str, configured: TrialSection) -> Trial:
    """A trial as configured, keys left out at the defaults of its kind."""
    kind = KINDS[configured.kind]
    options = {key: getattr(configured, key) or default for key, default in kind.options.items()}
    return Trial(
        name,
        kind,
        configured.seed,
        configured.replicates,
        configured.batch,
        configured.cases or kind.cases,
        tuple(BY_NAME[name] for name in configured.methods or kind.methods),
        {key: list(values) for key, values in options.items()},
    )


def _file_name(case: str) -> str:
    return re.sub(r"[^a-z0-9]+", "_", case.lower())
