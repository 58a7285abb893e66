"""What a line settles to over two of its parameters, and where its frequencies are two to one."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from galloping.figures import panels
from galloping.figures.style import DIRECTIONS, DOUBLE, PAPER, STATE_LABELS

HIGHEST = 6.0  # m: larger motions, a sag or more, are drawn alike
QUANTITIES = {"v_m": "q_v", "w_m": "q_w"}


def draw_resonance_map(table: pd.DataFrame, settings: Mapping) -> Figure:
    """Half range of both directions over the map of one case.

    table: rows of `map_rows`. settings: case, x_label, y_label, y_scale (units of the axis in one
    of the table, such as 1000 for kN).
    """
    if table.empty:
        return panels.nothing_at_all("this study varies no two parameters")
    table = table[table["case"] == settings["case"]]
    scale = settings["y_scale"]
    figure = Figure(figsize=(DOUBLE, 3.1), layout="constrained")
    for k, (axes, name) in enumerate(zip(figure.subplots(1, 2), QUANTITIES, strict=True)):
        state = QUANTITIES[name]
        panels.letter(axes, k, f"{DIRECTIONS[state]}, {STATE_LABELS[state]}")
        grid = table.pivot(index="y", columns="x", values=name)
        x, y = grid.columns.to_numpy(float), grid.index.to_numpy(float) / scale
        shown = axes.pcolormesh(
            x, y, grid.to_numpy(), cmap="cividis", vmin=0, vmax=HIGHEST, shading="nearest",
            rasterized=True,
        )  # fmt: skip
        figure.colorbar(shown, ax=axes, label="half range, m", pad=0.02, extend="max")
        ratio = table.pivot(index="y", columns="x", values="frequency_ratio").to_numpy()
        lines = axes.contour(x, y, ratio, levels=[2.0], colors="white", linewidths=1.4)
        axes.clabel(lines, fmt=r"$\omega_v = 2\,\omega_w$")
        for marker, chosen, text in (
            ("x", table["kind"] == "irregular", "does not repeat, or settles very slowly"),
            ("v", ~np.isfinite(table[name]), "no bounded motion"),
        ):
            at = table[chosen]
            axes.plot(
                at["x"], at["y"] / scale, ls="", marker=marker, ms=4, mfc="white", mec=PAPER,
                label=text if len(at) else None,
            )  # fmt: skip
        axes.set(xlabel=settings["x_label"], ylabel=settings["y_label"])
    handles, labels = axes.get_legend_handles_labels()
    if handles:
        figure.legend(handles, labels, loc="outside lower center", ncols=2)
    return figure
