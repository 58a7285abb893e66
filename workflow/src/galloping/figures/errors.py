"""Figures 6, 7 and 10: errors of the paper's method; overview of methods beside the bound."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from galloping.figures import parts
from galloping.figures.style import (
    DARK_GREY,
    PAPER_COLOR,
    SERIES,
    SHADE,
    SINGLE_COLUMN,
    method_style,
    spoken,
)
from galloping.paper.claims import CLAIMS, Claim
from galloping.recording.measurement import PROTOCOLS_BY_NAME
from galloping.results import BOUND, MAIN_METHOD, NOISE, PAPER_METHOD
from galloping.tables.scores import ORACLE_SETTING, TERM_DEGREES, mean_error, of_kind, spread

DEFAULT_LIMITS = (1e-2, 1e2)  # percent: limits of an axis without errors
SERIES_SPACING = 0.035  # distance between series at one place, decades
NO_VALUES = pd.Series(dtype=float)
DASHES = ("-", (0, (4, 1.5)), (0, (1, 1)))
PYSINDY = (PAPER_METHOD, "stlsq", "lasso", "frols", "ensemble", "weak")
ORACLE_STYLE = "oracle"  # name of the style of the best possible tuning of pysindy
STAR = {"marker": "*", "ms": 8, "mew": 0, "zorder": 6, "label": "paper: printed"}
BAR = {"marker": "_", "ms": 16, "mew": 1.4, "zorder": 2, "label": "paper: at least"}


@dataclass(frozen=True)
class Quantity:
    """Quantity on the y axis of an error plot: its columns in scores.csv and the axis label.

    columns: each with its name in the legend. label: of the axis. in_words: description of a value,
    with the name of a column in it.
    """

    columns: Mapping[str, str]
    label: str
    in_words: str
    is_r2: bool = False

    def limits(self, values: np.ndarray) -> tuple[float, float]:
        """Compute the axis limits for given values: fixed for R2, whole decades for errors."""
        if self.is_r2:
            low, high = map(parts.r2_place, parts.R2_LIMITS)
            return float(low), float(high)
        values = values[np.isfinite(values) & (values > 0)]
        low, high = (values.min(), values.max()) if values.size else DEFAULT_LIMITS
        return float(10 ** np.floor(np.log10(low))), float(10 ** np.ceil(np.log10(high)))

    def place(self, values: ArrayLike) -> np.ndarray:
        """Convert values to axis positions; values of R2 are transformed to spread those near 1.

        R2 below zero is beyond the axis.
        """
        values = np.asarray(values, float)
        if not self.is_r2:
            return values
        beyond = parts.r2_place(parts.R2_LIMITS[0]) - 1
        return np.where(values < parts.R2_LIMITS[0], beyond, parts.r2_place(values))

    def prepare(self, axes: Axes, limits: tuple[float, float]) -> None:
        """Set the scale, limits and label of a panel's y axis for this quantity.

        limits: as the method `limits` returns them.
        """
        if self.is_r2:
            parts.prepare_r2(axes, self.label)
        else:
            parts.prepare_log(axes, (limits[0] / 1.6, limits[1] * 1.6), self.label)

    def say(self, value: float) -> str:
        """Format a value as text with its unit, or as 'no model' if it is not finite."""
        if not np.isfinite(value):
            return "no model"
        return f"{value:.4g}" if self.is_r2 else f"{value:.2g} %"


QUANTITIES = {
    "coefficients": Quantity(
        {f"mean_error_{order}_percent": f"{order} terms" for order in TERM_DEGREES},
        "mean error of\nthe coefficients, %",
        "Median error, {}",
    ),
    "r2": Quantity(
        {"r2_q_v": "vertical motion", "r2_q_w": "horizontal motion"},
        "$R^2$ over the record",
        "Median R², {}",
        is_r2=True,
    ),
    "amplitude": Quantity(
        {
            "amplitude_error_q_v_percent": "vertical motion",
            "amplitude_error_q_w_percent": "horizontal motion",
        },
        "error of the steady\namplitude, %",
        "Median amplitude error, {}",
    ),
}
CELL_TEXTS = {"level": "at noise {:g}", "points": "from {:,.0f} samples"}


def printed(column: str, case: str) -> list[Claim]:
    """List the values and bounds in the reproduced paper for one score of one overhead line."""
    return [c for c in CLAIMS if c.column == column and c.case in (case, "") and not c.minus]


def draw_draws(table: pd.DataFrame, settings: Mapping, draws: pd.DataFrame | None = None) -> Figure:
    """Plot median and 5-95 % range of coefficient errors over noise realisations.

    There is a panel for each quantity, with a line for each of its columns. table: scores.csv.
    settings: case, protocol and method; kind of cells; x, `level` or `points`, and its labels by
    protocol; quantities, names of QUANTITIES. draws: more realisations, of
    `paper.draws.paper_draws`, instead of those of the same cells in `table`; without them, the
    study is not the paper's, and what the paper prints is not drawn.
    """
    x, case = settings["x"], settings["case"]
    rows = replace_cells(table, draws, settings)
    rows = rows[rows["level"] > 0]
    if rows.empty:
        return parts.make_empty_figure("this study has no noisy recordings with this method")
    quantities = [QUANTITIES[name] for name in settings["quantities"]]
    height = 0.85 + (1.75 if len(quantities) == 1 else 1.35 * len(quantities))
    figure, grid = parts.panels(height, len(quantities), width=SINGLE_COLUMN, sharex=True)
    panes, places = grid[:, 0], parts.LogAxis.of(rows[x])
    for quantity, axes in zip(quantities, panes, strict=True):
        places.prepare(axes, settings["labels"][settings["protocol"]] if axes is panes[-1] else "")
        columns = [name for name in quantity.columns if rows.get(name, NO_VALUES).notna().any()]
        if not columns:
            parts.write_reason(axes, "this line has no such values")
            continue
        by_place = {name: _tabulate_interval(rows, x, name) for name in columns}
        claims = [] if draws is None else [c for name in columns for c in printed(name, case)]
        stars = [claim.printed for claim in claims]
        limits = quantity.limits(np.concatenate([stars, *map(np.ravel, by_place.values())]))
        quantity.prepare(axes, limits)
        for k, (name, values) in enumerate(by_place.items()):
            shift = SERIES_SPACING * (k - (len(by_place) - 1) / 2)
            positions = {value: places.position(value, shift) for value in values.index}
            _draw_series(axes, list(positions.values()), quantity.place(values.T), limits, k)
            label = quantity.columns[name]
            axes.plot([], [], color=SERIES[k][0], marker=SERIES[k][1], ls=DASHES[k], label=label)
            for claim in claims:
                is_drawn = claim.cell_kind == settings["kind"] and getattr(claim, x) in positions
                is_drawn &= claim.column == name
                if claim.is_counted and is_drawn and claim.level in set(rows["level"]):
                    place = positions[getattr(claim, x)], quantity.place(claim.printed)
                    look = STAR if claim.is_number else BAR
                    axes.plot(*place, ls="", color=PAPER_COLOR, **look)
    parts.legend(figure, columns=2)
    figure.set_label(_describe_trend(rows, x, quantities[-1]))
    return figure


def _draw_series(
    axes: Axes, x: Sequence[float], values: np.ndarray, limits: tuple[float, float], index: int
) -> None:
    """Draw medians on a line, with bars. values: (3, n) median, low, high, places on the axis."""
    (color, marker), (median, low, high) = SERIES[index], np.clip(values, *limits)
    axes.vlines(x, low, high, color=color, lw=1.0)
    axes.plot(x, median, color=color, ls=DASHES[index])
    parts.points(axes, x, values[0], limits, color, marker, 4)


def _describe_trend(rows: pd.DataFrame, x: str, quantity: Quantity) -> str:
    """Describe the median of the quantity's first column at both ends of the axis."""
    name, label = next(iter(quantity.columns.items()))
    if rows.get(name, NO_VALUES).isna().all():
        return ""
    medians = _tabulate_interval(rows, x, name)["median"]
    ends = dict.fromkeys([medians.index[0], medians.index[-1]])
    texts = [f"{quantity.say(medians[end])} {CELL_TEXTS[x].format(end)}" for end in ends]
    return f"{quantity.in_words.format(label)}: {', '.join(texts)}"


def replace_cells(
    table: pd.DataFrame, draws: pd.DataFrame | None, settings: Mapping
) -> pd.DataFrame:
    """Combine two score tables of one method, preferring rows with more noise realisations.

    Rows of `draws` replace the rows of `table` with the same kind of recordings, noise level and
    number of samples. table, draws: as of `draw_draws`. settings: case, protocol, method and kind.
    """
    keys = {name: settings[name] for name in ("case", "protocol", "method", "kind")}
    rows = parts.where(table, **keys)
    if draws is None:
        return rows
    more = parts.where(draws, kind=settings["kind"])
    cells = [pd.MultiIndex.from_frame(t[["kind", "level", "points"]]) for t in (rows, more)]
    kept_rows = rows[~cells[0].isin(cells[1])]
    return pd.concat([more, kept_rows], ignore_index=True)


def _tabulate_interval(table: pd.DataFrame, x: str, name: str) -> pd.DataFrame:
    """Tabulate median, low and high of a column at each x, the index."""
    return table.dropna(subset=name).groupby(x).agg(**spread(name)).astype(float)


def draw_overview(table: pd.DataFrame, settings: Mapping, peers: pd.DataFrame) -> Figure:
    """Plot the mean coefficient error of several identification methods against noise.

    The mean is over the orders of the terms; all recordings have one measurement setup. Drawn are
    the paper's method, the best of pysindy, its best possible tuning, our method, and the bound, as
    far as the study has them. Errors are of the fits that gave a model; the number of failures is
    written above. table: scores.csv. peers: peers.csv. settings: case and protocol to show, and the
    label of the noise.
    """
    case, protocol = settings["case"], settings["protocol"]
    figure, ((axes,),) = parts.panels(3.7, width=SINGLE_COLUMN)
    errors = _tabulate_errors(table, peers, case, protocol)
    if errors.empty:
        parts.write_reason(axes, "no noisy recordings of this line have coefficient errors")
        return figure
    places = parts.LogAxis.of(errors["level"])
    places.prepare(axes, settings["label"])
    prefixes = {PAPER_METHOD: "", best_of_pysindy(errors) or "": "best of pysindy: ",
            ORACLE_STYLE: "pysindy, ", MAIN_METHOD: "ours: ", BOUND: ""}  # fmt: skip
    present = set(errors["method"])
    names = {k: text + method_style(k).label for k, text in prefixes.items() if k in present}
    shown_errors = errors[errors["method"].isin(names)]
    values = shown_errors[["median", "low", "high"]].to_numpy(float).ravel()
    values = values[np.isfinite(values) & (values > 0)]
    # at most ten times 100 %, the error of a model without terms
    limits = (values.min() / 2, min(values.max() * 2, 1e3)) if values.size else DEFAULT_LIMITS
    parts.prepare_log(axes, limits, "mean error of the coefficients, %")
    bound = errors[errors["method"] == BOUND]
    if len(bound) > 1:
        x = [places.position(level) for level in bound["level"]]
        axes.fill_between(x, limits[0], bound["median"], color=SHADE, lw=0, zorder=0)
        axes.text(x[-1] / 1.05, limits[0] * 1.35, "below the Cramér-Rao bound", ha="right",
                  fontsize="small", color=DARK_GREY)  # fmt: skip
    shift = parts.shifts(list(names), 0.03)
    for method in names:
        line = errors[errors["method"] == method]
        x = [places.position(level, shift[method]) for level in line["level"]]
        parts.series(axes, x, line[["median", "low", "high"]].to_numpy().T, method, limits)
    _note_failures(axes, shown_errors, places)
    title = [f"{spoken(case)}, {PROTOCOLS_BY_NAME[protocol].meaning}"]
    if levels := beaten_at(errors):
        title.append(f"pysindy with the best possible tuning is better than ours at {levels}")
    axes.set_title("\n".join(title), fontsize="small")
    keys = parts.method_keys(names)
    parts.legend(figure, *keys, columns=1, loc="outside upper left", handlelength=3)
    figure.set_label(_compare_methods(errors, names))
    return figure


def _compare_methods(errors: pd.DataFrame, names: Mapping[str, str]) -> str:
    """Describe the median error of each drawn method at the middle level, the least first."""
    levels = np.unique(errors["level"])
    middle = levels[(len(levels) - 1) // 2]
    medians = errors[errors["level"] == middle].set_index("method")["median"]
    shown = [name for name in names if name not in (BOUND, ORACLE_STYLE)]
    medians = medians.reindex(shown).dropna().sort_values(kind="stable")
    if medians.empty:
        return ""
    texts = [f"{value:.2g} % by {method_style(name).label}" for name, value in medians.items()]
    return f"Median coefficient error at sensor noise {middle:g}: {', '.join(texts)}"


def _note_failures(axes: Axes, errors: pd.DataFrame, places: parts.LogAxis) -> None:
    """Write above each level how many fits of a method gave no model."""
    failed = errors[errors["failures"] > 0]
    for level, rows in failed.groupby("level"):
        for line, row in enumerate(rows.itertuples()):
            axes.annotate(
                f"{row.failures:.0f} of {row.count:.0f}: no model", (places.position(level), 1.0),
                (0, -3 - 7 * line), xycoords=("data", "axes fraction"), textcoords="offset points",
                ha="center", va="top", size="x-small", color=method_style(row.method).color,
            )  # fmt: skip


def best_of_pysindy(table: pd.DataFrame) -> str | None:
    """Return the name of the pysindy method with the lowest median error over the noise levels."""
    medians = table.groupby("method")["median"].agg(np.median)
    medians = medians.reindex([method for method in PYSINDY if method in medians]).dropna()
    return None if medians.empty else medians.idxmin()


def beaten_at(table: pd.DataFrame) -> str:
    """List the noise levels where ideally tuned pysindy is more accurate than maximum likelihood.

    Returned is a text, '' if there is no such level.
    """
    medians = table.pivot_table(index="level", columns="method", values="median")
    if not {ORACLE_STYLE, MAIN_METHOD} <= set(medians):
        return ""
    return ", ".join(
        f"{level:g}" for level in medians.index[medians[ORACLE_STYLE] < medians[MAIN_METHOD]]
    )


def _tabulate_errors(
    scores: pd.DataFrame, peers: pd.DataFrame, case: str, protocol: str
) -> pd.DataFrame:
    """Tabulate method, level, median, low, high, count and failures at the levels above zero.

    Errors are of the fits with a model, to a line with true coefficients; those of the best
    possible tuning are the lowest of STLSQ, FROLS and the weak form.
    """
    cells, others = (
        parts.where(rows[rows["level"] > 0], case=case, protocol=protocol)
        for rows in (of_kind(scores, NOISE), peers)
    )
    cells = cells.assign(error=mean_error(cells)).dropna(subset="error")
    has_model = np.isfinite(cells["error"])
    keys = ["method", "level"]
    errors = cells[has_model].groupby(keys).agg(**spread("error"))
    counts = cells.assign(failed=~has_model).groupby(keys)["failed"].agg(["size", "sum"])
    errors = errors.join(counts.set_axis(["count", "failures"], axis=1), how="right").reset_index()
    others = others[(others["setting"] == ORACLE_SETTING) & others["method"].isin(PYSINDY)]
    others = others.dropna(subset="mean_error_percent")
    if others.empty:  # its columns have no numbers
        return errors
    least = others.groupby("level")["mean_error_percent"].min()
    columns = dict.fromkeys(("median", "low", "high"), least)
    oracle = pd.DataFrame(columns).reset_index().assign(method=ORACLE_STYLE, failures=0)
    return pd.concat([errors, oracle])
