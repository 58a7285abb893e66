"""The paper's claims: beside the study's values with verdicts, beside draws of the paper's own
method, at other values of the settings that the paper leaves open, and what its printed numbers
tell of these.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from textwrap import fill

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle
from matplotlib.ticker import NullFormatter

from galloping.figures import parts
from galloping.figures.style import (
    BAND,
    DOUBLE,
    MODEL,
    PAPER,
    QUIET,
    method_style,
    scientific,
    spoken,
)
from galloping.paper.claims import AT_LEAST, AT_MOST, CLAIMS, Claim
from galloping.paper.unknowns import BASE, UNKNOWNS, Unknown
from galloping.results import PAPER_METHOD

BY_NAME = {claim.name: claim for claim in CLAIMS}
ROW, HEAD = 0.23, 1.25  # inches: height of a claim, room for the heads and the legend
VERDICT_LOOKS = {  # marker and colour
    "better": ("^", "#2fa86a"), "reproduced": ("o", "#2fa86a"), "met": ("s", "#2fa86a"),
    "seldom met": ("D", "#e69f00"), "worse": ("v", "#111111"), "not met": ("x", "#111111"),
    "undecided": ("P", QUIET), "not run": ("_", "#9a9a9a"),
}  # fmt: skip
DOTS, CELLS = (0.352, 0.165), (0.53, 0.47)  # of the figure's width: left, width
BOUNDS = {AT_LEAST: "≥ ", AT_MOST: "≤ "}
OURS = method_style(PAPER_METHOD).color  # of draws of the paper's method
BINS = 30
ACROSS = 4
LEAST = -12.0  # power of ten: readings that are less probable end there
NOT_RUN, NOT_HELD, HELD = "#ffffff", "#d9d9d9", MODEL


def _percent_axis(axes: Axes, low: float, high: float, label: str) -> tuple[float, float]:
    """Decades of percent, with a tick each; they are the limits of what is drawn."""
    axes.set_xscale("log")
    ticks = 10.0 ** np.arange(np.log10(low), np.log10(high) + 1)
    axes.set(xlim=(low / 1.5, high * 1.5), xlabel=label)
    axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    return low, high


def _is_r2(claim: Claim) -> bool:
    return claim.column.startswith("r2_") and not claim.minus


# --- every method ---


@dataclass(frozen=True)
class Group:
    """Claims that share one axis; `axis` is error, r2 or none. rows: (claim, case)."""

    title: str
    axis: str
    rows: list[tuple[str, str]]

    @property
    def gap(self) -> float:
        """Below it, in inches: its axis, and the title of the next one."""
        return 0.36 if self.axis == "none" else 0.66


def draw_claims(table: pd.DataFrame, settings: Mapping) -> Figure:
    """Dots with intervals where claims share a unit, and values with verdicts for all of them.

    table: claims.csv. settings: combinations, the (protocol, method) pairs to show.
    """
    pairs = [tuple(pair) for pair in settings["combinations"]]
    shown = table.set_index(["protocol", "method"])
    shown = shown[shown.index.isin(pairs)].reset_index()
    groups = _groups(shown)
    if not groups:
        return parts.nothing_at_all("no claim was tested by these protocols and methods")
    found = shown.set_index(["claim", "case", "protocol", "method"]).to_dict("index")
    height = HEAD + sum(ROW * len(group.rows) + group.gap for group in groups) - 0.15
    figure = Figure(figsize=(DOUBLE, height))
    top = height - HEAD
    for group in groups:
        tall = ROW * len(group.rows)
        box = (top - tall) / height, tall / height
        dots = figure.add_axes((DOTS[0], box[0], DOTS[1], box[1]))
        cells = figure.add_axes((CELLS[0], box[0], CELLS[1], box[1]), sharey=dots)
        first = group.rows[0][1]
        names = [name if case == first else f"{name}, {spoken(case)}" for name, case in group.rows]
        parts.rows(dots, list(map(parts.typeset, names)), lines=False)
        dots.tick_params(axis="y", pad=4)
        for axes in (dots, cells):
            for k in range(0, len(group.rows), 2):
                axes.axhspan(k - 0.5, k + 0.5, color="#f2f2f2", lw=0, zorder=-2)
        if group.axis == "none":
            _quantities(dots, group)
        else:
            _dots(dots, found, group, pairs)
        _cells(cells, found, group, pairs)
        figure.text(0.01, (top + 0.06) / height, group.title, weight="bold", va="bottom")
        top -= tall + group.gap
    _heads(figure, pairs, height)
    return figure


def _groups(table: pd.DataFrame) -> list[Group]:
    rows: dict[str, list] = {"none": [], "error": [], "r2": []}
    for name, case in dict.fromkeys(zip(table["claim"], table["case"], strict=True)):
        claim = BY_NAME[name]
        rows["error" if claim.is_number else "r2" if _is_r2(claim) else "none"].append((name, case))
    titles = {"none": "Structure and order of the errors", "error": "Errors (the paper's value, %)",
              "r2": "$R^2$ (at least the paper's value)"}  # fmt: skip
    return [Group(titles[axis], axis, of) for axis, of in rows.items() if of]


def _dots(axes: Axes, found: Mapping, group: Group, pairs: Sequence[tuple[str, str]]) -> None:
    if group.axis == "error":
        limits, place = _percent_axis(axes, 1e-2, 1e2, "relative error, %"), float
    else:
        limits, place = tuple(map(parts.r2_place, parts.R2_LIMITS)), parts.r2_place
        parts.prepare_r2(axes, "$R^2$", vertical=False, ticks=(0, 0.9, 0.99, 0.999))
        axes.tick_params(axis="x", labelsize="x-small")
    for k, row in enumerate(group.rows):
        for j, pair in enumerate(pairs):
            one = found.get((*row, *pair))
            if one is None:
                continue
            axes.plot(place(one["paper_value"]), k, "|", color=PAPER, ms=9, mew=1.5, zorder=5)
            if one["replicates"]:
                values = [place(one[name]) for name in ("study_value", "low", "high")]
                style = method_style(pair[1])
                parts.dot(axes, k + 0.8 * ((j + 0.5) / len(pairs) - 0.5), values, limits,
                          style.color, style.marker, 2.8, filled=pair[0] == pairs[0][0],
                          bar={"lw": 0.6})  # fmt: skip


def _quantities(axes: Axes, group: Group) -> None:
    """What is compared, in words, where every claim has a unit of its own."""
    axes.set_xticks([])
    axes.spines[["left", "bottom"]].set_visible(False)
    for k, (name, _) in enumerate(group.rows):
        text = parts.typeset(fill(BY_NAME[name].quantity, 26))
        axes.text(0.5, k, text, transform=axes.get_yaxis_transform(), ha="center", va="center",
                  fontsize="x-small", linespacing=1.0)  # fmt: skip


def _cells(axes: Axes, found: Mapping, group: Group, pairs: Sequence[tuple[str, str]]) -> None:
    """The paper's value, and ours with the verdict's symbol for each combination."""
    axes.set(xlim=(0, len(pairs) + 1), xticks=[])
    axes.tick_params(left=False, labelleft=False)
    axes.spines[:].set_visible(False)
    digits = 4 if group.axis == "r2" else 3  # 0.9899 must not read 0.99 beside a bound
    for k, row in enumerate(group.rows):
        claim = BY_NAME[row[0]]
        text = BOUNDS.get(claim.kind, "") + _number(claim.paper_value, 4)
        axes.text(0.5, k, text, ha="center", va="center", color=PAPER, fontsize="x-small")
        for j, pair in enumerate(pairs, start=1):
            one = found.get((*row, *pair))
            if one is None:
                continue
            marker, color = VERDICT_LOOKS[one["verdict"]]
            axes.plot(j + 0.08, k, marker=marker, color=color, ms=4, mew=1.2)
            if one["replicates"]:
                value, share = _number(one["study_value"], digits), f"{100 * one['met_by']:.0f} %"
                axes.text(j + 0.2, k - 0.17, value, va="center", fontsize="x-small")
                axes.text(j + 0.2, k + 0.27, share, va="center", fontsize="xx-small", color=QUIET)


def _number(value: float, digits: int) -> str:
    """A few digits, with true minus and infinity signs."""
    if np.isinf(value):
        return "∞" if value > 0 else "−∞"
    if value and abs(value) < 1e-3:
        return scientific(value)
    return f"{value:.{digits}g}".replace("-", "−")


def _heads(figure: Figure, pairs: Sequence[tuple[str, str]], height: float) -> None:
    """Column heads above the cells, and the legend of the dots and verdicts."""
    left, step = CELLS[0], CELLS[1] / (len(pairs) + 1)
    y = (height - HEAD + 0.06) / height
    figure.text(left + step / 2, y, "paper", ha="center", color=PAPER, fontsize="small")
    keys = [parts.key("paper", marker="|", color=PAPER, ms=8, mew=1.5)]
    for j, (protocol, method) in enumerate(pairs, start=1):
        style = method_style(method)
        words = "\n".join([protocol, *style.label.split(" ")])
        figure.text(left + j * step, y + 0.4 / height, words, va="top", fontsize="x-small")
        face = style.color if protocol == pairs[0][0] else "white"
        label = f"{style.label}, {protocol}"
        keys.append(parts.key(label, marker=style.marker, mfc=face, mec=style.color, ms=3.5))
    for verdict, (marker, color) in VERDICT_LOOKS.items():
        keys.append(parts.key(verdict, marker=marker, color=color, ms=4.5, mew=1.2))
    figure.legend(handles=keys, loc="upper left", ncols=3, columnspacing=1.2, handletextpad=0.3)


# --- the paper's own method ---


def draw_printed(table: pd.DataFrame, settings: Mapping) -> Figure:
    """Left the printed errors on the draws' 5 to 95 %, right the share of draws that keep a bound.

    table: paper.csv. settings: case, the paper's, that the numbers are about.
    """
    rows = table[(table["case"] == settings["case"]) & table["median"].notna()]
    rows = rows[rows["claim"].isin(BY_NAME)]
    numbers = rows[[BY_NAME[name].is_number for name in rows["claim"]]]
    bounds = rows[[_is_r2(BY_NAME[name]) for name in rows["claim"]]]
    if numbers.empty and bounds.empty:
        return parts.nothing_at_all("the paper's claims are not judged in this study")
    height = 0.9 + 0.22 * max(len(numbers), len(bounds))
    figure = Figure(figsize=(DOUBLE, height), layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=(1.1, 1))
    parts.letter(left, 0, "errors that the paper prints")
    limits = _percent_axis(left, 1e-2, 1e3, "error, %")
    for k, row in enumerate(numbers.itertuples()):
        bar = {"lw": 3.0, "alpha": 0.45}
        parts.dot(left, k, (row.median, row.low, row.high), limits, OURS, "o", 4, bar=bar)
        if row.high > limits[1]:
            left.plot(limits[1], k, ">", color=OURS, ms=4, clip_on=False)
        left.plot(row.printed, k, "*", color=PAPER, ms=8, mew=0, zorder=5)
    parts.rows(left, [_short(name) for name in numbers["claim"]], lines=False)
    parts.letter(right, 1, "draws that keep a bound")
    shares = 100 * bounds["share_of_draws"].to_numpy(float)
    right.barh(np.arange(len(bounds)), shares, height=0.55, color=OURS, alpha=0.45)
    for k, share in enumerate(shares):
        right.text(share + 1.5, k, f"{share:.0f} %", va="center", fontsize="small")
    right.axvline(50, color="#8a8a8a", lw=0.6, ls=":")
    right.set(xlim=(0, 112), xticks=[0, 25, 50, 75, 100], xlabel="share of the draws, %")
    names = zip(bounds["claim"], bounds["printed"], strict=True)
    parts.rows(
        right, [_short(name.replace("R2", f"R2 ≥ {bound:g}", 1)) for name, bound in names],
        lines=False,
    )  # fmt: skip
    star = parts.key("printed in the paper", marker="*", color=PAPER, ms=8, mew=0)
    ours = "draws of the paper's method: median, 5 to 95 %"
    dot = parts.key(ours, color=OURS, marker="o", ms=4, ls="-")
    parts.legend(figure, star, dot)
    return figure


def _short(name: str) -> str:
    for long, short in (("mean error of ", ""), ("amplitude error", "amplitude"),
                        (" (first abstract)", ", abstract")):  # fmt: skip
        name = name.replace(long, short)
    return parts.typeset(name)


# --- other settings ---


def draw_reproduction(table: pd.DataFrame, settings: Mapping) -> Figure:
    """A row for each claim, a column for each value, one block for each parameter.

    table: reproduction.csv. settings: labels, of the parameters, by name in their order.
    """
    if table.empty:
        return parts.nothing_at_all("this study varies no parameter of the paper's line")
    names = [name for name in settings["labels"] if name in set(table["parameter"])]
    claims = list(dict.fromkeys(table["claim"]))
    widths = [table[table["parameter"] == name]["value"].nunique() for name in names]
    figure = Figure(figsize=(DOUBLE, 1.3 + 0.17 * len(claims)), layout="constrained")
    panes = figure.subplots(1, len(names), sharey=True, squeeze=False, width_ratios=widths)[0]
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
                axes.add_patch(Rectangle(*frame, fill=False, ec=PAPER, lw=1.2, zorder=4))
    squares = Patch(fc=HELD, label="holds"), Patch(fc=NOT_HELD, label="does not hold")
    title = "framed: the study's value; above: how many claims hold"
    parts.legend(figure, *squares, columns=2, loc="outside lower center", title=title)
    return figure


# --- what the paper leaves out ---


def draw_region(samples: pd.DataFrame, readings: pd.DataFrame) -> Figure:
    """A panel for each unknown number, and one of all readings.

    samples: of `tables.inference.region_samples`, readings: of `readings`.
    """
    rows = -(-len(UNKNOWNS) // ACROSS)
    bars = 0.17 * len(readings)
    heights = [*([1.35] * rows), bars + 0.4]
    figure = Figure(figsize=(DOUBLE, sum(heights) + 0.5), layout="constrained")
    upper, lower = figure.subfigures(2, 1, height_ratios=[sum(heights[:-1]) + 0.5, heights[-1]])
    drawn = samples[samples["kind"] == "setting"]
    best = readings.set_index("reading").loc[BASE.name]
    for k, unknown in enumerate(UNKNOWNS):
        axes = upper.add_subplot(rows, ACROSS, k + 1)
        parts.letter(axes, k, unknown.label)
        _histograms(axes, unknown, drawn, best[unknown.name])
    upper.legend(*axes.get_legend_handles_labels(), loc="outside upper center", ncols=3)
    axes = lower.subplots()
    parts.letter(axes, len(UNKNOWNS), "readings of the paper, beside the first")
    _bars(axes, readings)
    return figure


def _histograms(axes: Axes, unknown: Unknown, drawn: pd.DataFrame, best: float) -> None:
    edges = np.geomspace(unknown.low, unknown.high, BINS + 1)
    looks = {
        "log_probability": {"color": MODEL, "histtype": "stepfilled", "label": "all numbers"},
        "without_amplitudes": {
            "edgecolor": BAND, "histtype": "step", "lw": 1.6,
            "label": "without the errors of the amplitude",
        },
    }  # fmt: skip
    for known, look in looks.items():
        axes.hist(drawn.loc[drawn["known"] == known, unknown.name], bins=edges, **look)
    axes.axvline(best, color=PAPER, lw=1.0, label="most probable setting")
    axes.set_xscale("log")
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_xlim(unknown.low, unknown.high)
    axes.set_yticks([])
    axes.set_xlabel("SI units" if unknown.unit == "1" and not unknown.path else
                    "ratio" if unknown.unit == "1" else unknown.unit)  # fmt: skip


def _symbols(reading: str) -> str:
    """The name of a reading with its coefficients as symbols: `beta2 minus 0.1` as beta_2 -0.1."""
    return re.sub(r"\b(beta|eta)(\d)", r"$\\\1_\2$", reading.replace("minus ", "\N{MINUS SIGN}"))


def _bars(axes: Axes, readings: pd.DataFrame) -> None:
    places = np.arange(len(readings))
    powers = readings["power_of_ten"].to_numpy(float)
    shown = np.clip(np.where(np.isfinite(powers), powers, LEAST), LEAST, None)
    axes.barh(places, shown - LEAST, left=LEAST, height=0.65, color=MODEL)
    for place, power, verdict in zip(places, powers, readings["verdict"], strict=True):
        number = f"{power:.1f}, " if np.isfinite(power) else ""
        axes.text(max(power, LEAST) + 0.15 if np.isfinite(power) else LEAST + 0.15, place,
                  f"{number}{verdict}", va="center", size="small")  # fmt: skip
    axes.set_yticks(places, [_symbols(reading) for reading in readings["reading"]])
    axes.tick_params(axis="y", length=0)
    axes.set_ylim(len(readings) - 0.4, -0.6)
    axes.set_xlim(LEAST, max(2.0, np.nanmax(powers) + 2.0))
    axes.set_xlabel("power of ten by which a reading is more probable than the first")
