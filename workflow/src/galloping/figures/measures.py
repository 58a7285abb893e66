"""Measures against galloping, ranked, with what the identification leaves open."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib import rcParams
from matplotlib.axes import Axes
from matplotlib.figure import Figure

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
    cases, height = panels.fitting(settings["cases"], 0.1, 0.7 + 0.2 * rows)
    figure = Figure(figsize=(DOUBLE, height), layout="constrained")
    blocks = figure.subfigures(len(cases), 1, squeeze=False)[:, 0]
    for row, (case, block) in enumerate(zip(cases, blocks, strict=True)):
        block.suptitle(spoken(case), x=0.01, ha="left", weight="bold", size=rcParams["font.size"])
        grid = block.subplots(1, len(QUANTITIES), sharey=True)
        of_case = table[table["case"] == case].sort_values("rank", ascending=False)
        for column, (axes, name) in enumerate(zip(grid, QUANTITIES, strict=True)):
            panels.letter(axes, row * len(QUANTITIES) + column, QUANTITIES[name])
            _panel(axes, of_case, name)
    panels.note_left_out(figure, settings["cases"][len(cases) :], "measures.csv")
    return figure


def _panel(axes: Axes, table: pd.DataFrame, name: str) -> None:
    places = np.arange(len(table))
    values, low, high = (table[f"{name}{end}"].to_numpy(float) for end in ("", "_low", "_high"))
    finite = np.isfinite(values)
    axes.hlines(places, 0, np.where(finite, values, 0), color="#c9c9dd", lw=4)
    axes.hlines(places, low, high, color=MODEL, lw=1.6)
    axes.plot(values[finite], places[finite], ls="", marker="o", color=MODEL)
    for place, value in zip(places[~finite], values[~finite], strict=True):
        text = "never" if np.isposinf(value) else "no bounded motion"
        axes.text(0.02, place, text, transform=axes.get_yaxis_transform(), va="center",
                  size="small", color=PAPER)  # fmt: skip
    if name == "clearance_m":
        axes.axvline(float(table["limit_m"].iloc[0]), color=PAPER, lw=0.9, ls=(0, (4, 2)))
    axes.set_xlim(left=0)
    axes.set_ylim(-0.6, len(table) - 0.4)
    labels = [
        f"{text} *" if isinstance(note, str) and note else text
        for text, note in zip(table["measure"], table["note"], strict=True)
    ]
    axes.set_yticks(places, labels)
