"""Figure 10: errors of the motion against the amount of data."""

from __future__ import annotations

from collections.abc import Mapping

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from galloping.figures import panels, paper
from galloping.figures.style import DOUBLE, STATE_LABELS

POINTS_LABEL = "points"
ERROR_LIMITS = (1e-2, 1e2)  # percent; a motion without galloping is 100 % wrong
R2_TICKS = (0.0, 0.9, 0.99, 0.999, 0.9999)
SPREAD = 0.13  # decades, within which methods are moved apart
QUANTITIES = {"r2": "$R^2$", "amplitude_error_percent": "amplitude\nerror, %"}
SCORES = {"r2": "r2_{}", "amplitude_error_percent": "amplitude_error_{}_percent"}


def draw_data_amount(table: pd.DataFrame, settings: Mapping) -> Figure:
    """R2 and amplitude error: a row for each case, quantity and state, a column for each protocol.

    table: data_amount.csv. settings: cases, protocols, methods in the study's order; level of the
    noise.
    """
    columns = settings["protocols"]
    shown = [(quantity, state) for quantity in QUANTITIES for state in STATE_LABELS]
    cases, height = panels.fitting(settings["cases"], 0.8, 1.08 * len(shown))
    rows = [(case, *pair) for case in cases for pair in shown]
    figure = Figure(figsize=(DOUBLE, height), layout="constrained")
    grids = panels.case_grids(figure, cases, len(shown), len(columns))
    places = panels.LogAxis.of(table["points"])
    marks = set()
    for row, (case, quantity, state) in enumerate(rows):
        line = grids[case][row % len(shown)]
        of_row = table[(table["case"] == case) & (table["state"] == state)]
        for column, (axes, protocol) in enumerate(zip(line, columns, strict=True)):
            panels.letter(axes, row * len(columns) + column, f"{STATE_LABELS[state]}, {protocol}")
            chosen = of_row[of_row["protocol"] == protocol]
            if chosen.empty:
                panels.nothing(axes, "no subsets")
            else:
                marks |= _panel(axes, chosen, places, settings, quantity)
            if (quantity, state) != shown[-1]:
                axes.set_xlabel("")
        line[0].set_ylabel(QUANTITIES[quantity])
    present = panels.in_order(table, "method", settings["methods"])
    panels.method_legend(
        figure,
        present,
        paper.handles(value="value" in marks, bound="at_least" in marks),
        columns=4,
    )
    panels.note_left_out(figure, settings["cases"][len(cases) :], "data_amount.csv")
    return figure


def _panel(
    axes: Axes, table: pd.DataFrame, places: panels.LogAxis, settings: Mapping, quantity: str
) -> set:
    """One quantity of one state; returns the kinds of the paper's marks drawn."""
    methods = panels.in_order(table, "method", settings["methods"])
    places.prepare(axes, POINTS_LABEL)
    if quantity == "r2":
        panels.prepare_r2(axes, "", ticks=R2_TICKS)
    else:
        axes.set_yscale("log")
        axes.set_ylim(ERROR_LIMITS[0] / 1.6, ERROR_LIMITS[1] * 1.6)
    shift = panels.shifts(methods, SPREAD)
    for method in methods:
        line = table[table["method"] == method].sort_values("points")
        x = [places.position(points, shift[method]) for points in line["points"]]
        values = (line[f"{quantity}{end}"] for end in ("", "_low", "_high"))
        if quantity == "r2":
            panels.r2_series(axes, x, *values, method)
        else:
            panels.series(axes, x, *values, method, ERROR_LIMITS)
    return _mark(axes, places, settings["level"], table.iloc[0], quantity)


def _mark(axes: Axes, places: panels.LogAxis, level: float, cell: pd.Series, quantity: str) -> set:
    kinds = set()
    for claim in paper.claims_of(SCORES[quantity].format(cell["state"]), cell["case"], subset=True):
        if claim.points in places.values and claim.level == level:
            r2 = quantity == "r2"
            height = panels.r2_place(claim.paper_value) if r2 else claim.paper_value
            paper.mark(axes, places.position(claim.points), height, claim)
            kinds.add(claim.kind)
    return kinds
