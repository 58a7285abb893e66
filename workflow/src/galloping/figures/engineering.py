"""Figures for the line engineer: galloping span, orbits beside design ellipses, measures."""

import os
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Polygon, Rectangle
from matplotlib.path import Path
from PIL import Image

from galloping.figures import parts
from galloping.figures.schematics import INK, arrow
from galloping.figures.style import MODEL_COLOR, PAPER_COLOR, TRUE_COLOR, spoken, styled
from galloping.line.galerkin import Line, make_mode_shapes, positions
from galloping.line.measures import NO_MEASURE, design_ellipses, ice_removal
from galloping.storage import replacing

MAX_COLUMNS = 3  # columns of panels of orbits
ELLIPSES = {
    "Davison": ("#b30000", (0, (5, 2))),
    "Toye": ("#2fa86a", (0, (1, 1))),
    "CIGRE 322": ("#e69f00", "-."),
}
ORBIT_POINTS = 4000  # plotted points at the end of an orbit, about twenty revolutions
LEVEL_STYLE: dict[str, Any] = {"color": TRUE_COLOR, "lw": 0.8, "ls": (0, (6, 3))}
MEASURE_LABELS = {
    "vertical_amplitude_m": "vertical amplitude, m",
    "critical_wind_m_s": "critical wind, m/s",
    "clearance_m": "least clearance, m",
}
ANIMATION_SIZE = (7.2, 3.2)  # inches
DPI = 110  # px/inch
FRAME_RATE = 10  # frames per second
PALETTE_SIZE = 24  # colours of an animation


def draw_orbits(orbits: Mapping[str, Mapping[float, np.ndarray]], settings: Mapping) -> Figure:
    """Plot the orbits of galloping lines at mid-span beside design ellipses, a panel per line.

    The scales are equal in both directions. orbits: of each case, by wind speed in m/s, (n, 2)
    places (w, v) in m about rest. settings: cases, sections of the configuration by name; winds,
    m/s, of the simulations.
    """
    names = list(settings["cases"])
    columns = min(len(names), MAX_COLUMNS)
    height = parts.height(0.6, 3.6, -(-len(names) // columns))
    figure, grid = parts.wrapped_grid(len(names), columns, height)
    outlines = [places for of_case in orbits.values() for places in of_case.values()]
    for case in settings["cases"].values():
        outlines += [each.outline() for each in design_ellipses(case).values()]
    reach = 1.35 * max(np.max(np.abs(each[:, 0])) for each in outlines)
    for k, (axes, name) in enumerate(zip(grid, names, strict=True)):
        without = "" if orbits[name] else ": no limit cycle at these winds"
        parts.letter(axes, k, f"{spoken(name)}{without}")
        _draw_orbits_of_case(axes, settings["cases"][name], orbits[name], reach)
        axes.set_ylabel("" if k % columns else "vertical, m from rest")
    parts.legend(figure, columns=6, loc="outside lower center")
    outside = {name: _first_outside(settings["cases"][name], orbits[name]) for name in names}
    texts = [f"{wind:g} m/s ({spoken(name)})" for name, wind in outside.items() if wind is not None]
    if texts:
        figure.set_label(f"The orbit leaves all design ellipses at {' and '.join(texts)}")
    elif all(set(orbits[name]) >= set(settings["winds"]) for name in names):
        figure.set_label("Every orbit stays within a design ellipse")
    return figure


def _first_outside(case: Mapping, orbits: Mapping[float, np.ndarray]) -> float | None:
    """Find the lowest wind speed whose orbit is partly outside of all ellipses."""
    outlines = [Path(ellipse.outline()) for ellipse in design_ellipses(case).values()]
    for wind, places in sorted(orbits.items()):
        if not np.any([outline.contains_points(places) for outline in outlines], axis=0).all():
            return wind
    return None


def _draw_orbits_of_case(
    axes: Axes, case: Mapping, orbits: Mapping[float, np.ndarray], reach: float
) -> None:
    sag = Line.from_case(case).sag
    for what, ellipse in design_ellipses(case).items():
        color, line = ELLIPSES[what]
        outline = Polygon(ellipse.outline(), closed=True, fill=False, ec=color, ls=line, lw=1.1)
        axes.add_patch(outline)
        axes.plot([], [], color=color, ls=line, lw=1.1, label=what)
    shades = np.linspace(0.55, 1.0, len(orbits))
    for (wind, places), shade in zip(sorted(orbits.items()), shades, strict=True):
        axes.plot(*places[-ORBIT_POINTS:].T, color=MODEL_COLOR, alpha=shade, lw=0.6 + shade,
                  label=f"{wind:g} m/s")  # fmt: skip
        axes.annotate(
            f"{wind:g}", places[np.argmax(places[:, 1])], xytext=(0, 2),
            textcoords="offset points", ha="center", color=MODEL_COLOR, size="x-small",
        )  # fmt: skip
    axes.plot(0, 0, marker="+", ms=8, color=INK)
    axes.axhline(sag, **LEVEL_STYLE)
    axes.text(0.02, sag, "supports", transform=axes.get_yaxis_transform(), va="bottom",
              color="#5f5f5f", size="small")  # fmt: skip
    arrow_x = 0.95 * reach
    arrow(axes, (arrow_x, 0), (arrow_x, sag), style="<|-|>", width=0.8)
    axes.text(arrow_x, 0.75 * sag, f"sag {sag:.1f} m", size="small", rotation=90, ha="right",
              va="center")  # fmt: skip
    side = case["bundle"]["dimension"]
    axes.add_patch(Rectangle((-side / 2, -side / 2), side, side, fc=INK, ec=INK))
    axes.set(aspect="equal", xlim=(-reach, reach), xlabel="along the wind, m from rest")


def draw_measures(table: pd.DataFrame, settings: Mapping) -> Figure:
    """Plot amplitude, critical wind and clearance of a span for each measure against galloping.

    table: measures.csv. settings: cases.
    """
    most = table[table["case"].isin(settings["cases"])]["case"].value_counts().max()
    figure, grids = parts.case_grids(
        settings["cases"], len(MEASURE_LABELS), 0.4, 0.7 + 0.2 * most, sharex=False
    )
    for row, (case, grid) in enumerate(grids.items()):
        of_case = table[table["case"] == case].sort_values("rank")
        limit = float(of_case["required_clearance_m"].iloc[0])
        labels = of_case["measure"] + np.where(of_case["note"].fillna("") != "", " *", "")
        for column, (axes, name) in enumerate(zip(grid[0], MEASURE_LABELS, strict=True)):
            parts.letter(axes, row * len(MEASURE_LABELS) + column, MEASURE_LABELS[name])
            values = of_case[[name, f"{name}_low", f"{name}_high"]].to_numpy(float)
            known = values[np.isfinite(values[:, 0])]
            least = limit if name == "clearance_m" else 0.0
            reach = np.max(known, initial=least, where=np.isfinite(known)) or 1.0
            parts.rows(axes, labels)
            for y, value in enumerate(values):
                text, end, color = _format_value(value[0]), 0.0, PAPER_COLOR
                if np.isfinite(value[0]):
                    text += " or never" if np.isposinf(value[2]) else ""
                    end, color = np.nanmax(np.minimum(value, reach)), MODEL_COLOR
                    limits = (-np.inf, reach)
                    parts.dot(axes, y, value, limits, MODEL_COLOR, "o", 3.5, bar={"lw": 1.6})
                axes.annotate(text, (end, y), (5, 0), textcoords="offset points", va="center",
                              size="small", color=color)  # fmt: skip
            axes.set(xlim=(-0.04 * reach, 1.4 * reach))
        axes.axvline(limit, color=PAPER_COLOR, lw=0.9, ls=(0, (4, 2)), label="clearance to keep")
    parts.legend(figure)
    figure.set_label(_most_useful(table[table["case"] == next(iter(settings["cases"]))]))
    return figure


def _most_useful(of_case: pd.DataFrame) -> str:
    """Describe the vertical amplitude without and with the best measure that keeps the ice."""
    with_ice = of_case[of_case["measure"] != ice_removal().label].set_index("measure")
    amplitude = with_ice["vertical_amplitude_m"]
    amplitude = amplitude[np.isfinite(amplitude)]
    if not amplitude.get(NO_MEASURE.label, 0.0) > amplitude.min():
        return ""
    return (
        f"The best measure that leaves the ice, {amplitude.idxmin()}, reduces the vertical "
        f"amplitude from {amplitude[NO_MEASURE.label]:.2g} to {amplitude.min():.2g} m"
    )


def _format_value(value: float) -> str:
    """Format a value with three digits, or why there is none."""
    if np.isfinite(value):
        return f"{value:.3g}"
    return "never" if np.isposinf(value) else "no bounded motion"


def write_animation(
    path: str | os.PathLike, case: Mapping, time: np.ndarray, states: np.ndarray, title: str
) -> None:
    """Write the motion of a span as an animated GIF that repeats endlessly.

    The same motion gives the same bytes. The span is drawn in elevation (vertical motion to the
    scale of the sag) and in plan, with the path of mid-span to scale, in real time. case: of the
    configuration. time: (n,) s, uniform. states: (n, n_states) the motion, m and m/s, of which
    FRAME_RATE frames a second are shown. title: shown above the span.
    """
    step = max(1, round(1 / (FRAME_RATE * (time[1] - time[0]))))
    with styled(8):
        figure, update = _prepare_scene(case, states, title)
        frames = range(0, len(time), step)
        ends = step * (time[1] - time[0]) * np.arange(len(frames) + 1)
        _write_gif(path, figure, update, frames, np.diff(np.round(100 * ends)))


def write_still(path: str | os.PathLike, reason: str) -> None:
    """Write a GIF with a single frame that states why there is no motion to animate."""
    with styled(8):
        _write_gif(path, parts.make_empty_figure(reason), lambda frame: None, range(1), [1])


def _write_gif(
    path: str | os.PathLike, figure: Figure, update: Callable[[int], None], frames: range,
    durations: Sequence[float] | np.ndarray,
) -> None:  # fmt: skip
    """Write `frames` of a figure that `update` changes, with one common palette of few colours.

    durations: of each frame, in the file's unit, 10 ms.
    """
    figure.set_dpi(DPI)
    canvas = FigureCanvasAgg(figure)
    figure.draw_without_rendering()
    figure.set_layout_engine("none")  # solved once, not in every frame
    images: list[Image.Image] = []
    for frame in frames:
        update(frame)
        canvas.draw()
        image = Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")
        palette = images[0] if images else image.quantize(PALETTE_SIZE, dither=Image.Dither.NONE)
        images.append(image.quantize(palette=palette, dither=Image.Dither.NONE))
    with replacing(path) as partial:
        images[0].save(
            partial, "GIF", save_all=True, append_images=images[1:], loop=0,
            duration=[10 * int(each) for each in durations],
        )  # fmt: skip


def _prepare_scene(
    case: Mapping, states: np.ndarray, title: str
) -> tuple[Figure, Callable[[int], None]]:
    line = Line.from_case(case)
    phi, psi = make_mode_shapes(case, line)
    s = positions(line.span)
    rest = -4 * line.sag * (s / line.span) * (1 - s / line.span)
    figure = Figure(figsize=ANIMATION_SIZE, layout="constrained")
    panes = figure.subplot_mosaic(
        [["elevation", "orbit"], ["plan", "orbit"]], width_ratios=[2.2, 1]
    )
    elevation, plan, middle = panes["elevation"], panes["plan"], panes["orbit"]
    elevation.set_title(title, loc="left")
    reach = 1.15 * np.max(np.abs(states[:, :2])) or 1.0  # m, of a line at rest
    elevation.plot(s, rest, **LEVEL_STYLE)
    (side,) = elevation.plot(s, rest, color=MODEL_COLOR, lw=1.6)
    elevation.set(
        xlim=(0, line.span), ylim=(-line.sag - reach, 1.0), ylabel="height, m", xticklabels=[]
    )
    plan.axhline(0, **LEVEL_STYLE)
    (above,) = plan.plot(s, 0 * s, color=MODEL_COLOR, lw=1.6)
    plan.set(xlim=(0, line.span), ylim=(-reach, reach), xlabel="m along the span",
             ylabel="downwind, m")  # fmt: skip
    middle.plot(states[:, 1], states[:, 0], color=TRUE_COLOR, lw=0.8)
    (point,) = middle.plot([0], [0], ls="", marker="s", ms=5, mfc="white", mec=INK, mew=1.3)
    middle.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal",
               xlabel="downwind at mid-span, m", ylabel="vertical, m")  # fmt: skip

    def update(frame: int) -> None:
        v, w = states[frame, :2]
        side.set_ydata(rest + phi.shape * v)
        above.set_ydata(psi.shape * w)
        point.set_data([w], [v])

    return figure, update
