"""Reliability of statuses and intervals, on trials whose truth is known.

Compared are published methods, and lines that differ from their model.
"""

from collections import Counter
from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from galloping.configuration.kinds import GAMMAS
from galloping.figures import parts
from galloping.figures.style import DARK_GREY, MODEL_COLOR, SERIES, SHADE, method_style, spoken
from galloping.results import MAIN_METHOD
from galloping.tables.trial_summaries import METHODS

STATUSES = ("ok", "not identifiable", "approximate", "refused")
WHOLE_STYLE: dict[str, Any] = {"fc": "white", "ec": DARK_GREY, "lw": 0.7, "hatch": "////"}
PEER_STYLES: dict[str, dict[str, Any]] = {  # styles of published methods
    "odr_bindy": {"color": "#000000", "ls": "--", "marker": "s", "ms": 2.5},
    "jsindy": {"color": "#1f78b4", "ls": ":", "marker": "D", "ms": 2.5},
    "ensemble_weak_sindy": {"color": "#e69f00", "ls": "-.", "marker": "P", "ms": 2.5},
}
NOMINAL_STYLE: dict[str, Any] = {"color": "#8a8a8a", "lw": 0.8, "ls": ":"}
ERROR_LABELS = {
    "frequency_v": "frequency, vertical",
    "amplitude_v": "amplitude, vertical",
    "amplitude_w": "amplitude, horizontal",
    "damping_v": "net damping, vertical",
    "damping_w": "net damping, horizontal",
}
ERROR_LIMITS = (3e-3, 300.0)  # percent: limits of the axis
MIN_SHADED_ERROR = 30.0  # percent: the axis is shaded above
MISSING_METHOD = f"these trials are without {method_style(MAIN_METHOD).label}"
ROW_HEIGHT = 0.62  # height shared by the methods of a row, in spacings of the rows


def draw_trust(table: pd.DataFrame) -> Figure:
    """Plot how often the status of a fit, such as `ok`, is right, in a panel per group of fits.

    table: fits.csv.
    """
    table = table.assign(right=_is_right(table))
    groups = list(table.groupby("group", sort=False))
    figure, grid = parts.wrapped_grid(len(groups), 2, 0.5 + 1.5 * -(-len(groups) // 2))
    for k, (axes, (group, fits)) in enumerate(zip(grid, groups, strict=True)):
        parts.letter(axes, k, f"{group}, {len(fits):,} fits")
        of_status = fits.groupby("status")["right"].agg(["size", "sum"])
        of_status = of_status.reindex(STATUSES, fill_value=0).set_axis(["all", "right"], axis=1)
        places, shares = np.arange(len(STATUSES)), 100.0 / len(fits) * of_status.astype(float)
        axes.barh(places, shares["all"], height=0.6, **WHOLE_STYLE)
        axes.barh(places, shares["right"], height=0.6, color=MODEL_COLOR)
        for y, row in zip(places.tolist(), of_status.itertuples(), strict=True):
            text = f"{row.right:d} of {row.all}" if row.all else "none"
            end = 100.0 / len(fits) * row.all + 1.5
            axes.text(end, y, text, va="center", size="small")
        parts.rows(axes, STATUSES, lines=False)
        axes.set(xlim=(0, 118), xticks=[0, 25, 50, 75, 100])
    for axes in grid[-2:]:
        axes.set_xlabel("share of the fits, %")
    right = Patch(facecolor=MODEL_COLOR, label="right")
    parts.legend(
        figure, right, Patch(label="ok and wrong, or a doubt without reason", **WHOLE_STYLE)
    )
    sure = table[table["status"] == "ok"]
    figure.set_label(
        f"{sure['right'].sum():,} of {len(sure):,} models with the status ok are right"
    )
    return figure


def _is_right(fits: pd.DataFrame) -> pd.Series:
    """Decide whether the status of each fit is right: a correct claim, or a justified doubt.

    A doubt is justified if the identified terms are not exactly the true ones, or if the recording
    has a fault; the status that no model of the library is right, and a refusal, only by a fault.
    """
    status, faulty = fits["status"], fits["fault_diagnosed"].notna()
    unsure = (status == "not identifiable") & ~fits["exact_support"]
    return ((status == "ok") & ~fits["ok_and_wrong"]) | unsure | ((status != "ok") & faulty)


def draw_published_terms(table: pd.DataFrame) -> Figure:
    """Plot how often methods find exactly the true terms against noise, beside published results.

    There is a panel for each system and length. table: published_terms.csv, of which the rows of
    our method are drawn.
    """
    table, style = table[table["method"] == MAIN_METHOD], method_style(MAIN_METHOD)
    if table.empty:
        return parts.make_empty_figure(MISSING_METHOD)
    exact = "share_exact_support"
    shares = ["level", exact, f"{exact}_low", f"{exact}_high", *PEER_STYLES]
    table = table.assign(**100.0 * table[shares])
    cells = list(table.groupby(["system", "duration"], sort=True))
    figure, grid = parts.wrapped_grid(len(cells), 4, 0.7 + 1.6 * -(-len(cells) // 4))
    for k, (axes, ((system, duration), group)) in enumerate(zip(grid, cells, strict=True)):
        parts.letter(axes, k, f"{spoken(system)}, {duration:g} s")
        for name, look in PEER_STYLES.items():
            if group[name].notna().any():
                axes.plot(group["level"], group[name], **look, label=METHODS[name])
        parts.band(axes, group["level"], group[f"{exact}_low"], group[f"{exact}_high"], None,
                   color=style.color, alpha=0.2)  # fmt: skip
        axes.plot(group["level"], group[exact], color=style.color, marker=style.marker, ms=4)
        axes.set(ylim=(-3, 103), ylabel="" if k % 4 else "exact terms, %")
    for axes in grid[-4:]:
        axes.set_xlabel("noise, %")
    ours = parts.key(style.label, color=style.color, marker=style.marker, ms=4, ls="-")
    parts.legend(figure, ours)
    others = table[list(PEER_STYLES)].max(axis=1).dropna()
    ahead = (table.loc[others.index, exact] >= others).sum()
    figure.set_label(
        f"Exact terms at least as often as the best published method in {ahead} of {len(others)} "
        "cells"
    )
    return figure


def draw_published_intervals(table: pd.DataFrame) -> Figure:
    """Plot detection rate and interval coverage of a quadratic term against its coefficient.

    table: published_intervals.csv, of which the rows of our method are drawn.
    """
    table = table[table["method"] == MAIN_METHOD]
    if table.empty:
        return parts.make_empty_figure(MISSING_METHOD)
    column = "share_with_term"
    shares = [column, f"{column}_low", f"{column}_high", f"{column}_published", "coverage"]
    table = table.assign(gamma=table["case"].map(GAMMAS), **100.0 * table[shares])
    figure, ((left, right),) = parts.panels(2.6, 1, 2, sharex=True)
    parts.letter(left, 0, "term found")
    parts.letter(right, 1, "95 % interval contains the coefficient")
    by_samples = table.sort_values("gamma").groupby("samples", sort=True)
    open_circle: dict[str, Any] = {"ls": "", "marker": "o", "ms": 9, "mfc": "none"}
    for k, (samples, group) in enumerate(by_samples):
        color, marker = SERIES[k % len(SERIES)]
        gamma, power = group["gamma"] + 0.0012 * (k - 1.5), group[column]  # side by side
        spread = [power - group[f"{column}_low"], group[f"{column}_high"] - power]
        look = {"color": color, "marker": marker, "lw": 0.8}
        left.errorbar(gamma, power, np.maximum(spread, 0.0), **look)
        left.plot(gamma, group[f"{column}_published"], mec=color, **open_circle)
        right.plot(gamma, group["coverage"], label=f"{samples:,} samples", **look)
    left.axhline(5.0, **NOMINAL_STYLE)
    right.axhline(95.0, **NOMINAL_STYLE, label="nominal")
    left.set(ylim=(-3, 103), xlabel="quadratic coefficient", ylabel="share of the fits, %")
    right.set(ylim=(min(78.0, table["coverage"].min() - 2.0), 101), xlabel="quadratic coefficient")
    right.plot([], [], mec="k", label="published power", **open_circle)
    parts.legend(figure, columns=6)
    least, most = table["coverage"].min(), table["coverage"].max()
    figure.set_label(f"95 % intervals contain the coefficient in {least:.0f} to {most:.0f} %")
    return figure


def draw_model_error(table: pd.DataFrame, settings: Mapping) -> Figure:
    """Plot errors of identified frequencies, damping and amplitudes, by overhead line and sensors.

    There is a panel for each quantity, and a marker per method. Errors in percent are medians over
    the identified noise realisations, with a line to the worst; the last panel shows how many were
    identified, with how many terms. table: model_error.csv. settings: truths, in order.
    """
    order = settings["truths"].index
    lines = sorted(
        set(zip(table["truth"], table["sensors"], strict=True)),
        key=lambda line: (order(line[0]), line[1]),
    )
    count = Counter(truth for truth, _ in lines)
    methods = sorted(table["method"].unique(), key=lambda method: method != MAIN_METHOD)
    figure, grid = parts.panels(1.3 + 0.8 * len(lines), 2, 3, sharey=True)
    *panels, answers = grid.ravel()
    step = ROW_HEIGHT / max(len(methods) - 1, 1)
    rows = table.assign(place=[
        lines.index((row.truth, row.sensors)) - ROW_HEIGHT / 2 + step * methods.index(row.method)
        for row in table.itertuples()
    ]).to_dict("records")  # fmt: skip
    for k, (axes, (quantity, label)) in enumerate(zip(panels, ERROR_LABELS.items(), strict=True)):
        parts.letter(axes, k, label)
        axes.set_xscale("log")
        axes.set(xlim=ERROR_LIMITS, xlabel="error, %")
        axes.axvspan(MIN_SHADED_ERROR, ERROR_LIMITS[1], color=SHADE, lw=0, zorder=0)
        for row in rows:
            median, worst = row[f"{quantity}_error_percent"], row[f"{quantity}_worst_percent"]
            if np.isfinite(median) or np.isposinf(median):
                style, size = method_style(row["method"]), parts.line_look(row["method"])
                # smaller errors are drawn at the edge
                interval = (max(median, ERROR_LIMITS[0]), median, worst)
                parts.dot(axes, row["place"], interval, ERROR_LIMITS, style.color, style.marker,
                          size["markersize"])  # fmt: skip
    parts.letter(answers, len(panels), "answered; terms")
    answers.set(xlim=(0, len(methods)), xticks=[])
    for row in rows:
        terms = f"; {row['terms']:.0f}" if row["n_models"] else ""
        text = f"{row['n_models']} of {row['replicates']}{terms}"
        color = method_style(row["method"]).color
        answers.text(0.1, row["place"], text, va="center", size="x-small", color=color)
    names = [", ".join(line if count[line[0]] > 1 else line[:1]) for line in lines]
    for axes in (*panels, answers):
        parts.rows(axes, [name.replace(", ", ",\n") for name in names])
    parts.legend(figure, *parts.method_keys(methods), columns=len(methods) + 1)
    errors = table.loc[
        table["method"] == methods[0], [f"{name}_error_percent" for name in ERROR_LABELS]
    ]
    frequency, *_, damping, _ = errors.median()
    result = "gives no vertical frequency and net damping of most lines"
    if np.isfinite([frequency, damping]).all():
        result = f"errs by {frequency:.1g} % in the vertical frequency and {damping:.1g} % in the "
        result += "vertical net damping, in the median over the lines"
    name = method_style(methods[0]).label
    figure.set_label(f"{name[:1].upper()}{name[1:]} {result}")
    return figure
