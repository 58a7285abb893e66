"""Figure 10: errors of the motion against the amount of data."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from galloping.figures import panels, paper
from galloping.figures.style import DOUBLE, STATES, spoken

POINTS_LABEL = "points"
ERROR_LIMITS = (1e-2, 1e2)  # percent; a motion without galloping is 100 % wrong


def draw_data_amount(table: pd.DataFrame, settings: Mapping) -> Figure:
    """R2 and amplitude error: two rows for each case, a column for each protocol and state.

    table: data_amount.csv. settings: cases, protocols, methods in the study's order; level of the
    noise.
    """
    cases = settings["cases"]
    columns = [(protocol, state) for protocol in settings["protocols"] for state in STATES]
    figure = Figure(figsize=(DOUBLE, 0.8 + 3.5 * len(cases)), layout="constrained")
    grid = figure.subplots(2 * len(cases), len(columns), squeeze=False, sharex=True, sharey="row")
    marks = set()
    for k, case in enumerate(cases):
        for column, (protocol, state) in enumerate(columns):
            chosen = table[
                (table["case"] == case)
                & (table["protocol"] == protocol)
                & (table["state"] == state)
            ]
            pair = grid[2 * k : 2 * k + 2, column]
            for row, axes in enumerate(pair):
                panels.letter(
                    axes, (2 * k + row) * len(columns) + column, f"{STATES[state]}, {protocol}"
                )
                if chosen.empty:
                    panels.nothing(axes, "no subsets")
            if not chosen.empty:
                marks |= _pair(pair, chosen, settings, case, state)
            if k < len(cases) - 1:
                pair[1].set_xlabel("")
        grid[2 * k, 0].set_ylabel(f"{spoken(case)}\n$R^2$")
        grid[2 * k + 1, 0].set_ylabel(f"{spoken(case)}\namplitude error, %")
    present = panels.in_order(table, "method", settings["methods"])
    panels.method_legend(
        figure,
        present,
        paper.handles(value="value" in marks, bound="at_least" in marks),
        columns=4,
    )
    return figure


def _pair(pair: np.ndarray, table: pd.DataFrame, settings: Mapping, case: str, state: str) -> set:
    """R2 above, amplitude error below; returns the kinds of the paper's marks drawn."""
    upper, lower = pair
    methods = panels.in_order(table, "method", settings["methods"])
    places = panels.LogAxis.of(table["points"])
    places.prepare(upper, "")
    places.prepare(lower, POINTS_LABEL)
    panels.prepare_r2(upper, "")
    lower.set_yscale("log")
    lower.set_ylim(ERROR_LIMITS[0] / 1.6, ERROR_LIMITS[1] * 1.6)
    shift = panels.shifts(methods, 0.03)
    for method in methods:
        line = table[table["method"] == method].sort_values("points")
        x = [places.position(points, shift[method]) for points in line["points"]]
        panels.r2_series(upper, x, line["r2"], line["r2_low"], line["r2_high"], method)
        panels.series(
            lower,
            x,
            line["amplitude_error_percent"],
            line["amplitude_error_percent_low"],
            line["amplitude_error_percent_high"],
            method,
            ERROR_LIMITS,
        )
    kinds = _mark(upper, places, settings, case, f"r2_{state}", panels.r2_place)
    return kinds | _mark(
        lower, places, settings, case, f"amplitude_error_{state}_percent", lambda value: value
    )


def _mark(axes: Axes, places: panels.LogAxis, settings: Mapping, case: str, column: str, height):
    kinds = set()
    for claim in paper.claims_of(column, case, subset=True):
        if claim.points in places.values and claim.level == settings["level"]:
            paper.mark(axes, places.position(claim.points), height(claim.paper_value), claim)
            kinds.add(claim.kind)
    return kinds
