"""Figure 1: the line, its coordinates and the cross-section of the bundle."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from galloping.figures import panels
from galloping.figures.sketch import INK, arrow, bare, iced_conductor
from galloping.figures.style import DOUBLE, MODEL, spoken
from galloping.physics.galerkin import Derived
from galloping.physics.line import MODES, Line, positions

HEIGHT = 2.9
ELEVATION = (0.075, 0.15, 0.63, 0.76)  # of the figure: left, bottom, width, height
SECTION = (0.735, 0.1, 0.26, 0.82)


def draw_line(model: Derived, settings: Mapping) -> Figure:
    """Elevation with a stated exaggeration, and the bundle's cross-section (not to scale).

    model: what follows from the line. settings: case, its name; line, its parameters.
    """
    case, derived, name = settings["line"], model.quantities, settings["case"]
    figure = Figure(figsize=(DOUBLE, HEIGHT))
    elevation = figure.add_axes(ELEVATION)
    section = figure.add_axes(SECTION)
    _elevation(elevation, case, derived, name)
    _section(section, case["bundle"]["subconductors"])
    return figure


def _elevation(axes: Axes, case: Mapping, derived: Mapping, name: str) -> None:
    span, sag = case["line"]["span"], derived["sag_m"]
    low, high = -1.75 * sag, 0.95 * sag
    left, right = -0.06 * span, 1.06 * span
    axes.set(xlim=(left, right), ylim=(low, high))
    width, height = DOUBLE * ELEVATION[2], HEIGHT * ELEVATION[3]
    exaggeration = (height / (high - low)) / (width / (right - left))

    def rest(s):
        return -4 * sag * (s / span) * (1 - s / span)

    s = np.linspace(0, span, 201)
    axes.plot([0, span], [0, 0], color="#9a9a9a", lw=0.8, ls=(0, (6, 3)))
    axes.plot(s, rest(s), color=INK, lw=1.6)
    nodes = positions(span)
    mode = MODES[case["line"]["mode_shape"]](Line.from_case(case)).shape
    axes.plot(nodes, rest(nodes) + 0.35 * sag * mode, color=MODEL, lw=0.9, ls="--")
    axes.text(
        0.84 * span, rest(0.84 * span) - 0.05 * sag, "at rest", ha="left", va="top", color=INK
    )
    axes.annotate(
        r"first mode, $V=\phi_v(s)\,q_v$",
        xy=(0.6 * span, rest(0.6 * span) + 0.33 * sag),
        xytext=(0.53 * span, 0.12 * sag),
        color=MODEL,
    )
    for support in (0, span):
        axes.plot([support, support], [low, 0.12 * sag], color=INK, lw=2.2)
    spacers = np.asarray(case["spacers"]["positions"], float)
    axes.plot(spacers, rest(spacers), ls="", marker="s", ms=5, mfc="white", mec=INK, mew=1.1)
    for k, place in enumerate(spacers, start=1):
        axes.text(place, rest(place) - 0.12 * sag, f"$s_{{{k}}}$", ha="center", va="top")
    middle = 0.44 * span
    arrow(axes, (middle, 0), (middle, rest(middle)), style="<|-|>", width=0.8)
    axes.text(
        middle - 0.01 * span, -0.35 * sag, f"sag {sag:.2f} m", ha="right", va="center",
        bbox={"facecolor": "white", "edgecolor": "none", "pad": 1},
    )  # fmt: skip
    _triad(axes, 0.03 * span, 0.3 * sag, 0.13 * span, 0.5 * sag)
    axes.text(
        0.98 * span, 0.92 * sag,
        rf"$l$ = {span:g} m, $H$ = {case['line']['tension'] / 1e3:g} kN a conductor,"
        rf" $\lambda^2$ = {derived['irvine_parameter']:.3g}" "\n"
        rf"$\omega_v$ = {derived['omega_v_rad_s']:.3f} rad/s,"
        rf" $\omega_w$ = {derived['omega_w_rad_s']:.3f} rad/s",
        ha="right", va="top",
    )  # fmt: skip
    axes.set(xlabel="distance from the left support, m", ylabel="height above the supports, m")
    axes.set_yticks(sorted({0.0, -round(sag, 2)}))
    panels.letter(axes, 0, f"elevation, {spoken(name)}; heights × {exaggeration:.3g}")


def _triad(axes: Axes, x: float, y: float, along: float, up: float) -> None:
    """The coordinate s with the displacement Y along it, V upwards, W towards the reader."""
    arrow(axes, (x, y), (x + along, y))
    arrow(axes, (x, y), (x, y + up))
    axes.text(x + along * 1.05, y, "$s$, $Y$", va="center")
    axes.text(x + 0.08 * along, y + up, "$V$", va="center", ha="left")
    axes.plot(x, y, "o", ms=7, mfc="white", mec=INK, mew=0.9)
    axes.plot(x, y, "o", ms=2, color=INK)
    axes.text(x - 0.16 * along, y, "$W$", va="center", ha="right")


def _section(axes: Axes, count: int) -> None:
    """Sub-conductors on a regular polygon around the reference curve."""
    turn = np.pi / count + 2 * np.pi * np.arange(count) / count
    ring = 0.0 if count == 1 else 1.0
    x, y = ring * np.cos(turn), ring * np.sin(turn)
    axes.plot([*x, x[0]], [*y, y[0]], color="#9a9a9a", lw=2.0, zorder=0)
    for place in zip(x, y, strict=True):
        iced_conductor(axes, *place, 0.2)
    axes.add_patch(Circle((0, 0), 0.05, color=INK))
    arrow(axes, (0, 0), (0, 0.55))
    arrow(axes, (0, 0), (0.55, 0))
    axes.text(0.06, 0.52, "$V$", va="center")
    axes.text(0.55, -0.06, "$W$", va="top", ha="center")
    axes.text(-0.05, -0.12, "reference\ncurve", va="top", ha="center", fontsize="small")
    for height in (-0.35, 0, 0.35):
        arrow(axes, (-1.75, height), (-1.25, height), color=MODEL)
    axes.text(-1.5, 0.45, "wind $U$", ha="center", va="bottom", color=MODEL)
    axes.set(xlim=(-1.9, 1.15), ylim=(-1.35, 1.25))
    bare(axes)
    panels.letter(axes, 1, f"bundle of {count}, not to scale")
    axes.text(0.0, -1.08, "spacer frame, ice to windward", ha="center", va="top", fontsize="small")
