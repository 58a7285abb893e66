"""What is varied of the lines, and in which pieces: a range that grows computes new pieces only."""

from __future__ import annotations

from dataclasses import dataclass

from galloping.configuration import settings

BLOCK = 13  # values of a sweep that one job simulates


@dataclass(frozen=True)
class Block:
    """Values that one job simulates: of the first parameter, and one of the second of a map."""

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
    def blocks(self) -> tuple[Block, ...]:
        """Named by their values, so that a block keeps its file when others are added."""
        if self.is_map:
            return tuple(
                Block(f"{self.second}_{value:.12g}", self.values, value)
                for value in self.second_values
            )
        starts = range(0, len(self.values), BLOCK)
        parts = [self.values[start : start + BLOCK] for start in starts]
        return tuple(Block(f"{part[0]:.12g}_to_{part[-1]:.12g}", part) for part in parts)


def sweep(name: str, configured: settings.Sweep) -> Sweep:
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
