"""All methods beside each other, against noise or amount of data."""

from __future__ import annotations

from collections.abc import Mapping

import pandas as pd
from matplotlib.figure import Figure

from galloping.figures import panels
from galloping.figures.quantities import QUANTITIES
from galloping.tables.scores import spread

SPREAD = 0.1  # decades, within which methods are moved apart


def draw_methods(table: pd.DataFrame, settings: Mapping) -> Figure:
    """Median and 5th to 95th percentile of each method: a block for each case, a row for each
    quantity, a column for each protocol.

    table: scores.csv. settings: cases, protocols, methods in the study's order; kind of cells; x,
    `level` or `points`, and its labels by protocol; quantities, names of QUANTITIES; values, where
    the values of cases not drawn are.
    """
    x, rows = settings["x"], [QUANTITIES[name] for name in settings["quantities"]]
    table = table[(table["kind"] == settings["kind"]) & (table[x] > 0)]
    figure, grid = panels.method_grid(settings, len(rows), 2.1, settings["values"])
    places = panels.LogAxis.of(table[x])
    shift = panels.shifts(panels.in_order(table, "method", settings["methods"]), SPREAD)
    drawn = set()
    for (case, row, protocol), axes in grid.items():
        quantity, of_case = rows[row], table[table["case"] == case]
        of_case = of_case.assign(value=quantity.combined(of_case)).dropna(subset="value")
        of_panel = of_case[of_case["protocol"] == protocol]
        if of_panel.empty:
            panels.nothing(axes, "no values in this study")
            continue
        places.prepare(axes, settings["labels"][protocol] if row == len(rows) - 1 else "")
        limits = quantity.limits(_summarised(of_case, x)["median"].to_numpy(float))
        first = protocol == settings["protocols"][0]
        quantity.prepare(axes, limits, quantity.together if first else "")
        for method, line in _summarised(of_panel, x).groupby("method"):
            at = [places.position(value, shift[method]) for value in line[x]]
            values = quantity.place(line[["median", "low", "high"]].to_numpy(float).T)
            panels.series(axes, at, values, method, limits)
            drawn.add(method)
    panels.legend(figure, [name for name in settings["methods"] if name in drawn], columns=4)
    return figure


def _summarised(table: pd.DataFrame, x: str) -> pd.DataFrame:
    """protocol, method, x, median, low, high of `value` over replicates."""
    return table.groupby(["protocol", "method", x], as_index=False).agg(**spread("value"))
