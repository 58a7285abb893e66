"""Motions: figures 4, 8 and 9, true and reconstructed; what a line settles to along a parameter and
over two, as identified models predict it at other wind speeds and beyond the end of the record.
"""

from collections.abc import Mapping, Sequence
from textwrap import fill, shorten

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke

from galloping.cycles.rows import SIMULATION
from galloping.figures import parts, style
from galloping.measurement import Motion
from galloping.physics.galerkin import at_rest
from galloping.results import Reconstruction

LAST = 30.0  # s at the end of the record, where single periods can be seen
HEADROOM = 1.5  # of the true motion: what goes beyond is cut
TRUE_LINE = {"color": style.TRUE, "lw": 2.0, "ls": "-"}
MODEL_LINE = {"color": style.MODEL, "lw": 0.8, "ls": "--"}


def draw_recovery(
    trajectories: Mapping[str, Sequence[Motion]],
    reconstructions: Mapping[str, Mapping[str, Reconstruction]],
    settings: Mapping,
) -> Figure:
    """Whole record, its last seconds, and their phase portrait; two rows for each case.

    trajectories: motions by case, of which the first counts. reconstructions: by case and method,
    of the cell at the lowest level. settings: cases, protocol, method and level.
    """
    cases = settings["cases"]
    height = parts.height(0.6, 2.9, len(cases))
    figure, grid = parts.panels(height, 2 * len(cases), 3, width_ratios=(2, 2, 1.25))
    for k, row in enumerate(grid):
        case, (j, state) = cases[k // 2], (k % 2, list(style.STATE_LABELS)[k % 2])
        true, motion = trajectories[case][0], reconstructions[case][settings["method"]]
        name = style.STATE_LABELS[state]
        last = max(true.time[0], true.time[-1] - LAST), true.time[-1]
        titles = (
            f"{style.spoken(case)}, {style.DIRECTIONS[state]}:\n{_distance(true, motion, j)}",
            f"the last {LAST:g} s",
            "their phase portrait",
        )
        for column, (axes, title) in enumerate(zip(row, titles, strict=True)):
            parts.letter(axes, 3 * k + column, title)
        for time, states, look, whole in (
            (true.time, true.states, TRUE_LINE, {"lw": 1.2}),
            (motion.time, motion.representative, MODEL_LINE, {"lw": 0.4, "ls": "-"}),
        ):
            late = (time >= last[0]) & (time <= last[1])
            row[0].plot(time, states[:, j], **look | whole)
            row[1].plot(time[late], states[late, j], **look)
            row[2].plot(states[late, j], states[late, j + 2], **look)
        for axes, span in zip(row, ((true.time[0], last[1]), last), strict=False):
            axes.set(xlim=span, xlabel="time, s" if j else "")
        row[0].set_ylabel(f"{name}, m")
        row[2].set(xlabel=f"{name}, m", ylabel=rf"$\dot{{q}}_{state[-1]}$, m/s")
    by = (
        f"reconstructed by {style.method_style(settings['method']).label} "
        f"(protocol {settings['protocol']}, noise level {settings['level']:g})"
    )
    keys = parts.key("true", **TRUE_LINE), parts.key(by, **MODEL_LINE)
    parts.legend(figure, *keys, columns=2)
    return figure


def _distance(true: Motion, motion: Reconstruction, column: int) -> str:
    """How far apart the two motions are at most, at the times of the thinned one."""
    expected = np.interp(motion.time, true.time, true.states[:, column])
    largest = np.max(np.abs(motion.representative[:, column] - expected))
    if not np.isfinite(largest):
        return "motion ended early"
    return f"at most {style.scientific(largest)} m apart"


def draw_histories(
    trajectory: Sequence[Motion],
    reconstructions: Mapping[str, Mapping[str, Reconstruction]],
    settings: Mapping,
) -> Figure:
    """Two rows, q_v and q_w, for each cell, by one method, over the whole window.

    trajectory: the true motions, of which the first counts. reconstructions: by cell and method.
    settings: case, protocol, method; the labels of the cells; window in s.
    """
    true, cells = trajectory[0], settings["cells"]
    if true.status != "ok":
        return parts.nothing_at_all(f"nothing to show: the line itself {true.status}")
    if not cells:
        return parts.nothing_at_all("nothing to show: this study has no such recordings")
    figure, grid = parts.panels(0.8 + 1.9 * len(cells), 2 * len(cells), sharex=True)
    grid = grid[:, 0]
    for k, (cell, label) in enumerate(cells.items()):
        motion = reconstructions[cell][settings["method"]]
        parts.letter(grid[2 * k], k, label)
        for j, name in enumerate(style.STATE_LABELS.values()):
            _history(grid[2 * k + j], true, motion, j, settings["window"])
            grid[2 * k + j].set_ylabel(f"{name}, m")
    grid[-1].set_xlabel("time, s")
    figure.align_ylabels(grid)
    parts.legend(figure, columns=3, title=parts.origin(settings))
    return figure


def _history(
    axes: Axes, true: Motion, motion: Reconstruction, column: int, window: Sequence[float]
) -> None:
    inside, shown = ((each.time >= window[0]) & (each.time <= window[1]) for each in (true, motion))
    time, states = motion.time[shown], true.states[inside, column]
    curves = motion.representative, motion.low, motion.high
    middle, low, high = (of[shown, column] for of in curves)
    parts.band(axes, time, low, high, "5th to 95th percentile of all draws")
    axes.plot(true.time[inside], states, color=style.TRUE, lw=1.8, label="true")
    axes.plot(time, middle, **MODEL_LINE, label="reconstructed, the draw with the median $R^2$")
    centre, half = (states.max() + states.min()) / 2, np.ptp(states) / 2
    axes.set(xlim=window, ylim=(centre - HEADROOM * half, centre + HEADROOM * half))
    if not np.all(np.isfinite(low) & np.isfinite(high)):
        note = "no band where the motion of a draw has ended"
        if not np.any(np.isfinite(middle)):
            note = "the motion of the median draw ended before this window"
        axes.text(
            0.995, 0.96, note, transform=axes.transAxes, ha="right", va="top", fontsize="small",
            bbox={"facecolor": "white", "edgecolor": "none", "pad": 1},
        )  # fmt: skip


STATES = {"v": "q_v", "w": "q_w"}
SMALL = 0.35  # velocity over wind speed, 20 degrees: the model's load is that of small angles
HIGHEST = 6.0  # m: larger motions, a sag or more, are drawn alike in the map
APART = 0.03  # decades between protocols
MARKS = {
    "Hopf": "o",
    "fold of cycles": "D",
    "branch point": "P",
    "period doubling": "s",
    "Neimark-Sacker": "X",
}


def _title(axes: Axes, index: int, state: str, more: str = "") -> None:
    parts.letter(axes, index, f"{style.DIRECTIONS[state]}, {style.STATE_LABELS[state]}{more}")


def draw_limit_cycles(
    cycles: pd.DataFrame, bifurcations: pd.DataFrame, settings: Mapping
) -> Figure:
    """Amplitude against a parameter: a row for each case, a column for each direction.

    cycles, bifurcations: limit_cycles.csv and bifurcations.csv. settings: parameter and its label;
    cases, each with its line, to mark motions beyond small angles, or None.
    """
    if cycles.empty:
        return parts.nothing_at_all("this study varies no single parameter")
    figure, grids = parts.case_grids(list(settings["cases"]), 1, len(STATES), 0.9, 2.2)
    for row, (case, grid) in enumerate(grids.items()):
        own = {"case": case, "parameter": settings["parameter"]}
        of_case = [parts.where(table, **own) for table in (cycles, bifurcations)]
        for column, (axes, direction) in enumerate(zip(grid[0], STATES, strict=True)):
            _title(axes, row * len(STATES) + column, STATES[direction])
            _branches(axes, *of_case, direction)
            axes.set(xlabel=settings["label"], xlim=(0, 1.03 * cycles["value"].max()))
        grid[0, 0].set_ylabel("half range, m")
        if settings["cases"][case]:
            _beyond_small_angles(grid[0], settings["cases"][case])
    parts.legend(figure, columns=4)
    return figure


def _beyond_small_angles(panels: Sequence[Axes], case: Mapping) -> None:
    """Shades half ranges whose velocity, at the mode's own frequency, is not small to the wind."""
    low, high = panels[0].get_ylim()  # all panels share it
    for axes, mode in zip(panels, at_rest(case)[1:], strict=False):
        wind = np.array(axes.get_xlim())
        small = np.minimum(SMALL * wind / mode.frequency, high)  # frequency: rad/s
        axes.fill_between(wind, small, high, color=style.SHADE, lw=0, zorder=0,
                          label="beyond small angles")  # fmt: skip
        axes.set_ylim(low, high)


def _branches(axes: Axes, cycles: pd.DataFrame, bifurcations: pd.DataFrame, direction: str) -> None:
    name, is_simulated = f"{direction}_m", cycles["branch"] == SIMULATION
    for _, branch in cycles[~is_simulated].groupby("branch", sort=False):
        x, y = branch["value"].to_numpy(float), branch[name].to_numpy(float)
        stable = branch["stable"].astype(bool).to_numpy()
        looks = ((stable, "-", "stable"), (~stable, (0, (3, 1.5)), "unstable"))
        for kept, look, label in looks:
            reached = kept | np.append(False, kept[:-1])  # up to the first point beyond a change
            if kept.any():
                y_kept = np.where(reached, y, np.nan)
                axes.plot(x, y_kept, color=style.MODEL, ls=look, lw=1.2, zorder=2, label=label)
    simulated = cycles[is_simulated]
    irregular = simulated[simulated["kind"] == "irregular"]
    if len(irregular):
        ends = (irregular[f"{direction}_{end}_m"] for end in ("low", "high"))
        label = "its range, not repeating"
        axes.vlines(irregular["value"], *ends, color=style.PAPER, lw=1.2, label=label)
    look = {"ls": "", "ms": 3, "mfc": "white", "mec": style.PAPER, "mew": 0.8, "zorder": 3}
    axes.plot(simulated["value"], simulated[name], marker="o", label="long simulation", **look)
    for kind, marker in MARKS.items():
        at = bifurcations[bifurcations["name"] == kind]
        if len(at):
            look = {"ls": "", "ms": 5, "mfc": style.BAND, "mec": "k", "mew": 0.7, "zorder": 4}
            axes.plot(at["value"], at[name], marker=marker, label=kind, **look)


def draw_resonance_map(table: pd.DataFrame, settings: Mapping) -> Figure:
    """Half range of both directions over wind and tension, and where the frequencies are 2:1.

    table: resonance_map.csv, which may hold maps over other parameters as well. settings: case,
    x_label, y_label, y_scale (units of the axis in one of the table, such as 1000 for kN).
    """
    if len(table):  # without a map it has no such columns
        over = {"x_parameter": "wind_speed", "y_parameter": "tension"}
        table = parts.where(table, case=settings["case"], **over).drop_duplicates(["x", "y"])
    if table.empty:
        return parts.nothing_at_all("this study does not vary wind and tension together")
    table = table.assign(y=table["y"] / settings["y_scale"])
    figure, (panels,) = parts.panels(3.1, 1, 2)
    ratio = table.pivot(index="y", columns="x", values="frequency_ratio")
    dark = [withStroke(linewidth=3.0, foreground="black")]  # seen upon any colour, and upon none
    for k, (axes, direction) in enumerate(zip(panels, STATES, strict=True)):
        _title(axes, k, STATES[direction])
        grid = table.pivot(index="y", columns="x", values=f"{direction}_m")
        shown = axes.pcolormesh(
            grid.columns, grid.index, grid.to_numpy(), cmap="cividis", vmin=0, vmax=HIGHEST,
            shading="nearest", rasterized=True,
        )  # fmt: skip
        figure.colorbar(shown, ax=axes, label="half range, m", pad=0.02, extend="max")
        resonance = axes.contour(ratio.columns, ratio.index, ratio.to_numpy(), levels=[2.0],
                                 colors="white", linewidths=1.4)  # fmt: skip
        resonance.set_path_effects(dark)
        for marker, chosen, text in (
            ("x", table["kind"] == "irregular", "does not repeat, or settles very slowly"),
            ("v", ~np.isfinite(table[f"{direction}_m"]), "no bounded motion"),
        ):
            at = table[chosen]
            axes.plot(
                at["x"], at["y"], ls="", marker=marker, ms=4, mfc="white", mec=style.PAPER,
                label=text if len(at) else None,
            )  # fmt: skip
        axes.set(xlabel=settings["x_label"], ylabel=settings["y_label"])
    line = parts.key(r"$\omega_v = 2\,\omega_w$", color="white", ls="-", lw=1.4, path_effects=dark)
    parts.legend(figure, line, columns=3, loc="outside lower center")
    return figure


def draw_prediction(table: pd.DataFrame, settings: Mapping) -> Figure:
    """Amplitude against wind for one replicate: truth, prediction and 95 % band; below each panel
    the same as deviation from the truth, of the first method.

    table: prediction.csv. settings: case, protocols, method, replicate, recorded (wind speed of
    the recording, m/s) and, where another method is to be compared, peer.
    """
    if table.empty:
        return parts.nothing_at_all("no model of this study states how sure it is")
    protocols, method = settings["protocols"], settings["method"]
    own = {name: settings[name] for name in ("case", "replicate")}
    chosen = parts.where(table, **own).sort_values("wind_m_s")
    figure, grid = parts.panels(
        0.8 + 2.7 * len(protocols), 2 * len(protocols), len(STATES), sharex=True,
        height_ratios=[2, 1] * len(protocols),
    )  # fmt: skip
    methods = [method, *([settings["peer"]] if settings.get("peer") else [])]
    for row, protocol in enumerate(protocols):
        for column, (direction, state) in enumerate(STATES.items()):
            axes, below = grid[2 * row : 2 * row + 2, column]
            _title(axes, row * len(STATES) + column, state, f", from {protocol}")
            own = {"protocol": protocol, "direction": direction}
            lines = {name: parts.where(chosen, method=name, **own) for name in methods}
            _predicted(axes, below, lines)
            for pane in (axes, below):
                label = "wind of the recording"
                pane.axvline(settings["recorded"], color=style.TRUE, lw=0.8, ls=":", label=label)
        grid[2 * row, 0].set_ylabel("half range, m")
        grid[2 * row + 1, 0].set_ylabel("deviation, %")
    for axes in grid[-1]:
        axes.set_xlabel("wind speed, m/s")
    parts.legend(figure)
    return figure


def _predicted(axes: Axes, below: Axes, lines: Mapping[str, pd.DataFrame]) -> None:
    """lines: rows by method, of which the first has a band, and its deviation below."""
    for k, (method, line) in enumerate(lines.items()):
        if line.empty:
            continue
        wind, own = line["wind_m_s"], style.method_style(method)
        if line["predicted_m"].isna().any():
            reason = next(iter(line["reason"].dropna()), "no stable limit cycle")
            axes.text(0.97, 0.05, fill(shorten(f"{own.label}: {reason}", 80), 40), ha="right",
                      color=own.color, fontsize="small", transform=axes.transAxes)  # fmt: skip
        if k == 0:
            axes.plot(wind, line["true_m"], color=style.TRUE, lw=4, zorder=0.9, label="truth")
            parts.band(axes, wind, line["low_m"], line["high_m"], "95 % band")
            doubtful = sorted(set(line["verdict"]) - {"ok"})
            if doubtful:
                axes.text(0.03, 0.95, doubtful[0].partition(":")[0], va="top",
                          transform=axes.transAxes, color=style.PAPER)  # fmt: skip
        look = parts.line_look(method) | {"lw": 1.0, "marker": own.marker}
        axes.plot(wind, line["predicted_m"], label=own.label, **look)
        if k == 0:
            low, value, high = (
                100 * (line[of] / line["true_m"] - 1) for of in ("low_m", "predicted_m", "high_m")
            )
            below.axhline(0, color=style.TRUE, lw=2, zorder=0.9)
            parts.band(below, wind, low, high, "95 % band")
            below.plot(wind, value, **look)


def draw_limit_cycle_ahead(table: pd.DataFrame, settings: Mapping) -> Figure:
    """Predicted limit cycle with its interval against noise, a panel for each displacement.

    table: limit_cycle_ahead.csv. settings: window, s, of the paper's steady state.
    """
    if table.empty:
        return parts.nothing_at_all("no model of this study states how sure it is")
    states, protocols = table["state"].unique(), table["protocol"].unique()
    axis, (begin, end) = parts.LogAxis.of(table["level"]), settings["window"]
    figure, (grid,) = parts.panels(2.9, 1, len(states))
    for k, (state, axes) in enumerate(zip(states, grid, strict=True)):
        of_state = table[table["state"] == state]
        _title(axes, k, state)
        axis.prepare(axes, "noise level, in the unit of each protocol")
        axes.axhline(of_state["true_m"].iloc[0], color=style.TRUE, lw=4, zorder=1,
                     label="true limit cycle")  # fmt: skip
        axes.axhline(of_state["recorded_m"].iloc[0], color=style.PAPER, lw=1.0, ls="--", zorder=1,
                     label=f"recorded, {begin:g}-{end:g} s")  # fmt: skip
        for j, protocol in enumerate(protocols):
            rows = of_state[of_state["protocol"] == protocol].sort_values("level")
            shift = APART * (j - (len(protocols) - 1) / 2)
            places = np.array([axis.position(level, shift) for level in rows["level"]])
            look = style.PROTOCOLS[protocol]
            axes.vlines(places, rows["low_m"], rows["high_m"], color=look["color"], lw=1.2)
            label = f"predicted from {protocol}"
            axes.plot(places, rows["predicted_m"], ls="", label=label, **look)
    grid[0].set_ylabel("half range, m")
    parts.legend(figure, columnspacing=1.2, handlelength=1.8)
    return figure
