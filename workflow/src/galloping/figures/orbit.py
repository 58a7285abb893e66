"""The orbit of the bundle at mid-span, to scale, beside the design ellipses."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from galloping.figures import panels
from galloping.figures.sketch import INK, arrow
from galloping.figures.style import DOUBLE, MODEL, spoken
from galloping.physics.clearance import design_ellipses
from galloping.physics.line import Line

COLUMNS = 3  # of panels
LOOKS = {
    "Davison": ("#b30000", (0, (5, 2))),
    "Toye": ("#2fa86a", (0, (1, 1))),
    "CIGRE 322": ("#e69f00", "-."),
}
SHOWN = 4000  # places at the end of an orbit, some twenty rounds: more would lie over each other


def draw_orbits(orbits: Mapping[str, Mapping[float, np.ndarray]], settings: Mapping) -> Figure:
    """Lissajous figures at mid-span, one panel for each case, equal scales in both directions.

    orbits: of each case, by wind speed in m/s, (n, 2) places (w, v) in m about rest. settings:
    cases, sections of the configuration by name.
    """
    names = list(settings["cases"])
    columns = min(len(names), COLUMNS)
    rows, height = panels.fitting(range(math.ceil(len(names) / columns)), 0.6, 3.6)
    shown = names[: len(rows) * columns]
    figure = Figure(figsize=(DOUBLE, height), layout="constrained")
    drawn = [places for of_case in orbits.values() for places in of_case.values()]
    for name in shown:
        drawn += [each.outline() for each in design_ellipses(settings["cases"][name]).values()]
    reach = 1.35 * max(np.max(np.abs(each[:, 0])) for each in drawn)
    grid = figure.subplots(len(rows), columns, squeeze=False, sharex=True, sharey=True)
    for k, (axes, name) in enumerate(zip(grid.flat, shown, strict=False)):
        panels.letter(axes, k, spoken(name))
        _panel(axes, settings["cases"][name], orbits[name], reach)
    for axes in grid.flat[len(shown) :]:
        axes.set_visible(False)
    for axes in grid[:, 0]:
        axes.set_ylabel("vertical, m from rest")
    named = {}
    for axes in grid.flat:
        named |= dict(zip(*reversed(axes.get_legend_handles_labels()), strict=True))
    figure.legend(named.values(), named, loc="outside lower center", ncols=6)
    panels.note_left_out(figure, names[len(shown) :], "clearance.csv")
    return figure


def _panel(axes: Axes, case: Mapping, orbits: Mapping[float, np.ndarray], reach: float) -> None:
    sag = Line.from_case(case).sag
    for what, ellipse in design_ellipses(case).items():
        color, line = LOOKS[what]
        outline = Polygon(ellipse.outline(), closed=True, fill=False, ec=color, ls=line, lw=1.1)
        axes.add_patch(outline)
        axes.plot([], [], color=color, ls=line, lw=1.1, label=what)
    shades = np.linspace(0.55, 1.0, len(orbits))
    for (wind, places), shade in zip(sorted(orbits.items()), shades, strict=True):
        axes.plot(
            *places[-SHOWN:].T, color=MODEL, alpha=shade, lw=0.6 + shade, label=f"{wind:g} m/s"
        )
        axes.annotate(
            f"{wind:g}", places[np.argmax(places[:, 1])], xytext=(0, 2),
            textcoords="offset points", ha="center", color=MODEL, size="x-small",
        )  # fmt: skip
    axes.plot(0, 0, marker="+", ms=8, color=INK)
    axes.axhline(sag, color="#9a9a9a", lw=0.8, ls=(0, (6, 3)))
    axes.text(0.02, sag, "supports", transform=axes.get_yaxis_transform(), va="bottom",
              color="#5f5f5f", size="small")  # fmt: skip
    place = 0.95 * reach
    arrow(axes, (place, 0), (place, sag), style="<|-|>", width=0.8)
    axes.text(
        place, 0.75 * sag, f"sag {sag:.1f} m", size="small", rotation=90, ha="right", va="center"
    )
    side = case["bundle"]["dimension"] / 2
    axes.add_patch(Polygon(_square(side), closed=True, fc=INK, ec=INK, label=None))
    axes.set_aspect("equal")
    axes.set_xlim(-reach, reach)
    axes.set_xlabel("along the wind, m from rest")


def _square(half: float) -> Sequence[tuple[float, float]]:
    return [(-half, -half), (half, -half), (half, half), (-half, half)]
