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
from galloping.figures.errors import replace_cells
from galloping.figures.style import DOUBLE, MODEL, PAPER, PROTOCOLS, QUIET, SERIES, TRUE, spoken
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
    model: Derived,
    identified: Mapping[str, Mapping[str, list[IdentifiedModel]]],
    settings: Mapping,
    table: pd.DataFrame,
    draws: pd.DataFrame | None = None,
) -> Figure:
    """Draw how many false terms draws of the noise have, and identified over true coefficients.

    Parameters
    ----------
    model : Derived
        Of the line.
    identified : Mapping
        Replicates by cell and method.
    settings : Mapping
        case, protocol, method and kind; levels by cell, and their unit; degree of the library.
    table, draws : DataFrame
        scores.csv, and more draws of the same cells, as of `errors.draw_draws`.
    """
    levels = list(settings["levels"].values())
    if not levels:
        return parts.nothing_at_all("no noise level above zero, or no true values")
    terms = library(len(STATES), settings["degree"])
    found = [
        identified_terms(model.model, identified[cell][settings["method"]], terms)
        for cell in settings["levels"]
    ]
    true = found[0][found[0]["true"] != 0]
    counts = true["equation"].value_counts(sort=False)
    figure = Figure(figsize=(DOUBLE, 5.2), layout="constrained")
    above, below = figure.subfigures(2, 1, height_ratios=(1, 1.15))
    possible = len(EQUATIONS) * len(terms) - len(true)
    _false_terms(above.subplots(), replace_cells(table, draws, settings), possible, settings)
    grid = below.subplots(1, len(counts), sharey=True, width_ratios=list(counts), squeeze=False)[0]
    reach = 1.1 * max(0.02, *(np.nanmax(np.abs(_ratio(each) - 1)) for each in found))
    limits = max(WIDEST[0], 1 - reach), min(WIDEST[1], 1 + reach)
    for column, (equation, count) in enumerate(counts.items()):
        axes = grid[column]
        parts.letter(axes, column + 1, f"{equation} equation")
        axes.axhline(1, color=TRUE, lw=0.8)
        for k, each in enumerate(found):
            x = np.arange(count) + 0.2 * (k - (len(levels) - 1) / 2)
            _ratios(axes, x, each[each["equation"] == equation], limits, *SERIES[k])
        margin = 0.04 * (limits[1] - limits[0])
        axes.set_ylim(limits[0] - margin, limits[1] + 4 * margin)  # room for a line of text
        named = {symbol for (of, _), symbol in SYMBOLS.items() if of == equation}
        if absent := ", ".join(
            _greek(s) for s in SYMBOLS.values() if s in named - {*true["symbol"]}
        ):
            axes.text(0.02, 0.98, f"zero in this line: {absent}", va="top",
                      transform=axes.transAxes, fontsize="small")  # fmt: skip
        own = true[true["equation"] == equation]
        values = [f"{value:.3g}".replace("-", "−") for value in own["true"]]
        labels = map("{}\n{}".format, map(_greek, own["symbol"]), values)
        axes.set_xticks(range(count), list(labels), fontsize="x-small")
    grid[0].set_ylabel("identified / true")
    for level, (color, marker) in zip(levels, SERIES, strict=False):
        label = f"noise level {level:g} {settings['unit']}"
        grid[0].plot([], [], ls="", color=color, marker=marker, label=label)
    parts.legend(figure, columns=4, title=parts.origin(settings))
    return figure


def _false_terms(axes: Axes, scores: pd.DataFrame, possible: int, settings: Mapping) -> None:
    """Number of false terms of each draw against the noise level, and their median."""
    parts.letter(axes, 0, f"false terms in a draw, of {possible} possible ones")
    places = parts.LogAxis.of(scores["level"])
    places.prepare(axes, f"noise level, {settings['unit']}")
    for level, draws in scores.groupby("level")["spurious"]:
        x, count = places.position(level), len(draws)
        spread = x * 10 ** parts.jitter(count, 0.09)
        axes.plot(spread, draws, ls="", marker="o", ms=1.8, mew=0, alpha=0.4, color=MODEL)
        axes.plot(x, draws.median(), marker="_", ms=20, mew=1.6, color=MODEL)
        axes.annotate(f"{draws.median():.0f}", (x, draws.median()), (14, 0), color=MODEL,
                      textcoords="offset points", va="center", weight="bold")  # fmt: skip
    axes.axhline(possible, color=QUIET, lw=0.8, ls=":")
    axes.set(ylim=(-0.04 * possible, 1.08 * possible), ylabel="false terms")
    axes.plot([], [], ls="", marker="o", ms=2.5, mew=0, color=MODEL, label="one draw")
    axes.plot([], [], ls="", marker="_", ms=12, mew=1.6, color=MODEL, label="median")


def _ratio(table: pd.DataFrame) -> np.ndarray:
    """Median and interval over the true value, sorted: (n_terms, 3)."""
    true = table[table["true"] != 0]
    ratio = true[["identified", "low", "high"]].to_numpy(float) / true[["true"]].to_numpy(float)
    ratio[:, 1:].sort(axis=1)
    return ratio


def _ratios(
    axes: Axes, x: np.ndarray, draws: pd.DataFrame, limits: tuple, color: str, marker: str
) -> None:
    """draws: terms of one equation over all draws at one level."""
    _, lows, highs = np.clip(_ratio(draws), *limits).T
    axes.vlines(x, lows, highs, color=color, lw=1.2, label="5th to 95th percentile")
    parts.points(axes, x, _ratio(draws)[:, 0], limits, color, marker, 4)


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
