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

from galloping.figures.style import BAND, DOUBLE, method_style, spoken

TALLEST = 12.0  # inches: what a page of a report shows at once
SHRUNK = 0.8  # of its wanted height has a case at least, where there are many
BEYOND = "beyond the axis"  # label of what stands at a limit as an open triangle
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


def method_grid(
    settings: Mapping, rows: int, each: float, where: str
) -> tuple[Figure, dict[tuple[str, int, str], Axes]]:
    """Panels by case, row and protocol: a headed block for each case, a column for each protocol.

    settings: cases and protocols, of which the cases that fit are drawn. each: height of a row, in
    inches. where: what holds the values of the other cases.
    """
    protocols = settings["protocols"]
    cases, height = fitting(settings["cases"], 0.8, each * rows)
    figure = Figure(figsize=(DOUBLE, height), layout="constrained")
    grid = {
        (case, row, protocol): axes
        for case, block in case_grids(figure, cases, rows, len(protocols)).items()
        for row, line in enumerate(block)
        for protocol, axes in zip(protocols, line, strict=True)
    }
    for index, ((_, _, protocol), axes) in enumerate(grid.items()):
        letter(axes, index, f"from {protocol}")
    note_left_out(figure, settings["cases"][len(cases) :], where)
    return figure, grid


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
    values: np.ndarray,
    method: str,
    limits: tuple[float, float],
    joined: Sequence[bool] | None = None,
) -> None:
    """Medians of one method, intervals as bars; those `joined` (all) lie on one line.

    x: (n,). values: (3, n) median, low and high, places on the axis. Values beyond `limits`,
    failures (inf) among them, stand at the limit as open triangles. A method without a marker is
    its line alone.
    """
    style, look = method_style(method), line_look(method)
    x, values = np.asarray(x, float), np.asarray(values, float)
    inside, low, high = np.clip(values, *limits)
    line = np.ones(len(x), bool) if joined is None else np.asarray(joined, bool)
    if not style.marker:
        dash = "_" if line.sum() == 1 else ""  # a line needs two points
        axes.plot(x[line], inside[line], **look | {"markersize": 14}, marker=dash, zorder=4.5)
        return
    axes.vlines(x, low, high, color=style.color, lw=0.9)
    axes.plot(x[line], inside[line], **look, zorder=2 + style.weight)
    points(axes, x, values[0], limits, style.color, style.marker, look["markersize"])


def points(
    axes: Axes, x: Sequence[float], y: Sequence[float], limits: tuple[float, float],
    color: str, marker: str, size: float,
) -> None:  # fmt: skip
    """Markers, those beyond the limits at the limit as open triangles."""
    x, y = np.asarray(x, float), np.asarray(y, float)
    look = {"ls": "", "mec": color, "mew": 0.7, "ms": size, "zorder": 5}
    for chosen, own, face, label in (
        ((y >= limits[0]) & (y <= limits[1]), marker, color, None),
        (y < limits[0], "v", "white", BEYOND),
        (y > limits[1], "^", "white", BEYOND),
    ):
        if chosen.any():
            clipped = np.clip(y[chosen], *limits)
            axes.plot(x[chosen], clipped, marker=own, mfc=face, label=label, **look)


def band(
    axes: Axes, x: Sequence[float], low: Sequence[float], high: Sequence[float], label: str
) -> None:
    """What lies between two curves, and dashes at their places where there is one place alone."""
    axes.fill_between(x, low, high, color=BAND, lw=0, label=label, zorder=1)
    if len(x) == 1:
        axes.vlines(x, low, high, color=BAND, lw=8, zorder=1)


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


def legend(
    figure: Figure, methods: Sequence[str] = (), columns: int = 5, title: str | None = None
) -> None:
    """Above the panels: methods, and all that is labelled in any panel, each once."""
    entries = method_handles({method: method_style(method).label for method in methods})
    named = {}
    for axes in figure.axes:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            named.setdefault(label, handle)
    if named.pop(BEYOND, None):
        look = {"ls": "", "marker": "v", "mfc": "white", "mec": "k", "mew": 0.7}
        named[BEYOND] = Line2D([], [], **look, label=BEYOND)
    figure.legend(
        [*entries, *named.values()], [*(entry.get_label() for entry in entries), *named],
        loc="outside upper center", ncols=columns, columnspacing=1.4, handlelength=2.4, title=title,
    )  # fmt: skip


def method_handles(names: Mapping[str, str]) -> list[Line2D]:
    """Legend entries of methods, as they are to be named."""
    return [
        Line2D([], [], **line_look(method), marker=method_style(method).marker, label=name)
        for method, name in names.items()
    ]
