"""The paper's printed errors and bounds of R2 beside many draws of its own method."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from galloping.figures import panels
from galloping.figures.style import DOUBLE, PAPER, STATE_LABELS, method_style
from galloping.paper.printed import CLAIMS
from galloping.study.kinds import PAPER_METHOD

ERRORS = (1e-2, 1e3)  # percent, the axis
COLOUR = method_style(PAPER_METHOD).color


def draw_printed(table: pd.DataFrame, settings: Mapping) -> Figure:
    """Left the printed errors on the draws' 5 to 95 %, right the share of draws that keep a bound.

    table: paper.csv. settings: case, the paper's, that the numbers are about.
    """
    about = {claim.name: claim for claim in CLAIMS}
    rows = table[(table["case"] == settings["case"]) & table["median"].notna()]
    rows = rows[rows["claim"].isin(about)].assign(about=rows["claim"].map(about))
    numbers = rows[[claim.is_number for claim in rows["about"]]]
    bounds = rows[[claim.column.startswith("r2_") and not claim.minus for claim in rows["about"]]]
    if numbers.empty and bounds.empty:
        return panels.nothing_at_all("the paper's claims are not judged in this study")
    figure = Figure(
        figsize=(DOUBLE, 0.9 + 0.22 * max(len(numbers), len(bounds))), layout="constrained"
    )
    left, right = figure.subplots(1, 2, width_ratios=(1.1, 1))
    _errors(left, numbers)
    _bounds(right, bounds)
    star = Line2D([], [], ls="", marker="*", color=PAPER, ms=8, mew=0, label="printed in the paper")
    ours = "draws of the paper's method: median, 5 to 95 %"
    dot = Line2D([], [], color=COLOUR, marker="o", ms=4, label=ours)
    figure.legend(handles=[star, dot], loc="outside upper center", ncols=2)
    return figure


def _errors(axes: Axes, rows: pd.DataFrame) -> None:
    axes.set_xscale("log")
    axes.set(xlim=ERRORS, xlabel="error, %")
    axes.set_xticks([0.01, 0.1, 1, 10, 100, 1000], ["0.01", "0.1", "1", "10", "100", "1000"])
    for k, row in enumerate(rows.to_dict("records")):
        low, median, high = np.clip([row["low"], row["median"], row["high"]], *ERRORS)
        axes.hlines(k, low, high, color=COLOUR, lw=3.0, alpha=0.45)
        axes.plot(median, k, "o", color=COLOUR, ms=4)
        if row["high"] > ERRORS[1]:
            axes.plot(ERRORS[1], k, ">", color=COLOUR, ms=4, clip_on=False)
        axes.plot(row["printed"], k, "*", color=PAPER, ms=8, mew=0, zorder=5)
    _name(axes, rows)
    panels.letter(axes, 0, "errors that the paper prints")


def _bounds(axes: Axes, rows: pd.DataFrame) -> None:
    shares = 100 * rows["share_of_draws"].to_numpy(float)
    axes.barh(np.arange(len(rows)), shares, height=0.55, color=COLOUR, alpha=0.45)
    for k, share in enumerate(shares):
        axes.text(share + 1.5, k, f"{share:.0f} %", va="center", fontsize="small")
    axes.axvline(50, color="#8a8a8a", lw=0.6, ls=":")
    axes.set(xlim=(0, 112), xlabel="share of the draws, %")
    axes.set_xticks([0, 25, 50, 75, 100])
    _name(axes, rows, bound=True)
    panels.letter(axes, 1, "draws above bounds of $R^2$")


def _name(axes: Axes, rows: pd.DataFrame, bound: bool = False) -> None:
    names = []
    for row in rows.to_dict("records"):
        text = row["claim"].replace("mean error of ", "").replace("amplitude error", "amplitude")
        text = text.replace(" (first abstract)", ", abstract")
        if bound:
            text = text.replace("R2", f"$R^2 \\geq$ {row['printed']:g}", 1)
        for plain, symbol in STATE_LABELS.items():
            text = text.replace(plain, symbol)
        names.append(text)
    axes.set_yticks(np.arange(len(names)), names)
    axes.set_ylim(len(names) - 0.4, -0.6)
    axes.tick_params(axis="y", length=0)
