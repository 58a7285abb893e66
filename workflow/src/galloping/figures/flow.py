"""Figure 3: the way from the line to its reconstructed model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from math import comb
from textwrap import fill

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch

from galloping.figures.sketch import INK, arrow
from galloping.figures.style import DOUBLE, PAPER, method_style
from galloping.physics.equations import STATES

# the drawing's unit is the inch
HEIGHT = 3.0
BOX = (2.0, 0.74)
COLUMNS, ROWS = (1.1, 3.5, 5.9), (2.57, 1.5, 0.43)
PATH = [(0, 0), (1, 0), (2, 0), (2, 1), (1, 1), (0, 1), (0, 2), (1, 2), (2, 2)]  # column, row
COLORS = ("#e6e6e6", "#fdf1d8", "#d6e6f2")  # truth, data, identified model


def draw_flow(settings: Mapping) -> Figure:
    """Boxes joined in reading order, and the way of the truth into the comparison.

    settings: degree of the library, protocols, methods, replicates; least and greatest of the noise
    levels and of the points of the subsets.
    """
    figure = Figure(figsize=(DOUBLE, HEIGHT))
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set(xlim=(0, DOUBLE), ylim=(0, HEIGHT))
    axes.axis("off")
    for (column, row), (title, text) in zip(PATH, _boxes(settings), strict=True):
        _box(axes, COLUMNS[column], ROWS[row], title, text, COLORS[row])
    for (column, row), (next_column, next_row) in pairwise(PATH):
        side, down = next_column - column, next_row - row
        arrow(
            axes,
            (COLUMNS[column] + side * BOX[0] / 2, ROWS[row] - down * BOX[1] / 2),
            (COLUMNS[next_column] - side * BOX[0] / 2, ROWS[next_row] + down * BOX[1] / 2),
        )
    _truth(axes)
    return figure


def _boxes(settings: Mapping) -> list[tuple[str, str]]:
    """Title and text of each box, in the order of `PATH`."""
    degree = settings["degree"]
    candidates = comb(len(STATES) + degree, degree)
    methods = "; ".join(method_style(name).label for name in settings["methods"])
    return [
        ("Line and wind", "conductor, bundle, span, tension, spacers, ice, wind speed, damping"),
        (
            "Galloping equations",
            "Galerkin projection on the first modes: γ₁…γ₈ and κ₁…κ₁₀",
        ),
        ("True motion", "Taylor integration to machine precision: displacements and velocities"),
        (
            "Recordings",
            f"protocol {_either(settings['protocols'])}; noise {_range(settings['levels'])}; "
            f"subsets of {_range(settings['points'])} points; {settings['replicates']} replicates",
        ),
        (
            "Candidate library",
            f"{candidates} monomials up to degree {degree}: regressed on derivatives or "
            "integrals, or fitted to the motion",
        ),
        ("Identification", f"{methods}; terms by a rule from the data alone"),
        ("Identified model", "support and coefficients of both equations, for each replicate"),
        (
            "Reconstructed motion",
            "integrated from the true initial state; one that diverges is kept as a failure",
        ),
        (
            "Comparison",
            "coefficient errors, terms found, $R^2$, amplitude, frequency: medians, intervals, "
            "claims",
        ),
    ]


def _either(names: Sequence[str]) -> str:
    return " or ".join(names)


def _range(values: Sequence[float]) -> str:
    low, high = min(values), max(values)
    return f"{low:g}" if low == high else f"{low:g} to {high:g}"


def _box(axes: Axes, x: float, y: float, title: str, text: str, color: str) -> None:
    width, height = BOX
    axes.add_patch(
        FancyBboxPatch(
            (x - width / 2, y - height / 2), width, height,
            boxstyle="round,pad=0,rounding_size=0.07", facecolor=color, edgecolor=INK, lw=0.8,
        )
    )  # fmt: skip
    axes.text(x, y + height / 2 - 0.07, title, ha="center", va="top", weight="bold")
    axes.text(
        x, y + height / 2 - 0.24, fill(text, 36), ha="center", va="top", fontsize="small",
        linespacing=1.15,
    )  # fmt: skip


def _truth(axes: Axes) -> None:
    """The dashed way of the truth around identification, straight into the comparison."""
    right, margin = COLUMNS[2] + BOX[0] / 2, DOUBLE - 0.14
    axes.plot(
        [right, margin, margin], [ROWS[0], ROWS[0], ROWS[2]], color=PAPER, lw=1.0, ls=(0, (4, 2))
    )
    arrow(axes, (margin, ROWS[2]), (right, ROWS[2]), color=PAPER)
    axes.text(
        margin - 0.05, (ROWS[1] + ROWS[2]) / 2, "true coefficients and motion",
        ha="right", va="center", color=PAPER, fontsize="small",
    )  # fmt: skip
