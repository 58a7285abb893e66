"""Fits in the settings of published comparisons, beside what others published of them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from galloping.figures import panels
from galloping.figures.style import DOUBLE, SERIES, method_style, spoken
from galloping.study.kinds import OURS
from galloping.trials.published_numbers import METHODS
from galloping.trials.registry import GAMMAS

COLUMNS = 4
LOOKS = {
    "odr_bindy": ("#000000", "--", "s"),
    "jsindy": ("#1f78b4", ":", "D"),
    "ensemble_weak_sindy": ("#e69f00", "-.", "P"),
}
NOMINAL = "#8a8a8a"


def draw_published_terms(table: pd.DataFrame, settings: Mapping) -> Figure:
    """A panel for each system and length: share of exactly the right terms against the noise.

    table: published_terms.csv, of which the rows of our method are drawn. settings: none are read.
    """
    table = table[table["method"] == OURS]
    cells = list(table.groupby(["system", "duration"], sort=True))
    rows = -(-len(cells) // COLUMNS)
    columns = min(COLUMNS, len(cells))
    figure = Figure(figsize=(DOUBLE, 0.7 + 1.6 * rows), layout="constrained")
    grid = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True).ravel()
    style = method_style(OURS)
    for k, (axes, ((system, duration), group)) in enumerate(zip(grid, cells, strict=False)):
        panels.letter(axes, k, f"{spoken(system)}, {duration:g} s")
        noise = 100.0 * group["level"]
        for name, (color, line, marker) in LOOKS.items():
            if group[name].notna().any():
                axes.plot(noise, 100.0 * group[name], color=color, ls=line, marker=marker, ms=2.5)
        low, high = 100.0 * group["exact_low"], 100.0 * group["exact_high"]
        axes.fill_between(noise, low, high, color=style.color, alpha=0.2, lw=0)
        axes.plot(noise, 100.0 * group["exact"], color=style.color, marker=style.marker, ms=4)
        axes.set_ylim(-3, 103)
    for axes in grid[len(cells) :]:
        axes.set_axis_off()
    for axes in grid[max(0, len(cells) - columns) : len(cells)]:
        axes.set_xlabel("noise, %")
        axes.tick_params(labelbottom=True)
    for axes in grid[::columns]:
        axes.set_ylabel("exact terms, %")
    handles = [Line2D([], [], color=style.color, marker=style.marker, ms=4, label=style.label)]
    handles += [
        Line2D([], [], color=color, ls=line, marker=marker, ms=2.5, label=METHODS[name])
        for name, (color, line, marker) in LOOKS.items()
    ]
    figure.legend(handles=handles, loc="outside upper center", ncols=len(handles))
    return figure


def draw_published_intervals(table: pd.DataFrame, settings: Mapping) -> Figure:
    """How often the quadratic term is found, and how often its interval holds, by its size.

    table: published_intervals.csv, of which the rows of our method are drawn. settings: none are
    read.
    """
    table = table[table["method"] == OURS]
    table = table.assign(gamma=table["case"].map(GAMMAS)).sort_values("gamma")
    figure = Figure(figsize=(DOUBLE, 2.6), layout="constrained")
    left, right = figure.subplots(1, 2, sharex=True)
    panels.letter(left, 0, "term found")
    panels.letter(right, 1, "95 % interval holds the coefficient")
    for k, (samples, group) in enumerate(table.groupby("samples", sort=True)):
        color, marker = SERIES[k % len(SERIES)]
        gamma = group["gamma"] + 0.0012 * (k - 1.5)  # side by side
        found = 100.0 * group["found"]
        spread = [found - 100.0 * group["found_low"], 100.0 * group["found_high"] - found]
        look = {"color": color, "marker": marker, "label": f"{samples:,} samples"}
        left.errorbar(gamma, found, np.maximum(spread, 0.0), lw=0.8, **look)
        right.plot(gamma, 100.0 * group["holds"], lw=0.8, **look)
        there = group["found_published"].notna()
        left.plot(
            gamma[there], 100.0 * group["found_published"][there], ls="", marker="o", ms=9,
            mfc="none", mec=color, zorder=3,
        )  # fmt: skip
    left.axhline(5.0, color=NOMINAL, lw=0.8, ls=":")
    right.axhline(95.0, color=NOMINAL, lw=0.8, ls=":")
    for axes in (left, right):
        axes.set_xlabel("quadratic coefficient")
        axes.set_ylabel("share of the fits, %")
    left.set_ylim(-3, 103)
    right.set_ylim(min(78.0, 100.0 * table["holds"].min() - 2.0), 101)
    handles, labels = left.get_legend_handles_labels()
    handles += [
        Line2D([], [], ls="", marker="o", ms=9, mfc="none", mec="black"),
        Line2D([], [], color=NOMINAL, lw=0.8, ls=":"),
    ]
    labels += ["published power", "nominal"]
    figure.legend(handles, labels, loc="outside upper center", ncols=len(handles))
    return figure
