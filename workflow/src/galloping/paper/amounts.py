"""How much the paper's study measures."""

from collections.abc import Sequence
from dataclasses import dataclass

from galloping.simulation import time_grid
from galloping.study.kinds import NOISE, SUBSET


@dataclass(frozen=True)
class Amounts:
    """What is recorded: whole records at `levels`, and subsets of `points` at `subset_level`."""

    levels: Sequence[float] = (0.01, 0.03, 0.05, 0.1)
    points: Sequence[int] = (1000, 5000, 10000, 30000)
    subset_level: float = 0.05
    duration: float = 300.0
    sampling_rate: float = 100.0
    steady_window: tuple[float, float] = (200.0, 300.0)

    @property
    def cells(self) -> list[tuple[str, float, int]]:
        """(kind, level, points) of each; the number of points of a whole record included."""
        whole = len(time_grid(self.duration, self.sampling_rate))
        cells = [(NOISE, level, whole) for level in self.levels]
        return cells + [(SUBSET, self.subset_level, points) for points in self.points]
