"""Parts of schematic drawings."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle, Polygon

ICE, METAL, INK = "#d6e6f2", "#6b6b6b", "#111111"


def iced_conductor(axes: Axes, x: float, y: float, radius: float) -> None:
    """A round conductor with a crescent of ice towards the wind, which comes from the left."""
    angle = np.linspace(np.pi / 2, 3 * np.pi / 2, 60)
    reach = radius * (1 + 0.75 * np.sin(angle - np.pi / 2) ** 0.8)
    outline = np.column_stack([x + reach * np.cos(angle), y + reach * np.sin(angle)])
    axes.add_patch(Polygon(outline, closed=True, facecolor=ICE, edgecolor=INK, lw=0.8))
    axes.add_patch(Circle((x, y), radius, facecolor=METAL, edgecolor=INK, lw=0.8))


def arrow(
    axes: Axes, start: tuple[float, float], end: tuple[float, float], color: str = INK,
    style: str = "-|>", width: float = 1.1, line: str = "-",
) -> None:  # fmt: skip
    """A straight arrow in data coordinates."""
    axes.annotate(
        "", xy=end, xytext=start,
        arrowprops={"arrowstyle": style, "color": color, "lw": width, "ls": line,
                    "shrinkA": 0, "shrinkB": 0, "mutation_scale": 9},
    )  # fmt: skip


def bare(axes: Axes) -> None:
    """A drawing to scale in both directions, without axes."""
    axes.set_aspect("equal")
    axes.axis("off")
