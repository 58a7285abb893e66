"""Figures 6 and 7: errors of the coefficients and of the motion against noise."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from galloping.figures import panels, paper
from galloping.figures.style import DIRECTIONS, DOUBLE, STATES, spoken

ORDERS = ("linear", "quadratic", "cubic")
LEVEL_LABEL = "noise level"


def draw_noise_coefficients(table: pd.DataFrame, settings: Mapping) -> Figure:
    """Mean coefficient error by order: a row for each case and protocol, a column for each order.

    table: noise_coefficients.csv. settings: cases, protocols, methods in the study's order.
    """
    rows = [(case, protocol) for case in settings["cases"] for protocol in settings["protocols"]]
    figure = Figure(figsize=(DOUBLE, 0.75 + 1.75 * len(rows)), layout="constrained")
    grid = figure.subplots(len(rows), len(ORDERS), squeeze=False, sharex=True)
    marked = False
    for row, (case, protocol) in enumerate(rows):
        part = table[(table["case"] == case) & (table["protocol"] == protocol)]
        limits = _error_limits(part, case)
        for column, order in enumerate(ORDERS):
            axes = grid[row, column]
            panels.letter(axes, row * len(ORDERS) + column, f"{order}, {spoken(case)}")
            chosen = part[part["order"] == order]
            if chosen.empty:
                panels.nothing(axes, "no values in this study")
                continue
            places = _error_panel(axes, chosen, settings["methods"], limits)
            for claim in paper.claims_of(f"mean_error_{order}_percent", case):
                if claim.level in places.values:
                    paper.mark(axes, places.position(claim.level), claim.paper_value, claim)
                    marked = True
            if row < len(rows) - 1:
                axes.set_xlabel("")
        grid[row, 0].set_ylabel(f"protocol {protocol}\nmean error, %")
    present = panels.in_order(table, "method", settings["methods"])
    panels.method_legend(figure, present, paper.handles(value=marked, bound=False), columns=4)
    return figure


def _error_panel(
    axes: Axes, table: pd.DataFrame, order: list[str], limits: tuple[float, float]
) -> panels.LogAxis:
    methods = panels.in_order(table, "method", order)
    places = panels.LogAxis.of(table["level"])
    places.prepare(axes, LEVEL_LABEL)
    axes.set_yscale("log")
    axes.set_ylim(limits[0] / 1.6, limits[1] * 1.6)
    shift = panels.shifts(methods, 0.025)
    for method in methods:
        line = table[table["method"] == method].sort_values("level")
        panels.series(
            axes,
            [places.position(level, shift[method]) for level in line["level"]],
            line["mean_error_percent"],
            line["mean_error_percent_low"],
            line["mean_error_percent_high"],
            method,
            limits,
            joined=line["level"] > 0,
        )
    return places


def _error_limits(table: pd.DataFrame, case: str) -> tuple[float, float]:
    """Whole decades around the noisy errors and the paper's; exact recovery lies far below."""
    noisy = table[table["level"] > 0]
    columns = ["mean_error_percent", "mean_error_percent_low", "mean_error_percent_high"]
    values = noisy[columns].to_numpy(float).ravel()
    printed = [
        claim.paper_value
        for order in ORDERS
        for claim in paper.claims_of(f"mean_error_{order}_percent", case)
    ]
    values = np.array([*values[np.isfinite(values) & (values > 0)], *printed])
    if not values.size:
        values = np.array([1e-2, 1e2])
    return (
        float(10 ** np.floor(np.log10(values.min()))),
        float(10 ** np.ceil(np.log10(values.max()))),
    )


def draw_noise_r2(table: pd.DataFrame, settings: Mapping) -> Figure:
    """R2 of the reconstructed motion: a row for each case and state, a column for each protocol.

    table: noise_r2.csv. settings: cases, protocols, methods in the study's order.
    """
    rows = [(case, state) for case in settings["cases"] for state in STATES]
    columns = settings["protocols"]
    figure = Figure(figsize=(DOUBLE, 0.75 + 1.75 * len(rows)), layout="constrained")
    grid = figure.subplots(len(rows), len(columns), squeeze=False, sharex=True)
    marked = False
    for row, (case, state) in enumerate(rows):
        for column, protocol in enumerate(columns):
            axes = grid[row, column]
            panels.letter(
                axes,
                row * len(columns) + column,
                f"{DIRECTIONS[state]}, {spoken(case)}, protocol {protocol}",
            )
            chosen = table[
                (table["case"] == case)
                & (table["protocol"] == protocol)
                & (table["state"] == state)
            ]
            if chosen.empty:
                panels.nothing(axes, "no values in this study")
                continue
            places = _r2_panel(axes, chosen, settings["methods"], state)
            for claim in paper.claims_of(f"r2_{state}", case):
                if claim.level in places.values:
                    height = panels.r2_place(claim.paper_value)
                    paper.mark(axes, places.position(claim.level), height, claim)
                    marked = True
            if row < len(rows) - 1:
                axes.set_xlabel("")
            if column:
                axes.set_ylabel("")
    present = panels.in_order(table, "method", settings["methods"])
    panels.method_legend(figure, present, paper.handles(value=False, bound=marked), columns=4)
    return figure


def _r2_panel(axes: Axes, table: pd.DataFrame, order: list[str], state: str) -> panels.LogAxis:
    methods = panels.in_order(table, "method", order)
    places = panels.LogAxis.of(table["level"])
    places.prepare(axes, LEVEL_LABEL)
    panels.prepare_r2(axes, f"$R^2$ of {STATES[state]}")
    shift = panels.shifts(methods, 0.02)
    for method in methods:
        line = table[table["method"] == method].sort_values("level")
        panels.r2_series(
            axes,
            [places.position(level, shift[method]) for level in line["level"]],
            line["r2_median"],
            line["r2_low"],
            line["r2_high"],
            method,
            joined=line["level"] > 0,
        )
    return places
