"""Figures 8 and 9: local time histories, true and reconstructed, with a band over replicates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from galloping.evaluation.motion import Reconstruction
from galloping.figures import panels
from galloping.figures.style import DOUBLE, MODEL, STATE_LABELS, TRUE, method_style, spoken
from galloping.measurement.measuring import Motion

HEADROOM = 1.5  # of the true motion: what goes beyond is cut


def draw_histories(
    trajectory: Sequence[Motion],
    reconstructions: Mapping[str, Mapping[str, Reconstruction]],
    settings: Mapping,
) -> Figure:
    """Two rows, q_v and q_w, for each cell, by one method, over the whole window.

    trajectory: the true motions, of which the first counts. reconstructions: by cell and method.
    settings: case, protocol, method; the labels of the cells; window in s.
    """
    true, cells = trajectory[0], settings["cells"]
    if true.status != "ok":
        return panels.nothing_at_all(f"nothing to show: the line itself {true.status}")
    if not cells:
        return panels.nothing_at_all("nothing to show: this study has no such recordings")
    figure = Figure(figsize=(DOUBLE, 0.8 + 1.9 * len(cells)), layout="constrained")
    grid = figure.subplots(2 * len(cells), 1, sharex=True)
    for k, (cell, label) in enumerate(cells.items()):
        motion = reconstructions[cell][settings["method"]]
        panels.letter(grid[2 * k], k, label)
        for j, state in enumerate(STATE_LABELS):
            _history(grid[2 * k + j], true, motion, j, settings["window"])
            grid[2 * k + j].set_ylabel(f"{STATE_LABELS[state]}, m")
    grid[-1].set_xlabel("time, s")
    figure.align_ylabels(grid)
    by = f"{method_style(settings['method']).label}, protocol {settings['protocol']}"
    panels.legend(figure, columns=3, title=f"{spoken(settings['case'])}, {by}")
    return figure


def _history(
    axes: Axes, true: Motion, motion: Reconstruction, column: int, window: Sequence[float]
) -> None:
    inside = (true.time >= window[0]) & (true.time <= window[1])
    states = true.states[inside, column]
    shown = (motion.time >= window[0]) & (motion.time <= window[1])
    time, middle = motion.time[shown], motion.representative[shown, column]
    low, high = motion.low[shown, column], motion.high[shown, column]
    panels.band(axes, time, low, high, "5th to 95th percentile of all draws")
    axes.plot(true.time[inside], states, color=TRUE, lw=1.8, label="true")
    label = "reconstructed, the draw with the median $R^2$"
    axes.plot(time, middle, color=MODEL, lw=0.8, ls="--", label=label)
    centre, half = (states.max() + states.min()) / 2, np.ptp(states) / 2
    axes.set(xlim=window, ylim=(centre - HEADROOM * half, centre + HEADROOM * half))
    note = ""
    if not np.any(np.isfinite(middle)):
        note = "the motion of the median draw ended before this window"
    elif not np.all(np.isfinite(low) & np.isfinite(high)):
        note = "no band where the motion of a draw has ended"
    if note:
        axes.text(
            0.995, 0.96, note, transform=axes.transAxes, ha="right", va="top", fontsize="small",
            bbox={"facecolor": "white", "edgecolor": "none", "pad": 1},
        )  # fmt: skip
