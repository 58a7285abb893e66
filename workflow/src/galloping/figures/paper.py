"""What the paper prints, as marks beside the study's own values."""

from __future__ import annotations

from dataclasses import dataclass

from matplotlib.axes import Axes

from galloping.figures.style import PAPER
from galloping.paper.printed import CLAIMS

LOOKS = {  # of a printed value and of a printed bound
    "paper: printed": {"marker": "*", "ms": 8, "mew": 0, "zorder": 6},
    "paper: at least": {"marker": "_", "ms": 16, "mew": 1.4, "zorder": 2},
}


@dataclass(frozen=True)
class Printed:
    """One number that the paper prints of a score.

    level, points: of the recording, points None where it is whole. look: a name of LOOKS.
    """

    level: float
    points: int | None
    value: float
    look: str


def printed(column: str, case: str) -> list[Printed]:
    """What the paper prints of a column of scores.csv, of one case."""
    value, bound = LOOKS
    return [
        Printed(c.level, c.points, c.paper_value, value if c.is_number else bound)
        for c in CLAIMS
        if c.column == column and c.case in (case, "") and not c.minus
    ]


def mark(axes: Axes, x: float, y: float, of: Printed) -> None:
    """A star at a printed value, a bar at a printed bound, at a place of the axes."""
    label = of.look if of.look not in axes.get_legend_handles_labels()[1] else None
    axes.plot(x, y, ls="", color=PAPER, label=label, **LOOKS[of.look])
