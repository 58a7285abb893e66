"""How far each method stays from the Cramér-Rao bound, against noise."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from galloping.figures import panels
from galloping.figures.style import method_style
from galloping.study.kinds import BOUND

LOWEST, HIGHEST = 0.5, 1e4  # of rms error / bound
SPREAD = 0.09  # decades, within which methods are moved apart
STEP = 1.75  # factor along the axis, from the last level to joint recordings


def draw_efficiency(table: pd.DataFrame, settings: Mapping) -> Figure:
    """Root mean square of error / bound: a block for each case, a column for each protocol.

    Recordings that share a model stand at the right of those taken alone.
    table: efficiency.csv. settings: cases, protocols, methods in the study's order;
    labels of the noise by protocol.
    """
    whole = table[table["points"] == table["points"].max()]
    figure, grid = panels.method_grid(settings, 1, 2.2, "efficiency.csv")
    for (case, _, protocol), axes in grid.items():
        of_case = whole[whole["case"] == case]
        chosen = of_case[of_case["protocol"] == protocol]
        if chosen.empty:
            panels.nothing(axes, "no noisy recordings in this study")
            continue
        limits = LOWEST, _top(of_case["efficiency"])
        places = _places(axes, of_case, settings["labels"][protocol])
        _panel(axes, chosen, places, settings["methods"], limits)
        axes.set_ylabel("rms error / bound" if protocol == settings["protocols"][0] else "")
    panels.legend(figure, panels.in_order(table, "method", settings["methods"]), columns=4)
    return figure


def _top(values: pd.Series) -> float:
    """The decade above all finite values, as far as the axis may reach."""
    finite = values[np.isfinite(values)]
    return min(HIGHEST, max(10.0, 10 ** np.ceil(np.log10(finite.max())))) if len(finite) else 10.0


def _places(axes: Axes, table: pd.DataFrame, label: str) -> dict[tuple[int, float], float]:
    """Where (recordings, level) stand on an axis, which is given their ticks."""
    cells = sorted(set(zip(table["recordings"], table["level"], strict=True)))
    joint = [cell for cell in cells if cell[0] > 1]
    if joint == cells:
        together = panels.LogAxis.of([level for _, level in cells])
        together.prepare(axes, f"{label}, {cells[0][0]} recordings")
        return {cell: together.position(cell[1]) for cell in cells}
    single = panels.LogAxis.of([level for recordings, level in cells if recordings == 1])
    single.prepare(axes, label)
    last = single.position(single.values[-1])
    places = {(1, level): single.position(level) for level in single.values}
    places |= {cell: last * STEP ** (k + 1) for k, cell in enumerate(joint)}
    if joint:
        labels = [label.get_text() for label in axes.get_xticklabels()]
        labels += [f"{level:g}\n{recordings} rec." for recordings, level in joint]
        axes.set_xticks(list(places.values()), labels)
        axes.set_xlim(right=max(places.values()) * 1.5)
        axes.axvline(last * np.sqrt(STEP), color="#bbbbbb", lw=0.6, ls=":")
    return places


def _panel(
    axes: Axes,
    table: pd.DataFrame,
    places: Mapping[tuple[int, float], float],
    order: list[str],
    limits: tuple[float, float],
) -> None:
    axes.set_yscale("log")
    axes.set_ylim(limits[0], limits[1] * 1.6)
    axes.axhline(1, **panels.line_look(BOUND), zorder=2)
    methods = [name for name in panels.in_order(table, "method", order) if name != BOUND]
    shift = panels.shifts(methods, SPREAD)
    for k, method in enumerate(methods):
        line = table[table["method"] == method].sort_values(["recordings", "level"])
        cells = zip(line["recordings"], line["level"], strict=True)
        values = line["efficiency"]  # undefined, and not drawn, where the bound is
        for row in line[np.isposinf(values)].to_dict("records"):
            at = places[row["recordings"], row["level"]] * 10 ** shift[method]
            text = f"{row['failures']} of {row['replicates']}"
            axes.annotate(
                text, (at, limits[1]), (6, -7 * k), textcoords="offset points", va="center",
                size="x-small", color=method_style(method).color,
            )  # fmt: skip
        panels.series(
            axes,
            [places[cell] * 10 ** shift[method] for cell in cells],
            np.array([values, values, values]),
            method,
            limits,
            joined=line["recordings"] == 1,
        )  # fmt: skip
