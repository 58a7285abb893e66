"""The limit cycle that identified models lead to, beside the true one and what was recorded."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from galloping.figures import panels
from galloping.figures.style import DIRECTIONS, DOUBLE, PAPER, STATE_LABELS, TRUE, protocol_style

SHIFT = 0.03  # decades between protocols


def draw_limit_cycle_ahead(table: pd.DataFrame, settings: Mapping) -> Figure:
    """Predicted limit cycle with its interval against noise, a panel for each displacement.

    table: limit_cycle_ahead.csv. settings: window, s, of the paper's steady state.
    """
    if table.empty:
        return panels.nothing_at_all("no model of this study states how sure it is")
    states = table["state"].unique()
    protocols = table["protocol"].unique()
    axis = panels.LogAxis.of(table["level"])
    figure = Figure(figsize=(DOUBLE, 2.9), layout="constrained")
    for k, (state, axes) in enumerate(zip(states, figure.subplots(1, len(states)), strict=True)):
        of_state = table[table["state"] == state]
        panels.letter(axes, k, f"{DIRECTIONS[state]}, {STATE_LABELS[state]}")
        axis.prepare(axes, "noise level")
        axes.axhline(of_state["true_m"].iloc[0], color=TRUE, lw=4, zorder=1)
        axes.axhline(of_state["recorded_m"].iloc[0], color=PAPER, lw=1.0, ls="--", zorder=1)
        for j, protocol in enumerate(protocols):
            rows = of_state[of_state["protocol"] == protocol].sort_values("level")
            shift = SHIFT * (j - (len(protocols) - 1) / 2)
            places = np.array([axis.position(level, shift) for level in rows["level"]])
            look = protocol_style(protocol)
            axes.vlines(places, rows["low_m"], rows["high_m"], color=look["color"], lw=1.2)
            axes.plot(places, rows["predicted_m"], ls="", **look)
        if k == 0:
            axes.set_ylabel("half range, m")
    begin, end = settings["window"]
    figure.legend(
        handles=[
            Line2D([], [], color=TRUE, lw=4, label="true limit cycle"),
            Line2D([], [], color=PAPER, lw=1.0, ls="--", label=f"recorded, {begin:g}-{end:g} s"),
            *(Line2D([], [], **protocol_style(p), label=f"predicted from {p}") for p in protocols),
        ],
        loc="outside upper center",
        ncols=5,
        columnspacing=1.2,
        handlelength=1.8,
    )
    return figure
