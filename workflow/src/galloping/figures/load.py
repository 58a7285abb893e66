"""Figure 2: aerodynamic load on the section with crescent-shaped ice."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Arc

from galloping.figures import panels
from galloping.figures.sketch import INK, arrow, bare, iced_conductor
from galloping.figures.style import BAND, DOUBLE, MODEL, PAPER
from galloping.measurement.measuring import Motion
from galloping.physics.galerkin import ice_coefficients


def draw_load(trajectory: Sequence[Motion], settings: Mapping) -> Figure:
    """Wind and forces on the section, and the force coefficients without their static parts.

    trajectory: the line's motions, of which the first counts. settings: line, its parameters.
    """
    case, motion = settings["line"], trajectory[0]
    velocity = motion.states[:, motion.names.index("dq_v")]
    if motion.status != "ok":
        velocity = np.zeros(1)  # of a line that diverges no angle is shown
    figure = Figure(figsize=(DOUBLE, 2.75), layout="constrained")
    left, right = figure.subfigures(1, 2, width_ratios=(1.15, 1))
    _vectors(left.subplots())
    attack = velocity / case["wind"]["speed"]
    upper, lower = right.subplots(2, 1, sharex=True)
    vertical, horizontal = ice_coefficients(case["ice"])
    _curve(upper, vertical, attack, "$C_Y$", "-")
    _curve(lower, horizontal, attack, "$C_Z$", "--")
    panels.letter(upper, 1, f"$C_Y$: {_formula(vertical)}")
    panels.letter(lower, 2, f"$C_Z$: {_formula(horizontal)}")
    lower.set_xlabel("attack angle $\\alpha$, rad\n(shaded: angles of the simulated motion)")
    return figure


def _curve(axes: Axes, values: tuple[float, ...], attack: np.ndarray, name: str, line: str) -> None:
    reach = 1.3 * max(float(np.max(np.abs(attack))), 0.05)
    alpha = np.linspace(-reach, reach, 201)
    axes.axvspan(float(attack.min()), float(attack.max()), color=BAND, alpha=0.45, lw=0)
    axes.axhline(0, color="#9a9a9a", lw=0.6)
    axes.axvline(0, color="#9a9a9a", lw=0.6)
    force = sum(value * alpha**power for power, value in enumerate(values, start=1))
    axes.plot(alpha, force, color=MODEL, ls=line, lw=1.4)
    axes.set(xlim=(-reach, reach), ylabel=f"{name} − static part")


def _formula(values: tuple[float, ...]) -> str:
    """The cubic polynomial, without the terms that are zero."""
    terms = [
        f"{'−' if value < 0 else '+'} {abs(value):g} α{('', '²', '³')[power - 1]}"
        for power, value in enumerate(values, start=1)
        if value
    ]
    return " ".join(terms).removeprefix("+ ") or "0"


def _vectors(axes: Axes) -> None:
    """The section moves up: the relative wind meets it from above, at the angle alpha."""
    iced_conductor(axes, 0, 0, 0.3)
    tip = (-0.62, 0.0)
    wind, rise = 1.55, 0.62
    start = (tip[0] - wind, tip[1])
    above = (start[0], tip[1] + rise)
    arrow(axes, start, tip, color=MODEL, width=1.5)
    arrow(axes, above, start, color=MODEL, line="--", width=1.2)
    arrow(axes, above, tip, color=PAPER, width=1.5)
    axes.text(-1.5, -0.08, "wind $U$", ha="center", va="top", color=MODEL)
    axes.text(start[0] - 0.06, rise / 2, r"$-\dot V$", ha="right", va="center", color=MODEL)
    axes.text(-1.35, 0.5, "relative wind $U_r$", ha="left", va="center", color=PAPER)
    angle = np.degrees(np.arctan2(rise, wind))
    axes.add_patch(Arc(tip, 1.7, 1.7, theta1=180 - angle, theta2=180, color=INK, lw=0.8))
    axes.text(tip[0] - 0.98, 0.17, r"$\alpha$", ha="center", va="center")
    arrow(axes, (0, 0.3), (0, 1.2), width=1.8)
    axes.text(0.07, 1.13, "$F_Y$", va="center")
    arrow(axes, (0.3, 0), (1.2, 0), width=1.8)
    axes.text(1.15, 0.12, "$F_Z$", ha="center", va="bottom")
    arrow(axes, (0.55, 0.3), (0.55, 0.95), color=MODEL, line="--", width=1.2)
    axes.text(0.62, 0.65, r"velocity $\dot V$", va="center", color=MODEL)
    axes.text(
        -0.5, -0.62, r"$\alpha \approx \dot V / U$,   $F_{Y,Z} = \frac{1}{2}\rho D U^2\,"
        r"C_{Y,Z}(\alpha)$", ha="center", va="top",
    )  # fmt: skip
    axes.set(xlim=(-2.65, 1.5), ylim=(-1.05, 1.35))
    bare(axes)
    axes.set_anchor("N")
    panels.letter(axes, 0, "section with crescent-shaped ice")
