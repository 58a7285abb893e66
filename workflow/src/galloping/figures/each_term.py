"""Figure 5: false terms, and each coefficient over its true value."""

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from galloping.figures import parts
from galloping.figures.errors import replace_cells
from galloping.figures.style import DARK_GREY, MODEL_COLOR, SERIES, SINGLE_COLUMN, TRUE_COLOR
from galloping.identification.identified_model import IdentifiedModel
from galloping.line.galerkin import EQUATIONS, STATES, Derived
from galloping.model.polynomial import polynomial_library, velocity_pairs
from galloping.results import KNOWN
from galloping.tables.scores import spread
from galloping.tables.table3 import identified_terms

RATIO_LIMITS = (-0.5, 2.5)  # widest limits of the axis of identified over true coefficients
SYMBOL_SPACING = 0.3  # distance of the symbols of one term, in spacings of the terms


def _typeset_symbol(symbol: str) -> str:
    """Typeset a symbol such as gamma_10."""
    letter, _, number = symbol.partition("_")
    return f"$\\{letter}_{{{number}}}$"


def draw_coefficients(
    model: Derived,
    identified: Mapping[str, Mapping[str, list[IdentifiedModel]]],
    settings: Mapping,
    table: pd.DataFrame,
    draws: pd.DataFrame | None = None,
) -> Figure:
    """Plot the number of false terms against noise, and ratios of identified to true coefficients.

    model: of the line. identified: models of all noise realisations by study cell and method.
    settings: case, protocol, method and kind; levels by cell, and the label of the noise; degree of
    the library; kinematics, as of the method, or None. table: scores.csv. draws: more realisations
    of the same cells, as of `errors.draw_draws`.
    """
    levels = list(settings["levels"].values())
    if not levels:
        return parts.make_empty_figure("no noise level above zero, or no true values")
    terms = polynomial_library(len(STATES), settings["degree"])
    tables = [
        identified_terms(model.model, identified[cell][settings["method"]], terms)
        for cell in settings["levels"]
    ]
    true = tables[0][tables[0]["true"] != 0]
    figure, ((above,), (below,)) = parts.panels(3.0, 2, width=SINGLE_COLUMN, height_ratios=(1, 1.2))
    known_equations = identified[next(iter(settings["levels"]))][settings["method"]][0].known
    if settings["kinematics"] == KNOWN:
        known_equations = tuple(velocity_pairs(STATES))
    present = model.model.on_polynomials(settings["degree"]).support[:, : len(terms)]
    possible = int(np.sum(~np.delete(present, known_equations, axis=0)))
    realisations = replace_cells(table, draws, settings)
    _draw_false_terms(above, realisations, possible, settings["label"])
    reach = 1.1 * max(0.02, *(np.nanmax(np.abs(_divide_by_truth(each) - 1)) for each in tables))
    limits = max(RATIO_LIMITS[0], 1 - reach), min(RATIO_LIMITS[1], 1 + reach)
    parts.letter(below, 1, "coefficients over their true values")
    below.axhline(1, color=TRUE_COLOR, lw=0.8)
    for k, (level, each) in enumerate(zip(levels, tables, strict=True)):
        x = np.arange(len(true)) + SYMBOL_SPACING * (k - (len(levels) - 1) / 2)
        _draw_ratios(below, x, each, limits, *SERIES[2 * k % len(SERIES)], f"noise {level:g}")
    vertical = (true["equation"] == EQUATIONS[min(EQUATIONS)]).sum()
    below.axvline(vertical - 0.5, color=DARK_GREY, lw=0.6)
    margin = 0.06 * (limits[1] - limits[0])
    below.set(ylim=(limits[0] - margin, limits[1] + margin), ylabel="identified / true")
    below.set_xticks(range(len(true)), list(map(_typeset_symbol, true["symbol"])), fontsize="small")
    parts.legend(figure, columns=3, title="coefficients in (b)")
    medians = realisations.groupby("level")["spurious"].median()
    medians = medians[medians.index > 0]
    texts = [f"{medians[level]:.0f} at noise {level:g}" for level in medians.index[[0, -1]]]
    figure.set_label(f"The median number of false terms is {' and '.join(dict.fromkeys(texts))}")
    return figure


def _draw_false_terms(axes: Axes, scores: pd.DataFrame, possible: int, label: str) -> None:
    """Draw median, 5th and 95th percentile of the number of false terms against noise."""
    parts.letter(axes, 0, f"false terms, of {possible} possible ones")
    noisy = scores[scores["level"] > 0]
    places = parts.LogAxis.of(noisy["level"])
    places.prepare(axes, label)
    counts = noisy.groupby("level").agg(**spread("spurious"))
    x = [places.position(level) for level in counts.index]
    axes.vlines(x, counts["low"], counts["high"], color=MODEL_COLOR, lw=1.0)
    axes.plot(x, counts["median"], color=MODEL_COLOR, marker="h", ms=4)
    axes.axhline(possible, color=DARK_GREY, lw=0.8, ls=":")
    axes.set(ylim=(-0.04 * possible, 1.08 * possible), ylabel="false terms")


def _divide_by_truth(table: pd.DataFrame) -> np.ndarray:
    """Divide median and interval by the true value, sorted: (n_terms, 3)."""
    true = table[table["true"] != 0]
    ratio = true[["identified", "low", "high"]].to_numpy(float) / true[["true"]].to_numpy(float)
    ratio[:, 1:].sort(axis=1)
    return ratio


def _draw_ratios(
    axes: Axes, x: np.ndarray, terms: pd.DataFrame, limits: tuple, color: str, marker: str,
    label: str,
) -> None:  # fmt: skip
    """Draw the ratios of one noise level. terms: of both equations, over all realisations."""
    _, lows, highs = np.clip(_divide_by_truth(terms), *limits).T
    axes.vlines(x, lows, highs, color=color, lw=1.2)
    parts.points(axes, x, _divide_by_truth(terms)[:, 0], limits, color, marker, 3.5)
    axes.plot([], [], ls="-", color=color, marker=marker, label=label)
