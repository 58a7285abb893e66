"""What verdicts and intervals are worth: on trials whose truth is known, beside what others
published, and of lines that are not their own model.
"""

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from galloping.configuration.kinds import GAMMAS
from galloping.figures import parts
from galloping.figures.style import MODEL, PAPER, QUIET, SERIES, SHADE, method_style, spoken
from galloping.results import OURS
from galloping.tables.trial_summaries import METHODS

STATUSES = ("ok", "not identifiable", "approximate", "refused")
WHOLE = {"facecolor": "white", "edgecolor": QUIET, "linewidth": 0.7, "hatch": "////"}
OTHERS = {  # published methods
    "odr_bindy": {"color": "#000000", "ls": "--", "marker": "s", "ms": 2.5},
    "jsindy": {"color": "#1f78b4", "ls": ":", "marker": "D", "ms": 2.5},
    "ensemble_weak_sindy": {"color": "#e69f00", "ls": "-.", "marker": "P", "ms": 2.5},
}
NOMINAL = {"color": "#8a8a8a", "lw": 0.8, "ls": ":"}
ERRORS = {
    "frequency_v": "frequency, vertical",
    "amplitude_v": "amplitude, vertical",
    "amplitude_w": "amplitude, horizontal",
    "damping_v": "net damping, vertical",
    "damping_w": "net damping, horizontal",
}
LIMITS = (3e-3, 300.0)  # percent
DOUBTFUL = 30.0  # percent: beyond, a value is hardly known
HEIGHT = 0.62  # of a row, shared by the methods
TWO_MODES = "two modes"
WORTH = {"amplitude_m": "amplitude\n200-300 s, m", "limit_cycle_m": "limit cycle, m", "r2": "$R^2$"}
LOOKS = {"vertical": {"color": MODEL, "marker": "o"}, "horizontal": {"color": PAPER, "marker": "s"}}
STRETCHES = {"r2_0_100_s": "white", "r2_100_200_s": "#bbbbbb", "r2_200_300_s": ""}


def draw_trust(table: pd.DataFrame) -> Figure:
    """A panel for each group of fits, a bar for each status: how often it is right.

    table: fits.csv.
    """
    table = table.assign(right=_right(table))
    groups = list(table.groupby("group", sort=False))
    figure, grid = parts.wrapped_grid(len(groups), 2, 0.5 + 1.5 * -(-len(groups) // 2))
    for k, (axes, (group, fits)) in enumerate(zip(grid, groups, strict=True)):
        parts.letter(axes, k, f"{group}, {len(fits):,} fits")
        of_status = fits.groupby("status")["right"].agg(["size", "sum"])
        of_status = of_status.reindex(STATUSES, fill_value=0).set_axis(["all", "right"], axis=1)
        places, shares = np.arange(len(STATUSES)), 100.0 / len(fits) * of_status.astype(float)
        axes.barh(places, shares["all"], height=0.6, **WHOLE)
        axes.barh(places, shares["right"], height=0.6, color=MODEL)
        for place, row in zip(places, of_status.itertuples(), strict=True):
            text = f"{row.right:d} of {row.all}" if row.all else "none"
            end = 100.0 / len(fits) * row.all + 1.5
            axes.text(end, place, text, va="center", size="small")
        parts.rows(axes, STATUSES, lines=False)
        axes.set(xlim=(0, 118), xticks=[0, 25, 50, 75, 100])
    for axes in grid[-2:]:
        axes.set_xlabel("share of the fits, %")
    right = Patch(facecolor=MODEL, label="right")
    parts.legend(figure, right, Patch(label="ok and wrong, or a doubt without need", **WHOLE))
    return figure


def _right(fits: pd.DataFrame) -> pd.Series:
    """Whether the status of each fit is right: a claim that holds, or a doubt that is due.

    It is due where the terms found are not exactly the true ones, or where the recording has a
    fault; no model of the library being right, and a refusal, are due to a fault alone.
    """
    status, faulty = fits["status"], fits["cause_named"].notna()
    unsure = (status == "not identifiable") & ~fits["exact"]
    return ((status == "ok") & ~fits["ok_and_wrong"]) | unsure | ((status != "ok") & faulty)


def draw_published_terms(table: pd.DataFrame) -> Figure:
    """A panel for each system and length: share of exactly the right terms against the noise.

    table: published_terms.csv, of which the rows of our method are drawn.
    """
    table, style = table[table["method"] == OURS], method_style(OURS)
    shares = ["level", "exact", "exact_low", "exact_high", *OTHERS]
    table = table.assign(**100.0 * table[shares])
    cells = list(table.groupby(["system", "duration"], sort=True))
    figure, grid = parts.wrapped_grid(len(cells), 4, 0.7 + 1.6 * -(-len(cells) // 4))
    for k, (axes, ((system, duration), group)) in enumerate(zip(grid, cells, strict=True)):
        parts.letter(axes, k, f"{spoken(system)}, {duration:g} s")
        for name, look in OTHERS.items():
            if group[name].notna().any():
                axes.plot(group["level"], group[name], **look, label=METHODS[name])
        parts.band(axes, group["level"], group["exact_low"], group["exact_high"], None,
                   color=style.color, alpha=0.2)  # fmt: skip
        axes.plot(group["level"], group["exact"], color=style.color, marker=style.marker, ms=4)
        axes.set(ylim=(-3, 103), ylabel="" if k % 4 else "exact terms, %")
    for axes in grid[-4:]:
        axes.set_xlabel("noise, %")
    ours = parts.key(style.label, color=style.color, marker=style.marker, ms=4, ls="-")
    parts.legend(figure, ours)
    return figure


def draw_published_intervals(table: pd.DataFrame) -> Figure:
    """How often the quadratic term is found, and how often its interval holds, by its size.

    table: published_intervals.csv, of which the rows of our method are drawn.
    """
    table = table[table["method"] == OURS]
    shares = ["found", "found_low", "found_high", "found_published", "holds"]
    table = table.assign(gamma=table["case"].map(GAMMAS), **100.0 * table[shares])
    figure, ((left, right),) = parts.panels(2.6, 1, 2, sharex=True)
    parts.letter(left, 0, "term found")
    parts.letter(right, 1, "95 % interval holds the coefficient")
    by_samples = table.sort_values("gamma").groupby("samples", sort=True)
    for k, (samples, group) in enumerate(by_samples):
        color, marker = SERIES[k % len(SERIES)]
        gamma, found = group["gamma"] + 0.0012 * (k - 1.5), group["found"]  # side by side
        spread = [found - group["found_low"], group["found_high"] - found]
        look = {"color": color, "marker": marker, "lw": 0.8}
        left.errorbar(gamma, found, np.maximum(spread, 0.0), **look)
        left.plot(gamma, group["found_published"], ls="", marker="o", ms=9, mfc="none", mec=color)
        right.plot(gamma, group["holds"], label=f"{samples:,} samples", **look)
    left.axhline(5.0, **NOMINAL)
    right.axhline(95.0, **NOMINAL, label="nominal")
    left.set(ylim=(-3, 103), xlabel="quadratic coefficient", ylabel="share of the fits, %")
    right.set(ylim=(min(78.0, table["holds"].min() - 2.0), 101), xlabel="quadratic coefficient")
    right.plot([], [], "o", ms=9, mfc="none", mec="k", label="published power")
    parts.legend(figure, columns=6)
    return figure


def draw_model_error(table: pd.DataFrame) -> Figure:
    """A panel for each quantity, a row for each line and its sensors, a marker for each method.

    Errors in percent, median over the answered replicates, a line on to the worst of them; the last
    panel says how many were answered, with how many terms. table: model_error.csv.
    """
    truths = sorted(table["truth"].unique(), key=lambda truth: (truth.startswith("two"), truth))
    methods = sorted(table["method"].unique(), key=lambda method: method != OURS)
    figure, grid = parts.panels(1.3 + 0.8 * len(truths), 2, 3, sharey=True)
    *panels, answers = grid.ravel()
    step = HEIGHT / max(len(methods) - 1, 1)
    rows = table.assign(place=[
        truths.index(row.truth) - HEIGHT / 2 + step * methods.index(row.method)
        for row in table.itertuples()
    ]).to_dict("records")  # fmt: skip
    for k, (axes, (quantity, label)) in enumerate(zip(panels, ERRORS.items(), strict=True)):
        parts.letter(axes, k, label)
        axes.set_xscale("log")
        axes.set(xlim=LIMITS, xlabel="error, %")
        axes.axvspan(DOUBTFUL, LIMITS[1], color=SHADE, lw=0, zorder=0)
        for row in rows:
            median, worst = row[f"{quantity}_error_percent"], row[f"{quantity}_worst_percent"]
            if np.isfinite(median) or np.isposinf(median):
                style, size = method_style(row["method"]), parts.line_look(row["method"])
                at = max(median, LIMITS[0]), median, worst  # what is less stands at the edge
                parts.dot(axes, row["place"], at, LIMITS, style.color, style.marker,
                          size["markersize"])  # fmt: skip
    parts.letter(answers, len(panels), "answered; terms")
    answers.set(xlim=(0, len(methods)), xticks=[])
    for row in rows:
        terms = f"; {row['terms']:.0f}" if row["answered"] else ""
        text = f"{row['answered']} of {row['replicates']}{terms}"
        color = method_style(row["method"]).color
        answers.text(0.1, row["place"], text, va="center", size="x-small", color=color)
    names = [truth.replace(", ", ",\n") for truth in truths]
    for axes in (*panels, answers):
        parts.rows(axes, names)
    parts.legend(figure, *parts.method_keys(methods), columns=len(methods) + 1)
    return figure


def draw_reduction(table: pd.DataFrame) -> Figure:
    """Amplitude, limit cycle and R2 by line: a row for each quantity, a column for each direction.

    table: reduction.csv. The two-mode model is the dashed line; crosses move in another way. R2 is
    that of its displacement in three stretches of the record.
    """
    lines = [name for name in table["line"].unique() if name != TWO_MODES]
    figure, grid = parts.panels(6.0, len(WORTH), 2, sharex=True)
    places = np.arange(len(lines))
    for column, (direction, look) in enumerate(LOOKS.items()):
        values = table[table["direction"] == direction].set_index("line")
        of_lines, last = values.loc[lines], grid[-1, column]
        for row, (quantity, label) in enumerate(WORTH.items()):
            axes = grid[row, column]
            parts.letter(axes, 2 * row + column, direction)
            axes.set_ylabel("" if column else label)
            if axes is last:
                continue
            apart = of_lines[f"{quantity.removesuffix('_m')}_error_percent"].isna().to_numpy()
            height, other = of_lines[quantity].to_numpy(), {"marker": "x"}
            axes.plot(places[~apart], height[~apart], ls="", **look, label=direction)
            axes.plot(places[apart], height[apart], ls="", **look | other, label="another motion")
            two = values.loc[TWO_MODES, quantity]
            axes.axhline(two, color="k", lw=0.8, ls="--", label="two-mode model")
            axes.set_ylim(0, 1.12 * np.nanmax([*height, two]))
        parts.prepare_r2(last, last.get_ylabel(), ticks=(0.0, 0.9, 0.99, 0.999, 0.9999))
        for key, face in STRETCHES.items():
            shade = {"mec": look["color"], "mfc": face or look["color"], "marker": look["marker"]}
            last.plot(places, parts.r2_place(of_lines[key]), ls="", clip_on=False, **shade)
        last.set_xticks(places, lines, rotation=60, ha="right")
    for key, face in STRETCHES.items():
        seconds = key.removeprefix("r2_").removesuffix("_s").replace("_", "-")
        last.plot([], [], "o", mec="k", mfc=face or "k", label=f"$R^2$, {seconds} s")
    parts.legend(figure, columns=4)
    return figure
