"""Figures 1 to 3, the schematics: the line, the aerodynamic load on its section, the flow chart."""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from math import comb
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Arc, Circle, FancyBboxPatch, Polygon

from galloping.figures import parts
from galloping.figures.style import (
    BAND,
    MODEL_COLOR,
    PAPER_COLOR,
    SINGLE_COLUMN,
    TRUE_COLOR,
    spoken,
)
from galloping.line.galerkin import MODES, STATES, Derived, Line, ice_coefficients, positions
from galloping.recording.measurement import Motion

ICE, METAL, INK = "#d6e6f2", "#6b6b6b", "#111111"
LINE_HEIGHT = 3.0  # inches: height of the figure of the line
ELEVATION_BOX = (0.16, 0.56, 0.82, 0.37)  # left, bottom, width, height, in shares of the figure
SECTION_BOX = (0.1, 0.0, 0.8, 0.34)
# flow chart, inches: height of the figure; width and height of a box; centres of the boxes
CHART_HEIGHT, BOX_SIZE = 2.7, (0.98, 0.62)
COLUMN_CENTRES, ROW_CENTRES = (0.52, 1.67, 2.82), (2.36, 1.4, 0.34)
BOX_ORDER = [(0, 0), (1, 0), (2, 0), (2, 1), (1, 1), (0, 1), (0, 2), (1, 2), (2, 2)]  # column, row
STAGE_COLORS = ("#e6e6e6", "#fdf1d8", "#d6e6f2")  # truth, data, identified model


def iced_conductor(axes: Axes, x: float, y: float, radius: float) -> None:
    """Draw the section of a round conductor with a crescent of ice on its windward, left side."""
    angle = np.linspace(np.pi / 2, 3 * np.pi / 2, 60)
    reach = radius * (1 + 0.75 * np.sin(angle - np.pi / 2) ** 0.8)
    outline = np.column_stack([x + reach * np.cos(angle), y + reach * np.sin(angle)])
    axes.add_patch(Polygon(outline, closed=True, facecolor=ICE, edgecolor=INK, lw=0.8))
    axes.add_patch(Circle((x, y), radius, facecolor=METAL, edgecolor=INK, lw=0.8))


def arrow(
    axes: Axes, start: tuple[float, float], end: tuple[float, float], color: str = INK,
    style: str = "-|>", width: float = 1.1, line: str = "-",
) -> None:  # fmt: skip
    """Draw a straight arrow between two points in data coordinates."""
    axes.annotate(
        "", xy=end, xytext=start,
        arrowprops={"arrowstyle": style, "color": color, "lw": width, "ls": line,
                    "shrinkA": 0, "shrinkB": 0, "mutation_scale": 9},
    )  # fmt: skip


def _add_texts(axes: Axes, *texts: tuple[float, float, str, str, str], **look: Any) -> None:
    """Add texts, each with position, words and alignment, horizontal and vertical."""
    for x, y, words, ha, va in texts:
        axes.text(x, y, words, ha=ha, va=va, **look)


def draw_line(model: Derived, settings: Mapping) -> Figure:
    """Draw a schematic of an overhead line: elevation of the span, and section of the bundle.

    The elevation states its exaggeration; the section is not to scale. model: quantities derived
    from the line. settings: case, its name; line, its parameters.
    """
    case = settings["line"]
    figure = Figure(figsize=(SINGLE_COLUMN, LINE_HEIGHT))
    ratio = model.quantities["omega_v_rad_s"] / model.quantities["omega_w_rad_s"]
    figure.set_label(f"The vertical natural frequency is {ratio:.2f} times the horizontal one")
    _draw_elevation(figure.add_axes(ELEVATION_BOX), case, model.quantities, settings["case"])
    _draw_section(figure.add_axes(SECTION_BOX), case["bundle"]["subconductors"])
    return figure


def _draw_elevation(axes: Axes, case: Mapping, derived: Mapping, name: str) -> None:
    span, sag = case["line"]["span"], derived["sag_m"]
    low, high, left, right = -2.1 * sag, 1.35 * sag, -0.08 * span, 1.06 * span
    axes.set(xlim=(left, right), ylim=(low, high), yticks=sorted({0.0, -round(sag, 2)}),
             xlabel="distance from the left support, m",
             ylabel="height, m")  # fmt: skip
    width, height = SINGLE_COLUMN * ELEVATION_BOX[2], LINE_HEIGHT * ELEVATION_BOX[3]
    exaggeration = (height / (high - low)) / (width / (right - left))
    parts.letter(axes, 0, f"{spoken(name)}; heights × {exaggeration:.3g}")

    def rest(s):
        return -4 * sag * (s / span) * (1 - s / span)

    s, nodes = np.linspace(0, span, 201), positions(span)
    axes.plot([0, span], [0, 0], color=TRUE_COLOR, lw=0.8, ls=(0, (6, 3)))
    axes.plot(s, rest(s), color=INK, lw=1.6)
    mode = MODES[case["line"]["mode_shape"]](Line.from_case(case)).shape
    axes.plot(nodes, rest(nodes) + 0.35 * sag * mode, color=MODEL_COLOR, lw=0.9, ls="--")
    for support in (0, span):
        axes.plot([support, support], [low, 0.12 * sag], color=INK, lw=2.2)
    spacers = np.asarray(case["spacers"]["positions"], float)
    axes.plot(spacers, rest(spacers), ls="", marker="s", ms=5, mfc="white", mec=INK, mew=1.1)
    middle = 0.44 * span
    arrow(axes, (middle, 0), (middle, rest(middle)), style="<|-|>", width=0.8)
    numbers = (
        rf"$l$ = {span:g} m, $H$ = {case['line']['tension'] / 1e3:g} kN" "\n"
        rf"$\omega$ = {derived['omega_v_rad_s']:.3f}, {derived['omega_w_rad_s']:.3f} rad/s"
    )  # fmt: skip
    # the coordinate s with the displacement Y along it, V upwards, W towards the reader
    x, y, along, up = 0.03 * span, 0.3 * sag, 0.13 * span, 0.5 * sag
    arrow(axes, (x, y), (x + along, y))
    arrow(axes, (x, y), (x, y + up))
    axes.plot(x, y, "o", ms=7, mfc="white", mec=INK, mew=0.9)
    axes.plot(x, y, "o", ms=2, color=INK)
    _add_texts(
        axes,
        (0.84 * span, rest(0.84 * span) - 0.05 * sag, "at rest", "left", "top"),
        (0.98 * span, 1.4 * sag, numbers, "right", "top"),
        (x + along * 1.05, y, "$s$, $Y$", "left", "center"),
        (x + 0.08 * along, y + up, "$V$", "left", "center"),
        (x - 0.16 * along, y, "$W$", "right", "center"),
        *((place, rest(place) - 0.12 * sag, f"$s_{{{k}}}$", "center", "top")
          for k, place in enumerate(spacers, start=1)),
    )  # fmt: skip
    first = r"first mode, $V=\phi_v(s)\,q_v$"
    _add_texts(axes, (0.5 * span, -1.45 * sag, first, "center", "top"), color=MODEL_COLOR)
    ground = {"facecolor": "white", "edgecolor": "none", "pad": 1}
    where = middle - 0.01 * span, -0.35 * sag
    _add_texts(axes, (*where, f"sag {sag:.2f} m", "right", "center"), bbox=ground)


def _draw_section(axes: Axes, count: int) -> None:
    """Draw sub-conductors on a regular polygon around the reference curve."""
    turn = np.pi / count + 2 * np.pi * np.arange(count) / count
    ring = 0.0 if count == 1 else 1.0
    x, y = ring * np.cos(turn), ring * np.sin(turn)
    axes.plot([*x, x[0]], [*y, y[0]], color=TRUE_COLOR, lw=2.0, zorder=0)
    for place in zip(x, y, strict=True):
        iced_conductor(axes, *place, 0.2)
    axes.add_patch(Circle((0, 0), 0.05, color=INK))
    for end in ((0, 0.55), (0.55, 0)):
        arrow(axes, (0, 0), end)
    for height in (-0.35, 0, 0.35):
        arrow(axes, (-1.75, height), (-1.25, height), color=MODEL_COLOR)
    _add_texts(axes, (0.06, 0.52, "$V$", "left", "center"), (0.58, 0.0, "$W$", "left", "center"))
    _add_texts(axes, (-1.62, 0.45, "wind $U$", "center", "bottom"), color=MODEL_COLOR)
    _add_texts(axes, (-0.05, -0.12, "reference\ncurve", "center", "top"),
         (0.0, -1.08, "spacer frame, ice to windward", "center", "top"),
         fontsize="x-small")  # fmt: skip
    axes.set(xlim=(-1.9, 1.15), ylim=(-1.35, 1.25), aspect="equal")
    axes.axis("off")
    parts.letter(axes, 1, f"bundle of {count}, not to scale")


def draw_aerodynamic_load(trajectory: Sequence[Motion], settings: Mapping) -> Figure:
    """Draw wind and forces on an iced section, and plot force coefficients over attack angle.

    The coefficients are without their static parts. trajectory: the line's motions, of which the
    first counts. settings: line, its parameters.
    """
    case, motion = settings["line"], trajectory[0]
    velocity = motion.states[:, motion.names.index("dq_v")]
    if motion.status != "ok":
        velocity = np.zeros(1)  # of a line that diverges no angle is shown
    figure = Figure(figsize=(SINGLE_COLUMN, 2.85), layout="constrained")
    halves: Any = figure.subfigures(2, 1, height_ratios=(1.2, 1))
    above, below = halves
    _draw_vectors(above.subplots())
    attack = velocity / case["wind"]["speed"]
    left, right = below.subplots(1, 2)
    vertical, horizontal = ice_coefficients(case["ice"])
    _draw_force_curve(left, vertical, attack, "-")
    _draw_force_curve(right, horizontal, attack, "--")
    parts.letter(left, 1, "vertical, $C_Y$")
    parts.letter(right, 2, "horizontal, $C_Z$")
    if motion.status == "ok":
        largest = np.max(np.abs(attack))
        figure.set_label(f"The attack angle of the motion stays within ±{largest:.2f} rad")
    return figure


def _draw_force_curve(axes: Axes, values: tuple[float, ...], attack: np.ndarray, line: str) -> None:
    """Draw a force coefficient without its static part, and shade the angles of the motion."""
    reach = 1.3 * max(float(np.max(np.abs(attack))), 0.05)
    alpha = np.linspace(-reach, reach, 201)
    axes.axvspan(float(attack.min()), float(attack.max()), color=BAND, alpha=0.45, lw=0)
    axes.axhline(0, color=TRUE_COLOR, lw=0.6)
    axes.axvline(0, color=TRUE_COLOR, lw=0.6)
    force = sum(value * alpha**power for power, value in enumerate(values, start=1))
    axes.plot(alpha, force, color=MODEL_COLOR, ls=line, lw=1.4)
    axes.set(xlim=(-reach, reach), xlabel="attack angle $\\alpha$, rad")


def _draw_vectors(axes: Axes) -> None:
    """Draw velocities and forces of a section that moves up: the relative wind comes from above."""
    iced_conductor(axes, 0, 0, 0.3)
    tip, start, above = (-0.62, 0.0), (-2.17, 0.0), (-2.17, 0.62)
    arrow(axes, start, tip, color=MODEL_COLOR, width=1.5)
    arrow(axes, above, start, color=MODEL_COLOR, line="--", width=1.2)
    arrow(axes, above, tip, color=PAPER_COLOR, width=1.5)
    arrow(axes, (0.55, 0.3), (0.55, 0.95), color=MODEL_COLOR, line="--", width=1.2)
    arrow(axes, (0, 0.3), (0, 1.2), width=1.8)
    arrow(axes, (0.3, 0), (1.2, 0), width=1.8)
    angle = np.degrees(np.arctan2(above[1], tip[0] - above[0]))
    axes.add_patch(Arc(tip, 1.7, 1.7, theta1=180 - angle, theta2=180, color=INK, lw=0.8))
    _add_texts(axes, (-1.5, -0.08, "wind $U$", "center", "top"),
         (start[0] - 0.06, 0.31, r"$-\dot V$", "right", "center"),
         (0.62, 0.65, r"velocity $\dot V$", "left", "center"), color=MODEL_COLOR)  # fmt: skip
    _add_texts(axes, (-2.1, 0.68, "relative wind $U_r$", "left", "bottom"), color=PAPER_COLOR)
    law = r"$\alpha \approx \dot V / U$,   $F_{Y,Z} = \frac{1}{2}\rho D U^2\,C_{Y,Z}(\alpha)$"
    _add_texts(
        axes, (0.07, 1.13, "$F_Y$", "left", "center"), (1.15, 0.12, "$F_Z$", "center", "bottom"),
        (-1.6, 0.17, r"$\alpha$", "center", "center"), (-0.5, -0.62, law, "center", "top"),
    )  # fmt: skip
    axes.set(xlim=(-2.65, 1.5), ylim=(-1.05, 1.35), aspect="equal", anchor="N")
    axes.axis("off")
    parts.letter(axes, 0, "section with crescent-shaped ice")


def draw_flow(settings: Mapping) -> Figure:
    """Draw the flow chart of the study, from the line's parameters to the comparison with truth.

    The boxes are in reading order. settings: degree of the library, methods; least and greatest of
    the noise levels and of the points of the subsets.
    """
    figure = Figure(figsize=(SINGLE_COLUMN, CHART_HEIGHT))
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set(xlim=(0, SINGLE_COLUMN), ylim=(0, CHART_HEIGHT))
    axes.axis("off")
    width, height = BOX_SIZE
    for (column, row), (title, text) in zip(BOX_ORDER, _describe_boxes(settings), strict=True):
        x, y = COLUMN_CENTRES[column], ROW_CENTRES[row]
        axes.add_patch(FancyBboxPatch(
            (x - width / 2, y - height / 2), width, height, facecolor=STAGE_COLORS[row],
            edgecolor=INK, boxstyle="round,pad=0,rounding_size=0.07", lw=0.8,
        ))  # fmt: skip
        top = y + height / 2
        _add_texts(axes, (x, top - 0.07, title, "center", "top"), weight="bold")
        _add_texts(axes, (x, top - 0.24, text, "center", "top"), fontsize="small")
    for (column, row), (next_column, next_row) in pairwise(BOX_ORDER):
        x, y = (next_column - column) * width / 2, (next_row - row) * height / 2
        arrow(axes, (COLUMN_CENTRES[column] + x, ROW_CENTRES[row] - y),
              (COLUMN_CENTRES[next_column] - x, ROW_CENTRES[next_row] + y))  # fmt: skip
    # the way of the truth around identification, straight into the comparison
    right, margin = COLUMN_CENTRES[2] + width / 2, SINGLE_COLUMN - 0.06
    axes.plot([right, margin, margin], [ROW_CENTRES[0], ROW_CENTRES[0], ROW_CENTRES[2]],
              color=PAPER_COLOR, lw=1.0, ls=(0, (4, 2)))  # fmt: skip
    arrow(axes, (margin, ROW_CENTRES[2]), (right, ROW_CENTRES[2]), color=PAPER_COLOR)
    where = margin - 0.05, (ROW_CENTRES[1] + ROW_CENTRES[2]) / 2
    _add_texts(axes, (*where, "the truth", "right", "center"), color=PAPER_COLOR, fontsize="small")
    figure.set_label("Identification sees the recordings alone")
    return figure


def _describe_boxes(settings: Mapping) -> list[tuple[str, str]]:
    """Return title and text of each box, in the order of `BOX_ORDER`."""
    degree = settings["degree"]
    candidates = comb(len(STATES) + degree, degree)
    noise = " to ".join(f"{level:g}" for level in dict.fromkeys(settings["levels"]))
    points = " to ".join(map(parts.short, dict.fromkeys(settings["points"])))
    n_methods = len(settings["methods"])
    return [
        ("line and wind", "span, ice,\ndamping"),
        ("equations", "Galerkin,\nγ and κ"),
        ("true motion", "Taylor series"),
        ("recordings", f"noise {noise},\n{points} samples"),
        ("candidates", f"{candidates} monomials\nto degree {degree}"),
        ("identification", f"{n_methods} method{'s' * (n_methods > 1)}"),
        ("model", "terms and\ncoefficients"),
        ("reconstruction", "from the true\nfirst state"),
        ("comparison", "terms, errors,\n$R^2$, amplitude"),
    ]
