"""Figures 4, 8 and 9: true and reconstructed motion, whole, over a window, and as an orbit."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from galloping.evaluation.motion import Reconstruction
from galloping.figures import parts
from galloping.figures.style import (
    DIRECTIONS,
    DOUBLE,
    MODEL,
    STATE_LABELS,
    TRUE,
    method_style,
    scientific,
    spoken,
)
from galloping.measurement import Motion

LAST = 30.0  # s at the end of the record, where single periods can be seen
HEADROOM = 1.5  # of the true motion: what goes beyond is cut


def draw_recovery(
    trajectories: Mapping[str, Sequence[Motion]],
    reconstructions: Mapping[str, Mapping[str, Reconstruction]],
    settings: Mapping,
) -> Figure:
    """Whole record, its last seconds, and their phase portrait; two rows for each case.

    trajectories: motions by case, of which the first counts. reconstructions: by case and method,
    of the cell at the lowest level. settings: cases, protocol, method and level.
    """
    cases, height = parts.fitting(settings["cases"], 0.6, 2.9)
    figure = Figure(figsize=(DOUBLE, height), layout="constrained")
    grid = figure.subplots(2 * len(cases), 3, squeeze=False, width_ratios=(2, 2, 1.25))
    by = (
        f"reconstructed by {method_style(settings['method']).label} "
        f"(protocol {settings['protocol']}, noise level {settings['level']:g})"
    )
    for k, row in enumerate(grid):
        case, (j, state) = cases[k // 2], (k % 2, list(STATE_LABELS)[k % 2])
        true, motion = trajectories[case][0], reconstructions[case][settings["method"]]
        name, last = STATE_LABELS[state], (max(true.time[0], true.time[-1] - LAST), true.time[-1])
        titles = (
            f"{spoken(case)}, {DIRECTIONS[state]}:\n{_distance(true, motion, j)}",
            f"the last {LAST:g} s",
            "their phase portrait",
        )
        for column, (axes, title) in enumerate(zip(row, titles, strict=True)):
            parts.letter(axes, 3 * k + column, title)
        for axes, span, thin in zip(row, ((true.time[0], last[1]), last, last), (0.5, 1, 1),
                                    strict=True):  # fmt: skip
            for time, states, look in (
                (true.time, true.states, {"color": TRUE, "lw": 2.0 if thin == 1 else 1.2}),
                (motion.time, motion.representative,
                 {"color": MODEL, "lw": 0.8 * thin, "ls": "--" if thin == 1 else "-"}),
            ):  # fmt: skip
                inside = (time >= span[0]) & (time <= span[1])
                x, y = time[inside], states[inside, j]
                if axes is row[2]:
                    x, y = y, states[inside, j + 2]
                axes.plot(x, y, **look)
            if axes is not row[2]:
                axes.set(xlim=span, xlabel="time, s" if j else "")
        row[0].set_ylabel(f"{name}, m")
        row[2].set(xlabel=f"{name}, m", ylabel=rf"$\dot{{q}}_{state[-1]}$, m/s")
    true = parts.key("true", color=TRUE, lw=2.0, ls="-")
    keys = true, parts.key(by, color=MODEL, lw=0.8, ls="--")
    parts.legend(figure, *keys, columns=2)
    left = settings["cases"][len(cases) :]
    parts.note_left_out(figure, left, "scores.csv, and trajectories/ in the results")
    return figure


def _distance(true: Motion, motion: Reconstruction, column: int) -> str:
    """How far apart the two motions are at most, at the times of the thinned one."""
    expected = np.interp(motion.time, true.time, true.states[:, column])
    largest = np.max(np.abs(motion.representative[:, column] - expected))
    if not np.isfinite(largest):
        return "motion ended early"
    return f"at most {scientific(largest)} m apart"


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
        return parts.nothing_at_all(f"nothing to show: the line itself {true.status}")
    if not cells:
        return parts.nothing_at_all("nothing to show: this study has no such recordings")
    figure = Figure(figsize=(DOUBLE, 0.8 + 1.9 * len(cells)), layout="constrained")
    grid = figure.subplots(2 * len(cells), 1, sharex=True)
    for k, (cell, label) in enumerate(cells.items()):
        motion = reconstructions[cell][settings["method"]]
        parts.letter(grid[2 * k], k, label)
        for j, state in enumerate(STATE_LABELS):
            _history(grid[2 * k + j], true, motion, j, settings["window"])
            grid[2 * k + j].set_ylabel(f"{STATE_LABELS[state]}, m")
    grid[-1].set_xlabel("time, s")
    figure.align_ylabels(grid)
    parts.legend(figure, columns=3, title=parts.origin(settings))
    return figure


def _history(
    axes: Axes, true: Motion, motion: Reconstruction, column: int, window: Sequence[float]
) -> None:
    inside = (true.time >= window[0]) & (true.time <= window[1])
    states = true.states[inside, column]
    shown = (motion.time >= window[0]) & (motion.time <= window[1])
    time, middle = motion.time[shown], motion.representative[shown, column]
    low, high = motion.low[shown, column], motion.high[shown, column]
    parts.band(axes, time, low, high, "5th to 95th percentile of all draws")
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
