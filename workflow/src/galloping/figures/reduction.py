"""What the two-mode model is worth against the continuous line."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from galloping.figures import panels
from galloping.figures.style import DOUBLE, MODEL, PAPER

TWO_MODES = "two modes"
QUANTITIES = {
    "amplitude_m": "amplitude\n200-300 s, m",
    "limit_cycle_m": "limit cycle, m",
    "r2": "$R^2$",
}
LOOKS = {"vertical": {"color": MODEL, "marker": "o"}, "horizontal": {"color": PAPER, "marker": "s"}}
OTHER = {"marker": "x", "label": "another motion"}  # not that of the two-mode model
R2_LOOKS = {"r2_0_100_s": "white", "r2_100_200_s": "#bbbbbb", "r2_200_300_s": ""}


def draw_reduction(table: pd.DataFrame, settings: Mapping) -> Figure:
    """Amplitude, limit cycle and R2 by line: a row for each quantity, a column for each direction.

    table: reduction.csv. The two-mode model is the dashed line; R2 is that of its displacement in
    three stretches of the record. settings: none are read.
    """
    lines = [name for name in table["line"].unique() if name != TWO_MODES]
    figure = Figure(figsize=(DOUBLE, 6.0), layout="constrained")
    grid = figure.subplots(len(QUANTITIES), 2, sharex=True)
    places = np.arange(len(lines))
    for column, (direction, look) in enumerate(LOOKS.items()):
        of_direction = table[table["direction"] == direction].set_index("line")
        for row, (quantity, label) in enumerate(QUANTITIES.items()):
            axes = grid[row, column]
            panels.letter(axes, 2 * row + column, direction)
            if quantity == "r2":
                panels.prepare_r2(axes, "")
                for key, face in R2_LOOKS.items():
                    height = panels.r2_place(of_direction.loc[lines, key].to_numpy())
                    axes.plot(
                        places, height, ls="", marker=look["marker"], mec=look["color"],
                        mfc=face or look["color"], clip_on=False,
                    )  # fmt: skip
                axes.set_xticks(places, lines, rotation=60, ha="right")
            else:
                values = of_direction.loc[lines, quantity].to_numpy()
                error = of_direction.loc[lines, f"{quantity.removesuffix('_m')}_error_percent"]
                apart = error.isna().to_numpy()
                axes.plot(places[~apart], values[~apart], ls="", **look, label=direction)
                axes.plot(places[apart], values[apart], ls="", **look | OTHER)
                two = of_direction.loc[TWO_MODES, quantity]
                axes.axhline(two, color="k", lw=0.8, ls="--", label="two-mode model")
                axes.set_ylim(0, None)
            if column == 0:
                axes.set_ylabel(label)
    for key, face in R2_LOOKS.items():
        grid[0, 0].plot([], [], "o", mec="k", mfc=face or "k", label=f"$R^2$, {_named(key)}")
    panels.legend(figure, columns=4)
    return figure


def _named(key: str) -> str:
    """0-100 s, of r2_0_100_s."""
    return key.removeprefix("r2_").removesuffix("_s").replace("_", "-") + " s"
