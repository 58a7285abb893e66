"""Figures of motions: 4, 8 and 9, limit cycles, maps over two parameters, and predictions."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke

from galloping.cycles.rows import SIMULATION
from galloping.figures import parts, style
from galloping.line.galerkin import make_line_and_modes
from galloping.recording.measurement import Motion
from galloping.results import Reconstruction

SHOWN_SHARE = 0.1  # share of a record that is plotted, at its end
AXIS_RATIO = 1.5  # limit of the axis over the true amplitude
ROW_HEIGHT = 0.68  # inches
TRUE_LINE: dict[str, Any] = {"color": style.TRUE_COLOR, "lw": 2.0, "ls": "-"}
MODEL_LINE: dict[str, Any] = {"color": style.MODEL_COLOR, "lw": 0.9, "ls": (0, (3, 1.5))}
CASE_DASHES = ("-", (0, (4, 1.5)), (0, (1, 1)), "-.")


def draw_recovery(
    trajectories: Mapping[str, Sequence[Motion]],
    reconstructions: Mapping[str, Mapping[str, Reconstruction]],
    settings: Mapping,
) -> Figure:
    """Plot true and reconstructed motion of an overhead line, and the growth of the error.

    The motion is the end of that of the first case; errors are those of all cases whose own motion
    does not diverge. trajectories: motions by case, of which the first counts. reconstructions: by
    case and method, of the cell at the lowest level. settings: cases, protocol, method and level.
    """
    first, method = settings["cases"][0], settings["method"]
    true = trajectories[first][0]
    if true.status != "ok":
        return parts.make_empty_figure(f"nothing to show: the line itself {true.status}")
    cases = [case for case in settings["cases"] if trajectories[case][0].status == "ok"]
    figure, grid = parts.panels(2.8, 3, width=style.SINGLE_COLUMN, height_ratios=(1, 1, 1.3))
    *upper, lower = grid[:, 0]
    motion = reconstructions[first][method]
    span = _last_window(true)
    for j, (axes, (state, name)) in enumerate(zip(upper, style.STATE_LABELS.items(), strict=True)):
        axes.plot(true.time, true.states[:, j], **TRUE_LINE, label="true")
        axes.plot(motion.time, motion.representative[:, j], **MODEL_LINE, label="reconstructed")
        axes.set(xlim=span, ylabel=f"{name}, m")
        parts.letter(axes, j, f"{style.DIRECTIONS[state]}, {style.spoken(first)}")
    upper[0].tick_params(labelbottom=False)
    parts.letter(lower, len(upper), "largest distance so far")
    largest = []
    for k, case in enumerate(cases):
        time, distance = _largest_distance(trajectories[case][0], reconstructions[case][method])
        color, dashes = style.SERIES[k % len(style.SERIES)][0], CASE_DASHES[k % len(CASE_DASHES)]
        shown = np.where(distance > 0, distance, np.nan)
        lower.plot(time, shown, color=color, ls=dashes, lw=1.2, label=style.spoken(case))
        largest.append(distance[-1] if len(distance) else np.nan)
    lower.set(yscale="log", xlabel="time, s", ylabel="m", xlim=(true.time[0], true.time[-1]))
    parts.legend(figure, columns=2)
    noise = f"At noise {settings['level']:g}" if settings["level"] else "Without noise"
    how_far = f"at most {np.max(largest):.0e} m from the true motion"
    if not np.all(np.isfinite(largest)):
        how_far = "lost before the end of a record"
    figure.set_label(f"{noise} the reconstructed motion is {how_far}")
    return figure


def _last_window(true: Motion) -> tuple[float, float]:
    begin, end = true.time[0], true.time[-1]
    return end - SHOWN_SHARE * (end - begin), end


def _largest_distance(true: Motion, motion: Reconstruction) -> tuple[np.ndarray, np.ndarray]:
    """Compute times, and the largest displacement error so far; NaN after a motion ended."""
    count = len(style.STATE_LABELS)
    expected = np.column_stack(
        [np.interp(motion.time, true.time, true.states[:, j]) for j in range(count)]
    )
    distance = np.abs(motion.representative[:, :count] - expected).max(axis=1)
    return motion.time, np.maximum.accumulate(distance)


def draw_histories(
    trajectory: Sequence[Motion],
    reconstructions: Mapping[str, Mapping[str, Reconstruction]],
    settings: Mapping,
) -> Figure:
    """Plot true and reconstructed vertical displacement over time, a row per set of recordings.

    Each row is a study cell, such as a noise level or a number of samples, at the end of the
    motion. trajectory: the true motions, of which the first counts. reconstructions: by cell and
    method. settings: case, protocol, method; the labels of the cells.
    """
    true, cells = trajectory[0], settings["cells"]
    if true.status != "ok":
        return parts.make_empty_figure(f"nothing to show: the line itself {true.status}")
    if not cells:
        return parts.make_empty_figure("nothing to show: this study has no such recordings")
    figure, grid = parts.panels(
        0.8 + ROW_HEIGHT * len(cells), len(cells), width=style.SINGLE_COLUMN,
        sharex=True, sharey=True,
    )  # fmt: skip
    spreads = {}
    for k, ((cell, label), axes) in enumerate(zip(cells.items(), grid[:, 0], strict=True)):
        spread = _draw_history(axes, true, reconstructions[cell][settings["method"]])
        lost = "" if np.isfinite(spread) else "; some realisations diverge or fail"
        parts.letter(axes, k, label + lost)
        axes.set_ylabel(f"{style.STATE_LABELS['q_v']}, m")
        spreads[label] = spread
    axes.set_xlabel("time, s")
    parts.legend(figure, columns=2)
    # a single realisation has no spread
    finite_spreads = {label: spread for label, spread in spreads.items() if 0 < spread < np.inf}
    if finite_spreads:
        ends = dict.fromkeys([next(iter(finite_spreads)), next(reversed(finite_spreads))])
        texts = [f"{100 * finite_spreads[label]:.0f} % with {label}" for label in ends]
        figure.set_label(f"Reconstructions spread over a share of the motion: {', '.join(texts)}")
    return figure


def _draw_history(axes: Axes, true: Motion, motion: Reconstruction) -> float:
    """Draw the end of q_v, and return the mean width of the band over the true range."""
    span = _last_window(true)
    inside, shown = ((each.time >= span[0]) & (each.time <= span[1]) for each in (true, motion))
    time, states = motion.time[shown], true.states[inside, 0]
    middle, low, high = (c[shown, 0] for c in (motion.representative, motion.low, motion.high))
    parts.band(axes, time, low, high, "5th to 95th percentile")
    axes.plot(true.time[inside], states, **TRUE_LINE, label="true")
    axes.plot(time, middle, **MODEL_LINE, label="realisation with the median $R^2$")
    centre, half = (states.max() + states.min()) / 2, np.ptp(states) / 2
    axes.set(xlim=span, ylim=(centre - AXIS_RATIO * half, centre + AXIS_RATIO * half))
    return float(np.mean(high - low) / (2 * half))


STATES = {"v": "q_v", "w": "q_w"}
AMPLITUDES = {"v": "vertical_amplitude", "w": "horizontal_amplitude"}  # stems of columns, m
# velocity over wind speed, an attack angle of 20 degrees: limit of the load for small angles
MAX_VELOCITY_RATIO = 0.35
MAX_MAP_AMPLITUDE = 6.0  # m: upper end of the colour scale of the map, about a sag
MARKS = {
    "Hopf": "o",
    "fold of cycles": "D",
    "branch point": "P",
    "period doubling": "s",
    "Neimark-Sacker": "X",
}


def _set_title(axes: Axes, index: int, state: str) -> None:
    parts.letter(axes, index, f"{style.DIRECTIONS[state]}, {style.STATE_LABELS[state]}")


def draw_limit_cycles(
    cycles: pd.DataFrame, bifurcations: pd.DataFrame, settings: Mapping
) -> Figure:
    """Plot limit-cycle amplitudes and bifurcations of lines against a parameter such as wind.

    There is a row for each case and a column for each direction. cycles, bifurcations:
    limit_cycles.csv and bifurcations.csv. settings: parameter and its label; cases, each with its
    line, to mark motions beyond small angles, or None.
    """
    if cycles.empty:
        return parts.make_empty_figure("this study varies no single parameter")
    cycles = parts.where(cycles, parameter=settings["parameter"])
    if cycles.empty:
        varied = settings["label"].partition(",")[0]
        return parts.make_empty_figure(f"this study does not vary the {varied} alone")
    figure, grids = parts.case_grids(list(settings["cases"]), len(STATES), 0.9, 1.9)
    for row, (case, grid) in enumerate(grids.items()):
        of_case = parts.where(cycles, case=case)
        its_bifurcations = parts.where(bifurcations, case=case, parameter=settings["parameter"])
        for column, (axes, direction) in enumerate(zip(grid[0], STATES, strict=True)):
            _set_title(axes, row * len(STATES) + column, STATES[direction])
            _draw_branches(axes, of_case, its_bifurcations, direction)
            axes.set(xlabel=settings["label"], xlim=(0, 1.03 * cycles["value"].max()))
        grid[0, 0].set_ylabel("amplitude, m")
        if settings["cases"][case]:
            _beyond_small_angles(grid[0], settings["cases"][case])
    parts.legend(figure, columns=4)
    own = {"parameter": settings["parameter"], "name": "Hopf"}
    begins = parts.where(bifurcations, **own).groupby("case")["value"].min()
    texts = [f"{begins[case]:.1f} m/s ({style.spoken(case)})" for case in grids if case in begins]
    if texts:
        figure.set_label(f"Galloping begins at a wind of {' and '.join(texts)}")
    return figure


def _beyond_small_angles(panels: Sequence[Axes], case: Mapping) -> None:
    """Shade amplitudes at which the velocity of the mode is not small against the wind."""
    low, high = panels[0].get_ylim()  # all panels share it
    for axes, mode in zip(panels, make_line_and_modes(case)[1:], strict=False):
        wind = np.array(axes.get_xlim())
        small = np.minimum(MAX_VELOCITY_RATIO * wind / mode.frequency, high)  # frequency: rad/s
        axes.fill_between(wind, small, high, color=style.SHADE, lw=0, zorder=0,
                          label="beyond small angles")  # fmt: skip
        axes.set_ylim(low, high)


def _draw_branches(
    axes: Axes, cycles: pd.DataFrame, bifurcations: pd.DataFrame, direction: str
) -> None:
    name, is_simulated = f"{AMPLITUDES[direction]}_m", cycles["branch"] == SIMULATION
    for _, branch in cycles[~is_simulated].groupby("branch", sort=False):
        x, y = branch["value"].to_numpy(float), branch[name].to_numpy(float)
        stable = branch["stable"].astype(bool).to_numpy()
        looks = ((stable, "-", "stable"), (~stable, (0, (3, 1.5)), "unstable"))
        for mask, line, label in looks:
            reached = mask | np.append(False, mask[:-1])  # up to the first point beyond a change
            if mask.any():
                y_kept = np.where(reached, y, np.nan)
                axes.plot(
                    x, y_kept, color=style.MODEL_COLOR, ls=line, lw=1.2, zorder=2, label=label
                )
    simulated = cycles[is_simulated]
    irregular = simulated[simulated["kind"] == "irregular"]
    if len(irregular):
        ends = (irregular[f"{AMPLITUDES[direction]}_{end}_m"] for end in ("min", "max"))
        axes.vlines(irregular["value"], *ends, color=style.PAPER_COLOR, lw=1.2,
                    label="its range, not repeating")  # fmt: skip
    # at rest, what is left of the motion would set the scale of the axis
    amplitudes = simulated[name].where(simulated["kind"] != "rest", 0.0)
    axes.plot(simulated["value"], amplitudes, ls="", marker="o", ms=3, mfc="white",
              mec=style.PAPER_COLOR, mew=0.8, zorder=3, label="long simulation")  # fmt: skip
    for kind, marker in MARKS.items():
        points = bifurcations[bifurcations["name"] == kind]
        if len(points):
            axes.plot(points["value"], points[name], ls="", marker=marker, ms=5,
                      mfc=style.BAND, mec="k", mew=0.7, zorder=4, label=kind)  # fmt: skip


def draw_resonance_map(table: pd.DataFrame, settings: Mapping) -> Figure:
    """Plot a map of galloping amplitudes over wind and tension, with the 2:1 frequency ratio.

    table: resonance_map.csv, which may have the two parameters in either order, and maps over
    others as well. settings: case, x_label, y_label, y_scale (units of the axis in one of the
    table, such as 1000 for kN).
    """
    if len(table):  # without a map it has no such columns
        axes_swapped = {"x": "y", "y": "x", "x_parameter": "y_parameter",
                        "y_parameter": "x_parameter"}  # fmt: skip
        table = pd.concat([table, table.rename(columns=axes_swapped)])
        table = parts.where(table, case=settings["case"], x_parameter="wind_speed",
                            y_parameter="tension").drop_duplicates(["x", "y"])  # fmt: skip
    if table.empty:
        return parts.make_empty_figure("this study does not vary wind and tension together")
    table = table.assign(y=table["y"] / settings["y_scale"])
    figure, (panels,) = parts.panels(3.1, 1, 2)
    ratio = table.pivot(index="y", columns="x", values="frequency_ratio")
    dark = [withStroke(linewidth=3.0, foreground="black")]  # visible on any colour
    for k, (axes, direction) in enumerate(zip(panels, STATES, strict=True)):
        _set_title(axes, k, STATES[direction])
        amplitude = f"{AMPLITUDES[direction]}_m"
        grid = table.pivot(index="y", columns="x", values=amplitude)
        mesh = axes.pcolormesh(
            grid.columns, grid.index, grid.to_numpy(), cmap="cividis", vmin=0,
            vmax=MAX_MAP_AMPLITUDE, shading="nearest", rasterized=True,
        )  # fmt: skip
        figure.colorbar(mesh, ax=axes, label="amplitude, m", pad=0.02, extend="max")
        resonance = axes.contour(ratio.columns, ratio.index, ratio.to_numpy(), levels=[2.0],
                                 colors="white", linewidths=1.4)  # fmt: skip
        resonance.set_path_effects(dark)
        for marker, is_marked, text in (
            ("x", table["kind"] == "irregular", "does not repeat, or settles very slowly"),
            ("v", ~np.isfinite(table[amplitude]), "no bounded motion"),
        ):
            points = table[is_marked]
            axes.plot(
                points["x"], points["y"], ls="", marker=marker, ms=4, mfc="white",
                mec=style.PAPER_COLOR, label=text if len(points) else None,
            )  # fmt: skip
        axes.set(xlabel=settings["x_label"], ylabel=settings["y_label"])
        axes.locator_params(axis="x", nbins=5)
    line = parts.key(r"$\omega_v = 2\,\omega_w$", color="white", ls="-", lw=1.4, path_effects=dark)
    parts.legend(figure, line, columns=3, loc="outside lower center")
    moving = table[np.isfinite(table["horizontal_amplitude_m"]) & (table["kind"] != "rest")]
    if len(moving):
        most = moving.loc[moving["horizontal_amplitude_m"].idxmax()]
        figure.set_label(
            "The horizontal amplitude is largest where the vertical frequency is "
            f"{most['frequency_ratio']:.2f} times the horizontal one"
        )
    return figure


def draw_prediction(table: pd.DataFrame, settings: Mapping) -> Figure:
    """Plot galloping amplitudes against wind: true, and predicted from a single recording.

    table: prediction.csv. settings: case, protocol, method, replicate, recorded (wind speed of
    the recording, m/s) and, where another method is to be compared, peer.
    """
    if table.empty:
        return parts.make_empty_figure("this study predicts no motion at other wind speeds")
    cell = {name: settings[name] for name in ("case", "protocol", "replicate")}
    rows = parts.where(table, **cell).sort_values("wind_m_s")
    methods = [method for method in (settings["method"], settings.get("peer")) if method]
    figure, panes = parts.panels(4.0, len(STATES), width=style.SINGLE_COLUMN, sharex=True)
    for k, (axes, direction) in enumerate(zip(panes[:, 0], STATES, strict=True)):
        _set_title(axes, k, STATES[direction])
        lines = {m: parts.where(rows, method=m, direction=direction) for m in methods}
        _draw_predictions(axes, lines)
        axes.axvline(settings["recorded"], color=style.TRUE_COLOR, lw=0.8, ls=":",
                     label="wind of the recording")  # fmt: skip
        axes.set_ylabel("amplitude, m")
    axes.set_xlabel("wind speed, m/s")
    parts.legend(figure, columns=2)
    every = {name: settings[name] for name in ("case", "protocol", "method")}
    predictions = parts.where(table, **every).dropna(subset="true_m")
    ours = predictions.dropna(subset="predicted_m")
    if len(ours):
        is_every = len(ours) == len(predictions)
        some = "" if is_every else f"{len(ours)} of {len(predictions)} predictions of "
        error = 100 * (ours["predicted_m"] / ours["true_m"] - 1).abs().max()
        least, most = ours["wind_m_s"].min(), ours["wind_m_s"].max()
        figure.set_label(
            f"From one recording at {settings['recorded']:g} m/s, amplitudes at {least:g} to "
            f"{most:g} m/s are predicted; the largest error of {some}all recordings is "
            f"{error:.2g} %"
        )
    return figure


def _draw_predictions(axes: Axes, lines: Mapping[str, pd.DataFrame]) -> None:
    """Draw the predicted lines. lines: rows by method, of which the first has an interval."""
    first = next(iter(lines.values()))
    axes.plot(
        first["wind_m_s"], first["true_m"], color=style.TRUE_COLOR, lw=4, zorder=0.9, label="truth"
    )
    axes.vlines(first["wind_m_s"], first["low_m"], first["high_m"], color="k", lw=1.6, zorder=5,
                label="95 % interval")  # fmt: skip
    for method, line in lines.items():
        look, doubt = parts.line_look(method) | {"lw": 1.0}, _describe_doubt(line)
        method_look = style.method_style(method)
        axes.plot(line["wind_m_s"], line["predicted_m"], marker=method_look.marker,
                  label=method_look.label + doubt, **look)  # fmt: skip
        rest = line[line["predicted_m"].isna()]
        label = "no model" if "refused" in set(rest["status"]) else "no stable limit cycle"
        axes.plot(rest["wind_m_s"], np.zeros(len(rest)), ls="", marker="x", color=method_look.color,
                  ms=6, label=label if len(rest) else None)  # fmt: skip


def _describe_doubt(line: pd.DataFrame) -> str:
    """Return the status of a method in brackets, if it assesses its models and it is not ok."""
    doubtful = sorted(set(line["status"]) - {"ok", "unjudged"})
    return f" ({doubtful[0]})" if doubtful else ""
