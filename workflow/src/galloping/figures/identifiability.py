"""Which terms the recordings can tell, and which they cannot."""

from __future__ import annotations

from collections.abc import Mapping
from textwrap import fill

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from galloping.bounds.identifiable import IDENTIFIABLE
from galloping.figures import panels
from galloping.figures.style import DOUBLE, protocol_style, spoken
from galloping.physics.equations import EQUATIONS, STATES, TERMS
from galloping.polynomial import term_name

ACROSS, TITLE_WIDTH = 4, 20  # panels beside each other; letters in a line of their titles
LEAST = 1e3  # times below the limit: what is less stands at the edge
SYMBOLS = {  # of the paper, by equation and term
    (EQUATIONS[row], term_name(exponents, STATES)): symbol
    for symbol, (row, exponents) in TERMS.items()
}


def draw_identifiability(table: pd.DataFrame, settings: Mapping) -> Figure:
    """t = |c| / bound of each term, a panel for each case, at most ACROSS beside each other.

    Symbols stand at the noise level closest to the wanted one, bars reach over all levels; open
    symbols are several recordings together.
    table: identifiability.csv. settings: cases, protocols; level, the wanted one.
    """
    whole = table[table["points"] == table["points"].max()]
    # a continuous line has no true coefficients, and so nothing to identify
    whole = whole[whole.groupby("case")["t"].transform("count") > 0]
    present = set(zip(whole["equation"], whole["term"], strict=True))
    terms = [term for term in SYMBOLS if term in present]
    count = -(-len(settings["cases"]) // ACROSS)
    rows, height = panels.fitting(range(count), 1.2, 0.24 * max(len(terms), 6))
    cases = settings["cases"][: ACROSS * len(rows)]
    figure = Figure(figsize=(DOUBLE, height), layout="constrained")
    across = -(-len(cases) // len(rows))
    grid = figure.subplots(len(rows), across, squeeze=False, sharex=True, sharey=True)
    if not terms:
        for axes in grid.flat:
            panels.nothing(axes, "this study has no bound\non noisy recordings")
        return figure
    for axes in grid.flat[len(cases) :]:
        axes.remove()
    for axes in grid.flat[len(cases) - across : -across]:  # with no panel below that has the labels
        axes.tick_params(labelbottom=True)
    joint = False
    for k, (case, axes) in enumerate(zip(cases, grid.flat, strict=False)):
        _prepare(axes, terms, whole["t"])
        panels.letter(axes, k, fill(spoken(case), TITLE_WIDTH))
        of_case = whole[whole["case"] == case]
        joint |= bool((of_case["recordings"] > 1).any())
        for j, protocol in enumerate(settings["protocols"]):
            dodge = 0.26 * (j - (len(settings["protocols"]) - 1) / 2)
            chosen = of_case[of_case["protocol"] == protocol]
            _terms(axes, chosen, terms, settings["level"], protocol, dodge)
    figure.legend(
        handles=_handles(settings["protocols"], whole, settings["level"], joint),
        loc="outside upper center",
        ncols=3,
    )
    panels.note_left_out(figure, settings["cases"][len(cases) :], "identifiability.csv")
    return figure


def _prepare(axes: Axes, terms: list[tuple[str, str]], t: pd.Series) -> None:
    lowest = max(t.min(), IDENTIFIABLE / LEAST)
    axes.set_xscale("log")
    axes.set_xlim(min(lowest, IDENTIFIABLE / 2) / 1.5, 1.5 * max(t.max(), 2 * IDENTIFIABLE))
    axes.set_xlabel("$t$ = |coefficient| / bound")
    axes.set_yticks(range(len(terms)), [_typeset(*term) for term in terms])
    axes.tick_params(axis="y", length=0)
    axes.set_ylim(len(terms) - 0.5, -0.5)
    axes.axvline(IDENTIFIABLE, color="#b30000", lw=0.9, zorder=1)
    axes.axvspan(0, IDENTIFIABLE, color="#f6e3e3", lw=0, zorder=0)
    for k in range(1, len(terms)):
        other = terms[k][0] != terms[k - 1][0]
        axes.axhline(k - 0.5, color="#5f5f5f" if other else "#e4e4e4", lw=0.6, zorder=0.5)


def _typeset(equation: str, term: str) -> str:
    """The paper's symbol and the monomial: kappa_6, dq_v^2."""
    letter, _, number = SYMBOLS[equation, term].partition("_")
    monomial = term.replace("dq_", r"\dot{q}_").replace(" ", r"\,")
    return rf"${monomial}$   $\{letter}_{{{number}}}$"


def _terms(
    axes: Axes, table: pd.DataFrame, terms: list[tuple[str, str]], level: float,
    protocol: str, dodge: float,
) -> None:  # fmt: skip
    color, marker = protocol_style(protocol).values()
    for (equation, term, recordings), cells in table.groupby(["equation", "term", "recordings"]):
        y = terms.index((equation, term)) + dodge
        left = axes.get_xlim()[0]
        nearest = max(left, cells.loc[(cells["level"] - level).abs().idxmin(), "t"])
        if recordings == 1:
            axes.hlines(y, cells["t"].min(), cells["t"].max(), color=color, lw=0.8, alpha=0.6)
        face = color if recordings == 1 else "white"
        axes.plot(
            nearest, y, marker=marker, mfc=face, mec=color, mew=0.8, ms=3.6, zorder=4,
            clip_on=False,
        )  # fmt: skip


def _handles(protocols: list[str], table: pd.DataFrame, level: float, joint: bool) -> list:
    levels = np.array(sorted(set(table["level"])))
    nearest = levels[np.argmin(np.abs(levels - level))]
    handles = [
        Line2D(
            [],
            [],
            ls="",
            **protocol_style(protocol),
            label=f"{protocol}, noise {nearest:g}",
        )
        for protocol in protocols
    ]
    if joint:
        handles.append(
            Line2D([], [], ls="", marker="o", mfc="white", mec="k", mew=0.8,
                   label="open: all recordings of the line together")
        )  # fmt: skip
    if len(levels) > 1:
        reach = f"noise {levels[0]:g} to {levels[-1]:g}"
        handles.append(Line2D([], [], color="#5f5f5f", lw=0.8, label=reach))
    handles.append(
        Patch(facecolor="#f6e3e3", edgecolor="#b30000", lw=0.6,
              label=f"not identifiable ($t$ ≤ {IDENTIFIABLE:g})")
    )  # fmt: skip
    return handles
