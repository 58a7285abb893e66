"""The paper's claims: beside the study's values with verdicts, beside draws of the paper's own
method, at other values of the settings that the paper leaves open, and what its printed numbers
tell of these.
"""

import re
from collections.abc import Mapping, Sequence
from itertools import product
from textwrap import fill

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle
from matplotlib.ticker import NullFormatter

from galloping.figures import parts, style
from galloping.paper.claims import AT_LEAST, AT_MOST, CLAIMS
from galloping.paper.unknowns import FIRST_READING, UNKNOWNS
from galloping.results import PAPER_METHOD

BY_NAME = {claim.name: claim for claim in CLAIMS}
ROW, HEAD = 0.23, 2.9  # inches: height of a claim, room for heads, titles, axes and the legend
VERDICT_LOOKS = {  # marker and colour
    "better": ("^", "#2fa86a"), "reproduced": ("o", "#2fa86a"), "met": ("s", "#2fa86a"),
    "seldom met": ("D", "#e69f00"), "worse": ("v", "#111111"), "not met": ("x", "#111111"),
    "undecided": ("P", style.QUIET), "not run": ("_", "#9a9a9a"),
}  # fmt: skip
TITLES = {  # of claims that share an axis, or, each with a unit of its own, none
    "none": "Structure and order of the errors",
    "error": "Errors (the paper's value, %)",
    "r2": "$R^2$ (at least the paper's value)",
}
BOUNDS = {AT_LEAST: "≥ ", AT_MOST: "≤ "}
OURS = style.method_style(PAPER_METHOD).color  # of draws of the paper's method
BINS = 30
ACROSS = 4
LEAST, LEAST_SHOWN = -12.0, -6.0  # powers of ten: where less probable readings are, the axis
NOT_RUN, NOT_HELD, HELD = "#ffffff", "#d9d9d9", style.MODEL


def _percent_axis(axes: Axes, low: float, high: float, label: str) -> tuple[float, float]:
    """Decades of percent, with a tick each; they are the limits of what is drawn."""
    axes.set_xscale("log")
    ticks = 10.0 ** np.arange(np.log10(low), np.log10(high) + 1)
    axes.set(xlim=(low / 1.5, high * 1.5), xlabel=label)
    axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    return low, high


def draw_claims(table: pd.DataFrame, settings: Mapping) -> Figure:
    """Dots with intervals where claims share a unit, and values with verdicts for all of them.

    table: claims.csv. settings: combinations, the (protocol, method) pairs to show.
    """
    pairs = [tuple(pair) for pair in settings["combinations"]]
    found = table.set_index(["claim", "case", "protocol", "method"]).to_dict("index")
    found = {key: row for key, row in found.items() if key[2:] in pairs}
    groups: dict[str, list] = {axis: [] for axis in TITLES}
    for name, case in dict.fromkeys(key[:2] for key in found):
        claim = BY_NAME[name]
        axis = "error" if claim.is_number else "r2" if claim.is_r2 else "none"
        groups[axis].append((name, case))
    groups = {axis: rows for axis, rows in groups.items() if rows}
    if not groups:
        return parts.nothing_at_all("no claim was tested by these protocols and methods")
    heights = list(map(len, groups.values()))
    figure, grid = parts.panels(
        HEAD + ROW * sum(heights), len(groups), 2, sharey="row", width_ratios=(0.35, 1),
        height_ratios=heights,
    )  # fmt: skip
    for (axis, rows), (dots, cells) in zip(groups.items(), grid, strict=True):
        names = [
            name if case == rows[0][1] else f"{name}, {style.spoken(case)}" for name, case in rows
        ]
        parts.rows(dots, list(map(parts.typeset, names)), lines=False)
        dots.set_title(TITLES[axis], loc="right", weight="bold")
        cells.set_xlim(0, len(pairs) + 1)
        cells.axis("off")
        for k, panel in product(range(0, len(rows), 2), (dots, cells)):
            panel.axhspan(k - 0.5, k + 0.5, color="#f2f2f2", lw=0, zorder=-2)
        _claims(dots, cells, axis, {row: [found.get((*row, *pair)) for pair in pairs]
                                    for row in rows}, pairs)  # fmt: skip
    keys = [parts.key("paper", marker="|", color=style.PAPER, ms=8, mew=1.5)]
    grid[0, 1].text(0.5, -0.7, "paper", ha="center", color=style.PAPER, fontsize="x-small")
    for j, (protocol, method) in enumerate(pairs, start=1):
        own = style.method_style(method)
        words = "\n".join([protocol, *own.label.split(" ")])
        grid[0, 1].text(j, -0.7, words, va="bottom", fontsize="x-small")
        keys.append(parts.key(f"{own.label}, {protocol}", marker=own.marker, mec=own.color, ms=3.5,
                              mfc=own.color if protocol == pairs[0][0] else "white"))  # fmt: skip
    for verdict, (marker, color) in VERDICT_LOOKS.items():
        keys.append(parts.key(verdict, marker=marker, color=color, ms=4.5, mew=1.2))
    parts.legend(figure, *keys, columns=3, handletextpad=0.3)
    return figure


def _claims(
    dots: Axes, cells: Axes, axis: str, rows: Mapping, pairs: Sequence[tuple[str, str]]
) -> None:
    """The paper's value, and of each pair the dot, the value and the verdict's symbol.

    rows: by (claim, case) what was found by each pair, or None. axis: of TITLES.
    """
    limits, place = (1e-2, 1e2), float
    if axis == "error":
        _percent_axis(dots, *limits, "relative error, %")
    elif axis == "r2":
        limits, place = tuple(map(parts.r2_place, parts.R2_LIMITS)), parts.r2_place
        parts.prepare_r2(dots, "$R^2$", vertical=False, ticks=(0, 0.9, 0.99, 0.999))
        dots.tick_params(axis="x", labelsize="x-small")
    else:
        dots.set_xticks([])
        dots.spines[["left", "bottom"]].set_visible(False)
    digits = 4 if axis == "r2" else 3  # 0.9899 must not read 0.99 beside a bound
    for k, ((name, _), found) in enumerate(rows.items()):
        claim = BY_NAME[name]
        text = BOUNDS.get(claim.kind, "") + _number(claim.printed, 4)
        cells.text(0.5, k, text, ha="center", va="center", color=style.PAPER, fontsize="x-small")
        if axis == "none":  # what is compared, in words
            text = parts.typeset(fill(claim.quantity, 28))
            dots.text(0.5, k, text, transform=dots.get_yaxis_transform(), ha="center", va="center",
                      fontsize="x-small", linespacing=1.0)  # fmt: skip
        else:
            dots.plot(place(claim.printed), k, "|", color=style.PAPER, ms=9, mew=1.5, zorder=5)
        for j, ((protocol, method), one) in enumerate(zip(pairs, found, strict=True)):
            if one is None:
                continue
            marker, color = VERDICT_LOOKS[one["verdict"]]
            cells.plot(j + 1.08, k, marker=marker, color=color, ms=4, mew=1.2)
            if one["replicates"]:
                value, share = _number(one["study_value"], digits), f"{100 * one['met_by']:.0f} %"
                cells.text(j + 1.2, k - 0.17, value, va="center", fontsize="x-small")
                cells.text(
                    j + 1.2, k + 0.27, share, va="center", fontsize="xx-small", color=style.QUIET
                )
            if one["replicates"] and axis != "none":
                values = [place(one[name]) for name in ("study_value", "low", "high")]
                own = style.method_style(method)
                parts.dot(dots, k + 0.8 * ((j + 0.5) / len(pairs) - 0.5), values, limits,
                          own.color, own.marker, 2.8, filled=protocol == pairs[0][0],
                          bar={"lw": 0.6})  # fmt: skip


def _number(value: float, digits: int) -> str:
    """A few digits, with true minus and infinity signs."""
    if np.isinf(value):
        return "∞" if value > 0 else "−∞"
    if value and abs(value) < 1e-3:
        return style.scientific(value)
    return f"{value:.{digits}g}".replace("-", "−")


def draw_printed(table: pd.DataFrame, settings: Mapping) -> Figure:
    """Left the printed errors on the draws' 5 to 95 %, right the share of draws that keep a bound.

    table: paper.csv. settings: case, the paper's, that the numbers are about.
    """
    rows = table[(table["case"] == settings["case"]) & table["median"].notna()]
    rows = rows[rows["claim"].isin(BY_NAME) & (rows["role"] == "counted")]
    numbers = rows[[BY_NAME[name].is_number for name in rows["claim"]]]
    bounds = rows[[BY_NAME[name].is_r2 for name in rows["claim"]]]
    if numbers.empty and bounds.empty:
        return parts.nothing_at_all("the paper's claims are not judged in this study")
    height = 0.9 + 0.22 * max(len(numbers), len(bounds))
    figure, ((left, right),) = parts.panels(height, 1, 2, width_ratios=(1.1, 1))
    parts.letter(left, 0, "errors that the paper prints")
    limits = _percent_axis(left, 1e-2, 1e3, "error, %")
    for k, row in enumerate(numbers.itertuples()):
        bar = {"lw": 3.0, "alpha": 0.45}
        parts.dot(left, k, (row.median, row.low, row.high), limits, OURS, "o", 4, bar=bar)
        if row.high > limits[1]:
            left.plot(limits[1], k, ">", color=OURS, ms=4, clip_on=False)
        left.plot(row.printed, k, "*", color=style.PAPER, ms=8, mew=0, zorder=5)
    parts.rows(left, [_short(name) for name in numbers["claim"]], lines=False)
    parts.letter(right, 1, "draws that keep a bound")
    columns = ["share_of_draws", "share_low", "share_high"]
    shares, low, high = 100 * bounds[columns].to_numpy(float).T
    right.barh(np.arange(len(bounds)), shares, height=0.55, color=OURS, alpha=0.45)
    right.hlines(np.arange(len(bounds)), low, high, color=OURS, lw=1.0)
    for k, share in enumerate(shares):
        right.text(high[k] + 1.5, k, f"{share:.0f} %", va="center", fontsize="small")
    right.axvline(50, color="#8a8a8a", lw=0.6, ls=":")
    right.set(xlim=(0, 112), xticks=[0, 25, 50, 75, 100], xlabel="share of the draws, %")
    names = zip(bounds["claim"], bounds["printed"], strict=True)
    parts.rows(
        right, [_short(name.replace("R2", f"R2 ≥ {bound:g}", 1)) for name, bound in names],
        lines=False,
    )  # fmt: skip
    star = parts.key("printed in the paper", marker="*", color=style.PAPER, ms=8, mew=0)
    ours = "draws of the paper's method: median, 5 to 95 %"
    dot = parts.key(ours, color=OURS, marker="o", ms=4, ls="-")
    parts.legend(figure, star, dot)
    return figure


def _short(name: str) -> str:
    for long, short in (("mean error of ", ""), ("amplitude error", "amplitude"),
                        (" (first abstract)", ", abstract")):  # fmt: skip
        name = name.replace(long, short)
    return parts.typeset(name)


def draw_reproduction(table: pd.DataFrame, settings: Mapping) -> Figure:
    """A row for each claim, a column for each value, one block for each parameter.

    table: reproduction.csv. settings: labels, of the parameters, by name in their order.
    """
    if table.empty:
        return parts.nothing_at_all("this study varies no parameter of the paper's line")
    names = [name for name in settings["labels"] if name in set(table["parameter"])]
    claims = list(dict.fromkeys(table["claim"]))
    widths = [table[table["parameter"] == name]["value"].nunique() for name in names]
    height = 1.3 + 0.17 * len(claims)
    figure, (panes,) = parts.panels(height, 1, len(names), sharey=True, width_ratios=widths)
    parts.rows(panes[0], list(map(parts.typeset, claims)), lines=False)
    panes[0].set_ylim(len(claims) - 0.5, -1.5)
    for axes, name in zip(panes, names, strict=True):
        block = table[table["parameter"] == name]
        values = list(dict.fromkeys(block["value"]))
        state = np.where(block["verdict"] == "not run", 0, np.where(block["held"], 2, 1))
        grid = block.assign(state=state).pivot(index="claim", columns="value", values="state")
        axes.pcolormesh(
            np.arange(len(values)), np.arange(len(claims)), grid.loc[claims, values].to_numpy(),
            cmap=ListedColormap((NOT_RUN, NOT_HELD, HELD)), vmin=-0.5, vmax=2.5, ec="white", lw=1.0,
            shading="nearest",
        )  # fmt: skip
        axes.set_xticks(np.arange(len(values)), [f"{value:g}" for value in values], rotation=90)
        axes.tick_params(length=0)
        axes.spines[:].set_visible(False)
        axes.set_title(settings["labels"][name], loc="left")
        own = set(block.loc[block["default"], "value"])
        met = block[block["held"]].groupby("value")["claim"].size()
        for k, value in enumerate(values):
            axes.text(k, -0.7, str(met.get(value, 0)), ha="center", va="bottom", size="small")
            if value in own:
                frame = (k - 0.5, -0.5), 1, len(claims)
                axes.add_patch(Rectangle(*frame, fill=False, ec=style.PAPER, lw=1.2, zorder=4))
    squares = Patch(fc=HELD, label="holds"), Patch(fc=NOT_HELD, label="does not hold")
    title = "framed: the study's value; above: how many claims hold"
    parts.legend(figure, *squares, columns=2, loc="outside lower center", title=title)
    return figure


def draw_region(samples: pd.DataFrame, readings: pd.DataFrame) -> Figure:
    """Draw the posterior of each unknown number, and the evidence of every reading.

    samples: of `tables.inference.region_samples`, readings: of `paper_readings`.
    """
    rows = -(-len(UNKNOWNS) // ACROSS)
    bars = 0.17 * len(readings)
    heights = [*([1.35] * rows), bars + 0.4]
    figure = Figure(figsize=(style.DOUBLE, sum(heights) + 0.5), layout="constrained")
    upper, lower = figure.subfigures(2, 1, height_ratios=[sum(heights[:-1]) + 0.5, heights[-1]])
    tried = samples[samples["stage"] == "tried"]
    best = readings.set_index("reading").loc[FIRST_READING.name]
    looks = {
        "all": {"color": style.MODEL, "histtype": "stepfilled", "label": "by all that is printed"},
        "amplitudes": {"edgecolor": style.BAND, "histtype": "step", "lw": 1.6,
                       "label": "without the errors of the amplitude"},
    }  # fmt: skip
    for k, unknown in enumerate(UNKNOWNS):
        axes = upper.add_subplot(rows, ACROSS, k + 1)
        parts.letter(axes, k, unknown.label)
        bins = np.geomspace(unknown.low, unknown.high, BINS + 1)
        for known, look in looks.items():
            axes.hist(tried[unknown.name], weights=tried[f"weight_{known}"], bins=bins, **look)
        axes.axvline(best[unknown.name], color=style.PAPER, lw=1.0, label="most probable setting")
        axes.set_xscale("log")
        axes.xaxis.set_minor_formatter(NullFormatter())
        unit = unknown.unit if unknown.unit != "1" else "ratio" if unknown.path else "SI units"
        axes.set(xlim=(unknown.low, unknown.high), yticks=[], xlabel=unit)
    upper.legend(*axes.get_legend_handles_labels(), loc="outside upper center", ncols=3)
    axes = lower.subplots()
    parts.letter(axes, len(UNKNOWNS), "evidence of each reading, relative to the first")
    powers = np.maximum(readings["power_of_ten"].to_numpy(float), LEAST)
    axes.axvline(0, color=style.QUIET, lw=0.6)
    axes.errorbar(powers, np.arange(len(readings)), xerr=2 * readings["standard_error"], fmt="o",
                  ms=3.5, color=style.MODEL, elinewidth=1.0)  # fmt: skip
    for k, row in enumerate(readings.itertuples()):
        end = powers[k] + 2 * row.standard_error
        axes.text(end + 0.15, k, row.verdict, va="center", size="small")
    parts.rows(axes, list(map(_symbols, readings["reading"])), lines=False)
    axes.set(xlim=(min(LEAST_SHOWN, powers.min() - 1), max(2.0, powers.max() + 2.5)),
             xlabel="power of ten by which a reading is more probable than the first, "
                    "± 2 standard errors")  # fmt: skip
    return figure


def _symbols(reading: str) -> str:
    """The name of a reading with its coefficients as symbols: `beta2 minus 0.1` as beta_2 -0.1."""
    return re.sub(r"\b(beta|eta)(\d)", r"$\\\1_\2$", reading.replace("minus ", "\N{MINUS SIGN}"))
