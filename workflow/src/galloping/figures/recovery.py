"""Figure 4: motion of the line without noise, true and reconstructed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure

from galloping.evaluation.motion import Reconstruction
from galloping.figures import panels
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
from galloping.measurement.measuring import Motion

LAST = 30.0  # s at the end of the record, where single periods can be seen


def draw_recovery(
    trajectories: Mapping[str, Sequence[Motion]],
    reconstructions: Mapping[str, Mapping[str, Reconstruction]],
    settings: Mapping,
) -> Figure:
    """Whole record, its last seconds, and their phase portrait; two rows for each case.

    trajectories: motions by case, of which the first counts. reconstructions: by case and method,
    of the cell at the lowest level. settings: cases, protocol, method and level.
    """
    cases, height = panels.fitting(settings["cases"], 0.6, 2.9)
    figure = Figure(figsize=(DOUBLE, height), layout="constrained")
    grid = figure.subplots(2 * len(cases), 3, squeeze=False, width_ratios=(2, 2, 1.25))
    by = (
        f"reconstructed by {method_style(settings['method']).label} "
        f"(protocol {settings['protocol']}, noise level {settings['level']:g})"
    )
    for k, case in enumerate(cases):
        true, motion = trajectories[case][0], reconstructions[case][settings["method"]]
        for j, state in enumerate(STATE_LABELS):
            row = grid[2 * k + j]
            _row(row, true, motion, j, by)
            titles = (
                f"{spoken(case)}, {DIRECTIONS[state]}:\n{_distance(true, motion, j)}",
                f"the last {LAST:g} s",
                "their phase portrait",
            )
            for column, (axes, title) in enumerate(zip(row, titles, strict=True)):
                panels.letter(axes, 3 * (2 * k + j) + column, title)
            row[0].set_ylabel(f"{STATE_LABELS[state]}, m")
            row[2].set(xlabel=f"{STATE_LABELS[state]}, m", ylabel=rf"$\dot{{q}}_{state[-1]}$, m/s")
            for axes in row[:2]:
                axes.set_xlabel("time, s" if j else "")
    panels.legend(figure, columns=2)
    left = settings["cases"][len(cases) :]
    panels.note_left_out(figure, left, "scores.csv, and trajectories/ in the results")
    return figure


def _row(row, true: Motion, motion: Reconstruction, column: int, by: str) -> None:
    end = true.time[-1]
    last = (max(true.time[0], end - LAST), end)
    spans = ((true.time[0], end), last, last)
    for axes, span in zip(row, spans, strict=True):
        whole = axes is row[0]
        for time, states, look in (
            (true.time, true.states,
             {"color": TRUE, "lw": 1.2 if whole else 2.0, "label": None if whole else "true"}),
            (motion.time, motion.representative,
             {"color": MODEL, "lw": 0.4 if whole else 0.8, "ls": "-" if whole else "--",
              "label": None if whole else by}),
        ):  # fmt: skip
            inside = (time >= span[0]) & (time <= span[1])
            x = states[inside, column] if axes is row[2] else time[inside]
            y = states[inside, column + 2] if axes is row[2] else states[inside, column]
            axes.plot(x, y, **look)
        if axes is not row[2]:
            axes.set_xlim(*span)


def _distance(true: Motion, motion: Reconstruction, column: int) -> str:
    """How far apart the two motions are at most, at the times of the thinned one."""
    expected = np.interp(motion.time, true.time, true.states[:, column])
    largest = np.max(np.abs(motion.representative[:, column] - expected))
    if not np.isfinite(largest):
        return "motion ended early"
    return f"at most {scientific(largest)} m apart"
