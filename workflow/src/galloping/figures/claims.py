"""The paper's claims beside the study's values, grouped by kind, with their verdicts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from textwrap import fill

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from galloping.figures import panels
from galloping.figures.style import DOUBLE, PAPER, STATE_LABELS, method_style, scientific, spoken
from galloping.paper.printed import AT_LEAST, AT_MOST, CLAIMS

ROW, HEAD = 0.23, 1.25  # inches: height of a claim, room for the heads and the legend
GAPS = {"none": 0.36, "error": 0.66, "r2": 0.66}  # below a group: its axis, the next one's title
VERDICT_LOOKS = {  # marker and colour
    "better": ("^", "#2fa86a"),
    "reproduced": ("o", "#2fa86a"),
    "met": ("s", "#2fa86a"),
    "seldom met": ("D", "#e69f00"),
    "worse": ("v", "#111111"),
    "not met": ("x", "#111111"),
    "undecided": ("P", "#5f5f5f"),
    "not run": ("_", "#9a9a9a"),
}
DOTS, CELLS = (0.352, 0.165), (0.53, 0.47)  # of the figure's width: left, width
ERROR_LIMITS = (1e-2, 1e2)  # percent
BOUNDS = {AT_LEAST: "≥ ", AT_MOST: "≤ "}


@dataclass(frozen=True)
class Group:
    """Claims that share one axis; `axis` is error, r2 or none."""

    title: str
    axis: str
    rows: list[tuple[str, str]]  # claim, case


def draw_claims(table: pd.DataFrame, settings: Mapping) -> Figure:
    """Dots with intervals where claims share a unit, and values with verdicts for all of them.

    table: claims.csv. settings: combinations, the (protocol, method) pairs to show.
    """
    pairs = [tuple(pair) for pair in settings["combinations"]]
    ran = zip(table["protocol"], table["method"], strict=True)
    shown = table[np.array([pair in pairs for pair in ran], bool)]
    groups = [group for group in _groups(shown) if group.rows]
    if not groups:
        figure = Figure(figsize=(DOUBLE, 2))
        panels.nothing(figure.subplots(), "no claim was tested by these protocols and methods")
        return figure
    height = HEAD + sum(ROW * len(group.rows) + GAPS[group.axis] for group in groups) - 0.15
    figure = Figure(figsize=(DOUBLE, height))
    top = height - HEAD
    for group in groups:
        tall = ROW * len(group.rows)
        box = (top - tall) / height, tall / height
        dots = figure.add_axes((DOTS[0], box[0], DOTS[1], box[1]))
        cells = figure.add_axes((CELLS[0], box[0], CELLS[1], box[1]), sharey=dots)
        _labels(dots, group)
        _dots(dots, shown, group, pairs)
        _cells(cells, shown, group, pairs)
        figure.text(0.01, (top + 0.06) / height, group.title, weight="bold", va="bottom")
        top -= tall + GAPS[group.axis]
    _heads(figure, pairs, height, CELLS)
    return figure


def _groups(table: pd.DataFrame) -> list[Group]:
    about = {claim.name: claim for claim in CLAIMS}
    rows: dict[str, list] = {"error": [], "r2": [], "none": []}
    for name, case in dict.fromkeys(zip(table["claim"], table["case"], strict=True)):
        claim = about.get(name)
        if claim and claim.is_number:
            rows["error"].append((name, case))
        elif claim and claim.column.startswith("r2_") and not claim.minus:
            rows["r2"].append((name, case))
        else:
            rows["none"].append((name, case))
    return [
        Group("Structure and order of the errors", "none", rows["none"]),
        Group("Errors (the paper's value, %)", "error", rows["error"]),
        Group("$R^2$ (at least the paper's value)", "r2", rows["r2"]),
    ]


def _labels(axes: Axes, group: Group) -> None:
    names = []
    first = group.rows[0][1]
    for name, case in group.rows:
        text = _typeset(name)
        names.append(text if case == first else f"{text}, {spoken(case)}")
    axes.set_yticks(range(len(names)), names)
    axes.tick_params(axis="y", length=0, pad=4)
    axes.set_ylim(len(names) - 0.5, -0.5)
    for k in range(0, len(names), 2):
        axes.axhspan(k - 0.5, k + 0.5, color="#f2f2f2", lw=0, zorder=-2)


def _typeset(text: str) -> str:
    """R2, q_v and q_w as symbols."""
    for plain, symbol in (("R2", "$R^2$"), *STATE_LABELS.items(), ("percent points", "% points")):
        text = text.replace(plain, symbol)
    return text


def _of(table: pd.DataFrame, row: tuple[str, str], pair: tuple[str, str]) -> pd.Series | None:
    chosen = table[
        (table["claim"] == row[0])
        & (table["case"] == row[1])
        & (table["protocol"] == pair[0])
        & (table["method"] == pair[1])
    ]
    return None if chosen.empty else chosen.iloc[0]


def _dots(axes: Axes, table: pd.DataFrame, group: Group, pairs: list[tuple[str, str]]) -> None:
    if group.axis == "none":
        _quantities(axes, table, group)
        return
    if group.axis == "error":
        limits, place = ERROR_LIMITS, float
        axes.set_xscale("log")
        axes.set(xlim=(limits[0] / 1.5, limits[1] * 1.5), xlabel="relative error, %")
        axes.set_xticks([0.01, 0.1, 1, 10, 100], ["0.01", "0.1", "1", "10", "100"])
    else:
        limits, place = tuple(map(panels.r2_place, panels.R2_LIMITS)), panels.r2_place
        panels.prepare_r2(axes, "$R^2$", vertical=False)
        ticks = (0, 0.9, 0.99, 0.999)
        axes.set_xticks(panels.r2_place(ticks), ["≤ 0", "0.9", "0.99", "0.999"], fontsize="x-small")
    for k, row in enumerate(group.rows):
        for j, pair in enumerate(pairs):
            found = _of(table, row, pair)
            if found is None:
                continue
            axes.plot(place(found["paper_value"]), k, "|", color=PAPER, ms=9, mew=1.5, zorder=5)
            if found["replicates"]:
                values = [place(found[name]) for name in ("low", "study_value", "high")]
                y = k + 0.8 * ((j + 0.5) / len(pairs) - 0.5)
                _dot(axes, y, values, limits, pair[1], filled=pair[0] == pairs[0][0])


def _quantities(axes: Axes, table: pd.DataFrame, group: Group) -> None:
    """What is compared, in words, where every claim has a unit of its own."""
    axes.set_xticks([])
    for side in ("left", "bottom"):
        axes.spines[side].set_visible(False)
    for k, (name, case) in enumerate(group.rows):
        found = table[(table["claim"] == name) & (table["case"] == case)].iloc[0]
        axes.text(
            0.5, k, _typeset(fill(found["quantity"], 26)),
            transform=axes.get_yaxis_transform(), ha="center", va="center",
            fontsize="x-small", linespacing=1.0,
        )  # fmt: skip


def _dot(
    axes: Axes, y: float, values: list[float], limits: tuple[float, float], method: str,
    filled: bool,
) -> None:  # fmt: skip
    """Low, median and high; a median off the axis is an arrowhead at its end."""
    style = method_style(method)
    low, median, high = np.clip(values, *limits)
    marker = style.marker
    if values[1] < limits[0]:
        marker = "<"
    elif values[1] > limits[1]:
        marker = ">"
    axes.hlines(y, low, high, color=style.color, lw=0.6)
    axes.plot(
        median, y, marker=marker, ms=2.8, mfc=style.color if filled else "white",
        mec=style.color, mew=0.6, zorder=4,
    )  # fmt: skip


def _cells(axes: Axes, table: pd.DataFrame, group: Group, pairs: list[tuple[str, str]]) -> None:
    """The paper's value, and ours with the verdict's symbol for each combination."""
    axes.set_xlim(0, len(pairs) + 1)
    axes.tick_params(left=False, labelleft=False)
    axes.set_xticks([])
    for spine in axes.spines.values():
        spine.set_visible(False)
    for k in range(0, len(group.rows), 2):
        axes.axhspan(k - 0.5, k + 0.5, color="#f2f2f2", lw=0, zorder=-2)
    digits = 4 if group.axis == "r2" else 3  # 0.9899 must not read 0.99 beside a bound
    kinds = {claim.name: BOUNDS.get(claim.kind, "") for claim in CLAIMS}
    for k, row in enumerate(group.rows):
        printed = table[(table["claim"] == row[0]) & (table["case"] == row[1])]["paper_value"]
        axes.text(
            0.5, k, kinds.get(row[0], "") + _number(printed.iloc[0], 4), ha="center", va="center",
            color=PAPER, fontsize="x-small",
        )  # fmt: skip
        for j, pair in enumerate(pairs, start=1):
            found = _of(table, row, pair)
            if found is None:
                continue
            marker, color = VERDICT_LOOKS[found["verdict"]]
            axes.plot(j + 0.08, k, marker=marker, color=color, ms=4, mew=1.2)
            if found["replicates"]:
                axes.text(
                    j + 0.2, k - 0.17, _number(found["study_value"], digits), va="center",
                    fontsize="x-small",
                )  # fmt: skip
                axes.text(
                    j + 0.2, k + 0.27, f"{100 * found['met_by']:.0f} %", va="center",
                    fontsize="xx-small", color="#5f5f5f",
                )  # fmt: skip


def _number(value: float, digits: int = 3) -> str:
    """A few digits, with true minus and infinity signs."""
    if np.isinf(value):
        return "∞" if value > 0 else "−∞"
    if value and abs(value) < 1e-3:
        return scientific(value)
    return f"{value:.{digits}g}".replace("-", "−")


def _heads(figure: Figure, pairs: list[tuple[str, str]], height: float, place: tuple) -> None:
    """Column heads above the cells, and the legend of the dots and verdicts."""
    left, width = place
    step = width / (len(pairs) + 1)
    y = (height - HEAD + 0.06) / height
    figure.text(left + step / 2, y, "paper", ha="center", color=PAPER, fontsize="small")
    entries = [Line2D([], [], ls="", marker="|", color=PAPER, ms=8, mew=1.5, label="paper")]
    for j, (protocol, method) in enumerate(pairs, start=1):
        style = method_style(method)
        name = style.label.replace(" ", "\n")
        text = f"{protocol}\n{name}"
        figure.text(left + j * step, y + 0.4 / height, text, va="top", fontsize="x-small")
        face = style.color if protocol == pairs[0][0] else "white"
        entries.append(
            Line2D([], [], ls="", marker=style.marker, mfc=face, mec=style.color, ms=3.5,
                   label=f"{style.label}, {protocol}")
        )  # fmt: skip
    entries += [
        Line2D([], [], ls="", marker=marker, color=color, ms=4.5, mew=1.2, label=verdict)
        for verdict, (marker, color) in VERDICT_LOOKS.items()
    ]
    figure.legend(handles=entries, loc="upper left", ncols=3, columnspacing=1.2, handletextpad=0.3)
