"""Limit cycles along a parameter: branches, bifurcations and the long simulations on them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from galloping.cycles.rows import SIMULATION
from galloping.figures import panels
from galloping.figures.style import DIRECTIONS, DOUBLE, MODEL, PAPER, STATE_LABELS

COLUMNS = {"v_m": "q_v", "w_m": "q_w"}
MARKS = {
    "Hopf": ("o", "Hopf"),
    "fold of cycles": ("D", "fold of cycles"),
    "branch point": ("P", "branch point"),
    "period doubling": ("s", "period doubling"),
    "Neimark-Sacker": ("X", "Neimark-Sacker"),
}


def draw_limit_cycles(
    cycles: pd.DataFrame, bifurcations: pd.DataFrame, settings: Mapping
) -> Figure:
    """Amplitude against a parameter: a row for each case, a column for each direction.

    cycles, bifurcations: limit_cycles.csv and bifurcations.csv. settings: cases, parameter, label
    and, where the axis is to end before the largest, `highest` (m).
    """
    if cycles.empty:
        return panels.nothing_at_all("this study varies no single parameter")
    cases, height = panels.fitting(settings["cases"], 0.7, 2.2)
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
    _legend(figure, bifurcations)
    panels.note_left_out(figure, settings["cases"][len(cases) :], "limit_cycles.csv")
    return figure


def _panel(axes: Axes, cycles: pd.DataFrame, bifurcations: pd.DataFrame, name: str) -> None:
    simulated = cycles[cycles["branch"] == SIMULATION]
    continued = cycles[cycles["branch"] != SIMULATION]
    for _, branch in continued.groupby("branch", sort=False):
        x, y = branch["value"].to_numpy(float), branch[name].to_numpy(float)
        stable = branch["stable"].astype(bool).to_numpy()
        for kept, look in ((stable, "-"), (~stable, (0, (3, 1.5)))):
            reached = kept | np.append(False, kept[:-1])  # up to the first point beyond a change
            axes.plot(x, np.where(reached, y, np.nan), color=MODEL, ls=look, lw=1.2, zorder=2)
    irregular = simulated["kind"] == "irregular"
    low, high = (simulated[f"{name[0]}_{end}_m"] for end in ("low", "high"))
    axes.vlines(simulated["value"][irregular], low[irregular], high[irregular], color=PAPER, lw=1.2)
    axes.plot(
        simulated["value"], simulated[name], ls="", marker="o", ms=3, mfc="white", mec=PAPER,
        mew=0.8, zorder=3,
    )  # fmt: skip
    for kind, (marker, _) in MARKS.items():
        at = bifurcations[bifurcations["name"] == kind]
        axes.plot(
            at["value"], at[name], ls="", marker=marker, ms=5, mfc="#f2c46d", mec="k", mew=0.7,
            zorder=4,
        )  # fmt: skip


def _legend(figure: Figure, bifurcations: pd.DataFrame) -> None:
    present = [kind for kind in MARKS if kind in set(bifurcations["name"])]
    handles = [
        Line2D([], [], color=MODEL, lw=1.2, label="stable"),
        Line2D([], [], color=MODEL, lw=1.2, ls=(0, (3, 1.5)), label="unstable"),
        Line2D([], [], ls="", marker="o", ms=3, mfc="white", mec=PAPER, label="long simulation"),
        Line2D([], [], ls="", marker="|", ms=8, mec=PAPER, label="its range, not repeating"),
        *(
            Line2D([], [], ls="", marker=MARKS[kind][0], ms=5, mfc="#f2c46d", mec="k",
                   label=MARKS[kind][1])
            for kind in present
        ),
    ]  # fmt: skip
    figure.legend(handles=handles, loc="outside upper center", ncols=4)
