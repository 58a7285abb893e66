"""Which of the paper's claims hold at which values of the settings that it leaves open."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle

from galloping.figures import panels
from galloping.figures.style import DOUBLE, PAPER

COLORS = ("#ffffff", "#d9d9d9", "#11115a")  # not run, does not hold, holds


def draw_reproduction(table: pd.DataFrame, settings: Mapping) -> Figure:
    """A row for each claim, a column for each value, one block for each parameter.

    table: of `galloping.paper.variations.variation_rows`. settings: labels, of the parameters, by
    name in their order.
    """
    if table.empty:
        return panels.nothing_at_all("this study varies no parameter of the paper's line")
    names = [name for name in settings["labels"] if name in set(table["parameter"])]
    claims = list(dict.fromkeys(table["claim"]))[::-1]  # the first on top
    widths = [table[table["parameter"] == name]["value"].nunique() for name in names]
    figure = Figure(figsize=(DOUBLE, 1.3 + 0.17 * len(claims)), layout="constrained")
    panes = figure.subplots(1, len(names), sharey=True, squeeze=False, width_ratios=widths)[0]
    for axes, name in zip(panes, names, strict=True):
        block = table[table["parameter"] == name]
        values = list(dict.fromkeys(block["value"]))
        state = np.where(block["verdict"] == "not run", 0, np.where(block["held"], 2, 1))
        grid = block.assign(state=state).pivot(index="claim", columns="value", values="state")
        axes.pcolormesh(
            np.arange(len(values)), np.arange(len(claims)), grid.loc[claims, values].to_numpy(),
            cmap=ListedColormap(COLORS), vmin=-0.5, vmax=2.5, ec="white", lw=1.0,
            shading="nearest",
        )  # fmt: skip
        own = set(block.loc[block["default"], "value"])
        labels = [f"{value:g}" for value in values]
        axes.set_xticks(np.arange(len(values)), labels, rotation=90)
        axes.tick_params(length=0)
        axes.spines[:].set_visible(False)
        axes.set_title(settings["labels"][name], loc="left")
        for k in [k for k, value in enumerate(values) if value in own]:
            axes.add_patch(
                Rectangle((k - 0.5, -0.5), 1, len(claims), fill=False, ec=PAPER, lw=1.2, zorder=4)
            )
        met = block[block["held"]].groupby("value")["claim"].size()
        for k, value in enumerate(values):
            axes.text(k, len(claims) - 0.3, str(met.get(value, 0)), ha="center", va="bottom",
                      size="small")  # fmt: skip
        axes.set_ylim(-0.5, len(claims) + 0.5)
    panes[0].set_yticks(np.arange(len(claims)), claims)
    squares = {"holds": COLORS[2], "does not hold": COLORS[1]}
    figure.legend(
        handles=[Patch(fc=color, label=label) for label, color in squares.items()],
        loc="outside lower center", ncols=2,
        title="framed: the study's value; above: how many claims hold",
    )  # fmt: skip
    return figure
