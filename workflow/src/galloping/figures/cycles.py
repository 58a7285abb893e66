"""Limit cycles along a parameter: branches, bifurcations and the long simulations on them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from galloping.cycles.rows import SIMULATION
from galloping.figures import panels
from galloping.figures.style import BAND, DIRECTIONS, DOUBLE, MODEL, PAPER, STATE_LABELS
from galloping.physics.galerkin import frequencies, modes
from galloping.physics.line import Line

COLUMNS = {"v_m": "q_v", "w_m": "q_w"}
SMALL = 0.35  # velocity over wind speed, 20 degrees: the model's load is that of small angles
BEYOND = "beyond small angles"
MARKS = {
    "Hopf": "o",
    "fold of cycles": "D",
    "branch point": "P",
    "period doubling": "s",
    "Neimark-Sacker": "X",
}


def draw_limit_cycles(
    cycles: pd.DataFrame, bifurcations: pd.DataFrame, settings: Mapping
) -> Figure:
    """Amplitude against a parameter: a row for each case, a column for each direction.

    cycles, bifurcations: limit_cycles.csv and bifurcations.csv. settings: parameter and its label;
    cases, each with its line, to mark motions beyond small angles, or None; where the axis is to
    end before the largest, `highest` (m).
    """
    if cycles.empty:
        return panels.nothing_at_all("this study varies no single parameter")
    cases, height = panels.fitting(list(settings["cases"]), 0.9, 2.2)
    figure = Figure(figsize=(DOUBLE, height), layout="constrained")
    grids = panels.case_grids(figure, cases, 1, len(COLUMNS))
    for row, case in enumerate(cases):
        of_case = [
            table[(table["case"] == case) & (table["parameter"] == settings["parameter"])]
            for table in (cycles, bifurcations)
        ]
        for column, (axes, name) in enumerate(zip(grids[case][0], COLUMNS, strict=True)):
            state = COLUMNS[name]
            panels.letter(
                axes, row * len(COLUMNS) + column, f"{DIRECTIONS[state]}, {STATE_LABELS[state]}"
            )
            _panel(axes, *of_case, name)
            axes.set(xlabel=settings["label"], ylabel="half range, m")
            axes.set_xlim(0, 1.03 * cycles["value"].max())
            if "highest" in settings:
                axes.set_ylim(-0.02 * settings["highest"], settings["highest"])
        for column, axes in enumerate(grids[case][0]):
            if settings["cases"][case]:
                _beyond_small_angles(axes, settings["cases"][case], column)
    panels.legend(figure, columns=4)
    left = list(settings["cases"])[len(cases) :]
    panels.note_left_out(figure, left, "limit_cycles.csv")
    return figure


def _beyond_small_angles(axes: Axes, case: Mapping, direction: int) -> None:
    """Shades half ranges whose velocity, at the mode's own frequency, is not small to the wind."""
    line = Line.from_case(case)
    frequency = frequencies(line, *modes(case, line))[direction]  # rad/s
    low, high = axes.get_ylim()
    wind = np.array(axes.get_xlim())
    axes.fill_between(
        wind, np.minimum(SMALL * wind / frequency, high), high, color="#ececec", lw=0, zorder=0,
        label=BEYOND,
    )  # fmt: skip
    axes.set_ylim(low, high)


def _panel(axes: Axes, cycles: pd.DataFrame, bifurcations: pd.DataFrame, name: str) -> None:
    simulated = cycles[cycles["branch"] == SIMULATION]
    continued = cycles[cycles["branch"] != SIMULATION]
    for _, branch in continued.groupby("branch", sort=False):
        x, y = branch["value"].to_numpy(float), branch[name].to_numpy(float)
        stable = branch["stable"].astype(bool).to_numpy()
        looks = ((stable, "-", "stable"), (~stable, (0, (3, 1.5)), "unstable"))
        for kept, look, label in looks:
            reached = kept | np.append(False, kept[:-1])  # up to the first point beyond a change
            if kept.any():
                y_kept = np.where(reached, y, np.nan)
                axes.plot(x, y_kept, color=MODEL, ls=look, lw=1.2, zorder=2, label=label)
    irregular = simulated["kind"] == "irregular"
    low, high = (simulated[f"{name[0]}_{end}_m"] for end in ("low", "high"))
    if irregular.any():
        axes.vlines(
            simulated["value"][irregular], low[irregular], high[irregular], color=PAPER, lw=1.2,
            label="its range, not repeating",
        )  # fmt: skip
    axes.plot(
        simulated["value"], simulated[name], ls="", marker="o", ms=3, mfc="white", mec=PAPER,
        mew=0.8, zorder=3, label="long simulation",
    )  # fmt: skip
    for kind, marker in MARKS.items():
        at = bifurcations[bifurcations["name"] == kind]
        if len(at):
            axes.plot(
                at["value"], at[name], ls="", marker=marker, ms=5, mfc=BAND, mec="k", mew=0.7,
                zorder=4, label=kind,
            )  # fmt: skip
