"""What panels share: axes over noise and data amount, R2 near one, medians with intervals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from textwrap import fill

import numpy as np
import pandas as pd
from matplotlib import rcParams
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import NullFormatter, NullLocator

from galloping.figures.style import DOUBLE, method_style, spoken

TALLEST = 12.0  # inches: what a page of a report shows at once
SHRUNK = 0.8  # of its wanted height has a case at least, where there are many
NOTE_WIDTH = 135  # letters in a line of the double width
R2_LIMITS = (0.0, 0.9999)
R2_TICKS = (0.0, 0.9, 0.95, 0.99, 0.999, 0.9999)


def nothing(axes: Axes, reason: str) -> None:
    """An empty panel that says why."""
    hidden = {"bottom": False, "left": False, "labelbottom": False, "labelleft": False}
    axes.tick_params(which="both", **hidden)  # others may share the ticks themselves
    axes.spines[:].set_visible(False)
    axes.text(0.5, 0.5, reason, transform=axes.transAxes, ha="center", va="center", color="#5f5f5f")


def nothing_at_all(reason: str) -> Figure:
    """A figure that says why there is nothing to show."""
    figure = Figure(figsize=(DOUBLE, 1.2), layout="constrained")
    nothing(figure.subplots(), reason)
    return figure


def letter(axes: Axes, index: int, text: str) -> None:
    """(a), (b), ..., (z), (aa), (bb), ... and what the panel shows."""
    axes.set_title(f"({chr(ord('a') + index % 26) * (1 + index // 26)}) {text}", loc="left")


def fitting(cases: Sequence[str], head: float, each: float) -> tuple[Sequence[str], float]:
    """The first cases, as many as fit into one figure, and its height in inches.

    head: height without any case. each: wanted height of one, of which SHRUNK is the least.
    """
    room = TALLEST - head
    shown = cases[: max(1, int(room / (SHRUNK * each)))]
    return shown, head + min(each * len(shown), room)


def note_left_out(figure: Figure, left: Sequence[str], where: str) -> None:
    """A line below the panels that names the cases without any. where: what holds their values."""
    if left:
        names = ", ".join(map(spoken, left))
        text = fill(f"Not drawn, for want of room: {names}. Their values: {where}.", NOTE_WIDTH)
        figure.supxlabel(text, x=0.01, ha="left", size=0.85 * rcParams["font.size"])


def case_grids(
    figure: Figure, cases: Sequence[str], rows: int, columns: int
) -> dict[str, np.ndarray]:
    """A headed block of rows x columns panels for each case, heights shared along a row."""
    blocks = figure.subfigures(len(cases), 1, squeeze=False)[:, 0]
    grids = {}
    for case, block in zip(cases, blocks, strict=True):
        block.suptitle(spoken(case), x=0.01, ha="left", weight="bold", size=rcParams["font.size"])
        grids[case] = block.subplots(rows, columns, squeeze=False, sharex=True, sharey="row")
    return grids


@dataclass(frozen=True)
class LogAxis:
    """A logarithmic axis of positive values, with zero in a place of its own at the left."""

    values: tuple[float, ...]

    @classmethod
    def of(cls, values: Sequence[float]) -> LogAxis:
        return cls(tuple(sorted({float(v) for v in values})))

    @property
    def _positive(self) -> tuple[float, ...]:
        return tuple(v for v in self.values if v > 0)

    @property
    def _zero(self) -> float:
        return self._positive[0] / 2 if self._positive else 1.0

    def position(self, value: float, shift: float = 0.0) -> float:
        """Where a value stands; shift: in decades, to keep methods apart."""
        return (value if value > 0 else self._zero) * 10**shift

    def prepare(self, axes: Axes, label: str) -> None:
        places = [self.position(v) for v in self.values]
        axes.set_xscale("log")
        axes.set_xlim(min(places) / 1.3, max(places) * 1.3)
        axes.set_xticks(
            places, [_short(v) for v in self.values], fontsize=0.75 * rcParams["font.size"]
        )
        axes.xaxis.set_minor_locator(NullLocator())
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.set_xlabel(label)
        if 0 in self.values and self._positive:
            axes.axvline(np.sqrt(self._zero * self._positive[0]), color="#bbbbbb", lw=0.6, ls=":")


def _short(value: float) -> str:
    return f"{value / 1000:g}k" if value >= 1000 else f"{value:g}"


def r2_place(r2: float | np.ndarray) -> float | np.ndarray:
    """-log10(1 - R2), which spreads the values near one."""
    return -np.log10(1 - np.clip(r2, *R2_LIMITS))


def prepare_r2(
    axes: Axes, label: str, vertical: bool = True, ticks: Sequence[float] = R2_TICKS
) -> None:
    """An axis of `r2_place`, labelled in R2; vertical: the y axis, else the x axis."""
    low, high = map(r2_place, R2_LIMITS)
    places, labels = [r2_place(r) for r in ticks], [f"{r:g}" for r in ticks]
    labels[0], labels[-1] = "≤ 0", "≥ 0.9999"
    limits = (low - 0.25, high + 0.25)
    if vertical:
        axes.set(ylim=limits, ylabel=label)
        axes.set_yticks(places, labels)
    else:
        axes.set(xlim=limits, xlabel=label)
        axes.set_xticks(places, labels)


def series(
    axes: Axes,
    x: Sequence[float],
    medians: Sequence[float],
    lows: Sequence[float],
    highs: Sequence[float],
    method: str,
    limits: tuple[float, float],
    joined: Sequence[bool] | None = None,
) -> None:
    """Medians of one method, intervals as bars; those `joined` (all) lie on one line.

    Values beyond `limits`, failures (inf) among them, stand at the limit as open triangles.
    A method without a marker is its line alone.
    """
    style = method_style(method)
    x, medians = np.asarray(x, float), np.asarray(medians, float)
    inside = np.clip(medians, *limits)
    line = np.ones(len(x), bool) if joined is None else np.asarray(joined, bool)
    look = line_look(method)
    if not style.marker:
        dash = "_" if line.sum() == 1 else ""  # a line needs two points
        axes.plot(x[line], inside[line], **look | {"markersize": 14}, marker=dash, zorder=4.5)
        return
    axes.vlines(x, np.clip(lows, *limits), np.clip(highs, *limits), color=style.color, lw=0.7)
    axes.plot(x[line], inside[line], **look, zorder=2 + style.weight)
    size = look["markersize"]
    for chosen, marker, face in (
        ((medians >= limits[0]) & (medians <= limits[1]), style.marker, style.color),
        (medians < limits[0], "v", "white"),
        (medians > limits[1], "^", "white"),
    ):
        axes.plot(
            x[chosen], inside[chosen], ls="", marker=marker, mfc=face, mec=style.color,
            mew=0.7, ms=size, zorder=3 + style.weight,
        )  # fmt: skip


def line_look(method: str) -> dict:
    """Colour, dashes and sizes of a method's line and marker."""
    style = method_style(method)
    return {
        "color": style.color,
        "ls": style.line,
        "lw": style.weight * rcParams["lines.linewidth"],
        "markersize": style.weight * rcParams["lines.markersize"],
    }


def shifts(methods: Sequence[str], width: float) -> dict[str, float]:
    """Small displacements that keep bars apart, `width` decades for six; lines alone stay."""
    marked = [method for method in methods if method_style(method).marker]
    step = width / max(5, len(marked) - 1)
    middle = (len(marked) - 1) / 2
    places = {method: step * (k - middle) for k, method in enumerate(marked)}
    return dict.fromkeys(methods, 0.0) | places


def in_order(table: pd.DataFrame, column: str, order: Sequence[str]) -> list[str]:
    """The entries of `order` that a column of the table holds."""
    present = set(table[column])
    return [name for name in order if name in present]


def method_legend(
    figure: Figure, methods: Sequence[str], extra: Sequence[Line2D] = (), columns: int = 5
) -> None:
    """All methods and marks, above the panels."""
    clipped = Line2D(
        [], [], ls="", marker="v", mfc="white", mec="k", mew=0.7, label="beyond the axis"
    )
    entries = method_handles({method: method_style(method).label for method in methods})
    figure.legend(
        handles=[*entries, *extra, clipped], loc="outside upper center", ncols=columns,
        columnspacing=1.4, handlelength=2.8,
    )  # fmt: skip


def method_handles(names: Mapping[str, str]) -> list[Line2D]:
    """Legend entries of methods, as they are to be named."""
    return [
        Line2D([], [], **line_look(method), marker=method_style(method).marker, label=name)
        for method, name in names.items()
    ]


def r2_series(
    axes: Axes,
    x: Sequence[float],
    medians: Sequence[float],
    lows: Sequence[float],
    highs: Sequence[float],
    method: str,
    joined: Sequence[bool] | None = None,
) -> None:
    """`series` of R2 on an axis of `prepare_r2`: open triangles stand for R2 of zero or less."""
    low, high = map(r2_place, R2_LIMITS)
    places = np.where(np.asarray(medians, float) < R2_LIMITS[0], low - 1, r2_place(medians))
    series(axes, x, places, r2_place(lows), r2_place(highs), method, (low, high), joined)
