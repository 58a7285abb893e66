"""Figures 6, 7 and 10, errors against noise and amount of data: the paper's method as the paper
shows it, all methods beside each other, and how far they stay from the Cramér-Rao bound.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from galloping.figures import parts
from galloping.figures.style import MODEL, PAPER, QUIET, SHADE, SINGLE, method_style, spoken
from galloping.paper.claims import CLAIMS, Claim
from galloping.results import BOUND, NOISE, OURS, PAPER_METHOD
from galloping.tables.scores import ORACLE, ORDERS, mean_error, of_kind, spread

DECADES = (1e-2, 1e2)  # percent: the axis of errors where there are none
METHODS_APART = 0.1  # decades, within which methods are moved apart
LOWEST, HIGHEST = 0.5, 1e4  # of rms error / bound
EFFICIENCY_APART = 0.09  # decades
JITTERED = 0.09  # decades, over which draws at one place are spread
STEP = 1.75  # factor along the axis, from the last level to joint recordings
PYSINDY = (PAPER_METHOD, "stlsq", "lasso", "frols", "ensemble", "weak")
ORACLES = "oracle"  # how the best settings of pysindy are drawn
STAR = {"marker": "*", "ms": 8, "mew": 0, "zorder": 6, "label": "paper: printed"}
BAR = {"marker": "_", "ms": 16, "mew": 1.4, "zorder": 2, "label": "paper: at least"}


@dataclass(frozen=True)
class Quantity:
    """Columns of scores.csv that share an axis.

    columns: each with the title of its panel; those with a name that scores.csv lacks are left out.
    label: of the axis. together: of an axis of one value a replicate, `combined` (n_rows,).
    """

    columns: Mapping[str, str]
    label: str
    together: str
    is_r2: bool = False

    def combined(self, scores: pd.DataFrame) -> pd.Series:
        """One value a row: the mean error over the orders, else that of the worse direction."""
        if self is QUANTITIES["coefficients"]:
            return mean_error(scores)
        both = scores[list(self.columns)]
        return both.min(axis=1) if self.is_r2 else both.max(axis=1)

    def limits(self, values: np.ndarray) -> tuple[float, float]:
        """Of places on the axis: R2 from zero on, errors over whole decades around all values."""
        if self.is_r2:
            low, high = map(parts.r2_place, parts.R2_LIMITS)
            return float(low), float(high)
        values = values[np.isfinite(values) & (values > 0)]
        low, high = (values.min(), values.max()) if values.size else DECADES
        return float(10 ** np.floor(np.log10(low))), float(10 ** np.ceil(np.log10(high)))

    def place(self, values: np.ndarray) -> np.ndarray:
        """Where values stand; R2 below zero stands beyond the axis."""
        values = np.asarray(values, float)
        if not self.is_r2:
            return values
        beyond = parts.r2_place(parts.R2_LIMITS[0]) - 1
        return np.where(values < parts.R2_LIMITS[0], beyond, parts.r2_place(values))

    def prepare(self, axes: Axes, limits: tuple[float, float], label: str) -> None:
        """limits: as of `limits`."""
        if self.is_r2:
            parts.prepare_r2(axes, label)
            return
        parts.prepare_log(axes, (limits[0] / 1.6, limits[1] * 1.6), label)


QUANTITIES = {
    "coefficients": Quantity(
        {f"mean_error_{order}_percent": f"{order} terms" for order in ORDERS},
        "mean error of\nthe coefficients, %",
        "mean error of\nall coefficients, %",
    ),
    "r2": Quantity(
        {"r2_q_v": "vertical, $q_v$", "r2_q_w": "horizontal, $q_w$"},
        "$R^2$ over the record",
        "$R^2$, worse direction",
        is_r2=True,
    ),
    "amplitude": Quantity(
        {"amplitude_error_q_v_percent": "vertical, $q_v$",
         "amplitude_error_q_w_percent": "horizontal, $q_w$"},
        "error of the steady\namplitude, %",
        "amplitude error, %,\nworse direction",
    ),
}  # fmt: skip


def printed(column: str, case: str) -> list[Claim]:
    """The paper's claims that are values or bounds of a column of scores.csv, of one case."""
    return [c for c in CLAIMS if c.column == column and c.case in (case, "") and not c.minus]


def draw_draws(table: pd.DataFrame, settings: Mapping, draws: pd.DataFrame | None = None) -> Figure:
    """Draw every draw of the noise, their median and 5th to 95th percentile, and what is printed.

    A row for each quantity, a panel for each of its columns. Beside a printed bound is the share of
    the draws that keep it.

    Parameters
    ----------
    table : DataFrame
        scores.csv.
    settings : Mapping
        case, protocol and method; kind of cells; x, `level` or `points`, and its labels by
        protocol; quantities, names of QUANTITIES.
    draws : DataFrame, optional
        More draws, of `paper.draws.paper_draws`, instead of those of the same cells in `table`.
    """
    x, case = settings["x"], settings["case"]
    chosen = replace_cells(table, draws, settings)
    if chosen.empty or not (chosen[x] > 0).any():
        return parts.nothing_at_all("the paper's method has no noisy recordings in this study")
    quantities = [QUANTITIES[name] for name in settings["quantities"]]
    across = max(len(quantity.columns) for quantity in quantities)
    height = 0.9 + 2.3 * len(quantities)
    figure, grid = parts.panels(height, len(quantities), across, sharex=True, sharey="row")
    places, levels = parts.LogAxis.of(chosen[x]), set(chosen["level"])
    for j, (quantity, line) in enumerate(zip(quantities, grid, strict=True)):
        panels = {
            name: chosen.pivot(index="replicate", columns=x, values=name)
            for name in quantity.columns
            if name in chosen and chosen[name].notna().any()
        }
        shown = [_interval(of.loc[:, of.columns > 0]).iloc[1:] for of in panels.values()]
        stars = [claim.printed for name in panels for claim in printed(name, case)]
        limits = quantity.limits(np.concatenate([stars, *(of.to_numpy().ravel() for of in shown)]))
        for k, ((name, title), axes) in enumerate(zip(quantity.columns.items(), line, strict=True)):
            parts.letter(axes, across * j + k, title)
            if name not in panels:
                parts.nothing(axes, "this line has no such values")
                continue
            label = settings["labels"][settings["protocol"]]
            places.prepare(axes, label if j == len(quantities) - 1 else "")
            quantity.prepare(axes, limits, "" if k else quantity.label)
            _draws(axes, panels[name], places, quantity, limits)
            for claim in printed(name, case):
                is_shown = claim.cell_kind == settings["kind"] and claim.level in levels
                at = getattr(claim, x)
                if not claim.is_counted or not is_shown or at not in places.values:
                    continue
                place = places.position(at), quantity.place(claim.printed)
                axes.plot(*place, ls="", color=PAPER, **(STAR if claim.is_number else BAR))
                if not claim.is_number:
                    share = np.mean(claim.is_met(panels[name][at].dropna()))
                    axes.annotate(
                        f"{100 * share:.0f} % above", place, (0, -3), textcoords="offset points",
                        ha="center", va="top", color=PAPER, size="x-small", zorder=7,
                    )  # fmt: skip
    parts.legend(figure, title=parts.origin(settings), columns=4)
    return figure


def replace_cells(
    table: pd.DataFrame, draws: pd.DataFrame | None, settings: Mapping
) -> pd.DataFrame:
    """Return the scores of one method in cells of one kind, of the cells in `draws` those there.

    table, draws: as of `draw_draws`. settings: case, protocol, method and kind.
    """
    own = {name: settings[name] for name in ("case", "protocol", "method", "kind")}
    chosen = parts.where(table, **own)
    if draws is None:
        return chosen
    more = parts.where(draws, kind=settings["kind"])
    cells = [pd.MultiIndex.from_frame(t[["kind", "level", "points"]]) for t in (chosen, more)]
    kept = chosen[~cells[0].isin(cells[1])]
    return pd.concat([more.rename(columns={"draw": "replicate"}), kept], ignore_index=True)


def _interval(draws: pd.DataFrame) -> pd.DataFrame:
    """Number, median, low and high of the draws at each x, its columns."""
    long = draws.melt(value_name="value", var_name="x").dropna()
    table = long.groupby("x").agg(count=("value", "size"), **spread("value")).T
    return table.reindex(columns=draws.columns).astype(float)


def _draws(
    axes: Axes, draws: pd.DataFrame, places: parts.LogAxis, quantity: Quantity, limits: tuple
) -> None:
    """draws: a row for each replicate, in order, a column for each x."""
    count, *summary = _interval(draws).to_numpy()
    x = np.array([places.position(at) for at in draws])
    median, low, high = np.clip(quantity.place(summary), *limits)
    at = np.repeat(x, len(draws)) * 10 ** np.tile(parts.jitter(len(draws), JITTERED), len(x))
    every = np.clip(quantity.place(draws.to_numpy(float)), *limits).T.ravel()
    many = f"each of {np.nanmax(count):.0f} draws"
    axes.plot(at, every, ls="", marker="o", ms=1.6, mew=0, alpha=0.35, color=MODEL, label=many)
    axes.vlines(x, low, high, color=MODEL, lw=1.0, label="5th to 95th percentile")
    axes.plot(x, median, color=MODEL, lw=1.0, marker="o", ms=4.5, label="typical draw: the median")


def draw_methods(table: pd.DataFrame, settings: Mapping) -> Figure:
    """Median and 5th to 95th percentile of each method: a block for each case, a row for each
    quantity, a column for each protocol.

    table: scores.csv. settings: cases, protocols, methods in the study's order; kind of cells; x,
    `level` or `points`, and its labels by protocol; quantities, names of QUANTITIES.
    """
    x, rows = settings["x"], [QUANTITIES[name] for name in settings["quantities"]]
    table = table[(table["kind"] == settings["kind"]) & (table[x] > 0)]
    figure, grid = parts.method_grid(settings, len(rows), 2.1)
    places = parts.LogAxis.of(table[x])
    shift = parts.shifts(parts.in_order(table, settings["methods"]), METHODS_APART)
    drawn = set()
    for (case, row, protocol), axes in grid.items():
        quantity, of_case = rows[row], table[table["case"] == case]
        of_case = of_case.assign(value=quantity.combined(of_case)).dropna(subset="value")
        groups = of_case.groupby(["protocol", "method", x], as_index=False)
        of_case = groups.agg(**spread("value"))
        of_panel = of_case[of_case["protocol"] == protocol]
        if of_panel.empty:
            parts.nothing(axes, "no values in this study")
            continue
        places.prepare(axes, settings["labels"][protocol] if row == len(rows) - 1 else "")
        limits = quantity.limits(of_case["median"].to_numpy(float))
        first = protocol == settings["protocols"][0]
        quantity.prepare(axes, limits, quantity.together if first else "")
        for method, line in of_panel.groupby("method"):
            at = [places.position(value, shift[method]) for value in line[x]]
            values = quantity.place(line[["median", "low", "high"]].to_numpy(float).T)
            parts.series(axes, at, values, method, limits)
            drawn.add(method)
    keys = parts.method_keys([name for name in settings["methods"] if name in drawn])
    parts.legend(figure, *keys, columns=4)
    return figure


def draw_efficiency(table: pd.DataFrame, settings: Mapping) -> Figure:
    """Draw the root mean square of error / bound of the fits with a model.

    A block for each case, a column for each protocol. At the top is written how many fits of a
    method gave no model. Recordings that share a model are at the right of those taken alone.
    table: efficiency.csv. settings: cases, protocols, methods in the study's order;
    labels of the noise by protocol.
    """
    whole = table[table["points"] == table["points"].max()]
    figure, grid = parts.method_grid(settings, 1, 2.2)
    for (case, _, protocol), axes in grid.items():
        of_case = whole[whole["case"] == case]
        chosen = of_case[of_case["protocol"] == protocol]
        if chosen.empty:
            parts.nothing(axes, "no noisy recordings in this study")
            continue
        finite = of_case["efficiency"][np.isfinite(of_case["efficiency"])]
        decade = 10 ** np.ceil(np.log10(finite.max())) if len(finite) else 10.0
        limits = LOWEST, min(HIGHEST, max(10.0, decade))
        places = _places(axes, of_case, settings["labels"][protocol])
        axes.set(yscale="log", ylim=(limits[0], limits[1] * 1.6))
        axes.axhline(1, **parts.line_look(BOUND), zorder=2)
        methods = [m for m in parts.in_order(chosen, settings["methods"]) if m != BOUND]
        shift, lost = parts.shifts(methods, EFFICIENCY_APART), []
        for method in methods:
            line = chosen[chosen["method"] == method].sort_values(["recordings", "level"])
            cells = zip(line["recordings"], line["level"], strict=True)
            x = np.array([places[cell] for cell in cells]) * 10 ** shift[method]
            values = line["efficiency"].to_numpy()  # undefined, and not drawn, where the bound is
            failed = (line["no_model"] > 0).to_numpy()
            for at, row in zip(x[failed], line[failed].itertuples(), strict=True):
                text, upon = f"{row.no_model} of {row.replicates}", lost.count(row.level)
                axes.annotate(
                    text, (at, limits[1]), (6, -7 * upon), textcoords="offset points", va="center",
                    size="x-small", color=method_style(method).color,
                )  # fmt: skip
                lost.append(row.level)
            alone = line["recordings"] == 1
            parts.series(axes, x, np.array([values] * 3), method, limits, joined=alone)
        axes.set_ylabel("rms error / bound" if protocol == settings["protocols"][0] else "")
    keys = parts.method_keys(parts.in_order(table, settings["methods"]))
    parts.legend(figure, *keys, columns=4, title="n of m: fits that gave no model")
    return figure


def _places(axes: Axes, table: pd.DataFrame, label: str) -> dict[tuple[int, float], float]:
    """Where (recordings, level) stand on an axis, which is given their ticks."""
    cells = sorted(set(zip(table["recordings"], table["level"], strict=True)))
    joint = [cell for cell in cells if cell[0] > 1]
    if joint == cells:
        together = parts.LogAxis.of([level for _, level in cells])
        together.prepare(axes, f"{label}, {cells[0][0]} recordings")
        return {cell: together.position(cell[1]) for cell in cells}
    single = parts.LogAxis.of([level for recordings, level in cells if recordings == 1])
    single.prepare(axes, label)
    last = single.position(single.values[-1])
    places = {(1, level): single.position(level) for level in single.values}
    places |= {cell: last * STEP ** (k + 1) for k, cell in enumerate(joint)}
    if joint:
        labels = [label.get_text() for label in axes.get_xticklabels()]
        labels += [f"{level:g}\n{recordings} rec." for recordings, level in joint]
        axes.set_xticks(list(places.values()), labels)
        axes.set_xlim(right=max(places.values()) * 1.5)
        axes.axvline(last * np.sqrt(STEP), color="#bbbbbb", lw=0.6, ls=":")
    return places


def draw_overview(table: pd.DataFrame, settings: Mapping, peers: pd.DataFrame) -> Figure:
    """Draw the mean coefficient error over the orders against noise, by one protocol.

    The paper's method, the best of pysindy, its oracle, ours, and the bound; those that the study
    has. Errors are of the fits that gave a model; how many did not is written above.

    Parameters
    ----------
    table, peers : DataFrame
        scores.csv and peers.csv.
    settings : Mapping
        case and protocol to show, and the label of the noise.
    """
    case, protocol = settings["case"], settings["protocol"]
    figure, ((axes,),) = parts.panels(3.7, width=SINGLE)
    errors = _errors(table, peers, case, protocol)
    if errors.empty:
        parts.nothing(axes, "this study has no noisy recordings to show")
        return figure
    places = parts.LogAxis.of(errors["level"])
    places.prepare(axes, settings["label"])
    said = {PAPER_METHOD: "", best_of_pysindy(errors): "best of pysindy: ",
            ORACLES: "pysindy as the truth would set it: ", OURS: "ours: ", BOUND: ""}  # fmt: skip
    present = set(errors["method"])
    names = {k: text + method_style(k).label for k, text in said.items() if k in present}
    shown = errors[errors["method"].isin(names)]
    values = shown[["median", "low", "high"]].to_numpy(float).ravel()
    values = values[np.isfinite(values) & (values > 0)]
    # at most ten times what a lost model costs
    limits = (values.min() / 2, min(values.max() * 2, 1e3)) if values.size else DECADES
    parts.prepare_log(axes, limits, "mean error of the coefficients, %")
    bound = errors[errors["method"] == BOUND]
    if len(bound) > 1:
        x = [places.position(level) for level in bound["level"]]
        axes.fill_between(x, limits[0], bound["median"], color=SHADE, lw=0, zorder=0)
        axes.text(x[-1] / 1.05, limits[0] * 1.15, "below the Cramér-Rao bound", ha="right",
                  fontsize="small", color=QUIET)  # fmt: skip
    shift = parts.shifts(list(names), 0.03)
    for method in names:
        line = errors[errors["method"] == method]
        x = [places.position(level, shift[method]) for level in line["level"]]
        parts.series(axes, x, line[["median", "low", "high"]].to_numpy().T, method, limits)
    _note_failures(axes, shown, places)
    title = [f"{spoken(case)}, protocol {protocol}"]
    if levels := beaten_at(errors):
        title.append(f"the oracle is better than ours at {levels}")
    axes.set_title("\n".join(title), fontsize="small")
    keys = parts.method_keys(names)
    parts.legend(figure, *keys, columns=1, loc="outside upper left", handlelength=3)
    return figure


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
    """The method with the lowest median, over the noisy levels, of the median error."""
    medians = table.groupby("method")["median"].agg(np.median)
    medians = medians.reindex([method for method in PYSINDY if method in medians]).dropna()
    return None if medians.empty else medians.idxmin()


def beaten_at(table: pd.DataFrame) -> str:
    """The noise levels where the oracle's median is below ours, or ''."""
    medians = table.pivot_table(index="level", columns="method", values="median")
    if not {ORACLES, OURS} <= set(medians):
        return ""
    return ", ".join(f"{level:g}" for level in medians.index[medians[ORACLES] < medians[OURS]])


def _errors(scores: pd.DataFrame, peers: pd.DataFrame, case: str, protocol: str) -> pd.DataFrame:
    """method, level, median, low, high of the fits with a model, count and failures, at the levels
    above zero; of the oracle the lowest of STLSQ, FROLS and the weak form.
    """
    cells, others = (
        parts.where(rows[rows["level"] > 0], case=case, protocol=protocol)
        for rows in (of_kind(scores, NOISE), peers)
    )
    cells = cells.assign(error=mean_error(cells))
    has_model = np.isfinite(cells["error"])
    keys = ["method", "level"]
    errors = cells[has_model].groupby(keys).agg(**spread("error"))
    counts = cells.assign(failed=~has_model).groupby(keys)["failed"].agg(["size", "sum"])
    errors = errors.join(counts.set_axis(["count", "failures"], axis=1), how="right").reset_index()
    others = others[(others["setting"] == ORACLE) & others["method"].isin(PYSINDY)]
    if others.empty:  # its columns have no numbers
        return errors
    least = others.groupby("level")["mean_error_percent"].min()
    columns = dict.fromkeys(("median", "low", "high"), least)
    oracle = pd.DataFrame(columns).reset_index().assign(method=ORACLES, failures=0)
    return pd.concat([errors, oracle])
