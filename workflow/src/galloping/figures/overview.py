"""The study in one picture: error of the coefficients against noise, and what limits it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from galloping.figures import panels, paper
from galloping.figures.style import PAPER, SINGLE, method_style, spoken
from galloping.study.kinds import BOUND, NOISE, OURS, PAPER_METHOD
from galloping.tables.scores import ORACLE, mean_error, of_kind, spread

PYSINDY = (PAPER_METHOD, "stlsq", "lasso", "frols", "ensemble", "weak")
ORACLES = "oracle"  # how the best settings of pysindy are drawn
ORDERS = ("linear", "quadratic", "cubic")


def draw_overview(
    table: pd.DataFrame, settings: Mapping, peers: pd.DataFrame | None = None
) -> Figure:
    """Mean coefficient error over the orders against noise: the paper's method, the best of
    pysindy, its oracle, ours, and the bound; those that the study has.

    table: scores.csv. peers: peers.csv, or None to draw no oracle. settings: case and protocol to
    show, and the label of the noise.
    """
    case, protocol = settings["case"], settings["protocol"]
    figure = Figure(figsize=(SINGLE, 3.7), layout="constrained")
    axes = figure.subplots()
    errors = _errors(table, case, protocol)
    if peers is not None:
        errors = pd.concat([errors, _oracle(peers, case, protocol)])
    if errors.empty:
        panels.nothing(axes, "this study has no noisy recordings to show")
        return figure
    places = panels.LogAxis.of(errors["level"])
    places.prepare(axes, settings["label"])
    axes.set_yscale("log")
    shown = _shown(errors)
    printed = _printed(case, places)
    limits = _limits(errors[errors["method"].isin(shown)], [p.value for p in printed.values()])
    axes.yaxis.set_major_formatter("{x:g}")
    axes.set(ylim=limits, ylabel="mean error of the coefficients, %")
    _beyond(axes, errors, places, limits)
    shift = panels.shifts(list(shown), 0.03)
    for method in shown:
        line = errors[errors["method"] == method]
        x = [places.position(level, shift[method]) for level in line["level"]]
        panels.series(axes, x, line[["median", "low", "high"]].to_numpy().T, method, limits)
    for (order, each), face in zip(printed.items(), (PAPER, "white"), strict=False):
        axes.plot(
            places.position(each.level), each.value, "*", mfc=face, mec=PAPER, ms=8, mew=0.9,
            ls="", zorder=6, label=f"paper, {order} terms: {each.value:g} %",
        )  # fmt: skip
    title = [f"{spoken(case)}, protocol {protocol}"]
    if levels := beaten_at(errors):
        title.append(f"the oracle is better than ours at {levels}")
    axes.set_title("\n".join(title), fontsize="small")
    handles = [*panels.method_handles(shown), *axes.get_legend_handles_labels()[0]]
    figure.legend(handles=handles, loc="outside upper left", handlelength=3)
    return figure


def best_of_pysindy(table: pd.DataFrame) -> str | None:
    """The method with the lowest median, over the noisy levels, of the median error."""
    medians = {
        method: float(np.median(table.loc[table["method"] == method, "median"]))
        for method in PYSINDY
        if (table["method"] == method).any()
    }
    return min(medians, key=medians.get) if medians else None


def beaten_at(table: pd.DataFrame) -> str:
    """The noise levels where the oracle's median is below ours, or ''."""
    medians = table.pivot_table(index="level", columns="method", values="median")
    if not {ORACLES, OURS} <= set(medians):
        return ""
    return ", ".join(f"{level:g}" for level in medians.index[medians[ORACLES] < medians[OURS]])


def _oracle(peers: pd.DataFrame, case: str, protocol: str) -> pd.DataFrame:
    """The lowest oracle of STLSQ, FROLS and the weak form at each level, as `_errors` has."""
    chosen = peers[
        (peers["case"] == case) & (peers["protocol"] == protocol) & (peers["level"] > 0)
        & (peers["setting"] == ORACLE) & peers["method"].isin(PYSINDY)
    ]  # fmt: skip
    least = chosen.groupby("level", as_index=False)["mean_error_percent"].min()
    columns = dict.fromkeys(("median", "low", "high"), least["mean_error_percent"])
    return least[["level"]].assign(method=ORACLES, **columns)


def _errors(scores: pd.DataFrame, case: str, protocol: str) -> pd.DataFrame:
    """method, level, median, low, high over replicates, at the levels above zero."""
    cells = of_kind(scores, NOISE)
    cells = cells[(cells["case"] == case) & (cells["protocol"] == protocol) & (cells["level"] > 0)]
    groups = cells.assign(error=mean_error(cells)).groupby(["method", "level"], as_index=False)
    return groups.agg(**spread("error"))


def _shown(table: pd.DataFrame) -> dict[str, str]:
    """Names for the legend of the methods to draw, those of them that the study has."""
    best = best_of_pysindy(table)
    names = {
        PAPER_METHOD: "",
        ORACLES: "pysindy as the truth would set it",
        OURS: "ours",
        BOUND: "",
    }
    if best:
        names[best] = "best of pysindy"
    ordered = [PAPER_METHOD, best, ORACLES, OURS, BOUND]
    present = set(table["method"])
    return {
        name: f"{names[name]}: {method_style(name).label}".removeprefix(": ")
        for name in dict.fromkeys(ordered)
        if name in present
    }


def _printed(case: str, places: panels.LogAxis) -> dict[str, paper.Printed]:
    """By order, the largest first."""
    found = {
        order: each
        for order in ORDERS
        for each in paper.printed(f"mean_error_{order}_percent", case)
        if each.points is None and each.level in places.values
    }
    return dict(sorted(found.items(), key=lambda item: -item[1].value))


def _limits(table: pd.DataFrame, printed: list[float]) -> tuple[float, float]:
    """Room for all finite values, at most up to ten times what a lost model costs."""
    values = table[["median", "low", "high"]].to_numpy(float).ravel()
    values = np.array([*values[np.isfinite(values) & (values > 0)], *printed])
    if not values.size:
        return 1e-2, 1e2
    return float(values.min() / 2), float(min(values.max() * 2, 1e3))


def _beyond(axes: Axes, table: pd.DataFrame, places: panels.LogAxis, limits: tuple) -> None:
    """Shades what lies below the bound."""
    bound = table[table["method"] == BOUND]
    if len(bound) < 2:
        return
    x = [places.position(level) for level in bound["level"]]
    axes.fill_between(x, limits[0], bound["median"], color="#ececec", lw=0, zorder=0)
    axes.text(
        x[-1] / 1.05, limits[0] * 1.15, "more than the data hold", ha="right",
        fontsize="small", color="#5f5f5f",
    )  # fmt: skip
