"""Figure 5: identified coefficients against the true ones, term by term."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from galloping.figures import panels
from galloping.figures.style import DOUBLE, SERIES, method_style, spoken
from galloping.identification.model import IdentifiedModel
from galloping.physics.equations import EQUATIONS, STATES, TERMS
from galloping.physics.galerkin import Derived
from galloping.polynomial import library
from galloping.tables.coefficients import identified_terms

WIDEST = (-0.5, 2.5)  # of identified / true


def draw_coefficients(
    model: Derived,
    identified: Mapping[str, Mapping[str, list[IdentifiedModel]]],
    settings: Mapping,
) -> Figure:
    """IdentifiedModel over true coefficient of each equation, and how often each term was found.

    model: of the line. identified: replicates by cell and method. settings: case, protocol, method;
    levels by cell, and their unit; degree of the library.
    """
    levels = list(settings["levels"].values())
    if not levels:
        return panels.nothing_at_all("no noise level above zero, or no true values")
    terms = library(len(STATES), settings["degree"])
    draws = [identified[cell][settings["method"]] for cell in settings["levels"]]
    tables = [identified_terms(model.model, each, terms) for each in draws]
    first = [identified_terms(model.model, each[:1], terms) for each in draws]
    figure = Figure(figsize=(DOUBLE, 4.4), layout="constrained")
    true = tables[0][tables[0]["true"] != 0]
    equations = list(dict.fromkeys(true["equation"]))
    counts = [int((true["equation"] == equation).sum()) for equation in equations]
    grid = figure.subplots(
        2, len(equations), squeeze=False, sharey="row", sharex="col",
        height_ratios=(2.4, 1), width_ratios=counts,
    )  # fmt: skip
    limits = _limits(tables)
    for column, equation in enumerate(equations):
        upper, lower = grid[:, column]
        parts, ones = (
            [table[table["equation"] == equation] for table in each] for each in (tables, first)
        )
        _ratios(upper, parts, ones, limits)
        _absent(upper, equation, true)
        _shares(lower, parts)
        panels.letter(upper, column, f"{equation} equation")
        panels.letter(lower, len(equations) + column, "terms found")
        lower.set_xticks(*_ticks(parts[0][parts[0]["true"] != 0]), fontsize="x-small")
    grid[0, 0].set_ylabel("identified / true")
    grid[1, 0].set_ylabel("share found")
    for level, (color, marker) in zip(levels, SERIES, strict=False):
        label = f"noise level {level:g} {settings['unit']}"
        grid[0, 0].plot([], [], ls="", color=color, marker=marker, label=label)
    by = f"{method_style(settings['method']).label}, protocol {settings['protocol']}"
    panels.legend(figure, columns=2, title=f"{spoken(settings['case'])}, {by}")
    return figure


def _typeset(symbol: str) -> str:
    letter, _, number = symbol.partition("_")
    return f"$\\{letter}_{{{number}}}$"


def _ticks(true: pd.DataFrame) -> tuple[list[int], list[str]]:
    """Symbol and true value of each term."""
    labels = [
        f"{_typeset(symbol)}\n{value:.3g}".replace("-", "−")
        for symbol, value in zip(true["symbol"], true["true"], strict=True)
    ]
    return list(range(len(true))), labels


def _absent(axes: Axes, equation: str, true: pd.DataFrame) -> None:
    """Names the coefficients of the paper that are zero in this line."""
    absent = [
        _typeset(symbol)
        for symbol, (row, _) in TERMS.items()
        if EQUATIONS[row] == equation and symbol not in set(true["symbol"])
    ]
    if absent:
        axes.text(0.02, 0.98, f"zero in this line: {', '.join(absent)}", va="top",
                  transform=axes.transAxes, fontsize="small")  # fmt: skip


def _ratio(table: pd.DataFrame) -> np.ndarray:
    """Median and interval over the true value, sorted: (n_terms, 3)."""
    true = table[table["true"] != 0]
    ratio = true[["identified", "low", "high"]].to_numpy(float) / true[["true"]].to_numpy(float)
    ratio[:, 1:].sort(axis=1)
    return ratio


def _limits(tables: Sequence[pd.DataFrame]) -> tuple[float, float]:
    """Room for all intervals, as far as they stay within the widest axis."""
    values = np.concatenate([_ratio(table) for table in tables])
    reach = 1.1 * max(0.02, np.nanmax(np.abs(values - 1)))
    return max(WIDEST[0], 1 - reach), min(WIDEST[1], 1 + reach)


def _dodge(k: int, count: int) -> float:
    return 0.2 * (k - (count - 1) / 2)


def _ratios(
    axes: Axes, parts: Sequence[pd.DataFrame], first: Sequence[pd.DataFrame], limits: tuple
) -> None:
    """parts: of all draws, for each level. first: of the first draw alone."""
    axes.axhline(1, color="#9a9a9a", lw=0.8)
    for k, (table, one, (color, marker)) in enumerate(zip(parts, first, SERIES, strict=False)):
        ratio = _ratio(table)
        x = np.arange(len(ratio)) + _dodge(k, len(parts))
        medians, lows, highs = np.clip(ratio, *limits).T
        spread = "5th to 95th percentile and median of all draws"
        axes.vlines(x, lows, highs, color=color, lw=1.2, label=spread)
        axes.plot(x, medians, ls="", marker="_", color=color, ms=7)
        panels.points(axes, x, _ratio(one)[:, 0], limits, color, marker, 4)
    margin = 0.04 * (limits[1] - limits[0])
    axes.set_ylim(limits[0] - margin, limits[1] + 4 * margin)  # room for a line of text


def _shares(axes: Axes, parts: Sequence[pd.DataFrame]) -> None:
    spurious = []
    for k, (table, (color, _)) in enumerate(zip(parts, SERIES, strict=False)):
        found = table.loc[table["true"] != 0, "found"].to_numpy(float)
        x = np.arange(len(found)) + _dodge(k, len(parts))
        axes.bar(x, found, width=0.17, color=color)
        spurious.append(f"{table.loc[table['true'] == 0, 'found'].sum():.2g}")
    axes.set_ylim(0, 1.45)
    axes.set_yticks([0, 0.5, 1])
    axes.text(
        0.5, 0.97, f"false terms per draw: {', '.join(spurious)}",
        transform=axes.transAxes, ha="center", va="top", fontsize="small",
    )  # fmt: skip
