"""Figure 5 and beyond: each coefficient, as identified and as far as the recordings can tell it."""

from collections.abc import Mapping
from itertools import pairwise
from textwrap import fill

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from galloping.figures import parts
from galloping.figures.style import PAPER, PROTOCOLS, QUIET, SERIES, TRUE, spoken
from galloping.identification.model import IdentifiedModel
from galloping.intervals import IDENTIFIABLE
from galloping.physics.galerkin import EQUATIONS, STATES, TERMS, Derived
from galloping.polynomial import library, term_name
from galloping.tables.table3 import identified_terms

WIDEST = (-0.5, 2.5)  # of identified / true
ACROSS, TITLE_WIDTH = 4, 20  # panels beside each other; letters in a line of their titles
LEAST = 1e3  # times below the limit: what is less stands at the edge
UNTOLD = "#f6e3e3"  # ground of what cannot be identified
SYMBOLS = {  # of the paper, by equation and term
    (EQUATIONS[row], term_name(exponents, STATES)): symbol
    for symbol, (row, exponents) in TERMS.items()
}


def _greek(symbol: str) -> str:
    """gamma_10 as a symbol."""
    letter, _, number = symbol.partition("_")
    return f"$\\{letter}_{{{number}}}$"


def draw_coefficients(
    model: Derived, identified: Mapping[str, Mapping[str, list[IdentifiedModel]]], settings: Mapping
) -> Figure:
    """Identified over true coefficient of each equation, and how often each term was found.

    model: of the line. identified: replicates by cell and method. settings: case, protocol, method;
    levels by cell, and their unit; degree of the library.
    """
    levels = list(settings["levels"].values())
    if not levels:
        return parts.nothing_at_all("no noise level above zero, or no true values")
    terms = library(len(STATES), settings["degree"])
    draws = [identified[cell][settings["method"]] for cell in settings["levels"]]
    tables, firsts = (
        [identified_terms(model.model, each[:count], terms) for each in draws]
        for count in (None, 1)
    )
    true = tables[0][tables[0]["true"] != 0]
    counts = true["equation"].value_counts(sort=False)
    figure, grid = parts.panels(
        4.4, 2, len(counts), sharey="row", sharex="col", height_ratios=(2.4, 1),
        width_ratios=list(counts),
    )  # fmt: skip
    reach = 1.1 * max(0.02, *(np.nanmax(np.abs(_ratio(table) - 1)) for table in tables))
    limits = max(WIDEST[0], 1 - reach), min(WIDEST[1], 1 + reach)
    for column, (equation, count) in enumerate(counts.items()):
        upper, lower = grid[:, column]
        parts.letter(upper, column, f"{equation} equation")
        parts.letter(lower, len(counts) + column, "terms found")
        upper.axhline(1, color=TRUE, lw=0.8)
        spurious = []
        for k, (all_draws, first) in enumerate(zip(tables, firsts, strict=True)):
            of_equation, one = (t[t["equation"] == equation] for t in (all_draws, first))
            x = np.arange(count) + 0.2 * (k - (len(levels) - 1) / 2)
            _ratios(upper, x, of_equation, one, limits, *SERIES[k])
            is_true = of_equation["true"] != 0
            lower.bar(x, of_equation.loc[is_true, "found"], width=0.17, color=SERIES[k][0])
            spurious.append(f"{of_equation.loc[~is_true, 'found'].sum():.2g}")
        margin = 0.04 * (limits[1] - limits[0])
        upper.set_ylim(limits[0] - margin, limits[1] + 4 * margin)  # room for a line of text
        named = {symbol for (of, _), symbol in SYMBOLS.items() if of == equation}
        if absent := ", ".join(
            _greek(s) for s in SYMBOLS.values() if s in named - {*true["symbol"]}
        ):
            upper.text(0.02, 0.98, f"zero in this line: {absent}", va="top",
                       transform=upper.transAxes, fontsize="small")  # fmt: skip
        lower.text(0.5, 0.97, f"false terms per draw: {', '.join(spurious)}", ha="center", va="top",
                   transform=lower.transAxes, fontsize="small")  # fmt: skip
        own = true[true["equation"] == equation]
        values = [f"{value:.3g}".replace("-", "−") for value in own["true"]]
        labels = map("{}\n{}".format, map(_greek, own["symbol"]), values)
        lower.set_xticks(range(count), list(labels), fontsize="x-small")
    grid[0, 0].set_ylabel("identified / true")
    grid[1, 0].set(ylim=(0, 1.45), yticks=[0, 0.5, 1], ylabel="share found")
    for level, (color, marker) in zip(levels, SERIES, strict=False):
        label = f"noise level {level:g} {settings['unit']}"
        grid[0, 0].plot([], [], ls="", color=color, marker=marker, label=label)
    parts.legend(figure, columns=2, title=parts.origin(settings))
    return figure


def _ratio(table: pd.DataFrame) -> np.ndarray:
    """Median and interval over the true value, sorted: (n_terms, 3)."""
    true = table[table["true"] != 0]
    ratio = true[["identified", "low", "high"]].to_numpy(float) / true[["true"]].to_numpy(float)
    ratio[:, 1:].sort(axis=1)
    return ratio


def _ratios(
    axes: Axes, x: np.ndarray, draws: pd.DataFrame, first: pd.DataFrame, limits: tuple,
    color: str, marker: str,
) -> None:  # fmt: skip
    """draws: of all draws at one level. first: of the first draw alone."""
    medians, lows, highs = np.clip(_ratio(draws), *limits).T
    spread = "5th to 95th percentile and median of all draws"
    axes.vlines(x, lows, highs, color=color, lw=1.2, label=spread)
    axes.plot(x, medians, ls="", marker="_", color=color, ms=7)
    parts.points(axes, x, _ratio(first)[:, 0], limits, color, marker, 4)


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
    if not terms:
        return parts.nothing_at_all("this study has no bound on noisy recordings")
    cases = settings["cases"]
    rows = -(-len(cases) // ACROSS)
    height, across = parts.height(1.2, 0.24 * max(len(terms), 6), rows), -(-len(cases) // rows)
    figure, grid = parts.wrapped_grid(len(cases), across, height)
    reach = (max(whole["t"].min(), IDENTIFIABLE / LEAST), whole["t"].max())
    monomials = [term.replace("dq_", r"\dot{q}_").replace(" ", r"\,") for _, term in terms]
    names = [
        f"${one}$   {_greek(SYMBOLS[term])}" for one, term in zip(monomials, terms, strict=True)
    ]
    grid[0].set_xscale("log")
    grid[0].set_xlim(min(reach[0], IDENTIFIABLE / 2) / 1.5, 1.5 * max(reach[1], 2 * IDENTIFIABLE))
    for k, (case, axes) in enumerate(zip(cases, grid, strict=True)):
        parts.letter(axes, k, fill(spoken(case), TITLE_WIDTH))
        parts.rows(axes, names)
        for above, (one, other) in enumerate(pairwise(terms)):
            if one[0] != other[0]:  # of another equation
                axes.axhline(above + 0.5, color=QUIET, lw=0.6, zorder=0.6)
        axes.set_xlabel("$t$ = |coefficient| / bound")
        axes.axvline(IDENTIFIABLE, color=PAPER, lw=0.9, zorder=1)
        axes.axvspan(0, IDENTIFIABLE, color=UNTOLD, lw=0, zorder=0)
        of_case = whole[whole["case"] == case]
        for j, protocol in enumerate(settings["protocols"]):
            dodge = 0.26 * (j - (len(settings["protocols"]) - 1) / 2)
            chosen = of_case[of_case["protocol"] == protocol]
            _told(axes, chosen, terms, settings["level"], protocol, dodge)
    shown = whole[whole["case"].isin(cases)]
    levels = np.unique(shown["level"])
    nearest = levels[np.argmin(np.abs(levels - settings["level"]))]
    keys = [
        parts.key(f"{protocol}, noise {nearest:g}", **PROTOCOLS[protocol])
        for protocol in settings["protocols"]
    ]
    if (shown["recordings"] > 1).any():
        together = "open: all recordings of the line together"
        keys.append(parts.key(together, marker="o", mfc="white", mec="k", mew=0.8))
    if len(levels) > 1:
        reach = f"noise {levels[0]:g} to {levels[-1]:g}"
        keys.append(parts.key(reach, color=QUIET, lw=0.8, ls="-"))
    text = f"not identifiable ($t$ ≤ {IDENTIFIABLE:g})"
    keys.append(Patch(facecolor=UNTOLD, edgecolor=PAPER, lw=0.6, label=text))
    parts.legend(figure, *keys, columns=3)
    return figure


def _told(
    axes: Axes, table: pd.DataFrame, terms: list[tuple[str, str]], level: float,
    protocol: str, dodge: float,
) -> None:  # fmt: skip
    look, left = PROTOCOLS[protocol], axes.get_xlim()[0]
    color, marker = look["color"], look["marker"]
    for (equation, term, recordings), cells in table.groupby(["equation", "term", "recordings"]):
        y = terms.index((equation, term)) + dodge
        nearest = max(left, cells.loc[(cells["level"] - level).abs().idxmin(), "t"])
        if recordings == 1:
            axes.hlines(y, cells["t"].min(), cells["t"].max(), color=color, lw=0.8, alpha=0.6)
        face = color if recordings == 1 else "white"
        axes.plot(nearest, y, marker=marker, mfc=face, mec=color, mew=0.8, ms=3.6,
                  zorder=4, clip_on=False)  # fmt: skip
