"""Parts of figures: grids of panels, axes over noise and R2, intervals, rows of dots, legends."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from io import BytesIO
from typing import Any

import numpy as np
import pandas as pd
from matplotlib import rcParams
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import NullFormatter, NullLocator
from numpy.typing import ArrayLike

from galloping.figures.style import (
    BAND,
    DARK_GREY,
    DOUBLE_COLUMN,
    LIGHT_GREY,
    STATE_LABELS,
    method_style,
    spoken,
)

MAX_FIGURE_HEIGHT = 40.0  # inches: limit for a PNG of 1,200 px/inch
BEYOND_AXIS = "beyond the axis"  # label of open triangles at an end of an axis
R2_LIMITS = (0.0, 0.9999)
R2_TICKS = (0.0, 0.9, 0.95, 0.99, 0.999, 0.9999)

# --- panels ---


class ShownFigure(Figure):
    """Matplotlib figure that notebooks display although it is not made with pyplot."""

    def _repr_png_(self) -> bytes:
        written = BytesIO()
        self.savefig(written, format="png", dpi=120)
        return written.getvalue()


def write_reason(axes: Axes, reason: str) -> None:
    """Empty a panel of a figure, and write in it the reason why there is nothing to plot."""
    # hidden, not removed: other panels may share the ticks
    axes.tick_params(which="both", bottom=False, left=False, labelbottom=False, labelleft=False)
    axes.spines[:].set_visible(False)
    axes.text(0.5, 0.5, reason, transform=axes.transAxes, ha="center", va="center", color=DARK_GREY)


def panels(
    height: float, rows: int = 1, columns: int = 1, width: float = DOUBLE_COLUMN, **options: Any
) -> tuple[Figure, np.ndarray]:
    """Create a figure with a grid of panels; its width and height are in inches."""
    figure = ShownFigure(figsize=(width, height), layout="constrained")
    return figure, figure.subplots(rows, columns, squeeze=False, **options)


def make_empty_figure(reason: str) -> Figure:
    """Create a figure that contains only a text: the reason why there is nothing to plot."""
    figure, ((axes,),) = panels(1.2)
    write_reason(axes, reason)
    return figure


def letter(axes: Axes, index: int, text: str) -> None:
    """Set the title of a panel to a letter and a subject, such as '(a) vertical motion'.

    The letters are (a), (b), ..., (z), (aa), (bb), ...
    """
    axes.set_title(f"({chr(ord('a') + index % 26) * (1 + index // 26)}) {text}", loc="left")


def typeset(text: str) -> str:
    """Replace R2, q_v and q_w in a text by mathematical symbols for matplotlib.

    The words 'percent points' become '% points'.
    """
    for plain, symbol in (("R2", "$R^2$"), *STATE_LABELS.items(), ("percent points", "% points")):
        text = text.replace(plain, symbol)
    return text


def height(head: float, each: float, count: int) -> float:
    """Compute the height in inches of a figure with a number of equal rows, up to a maximum.

    head: height of all besides the rows. each: height of a row.
    """
    return head + min(each * count, MAX_FIGURE_HEIGHT - head)


def case_grids(
    cases: Sequence[str], columns: int, head: float, each: float, sharex: bool = True
) -> tuple[Figure, dict[str, np.ndarray]]:
    """Create a figure with a titled row of panels for each simulated line.

    A case is a line in a wind. head, each: inches, besides the rows and of a row, as in `height`.
    """
    figure = Figure(figsize=(DOUBLE_COLUMN, height(head, each, len(cases))), layout="constrained")
    blocks, grids = figure.subfigures(len(cases), 1, squeeze=False)[:, 0], {}
    for case, block in zip(cases, blocks, strict=True):
        block.suptitle(spoken(case), x=0.01, ha="left", weight="bold", size=rcParams["font.size"])
        grids[case] = block.subplots(1, columns, squeeze=False, sharex=sharex, sharey="row")
    return figure, grids


def wrapped_grid(count: int, columns: int, height: float) -> tuple[Figure, list[Axes]]:
    """Create a figure of panels with common axes, in rows of limited length.

    count: number of panels. columns: panels in a row, at most. height: of the figure, in inches.
    Panels with none below have the labels of the x axis.
    """
    columns = min(columns, count)
    figure, grid = panels(height, -(-count // columns), columns, sharex=True, sharey=True)
    grid = grid.ravel()
    for axes in grid[count:]:
        axes.remove()
    for axes in grid[max(0, count - columns) : count]:
        axes.tick_params(labelbottom=True)
    return figure, list(grid[:count])


# --- axes ---


@dataclass(frozen=True)
class LogAxis:
    """Logarithmic axis of values that are not negative, with a separate place for zero."""

    values: tuple[float, ...]
    zero: float

    @classmethod
    def of(cls, values: Sequence[float]) -> "LogAxis":
        """Create a logarithmic axis with ticks at the given values.

        Zero is drawn at half of the smallest positive value.
        """
        values = tuple(sorted({float(v) for v in values}))
        least = next((v for v in values if v > 0), 2.0)
        return cls(values, least / 2)

    def position(self, value: float, shift: float = 0.0) -> float:
        """Return the position of a value on the axis, shifted by a number of decades.

        Shifts keep the markers of several methods apart.
        """
        return (value if value > 0 else self.zero) * 10**shift

    def prepare(self, axes: Axes, label: str) -> None:
        """Set the scale, ticks, limits and label of a panel's x axis."""
        places = [self.position(v) for v in self.values]
        axes.set_xscale("log")
        axes.set_xlim(min(places) / 1.3, max(places) * 1.3)
        axes.set_xticks(
            places, list(map(short, self.values)), fontsize=0.75 * rcParams["font.size"]
        )
        axes.xaxis.set_minor_locator(NullLocator())
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.set_xlabel(label)
        if 0 in self.values and self.values[-1] > 0:
            axes.axvline(np.sqrt(self.zero * (2 * self.zero)), color="#bbbbbb", lw=0.6, ls=":")


def short(value: float) -> str:
    """Format a number as a short tick label, such as 5k for 5000."""
    return f"{value / 1000:g}k" if value >= 1000 else f"{value:g}"


def prepare_log(axes: Axes, limits: tuple[float, float], label: str) -> None:
    """Set a logarithmic scale, limits, a label and plain tick numbers on a panel's y axis."""
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter("{x:g}")
    axes.set(ylim=limits, ylabel=label)


def r2_place(r2: float | np.ndarray) -> float | np.ndarray:
    """Compute -log10(1 - R2), the position on an axis that spreads values of R2 near 1."""
    return -np.log10(1 - np.clip(r2, *R2_LIMITS))


def prepare_r2(axes: Axes, label: str) -> None:
    """Set up a panel's y axis for R2, at the positions of `r2_place`."""
    low, high = (float(r2_place(each)) for each in R2_LIMITS)
    names = {R2_LIMITS[0]: f"≤ {R2_LIMITS[0]:g}", R2_LIMITS[1]: f"≥ {R2_LIMITS[1]:g}"}
    labels = [names.get(r, f"{r:g}") for r in R2_TICKS]
    axes.set(ylim=(low - 0.25, high + 0.25), ylabel=label)
    axes.set_yticks(r2_place(np.array(R2_TICKS)), labels)


# --- values with intervals ---


def series(
    axes: Axes, x: Sequence[float], values: np.ndarray, method: str, limits: tuple[float, float]
) -> None:
    """Draw a line through the medians of one method, with an interval bar at each median.

    x: (n,). values: (3, n) median, low, high, places on the axis. Values beyond `limits`, including
    failures (inf), are drawn at the limit as open triangles. A method without a marker is a line
    alone, cut off by the axes.
    """
    style, look = method_style(method), line_look(method)
    inside, low, high = np.clip(values, *limits)
    if not style.marker:
        dash = "_" if len(x) == 1 else ""  # a line needs two points
        axes.plot(x, values[0], **look | {"markersize": 14}, marker=dash, zorder=4.5)
        return
    axes.vlines(x, low, high, color=style.color, lw=0.9)
    axes.plot(x, inside, **look, zorder=2 + style.weight)
    points(axes, x, values[0], limits, style.color, style.marker, look["markersize"])


def points(
    axes: Axes, x: ArrayLike, y: ArrayLike, limits: tuple[float, float],
    color: str, marker: str, size: float,
) -> None:  # fmt: skip
    """Draw markers at points; a point outside the limits becomes an open triangle at the limit."""
    across, up = np.asarray(x, float), np.asarray(y, float)
    look: dict[str, Any] = {"ls": "", "mec": color, "mew": 0.7, "ms": size, "zorder": 5}
    for is_chosen, symbol, face, label in (
        ((up >= limits[0]) & (up <= limits[1]), marker, color, None),
        (up < limits[0], "v", "white", BEYOND_AXIS),
        (up > limits[1], "^", "white", BEYOND_AXIS),
    ):
        if is_chosen.any():
            clipped = np.clip(up[is_chosen], *limits)
            axes.plot(across[is_chosen], clipped, marker=symbol, mfc=face, label=label, **look)


def band(
    axes: Axes, x: ArrayLike, low: ArrayLike, high: ArrayLike, label: str | None,
    **look: Any,
) -> None:  # fmt: skip
    """Shade the area between a lower and an upper curve.

    A single point is drawn as a thick vertical bar.
    """
    ground: dict[str, Any] = {"color": BAND, "lw": 0, "zorder": 1}
    axes.fill_between(x, low, high, **ground | look, label=label)
    if np.size(x) == 1:
        axes.vlines(x, low, high, color=BAND, lw=8, zorder=1)


def rows(axes: Axes, labels: Sequence[str], lines: bool = True) -> None:
    """Label the rows of a panel from top to bottom, with or without separating lines."""
    axes.set_yticks(range(len(labels)), labels)
    axes.tick_params(axis="y", length=0)
    axes.set_ylim(len(labels) - 0.5, -0.5)
    for k in range(1, len(labels) if lines else 0):
        axes.axhline(k - 0.5, color=LIGHT_GREY, lw=0.6, zorder=0.5)


def dot(
    axes: Axes, y: float, values: Sequence[float], limits: tuple[float, float], color: str,
    marker: str, size: float, bar: Mapping | None = None,
) -> None:  # fmt: skip
    """Draw a median as a marker and its interval as a bar, in one row of a panel.

    A median off the axis is an open arrowhead. values: median, low, high, places on the axis. bar:
    look of the interval.
    """
    median, low, high = np.clip(values, *limits)
    head = "<" if values[0] < limits[0] else ">" if values[0] > limits[1] else ""
    axes.hlines(y, low, high, **{"color": color, "lw": 0.8, **(bar or {})})
    axes.plot(
        median, y, ls="", marker=head or marker, ms=size, mec=color, mew=0.7, zorder=4,
        mfc="white" if head else color, clip_on=not head,
        label=BEYOND_AXIS if head else None,
    )  # fmt: skip


# --- methods and legends ---


def line_look(method: str) -> dict:
    """Return matplotlib's keywords for the line and markers of an identification method."""
    style = method_style(method)
    return {
        "color": style.color,
        "ls": style.line,
        "lw": style.weight * rcParams["lines.linewidth"],
        "markersize": style.weight * rcParams["lines.markersize"],
    }


def shifts(methods: Sequence[str], width: float) -> dict[str, float]:
    """Compute shifts, in decades of the x axis, that keep the markers of several methods apart.

    Six methods extend over `width` decades; methods without markers are not shifted.
    """
    marked = [method for method in methods if method_style(method).marker]
    step = width / max(5, len(marked) - 1)
    middle = (len(marked) - 1) / 2
    places = {method: step * (k - middle) for k, method in enumerate(marked)}
    return dict.fromkeys(methods, 0.0) | places


def where(table: pd.DataFrame, **values: object) -> pd.DataFrame:
    """Select the rows of a table in which the named columns have the given values."""
    for name, value in values.items():
        table = table[table[name] == value]
    return table


def key(label: str, **look: Any) -> Line2D:
    """Create a legend entry from a label and matplotlib's keywords for its marker and line."""
    return Line2D([], [], label=label, **{"ls": "", **look})


def method_keys(names: Sequence[str] | Mapping[str, str]) -> list[Line2D]:
    """Create legend entries for identification methods, in the style of each method.

    Labels are those of a mapping, else of the styles.
    """
    labels = names if isinstance(names, Mapping) else {}
    return [
        key(labels.get(name, style.label), marker=style.marker, **line_look(name))
        for name, style in ((name, method_style(name)) for name in names)
    ]


def legend(
    figure: Figure, *keys: Artist, columns: int = 5, loc: str = "outside upper center",
    **options: Any,
) -> None:  # fmt: skip
    """Add a legend to a figure, with the labels of all its panels and additional entries.

    Each label appears once.
    """
    entries: dict[str, Any] = {str(entry.get_label()): entry for entry in keys}
    for axes in figure.axes:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            entries.setdefault(label, handle)
    if entries.pop(BEYOND_AXIS, None):
        entries[BEYOND_AXIS] = key(BEYOND_AXIS, marker="v", mfc="white", mec="k", mew=0.7)
    look: dict[str, Any] = {"loc": loc, "columnspacing": 1.4, "handlelength": 2.4} | options
    if entries:
        handles: list[Any] = list(entries.values())
        for count in range(columns, 0, -1):  # as many columns as the width allows
            drawn = figure.legend(handles, list(entries), ncols=count, **look)
            if count == 1 or drawn.get_window_extent().width <= figure.bbox.width:
                break
            drawn.remove()
