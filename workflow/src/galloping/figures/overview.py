"""The study in one picture: error of the coefficients against noise, and what limits it."""

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from galloping.figures import parts
from galloping.figures.errors import DECADES, printed
from galloping.figures.style import PAPER, QUIET, SHADE, SINGLE, method_style, spoken
from galloping.names import BOUND, NOISE, OURS, PAPER_METHOD
from galloping.tables.scores import ORACLE, ORDERS, mean_error, of_kind, spread

PYSINDY = (PAPER_METHOD, "stlsq", "lasso", "frols", "ensemble", "weak")
ORACLES = "oracle"  # how the best settings of pysindy are drawn


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
    errors = _errors(table, peers, case, protocol)
    if errors.empty:
        parts.nothing(axes, "this study has no noisy recordings to show")
        return figure
    places = parts.LogAxis.of(errors["level"])
    places.prepare(axes, settings["label"])
    stars = [(claim.paper_value, order, places.position(claim.level))
             for order in ORDERS for claim in printed(f"mean_error_{order}_percent", case)
             if claim.points is None and claim.level in places.values]  # fmt: skip
    names = _shown(errors)
    values = errors[errors["method"].isin(names)][["median", "low", "high"]].to_numpy(float).ravel()
    values = np.array([*values[np.isfinite(values) & (values > 0)], *(star[0] for star in stars)])
    # at most ten times what a lost model costs
    limits = (values.min() / 2, min(values.max() * 2, 1e3)) if values.size else DECADES
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter("{x:g}")
    axes.set(ylim=limits, ylabel="mean error of the coefficients, %")
    _beyond(axes, errors, places, limits)
    shift = parts.shifts(list(names), 0.03)
    for method in names:
        line = errors[errors["method"] == method]
        x = [places.position(level, shift[method]) for level in line["level"]]
        parts.series(axes, x, line[["median", "low", "high"]].to_numpy().T, method, limits)
    for (value, order, x), face in zip(sorted(stars)[::-1], (PAPER, "white"), strict=False):
        axes.plot(x, value, "*", mfc=face, mec=PAPER, ms=8, mew=0.9, ls="", zorder=6,
                  label=f"paper, {order} terms: {value:g} %")  # fmt: skip
    title = [f"{spoken(case)}, protocol {protocol}"]
    if levels := beaten_at(errors):
        title.append(f"the oracle is better than ours at {levels}")
    axes.set_title("\n".join(title), fontsize="small")
    keys = parts.method_keys(names)
    parts.legend(figure, *keys, columns=1, loc="outside upper left", handlelength=3)
    return figure


def best_of_pysindy(table: pd.DataFrame) -> str | None:
    """The method with the lowest median, over the noisy levels, of the median error."""
    medians = table.groupby("method")["median"].agg(np.median)
    medians = medians.reindex([method for method in PYSINDY if method in medians]).dropna()
    return None if medians.empty else medians.idxmin()


def beaten_at(table: pd.DataFrame) -> str:
    """The noise levels where the oracle's median is below ours, or ''."""
    medians = table.pivot_table(index="level", columns="method", values="median")
    if not {ORACLES, OURS} <= set(medians):
        return ""
    return ", ".join(f"{level:g}" for level in medians.index[medians[ORACLES] < medians[OURS]])


def _errors(
    scores: pd.DataFrame, peers: pd.DataFrame | None, case: str, protocol: str
) -> pd.DataFrame:
    """method, level, median, low, high over replicates, at the levels above zero; of the oracle
    the lowest of STLSQ, FROLS and the weak form.
    """
    cells, others = (
        rows[(rows["case"] == case) & (rows["protocol"] == protocol) & (rows["level"] > 0)]
        for rows in (of_kind(scores, NOISE), scores[:0] if peers is None else peers)
    )
    groups = cells.assign(error=mean_error(cells)).groupby(["method", "level"], as_index=False)
    errors = groups.agg(**spread("error"))
    if peers is None:
        return errors
    others = others[(others["setting"] == ORACLE) & others["method"].isin(PYSINDY)]
    least = others.groupby("level")["mean_error_percent"].min()
    columns = dict.fromkeys(("median", "low", "high"), least)
    return pd.concat([errors, pd.DataFrame(columns).reset_index().assign(method=ORACLES)])


def _shown(table: pd.DataFrame) -> dict[str, str]:
    """Names for the legend of the methods to draw, those of them that the study has."""
    best = best_of_pysindy(table)
    names = {PAPER_METHOD: "", best: "best of pysindy",
             ORACLES: "pysindy as the truth would set it", OURS: "ours", BOUND: ""}  # fmt: skip
    present = set(table["method"])
    return {
        method: f"{name}: {method_style(method).label}".removeprefix(": ")
        for method, name in names.items()
        if method in present
    }


def _beyond(axes: Axes, table: pd.DataFrame, places: parts.LogAxis, limits: tuple) -> None:
    """Shades what lies below the bound."""
    bound = table[table["method"] == BOUND]
    if len(bound) < 2:
        return
    x = [places.position(level) for level in bound["level"]]
    axes.fill_between(x, limits[0], bound["median"], color=SHADE, lw=0, zorder=0)
    axes.text(
        x[-1] / 1.05, limits[0] * 1.15, "more than the data hold", ha="right", fontsize="small",
        color=QUIET,
    )  # fmt: skip
