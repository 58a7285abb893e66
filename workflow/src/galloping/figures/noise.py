"""Figures 6 and 7: errors of the coefficients and of the motion against noise."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from galloping.figures import panels, paper
from galloping.figures.style import DIRECTIONS, DOUBLE, STATE_LABELS

ORDERS = ("linear", "quadratic", "cubic")
LEVEL_LABEL = "noise level"
SPREAD = 0.09  # decades, within which methods are moved apart


def draw_noise_coefficients(table: pd.DataFrame, settings: Mapping) -> Figure:
    """Mean coefficient error: a row for each case and order, a column for each protocol.

    table: noise_coefficients.csv. settings: cases, protocols, methods in the study's order.
    """
    columns = settings["protocols"]
    cases, height = panels.fitting(settings["cases"], 0.8, 1.3 * len(ORDERS))
    rows = [(case, order) for case in cases for order in ORDERS]
    figure = Figure(figsize=(DOUBLE, height), layout="constrained")
    grids = panels.case_grids(figure, cases, len(ORDERS), len(columns))
    places = panels.LogAxis.of(table["level"])
    marked = False
    for row, (case, order) in enumerate(rows):
        line = grids[case][row % len(ORDERS)]
        of_row = table[(table["case"] == case) & (table["order"] == order)]
        limits = _error_limits(of_row, case, order)
        for column, (axes, protocol) in enumerate(zip(line, columns, strict=True)):
            panels.letter(axes, row * len(columns) + column, f"{order}, {protocol}")
            chosen = of_row[of_row["protocol"] == protocol]
            if chosen.empty:
                panels.nothing(axes, "no values in this study")
                continue
            _error_panel(axes, chosen, places, settings["methods"], limits)
            for claim in paper.claims_of(f"mean_error_{order}_percent", case):
                if claim.level in places.values:
                    paper.mark(axes, places.position(claim.level), claim.paper_value, claim)
                    marked = True
            if order != ORDERS[-1]:
                axes.set_xlabel("")
        line[0].set_ylabel("mean error, %")
    present = panels.in_order(table, "method", settings["methods"])
    panels.method_legend(figure, present, paper.handles(value=marked, bound=False), columns=4)
    panels.note_left_out(figure, settings["cases"][len(cases) :], "noise_coefficients.csv")
    return figure


def _error_panel(
    axes: Axes,
    table: pd.DataFrame,
    places: panels.LogAxis,
    order: list[str],
    limits: tuple[float, float],
) -> None:
    methods = panels.in_order(table, "method", order)
    places.prepare(axes, LEVEL_LABEL)
    axes.set_yscale("log")
    axes.set_ylim(limits[0] / 1.6, limits[1] * 1.6)
    shift = panels.shifts(methods, SPREAD)
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


def _error_limits(table: pd.DataFrame, case: str, order: str) -> tuple[float, float]:
    """Whole decades around the noisy errors and the paper's; exact recovery lies far below."""
    noisy = table[table["level"] > 0]
    columns = ["mean_error_percent", "mean_error_percent_low", "mean_error_percent_high"]
    values = noisy[columns].to_numpy(float).ravel()
    claims = paper.claims_of(f"mean_error_{order}_percent", case)
    printed = [claim.paper_value for claim in claims]
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
    columns = settings["protocols"]
    cases, height = panels.fitting(settings["cases"], 0.8, 1.75 * len(STATE_LABELS))
    rows = [(case, state) for case in cases for state in STATE_LABELS]
    figure = Figure(figsize=(DOUBLE, height), layout="constrained")
    grids = panels.case_grids(figure, cases, len(STATE_LABELS), len(columns))
    places = panels.LogAxis.of(table["level"])
    marked = False
    for row, (case, state) in enumerate(rows):
        line = grids[case][row % len(STATE_LABELS)]
        for column, (axes, protocol) in enumerate(zip(line, columns, strict=True)):
            panels.letter(axes, row * len(columns) + column, f"{DIRECTIONS[state]}, {protocol}")
            chosen = table[
                (table["case"] == case)
                & (table["protocol"] == protocol)
                & (table["state"] == state)
            ]
            if chosen.empty:
                panels.nothing(axes, "no values in this study")
                continue
            _r2_panel(axes, chosen, places, settings["methods"])
            for claim in paper.claims_of(f"r2_{state}", case):
                if claim.level in places.values:
                    height = panels.r2_place(claim.paper_value)
                    paper.mark(axes, places.position(claim.level), height, claim)
                    marked = True
            if row % len(STATE_LABELS) < len(STATE_LABELS) - 1:
                axes.set_xlabel("")
        line[0].set_ylabel(f"$R^2$ of {STATE_LABELS[state]}")
    present = panels.in_order(table, "method", settings["methods"])
    panels.method_legend(figure, present, paper.handles(value=False, bound=marked), columns=4)
    panels.note_left_out(figure, settings["cases"][len(cases) :], "noise_r2.csv")
    return figure


def _r2_panel(axes: Axes, table: pd.DataFrame, places: panels.LogAxis, order: list[str]) -> None:
    methods = panels.in_order(table, "method", order)
    places.prepare(axes, LEVEL_LABEL)
    panels.prepare_r2(axes, "")
    shift = panels.shifts(methods, SPREAD)
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
