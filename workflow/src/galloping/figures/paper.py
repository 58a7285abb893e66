"""What the paper prints, as marks beside the study's own values."""

from __future__ import annotations

from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from galloping.figures.style import PAPER
from galloping.tables.claims import CLAIMS, Claim


def claims_of(column: str, case: str, subset: bool = False) -> list[Claim]:
    """Claims about one score of one case, from whole records or from random subsets."""
    return [
        claim
        for claim in CLAIMS
        if claim.column == column
        and claim.case in (case, None)
        and claim.minus is None
        and (claim.points is not None) == subset
    ]


def mark(axes: Axes, x: float, y: float, claim: Claim) -> None:
    """A star at a printed value, a bar at a printed bound."""
    if claim.kind == "value":
        axes.plot(x, y, "*", color=PAPER, markersize=7, markeredgewidth=0, zorder=5)
    else:
        axes.plot(x, y, "_", color=PAPER, markersize=14, markeredgewidth=1.3, zorder=2)


def handles(value: bool, bound: bool) -> list[Line2D]:
    """Legend entries of the marks."""
    entries = []
    if value:
        entries.append(
            Line2D([], [], ls="", marker="*", color=PAPER, ms=7, mew=0, label="paper's value")
        )
    if bound:
        entries.append(
            Line2D([], [], ls="", marker="_", color=PAPER, ms=10, mew=1.3, label="paper: at least")
        )
    return entries
