"""Figures 6, 7 and 10 as the paper has them: its method, one draw of the noise, and all draws."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from galloping.figures import panels, paper
from galloping.figures.quantities import QUANTITIES, Quantity
from galloping.figures.style import DOUBLE, MODEL, method_style, spoken
from galloping.intervals import interval
from galloping.study.kinds import SUBSET

CELL = ["kind", "level", "points"]


def draw_draws(table: pd.DataFrame, settings: Mapping, draws: pd.DataFrame | None = None) -> Figure:
    """A row for each quantity, a panel for each of its columns: the first draw, the median and the
    5th to 95th percentile of all, and what the paper prints.

    table: scores.csv. draws: more of them, of `paper.draws.paper_draws`, instead of those of the
    same cells in scores.csv. settings: case, protocol and method; kind of cells; x, `level` or
    `points`, and its labels by protocol; quantities, names of QUANTITIES.
    """
    x, subsets = settings["x"], settings["kind"] == SUBSET
    chosen = table[
        np.logical_and.reduce([table[k] == settings[k] for k in ("case", "protocol", "method")])
        & (table["kind"] == settings["kind"]) & (table[settings["x"]] > 0)
    ]  # fmt: skip
    if draws is not None:
        more = draws.rename(columns={"draw": "replicate"})
        more = more[(more["kind"] == settings["kind"]) & (more[x] > 0)]
        kept = ~pd.MultiIndex.from_frame(chosen[CELL]).isin(pd.MultiIndex.from_frame(more[CELL]))
        chosen = pd.concat([more, chosen[kept]], ignore_index=True)
    if chosen.empty:
        return panels.nothing_at_all("the paper's method has no noisy recordings in this study")
    rows = [QUANTITIES[name] for name in settings["quantities"]]
    across = max(len(row.columns) for row in rows)
    figure = Figure(figsize=(DOUBLE, 0.8 + 2.3 * len(rows)), layout="constrained")
    grid = figure.subplots(len(rows), across, squeeze=False, sharex=True, sharey="row")
    label = settings["labels"][settings["protocol"]]
    places, levels = panels.LogAxis.of(chosen[x]), set(chosen["level"])
    for j, (quantity, line) in enumerate(zip(rows, grid, strict=True)):
        present = [name for name in quantity.columns if chosen.get(name, pd.Series()).notna().any()]
        limits = quantity.limits(_values(chosen, settings, present))
        for k, (name, axes) in enumerate(zip(quantity.columns, line, strict=True)):
            panels.letter(axes, across * j + k, quantity.columns[name])
            if name not in present:
                panels.nothing(axes, "this line has no such values")
                continue
            places.prepare(axes, label if j == len(rows) - 1 else "")
            quantity.prepare(axes, limits, "" if k else quantity.label)
            drawn = chosen.pivot(index="replicate", columns=x, values=name)
            _panel(axes, drawn, places, quantity, limits)
            for each in paper.printed(name, settings["case"]):
                at = each.level if x == "level" else each.points
                if at in places.values and each.level in levels and bool(each.points) == subsets:
                    paper.mark(axes, places.position(at), quantity.place(each.value), each)
    title = f"{spoken(settings['case'])}, {method_style(settings['method']).label}, protocol "
    panels.legend(figure, columns=5, title=f"{title}{settings['protocol']}")
    return figure


def _values(table: pd.DataFrame, settings: Mapping, columns: list[str]) -> np.ndarray:
    """What is drawn of some columns: intervals, the first draw, and what the paper prints."""
    marks = [each.value for name in columns for each in paper.printed(name, settings["case"])]
    first = table.loc[table["replicate"] == 0, columns].to_numpy(float).ravel()
    cells = [cell for _, cell in table.groupby(settings["x"])]
    ends = [interval(cell[name].dropna()) for cell in cells for name in columns]
    return np.concatenate([np.ravel(ends), first, marks])


def _panel(
    axes: Axes, draws: pd.DataFrame, places: panels.LogAxis, quantity: Quantity, limits: tuple
) -> None:
    """draws: a row for each replicate, in order, a column for each x."""
    x = [places.position(at) for at in draws]
    summary = np.transpose([interval(draws[at].dropna()) for at in draws])
    counts = draws.count()
    many = " to ".join(f"{count}" for count in sorted({counts.min(), counts.max()}))
    median, low, high = np.clip(quantity.place(summary), *limits)
    first = quantity.place(draws.iloc[0])
    panels.band(axes, x, low, high, f"5th to 95th percentile of {many} draws")
    axes.plot(x, median, color=MODEL, ls=":", lw=1.3, marker="_", label="their median")
    inside = np.flatnonzero((first >= limits[0]) & (first <= limits[1])).tolist()
    panels.points(axes, x, first, limits, MODEL, "o", 4.5)
    axes.plot(
        x, np.clip(first, *limits), color=MODEL, lw=0.8, marker="o", ms=4.5, markevery=inside,
        label="one draw, the first",
    )  # fmt: skip
