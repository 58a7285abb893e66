"""The galloping span and its orbit at mid-span, moving."""

from __future__ import annotations

import os
from collections.abc import Mapping

import numpy as np
from matplotlib.animation import FuncAnimation, PillowWriter
from matplotlib.figure import Figure

from galloping.cycles.collocation import Orbit
from galloping.figures.sketch import INK
from galloping.figures.style import MODEL, styled
from galloping.physics.galerkin import modes
from galloping.physics.line import Line, positions
from galloping.storage import replacing

SIZE, DPI, RATE = (7.2, 3.2), 130, 12  # inches, px/inch, frames per second


def write_animation(
    path: str | os.PathLike, case: Mapping, orbit: Orbit, title: str, frames: int = 36
) -> None:
    """One period of a limit cycle as a GIF that repeats; the same bytes for the same orbit.

    The span is drawn in elevation (vertical motion to the scale of the sag) and in plan; the orbit
    at mid-span to scale. A period takes frames / RATE seconds.
    """
    with styled(8), replacing(path) as partial:
        figure, update = _scene(case, orbit, title, frames)
        figure.draw_without_rendering()
        figure.set_layout_engine("none")  # solved once, not in every frame
        animation = FuncAnimation(figure, update, frames=frames, blit=False)
        animation.save(partial, writer=PillowWriter(fps=RATE), dpi=DPI)


def _scene(case: Mapping, orbit: Orbit, title: str, frames: int) -> tuple:
    line = Line.from_case(case)
    phi, psi = modes(case, line)
    s = positions(line.span)
    rest = -4 * line.sag * (s / line.span) * (1 - s / line.span)
    states = orbit.at(np.arange(frames) / frames)
    closed = np.vstack([states, states[:1]])
    figure = Figure(figsize=SIZE, layout="constrained")
    panes = figure.subplot_mosaic(
        [["elevation", "orbit"], ["plan", "orbit"]], width_ratios=[2.2, 1]
    )
    elevation, plan, middle = panes["elevation"], panes["plan"], panes["orbit"]
    elevation.set_title(title, loc="left")
    reach = 1.15 * np.max(np.abs(states[:, :2]))
    elevation.plot(s, rest, color="#9a9a9a", lw=0.8, ls=(0, (6, 3)))
    (side,) = elevation.plot(s, rest, color=MODEL, lw=1.6)
    elevation.set(
        xlim=(0, line.span), ylim=(-line.sag - reach, 1.0), ylabel="height, m", xticklabels=[]
    )
    plan.axhline(0, color="#9a9a9a", lw=0.8, ls=(0, (6, 3)))
    (above,) = plan.plot(s, 0 * s, color=MODEL, lw=1.6)
    plan.set(xlim=(0, line.span), ylim=(-reach, reach), xlabel="m along the span",
             ylabel="downwind, m")  # fmt: skip
    middle.plot(closed[:, 1], closed[:, 0], color="#9a9a9a", lw=0.8)
    (place,) = middle.plot([0], [0], ls="", marker="s", ms=5, mfc="white", mec=INK, mew=1.3)
    middle.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal",
               xlabel="downwind at mid-span, m", ylabel="vertical, m")  # fmt: skip

    def update(frame: int) -> tuple:
        v, w = states[frame, :2]
        side.set_ydata(rest + phi.shape * v)
        above.set_ydata(psi.shape * w)
        place.set_data([w], [v])
        return side, above, place

    return figure, update
