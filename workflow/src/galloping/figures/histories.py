"""Figures 8 and 9: local time histories, true and reconstructed, with a band over replicates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from galloping.evaluation.reconstruction import Reconstruction
from galloping.figures import panels
from galloping.figures.style import BAND, DOUBLE, MODEL, STATE_LABELS, TRUE, method_style, spoken
from galloping.measurement.motion import Motion

HEADROOM = 1.5  # of the true motion: what goes beyond is cut


def draw_histories(
    trajectory: Sequence[Motion],
    reconstructions: Mapping[str, Mapping[str, Reconstruction]],
    settings: Mapping,
) -> Figure:
    """Two rows, q_v and q_w, for each cell of the study; a column for each protocol and method.

    trajectory: the true motions, of which the first counts. reconstructions: by cell and method.
    settings: case; columns, each with protocol, method and the labels of its cells; window in s,
    of which as many columns as there are show only the last part.
    """
    true, columns, window = trajectory[0], settings["columns"], settings["window"]
    labels = list(columns[0]["cells"].values())
    figure = Figure(figsize=(DOUBLE, 0.8 + 0.95 * max(2, 2 * len(labels))), layout="constrained")
    if true.status != "ok":
        panels.nothing(figure.subplots(), f"nothing to show: the line itself {true.status}")
        return figure
    if not labels:
        panels.nothing(figure.subplots(), "nothing to show: this study has no such recordings")
        return figure
    window = (window[1] - (window[1] - window[0]) / len(columns), window[1])
    grid = figure.subplots(2 * len(labels), len(columns), sharex=True, sharey="row", squeeze=False)
    for column, shown in enumerate(columns):
        for k, (cell, label) in enumerate(shown["cells"].items()):
            motion = reconstructions[cell][shown["method"]]
            for j, state in enumerate(STATE_LABELS):
                _history(grid[2 * k + j, column], true, motion, j, window)
                grid[2 * k + j, 0].set_ylabel(f"{STATE_LABELS[state]}, m")
            text = f"{label}, {shown['protocol']}, {method_style(shown['method']).label}"
            panels.letter(grid[2 * k, column], k * len(columns) + column, text)
    for axes in grid[-1]:
        axes.set_xlabel("time, s")
    figure.align_ylabels(grid[:, 0])
    figure.legend(
        handles=[
            Line2D([], [], color=TRUE, lw=2.2, label="true"),
            Line2D([], [], color=MODEL, lw=0.8, ls="--", label="reconstructed (median replicate)"),
            Patch(facecolor=BAND, label="5th to 95th percentile of replicates"),
        ],
        loc="outside upper center",
        ncols=3,
        title=spoken(settings["case"]),
    )
    return figure


def _history(
    axes: Axes,
    true: Motion,
    motion: Reconstruction,
    column: int,
    window: Sequence[float],
) -> None:
    inside = (true.time >= window[0]) & (true.time <= window[1])
    states = true.states[inside, column]
    shown = (motion.time >= window[0]) & (motion.time <= window[1])
    time, middle = motion.time[shown], motion.representative[shown, column]
    low, high = motion.low[shown, column], motion.high[shown, column]
    axes.fill_between(time, low, high, color=BAND, lw=0)
    axes.plot(true.time[inside], states, color=TRUE, lw=1.8)
    axes.plot(time, middle, color=MODEL, lw=0.8, ls="--")
    centre, half = (states.max() + states.min()) / 2, np.ptp(states) / 2
    axes.set(xlim=window, ylim=(centre - HEADROOM * half, centre + HEADROOM * half))
    note = ""
    if not np.any(np.isfinite(middle)):
        note = "the motion of the median replicate ended before this window"
    elif not np.all(np.isfinite(low) & np.isfinite(high)):
        note = "no band where a replicate's motion has ended"
    axes.text(
        0.995, 0.96, note, transform=axes.transAxes, ha="right", va="top", fontsize="small",
        bbox={"facecolor": "white", "edgecolor": "none", "pad": 1} if note else None,
    )  # fmt: skip
