"""What a recording gives of a line that is not its own model, and what it does not."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from galloping.figures import panels
from galloping.figures.style import DOUBLE, method_style
from galloping.study.kinds import OURS

QUANTITIES = {
    "frequency_v": "frequency, vertical",
    "amplitude_v": "amplitude, vertical",
    "amplitude_w": "amplitude, horizontal",
    "damping_v": "net damping, vertical",
    "damping_w": "net damping, horizontal",
}
LIMITS = (3e-3, 300.0)  # percent
DOUBTFUL = 30.0  # percent: beyond, a value is hardly known
HEIGHT = 0.62  # of a row, shared by the methods


def draw_model_error(table: pd.DataFrame, settings: Mapping) -> Figure:
    """A panel for each quantity, a row for each line and its sensors, a marker for each method.

    Errors in percent, median over the answered replicates, a line on to the worst of them; the last
    panel says how many were answered, with how many terms. table: model_error.csv. settings: none
    are read.
    """
    truths = sorted(table["truth"].unique(), key=lambda truth: (truth.startswith("two"), truth))
    methods = sorted(table["method"].unique(), key=lambda method: method != OURS)
    figure = Figure(figsize=(DOUBLE, 1.3 + 0.8 * len(truths)), layout="constrained")
    grid = figure.subplots(2, 3, sharey=True).ravel()
    for k, (quantity, label) in enumerate(QUANTITIES.items()):
        axes = grid[k]
        panels.letter(axes, k, label)
        axes.set_xscale("log")
        axes.set_xlim(*LIMITS)
        axes.axvspan(DOUBTFUL, LIMITS[1], color="#ececec", lw=0, zorder=0)
        axes.set_xlabel("error, %")
        for method, place, row in _rows(table, truths, methods):
            _marks(axes, method, place, row, quantity)
    panels.letter(grid[-1], len(QUANTITIES), "answered; terms")
    grid[-1].set_xlim(0, len(methods))
    grid[-1].set_xticks([])
    for method, place, row in _rows(table, truths, methods):
        terms = f"; {row['terms']:.0f}" if row["answered"] else ""
        text = f"{row['answered']} of {row['replicates']}{terms}"
        grid[-1].text(
            0.1, place, text, va="center", size="x-small", color=method_style(method).color
        )
    names = [truth.replace(", ", ",\n") for truth in truths]
    for axes in grid[::3]:
        axes.set_yticks(range(len(truths)), names)
    grid[0].set_ylim(len(truths) - 0.5, -0.5)
    for axes in grid:
        axes.tick_params(axis="y", length=0)
        for k in range(1, len(truths)):
            axes.axhline(k - 0.5, color="#d5d5d5", lw=0.6, zorder=0.5)
    panels.legend(figure, methods, columns=len(methods) + 1)
    return figure


def _rows(table: pd.DataFrame, truths: list[str], methods: list[str]):
    """Method, place and row of the table."""
    step = HEIGHT / max(len(methods) - 1, 1)
    for _, row in table.iterrows():
        place = truths.index(row["truth"]) - HEIGHT / 2 + step * methods.index(row["method"])
        yield row["method"], place, row


def _marks(axes: Axes, method: str, place: float, row: pd.Series, quantity: str) -> None:
    style, look = method_style(method), panels.line_look(method)
    median, worst = row[f"{quantity}_error_percent"], row[f"{quantity}_worst_percent"]
    if np.isnan(median):
        return
    inside = np.clip([median, worst], *LIMITS)
    axes.plot(inside, [place, place], color=style.color, lw=0.8)
    beyond = median > LIMITS[1]
    axes.plot(
        inside[:1], [place], ls="", marker=">" if beyond else style.marker, mec=style.color,
        mfc="white" if beyond else style.color, ms=look["markersize"], clip_on=False,
        label=panels.BEYOND if beyond else None,
    )  # fmt: skip
