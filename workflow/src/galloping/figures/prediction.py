"""Limit cycles at other wind speeds, predicted from one recording, beside the truth."""

from __future__ import annotations

from collections.abc import Mapping
from textwrap import fill, shorten

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from galloping.figures import panels
from galloping.figures.style import DIRECTIONS, DOUBLE, STATE_LABELS, TRUE, method_style

AXES = {"v": "q_v", "w": "q_w"}


def draw_prediction(table: pd.DataFrame, settings: Mapping) -> Figure:
    """Amplitude against wind for one replicate: truth, prediction and 95 % band; below each panel
    the same as deviation from the truth, of the first method.

    table: prediction.csv. settings: case, protocols, method, replicate, recorded (wind speed of
    the recording, m/s) and, where another method is to be compared, peer.
    """
    if table.empty:
        return panels.nothing_at_all("no model of this study states how sure it is")
    protocols = settings["protocols"]
    chosen = table[
        (table["case"] == settings["case"]) & (table["replicate"] == settings["replicate"])
    ]
    figure = Figure(figsize=(DOUBLE, 0.8 + 2.7 * len(protocols)), layout="constrained")
    grid = figure.subplots(
        2 * len(protocols), len(AXES), squeeze=False, sharex=True,
        height_ratios=[2, 1] * len(protocols),
    )  # fmt: skip
    methods = [settings["method"], *([settings["peer"]] if settings.get("peer") else [])]
    for row, protocol in enumerate(protocols):
        for column, direction in enumerate(AXES):
            axes, below = grid[2 * row : 2 * row + 2, column]
            state = AXES[direction]
            panels.letter(
                axes,
                row * len(AXES) + column,
                f"{DIRECTIONS[state]}, {STATE_LABELS[state]}, from {protocol}",
            )
            of_panel = chosen[(chosen["protocol"] == protocol) & (chosen["direction"] == direction)]
            _panel(axes, of_panel, methods)
            _deviation(below, of_panel[of_panel["method"] == settings["method"]])
            for pane in (axes, below):
                pane.axvline(
                    settings["recorded"], color="#9a9a9a", lw=0.8, ls=":", label="recorded"
                )
            if column == 0:
                axes.set_ylabel("half range, m")
                below.set_ylabel("deviation, %")
            if row == len(protocols) - 1:
                below.set_xlabel("wind speed, m/s")
    panels.legend(figure)
    return figure


def _panel(axes: Axes, table: pd.DataFrame, methods: list[str]) -> None:
    for k, method in enumerate(methods):
        line = table[table["method"] == method].sort_values("wind_m_s")
        if line.empty:
            continue
        wind, style = line["wind_m_s"], method_style(method)
        if line["predicted_m"].isna().any():
            reason = next(iter(line["reason"].dropna()), "no stable limit cycle")
            axes.text(0.97, 0.05, fill(shorten(f"{style.label}: {reason}", 80), 40), ha="right",
                      color=style.color, fontsize="small", transform=axes.transAxes)  # fmt: skip
        if k == 0:
            axes.plot(wind, line["true_m"], color=TRUE, lw=4, zorder=0.9, label="truth")
            panels.band(axes, wind, line["low_m"], line["high_m"], "95 % band")
            doubtful = sorted(set(line["verdict"]) - {"ok"})
            if doubtful:
                axes.text(0.03, 0.95, doubtful[0].partition(":")[0], va="top",
                          transform=axes.transAxes, color="#b30000")  # fmt: skip
        look = panels.line_look(method) | {"lw": 1.0}
        axes.plot(wind, line["predicted_m"], **look, marker=style.marker, label=style.label)


def _deviation(axes: Axes, table: pd.DataFrame) -> None:
    line = table.sort_values("wind_m_s")
    wind = line["wind_m_s"]
    low, value, high = (
        100 * (line[name] / line["true_m"] - 1) for name in ("low_m", "predicted_m", "high_m")
    )
    axes.axhline(0, color=TRUE, lw=2, zorder=0.9)
    panels.band(axes, wind, low, high, "95 % band")
    for method in line["method"].unique():
        look = panels.line_look(method) | {"lw": 1.0}
        axes.plot(wind, value, **look, marker=method_style(method).marker)
