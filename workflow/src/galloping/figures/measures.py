"""Measures against galloping, ranked, with what the identification leaves open."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib import rcParams
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke

from galloping.figures import panels
from galloping.figures.style import DOUBLE, MODEL, PAPER, spoken

QUANTITIES = {
    "v_m": "vertical half range, m",
    "critical_wind_m_s": "critical wind, m/s",
    "clearance_m": "least clearance, m",
}


def draw_measures(table: pd.DataFrame, settings: Mapping) -> Figure:
    """Vertical motion at the design wind, critical wind and clearance of each measure.

    table: measures.csv. settings: cases.
    """
    rows = max(len(table[table["case"] == case]) for case in settings["cases"])
    cases, height = panels.fitting(settings["cases"], 0.4, 0.7 + 0.26 * rows)
    figure = Figure(figsize=(DOUBLE, height), layout="constrained")
    blocks = figure.subfigures(len(cases), 1, squeeze=False)[:, 0]
    for row, (case, block) in enumerate(zip(cases, blocks, strict=True)):
        block.suptitle(spoken(case), x=0.01, ha="left", weight="bold", size=rcParams["font.size"])
        grid = block.subplots(1, len(QUANTITIES), sharey=True)
        of_case = table[table["case"] == case].sort_values("rank", ascending=False)
        for column, (axes, name) in enumerate(zip(grid, QUANTITIES, strict=True)):
            panels.letter(axes, row * len(QUANTITIES) + column, QUANTITIES[name])
            _panel(axes, of_case, name)
    panels.legend(figure)
    panels.note_left_out(figure, settings["cases"][len(cases) :], "measures.csv")
    return figure


def _panel(axes: Axes, table: pd.DataFrame, name: str) -> None:
    """Dots, with the number and its interval written beside each, too narrow to be seen."""
    places = np.arange(len(table))
    values, low, high = (table[f"{name}{end}"].to_numpy(float) for end in ("", "_low", "_high"))
    finite = np.isfinite(values)
    reach = np.append(np.concatenate([values, low, high])[np.tile(finite, 3)], 0.0)
    axes.hlines(places, low, high, color=MODEL, lw=1.6)
    axes.plot(values[finite], places[finite], ls="", marker="o", color=MODEL)
    for place, value, *ends in zip(places, values, low, high, strict=True):
        axes.text(
            0.03, place + 0.17, _told(value, *ends), transform=axes.get_yaxis_transform(),
            size="x-small", color=MODEL if np.isfinite(value) else PAPER, zorder=4,
            path_effects=[withStroke(linewidth=2.0, foreground="white")],  # upon the limit
        )  # fmt: skip
    if name == "clearance_m":
        limit = float(table["limit_m"].iloc[0])
        axes.axvline(limit, color=PAPER, lw=0.9, ls=(0, (4, 2)), label="clearance to keep")
    axes.set_xlim(-0.04 * np.nanmax(reach), 1.08 * max(np.nanmax(reach), 1e-3))
    axes.set_ylim(-0.6, len(table) - 0.3)
    for place in places[1:] - 0.5:
        axes.axhline(place, color="#e4e4e4", lw=0.6, zorder=0)
    labels = [
        f"{text} *" if isinstance(note, str) and note else text
        for text, note in zip(table["measure"], table["note"], strict=True)
    ]
    axes.set_yticks(places, labels)


def _told(value: float, low: float, high: float) -> str:
    """The number and both ends of its interval, to the first digit of their difference."""
    if not np.isfinite(value):
        return "never" if np.isposinf(value) else "no bounded motion"
    if not low < high < np.inf:
        return f"{value:.3g}"
    decimals = max(0, -int(np.floor(np.log10(high - low))))
    return f"{value:.{decimals}f}  ({low:.{decimals}f} to {high:.{decimals}f})"
