"""How often each status of a verdict is right."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from galloping.figures import panels
from galloping.figures.style import DOUBLE, MODEL

JUDGED_STATUSES = ("ok", "not identifiable", "approximate", "refused")
WHOLE = {"facecolor": "white", "edgecolor": "#5f5f5f", "linewidth": 0.7, "hatch": "////"}


def draw_trust(table: pd.DataFrame, settings: Mapping) -> Figure:
    """A panel for each group of fits, a bar for each status: how often it is right.

    table: fits.csv. settings: none are read.
    """
    table = table.assign(right=_right(table))
    groups = list(dict.fromkeys(table["group"]))
    columns = min(2, len(groups))
    rows = -(-len(groups) // columns)
    figure = Figure(figsize=(DOUBLE, 0.5 + 1.5 * rows), layout="constrained")
    grid = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True).ravel()
    for k, (axes, group) in enumerate(zip(grid, groups, strict=False)):
        fits = table[table["group"] == group]
        panels.letter(axes, k, f"{group}, {len(fits):,} fits")
        _bars(axes, fits)
    for axes in grid[len(groups) :]:
        axes.set_axis_off()
    for axes in grid[max(0, len(groups) - columns) : len(groups)]:
        axes.set_xlabel("share of the fits, %")
        axes.tick_params(labelbottom=True)
    handles = [
        Patch(facecolor=MODEL, label="right"),
        Patch(label="ok and wrong, or a doubt without need", **WHOLE),
    ]
    figure.legend(handles=handles, loc="outside upper center", ncols=2)
    return figure


def _right(fits: pd.DataFrame) -> pd.Series:
    """Whether the status of each fit is right: a claim that holds, or a doubt that is due.

    It is due where the terms found are not exactly the true ones, or where the recording has a
    fault; no model of the library being right, and a refusal, are due to a fault alone.
    """
    status, faulty = fits["status"], fits["cause_named"].notna()
    unsure = (status == "not identifiable") & ~fits["exact"]
    return ((status == "ok") & ~fits["ok_and_wrong"]) | unsure | ((status != "ok") & faulty)


def _bars(axes: Axes, fits: pd.DataFrame) -> None:
    places = np.arange(len(JUDGED_STATUSES))
    of_status = [fits[fits["status"] == status] for status in JUDGED_STATUSES]
    counts = np.array([len(each) for each in of_status])
    right = np.array([each["right"].sum() for each in of_status])
    share = 100.0 / len(fits)
    axes.barh(places, share * counts, height=0.6, **WHOLE)
    axes.barh(places, share * right, height=0.6, color=MODEL)
    for place, count, good in zip(places, counts, right, strict=True):
        text = f"{good} of {count}" if count else "none"
        axes.text(share * count + 1.5, place, text, va="center", size="small")
    axes.set_yticks(places, JUDGED_STATUSES)
    axes.tick_params(axis="y", length=0)
    axes.set_ylim(len(JUDGED_STATUSES) - 0.4, -0.6)
    axes.set_xlim(0, 118)
    axes.set_xticks([0, 25, 50, 75, 100])
