"""Figures of a user's recordings: quality, fit and forecast."""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator

from galloping.behaviour.assessment import Assessment, Cycle
from galloping.behaviour.following import Sensed
from galloping.behaviour.forecast import Forecast
from galloping.figures import parts
from galloping.figures.style import BAND, MODEL_COLOR, PAPER_COLOR, SHADE, TRUE_COLOR
from galloping.identification.preparation.channels import Channels
from galloping.identification.random_forces.forced_motion import SPECTRUM_SEGMENTS, model_spectra
from galloping.identification.random_forces.start import place_on_grid
from galloping.inspection.quality import MIN_REPORTED_GAP, spectrum
from galloping.readers.units import meaning, plain_unit, state_unit
from galloping.recording.samples import Recording

if TYPE_CHECKING:
    from galloping.identification.identified_model import IdentifiedModel
    from galloping.readers.mapping import ColumnMapping
    from galloping.readers.series import Series

DPI, FONT_SIZE = 150, 8
ROW_HEIGHT = 1.7  # inches
MAX_LABEL_LETTERS = 26  # letters of a label along the height of a row
MAX_TITLED_LABEL_LETTERS = 18  # the same, if panels have titles
ENVELOPE_POINTS = 1500  # points of an envelope, more than a figure has pixels
SPECTRUM_DECADES = 6  # plotted decades of a spectrum
BAND_EDGE = "#a8741a"  # color of the edges of a band, also visible in grey
MARK_STYLE: Mapping[str, Any] = {"color": PAPER_COLOR, "lw": 0.8, "ls": ":"}
CYCLE_LINE: Mapping[str, Any] = {"color": MODEL_COLOR, "lw": 0.6, "ms": 3}


def draw_quality(
    series: "Sequence[Series]", reports: Sequence[dict], mapping: "ColumnMapping"
) -> Figure:
    """Plot samples and spectrum of each channel and input of each file, with gaps shaded.

    series: of each file. reports: of `quality`, of each file. mapping: names the channels.
    """
    rows = []
    for of_file, report in zip(series, reports, strict=True):
        gaps = [(gap["from_s"], gap["from_s"] + gap["length_s"])
                for gap in report["sampling"]["gaps"]]  # fmt: skip
        peaks = [f for one in report["channels"].values() for f in one["dominant_frequencies_hz"]]
        fastest = max(peaks, default=np.inf)
        for channel, values in zip(mapping.channels, of_file.values.T, strict=True):
            dominant = report["channels"][channel.column]["dominant_frequencies_hz"]
            title, label = _format_title(channel.column, report), _format_label(channel.measures)
            rows.append((title, label, of_file.time, values, gaps, dominant, fastest))
        for column in mapping.inputs:
            one, unit = of_file.inputs[column.name], of_file.units[column.name]
            unknown = [(a[1], b[0]) for a, b in pairwise(one.stretches)]
            title = f"{_format_title(column.column, report)}, an input"
            label = f"{column.name}, {unit}".removesuffix(", 1")
            rows.append((title, label, one.time, one.values, unknown, [], fastest))
    shared = len(series) == 1  # files differ in their times
    figure, grid = parts.panels(
        0.5 + ROW_HEIGHT * len(rows), len(rows), 2, sharex="col" if shared else "none",
        width_ratios=(2, 1),
    )  # fmt: skip
    reach = 0.0
    for k, ((motion_axes, spectrum_axes), row) in enumerate(zip(grid, rows, strict=True)):
        title, label, time, values, gaps, dominant, fastest = row
        parts.letter(motion_axes, 2 * k, title)
        parts.letter(spectrum_axes, 2 * k + 1, "spectrum")
        motion_axes.plot(*_envelope(time, values), color=MODEL_COLOR, lw=0.5)
        for gap in gaps:
            motion_axes.axvspan(*gap, color=BAND, lw=0, label="gap")
        motion_axes.set(ylabel=fill(label, MAX_TITLED_LABEL_LETTERS), xlim=(time[0], time[-1]))
        is_finite, step = np.isfinite(values), float(np.median(np.diff(time)))
        frequency, share = spectrum(time[is_finite], values[is_finite], step)
        share = np.maximum(share, share.max() * 10.0**-SPECTRUM_DECADES)
        for first in dominant[:1]:
            spectrum_axes.axvline(first, **MARK_STYLE, label="dominant")
            spectrum_axes.annotate(
                f"{first:.3g} Hz", (first, 1.0), xycoords=("data", "axes fraction"),
                xytext=(2, -2), textcoords="offset points", va="top", color=PAPER_COLOR,
                size="x-small",
            )  # fmt: skip
        top = min(5 * fastest, frequency[-1])
        is_shown = frequency <= top
        if share.any():  # the power of a constant is zero, without a logarithm
            spectrum_axes.semilogy(
                *_envelope(frequency[is_shown], share[is_shown]), color=MODEL_COLOR, lw=0.6
            )
        spectrum_axes.yaxis.set_minor_locator(NullLocator())
        spectrum_axes.yaxis.set_major_formatter("{x:.0e}")  # formulas for powers of ten take long
        reach = max(reach, top) if shared else top  # an input may be slower than the motion
        spectrum_axes.set(xlim=(0, reach), ylabel="share of the power")
    for motion_axes, spectrum_axes in grid[-1:] if shared else grid:
        motion_axes.set_xlabel("time, s")
        spectrum_axes.set_xlabel("frequency, Hz")
    parts.legend(figure, columns=2, loc="outside upper right")
    return figure


def _format_title(column: str, report: dict) -> str:
    """Format the names of a column and its file, in which a dollar begins no formula."""
    return f"{column} of {report['file']}".replace("$", r"\$")


def draw_fit(recording: Recording, motions: Sequence[tuple[np.ndarray, np.ndarray]]) -> Figure:
    """Plot recorded samples and a model's motion, with one column of panels for each stretch.

    motions: of each stretch the times (n,), s, and the channels (n, n_sensed) of the model.
    """
    if not motions:
        return parts.make_empty_figure("the recording gives no model to draw beside it")
    figure, panels, samples = _make_channel_panels(recording, len(motions))
    for (_, column, k), axes in panels.items():
        time, motion = motions[column]
        _plot_samples(axes, recording.time, samples[:, k], (time[0], time[-1]))
        axes.plot(time, motion[:, k], color=MODEL_COLOR, label="model, started anew in each part")
    parts.legend(figure)
    return figure


def draw_spectra(found: "IdentifiedModel", recording: Recording) -> Figure:
    """Plot the spectra of recorded samples and of a model with random forces, by channel."""
    from scipy.signal import welch  # slow to import

    channels = Channels.from_recordings([recording])
    step = recording.step
    grid = place_on_grid(recording.time, channels.samples(recording), step)
    filled = np.nan_to_num(grid - np.nanmean(grid, axis=0))
    long = max(len(filled) // SPECTRUM_SEGMENTS, 8)
    frequency, power = welch(filled, 1.0 / step, nperseg=long, axis=0)
    power /= np.isfinite(grid).mean(axis=0)
    frequency, power = frequency[frequency > 0], power[frequency > 0]
    fine, densities = model_spectra(found, recording, np.random.default_rng(0))
    figure, (row,) = parts.panels(0.5 + ROW_HEIGHT, columns=len(channels.names), sharex=True)
    for k, (axes, name) in enumerate(zip(row, channels.names, strict=True)):
        parts.letter(axes, k, meaning(name) or name)
        axes.semilogy(frequency, power[:, k], ".", ms=2.5, color=TRUE_COLOR, label="samples")
        axes.semilogy(fine, densities[:, k], color=MODEL_COLOR, label="model in random forces")
        unit = state_unit(name).replace("^2", "²")
        unit = f"({unit})" if "/" in unit else unit
        axes.set(xlabel="frequency, Hz", ylabel=f"spectrum, {unit}²/Hz")
    parts.legend(figure)
    return figure


def draw_forecast(
    recordings: Sequence[Recording], forecasts: Sequence[Forecast], length: float
) -> Figure:
    """Plot forecasts of held-out samples and of the time after a recording, with the samples.

    recordings: recording before each forecast. length: s, of each panel.
    """
    if not forecasts:
        return parts.make_empty_figure("the recording gives no model to forecast with")
    figure, panels, _ = _make_channel_panels(recordings[-1], len(forecasts))
    samples = [Sensed.by(one).samples(one) for one in recordings]
    for (row, column, k), axes in panels.items():
        ahead, time = forecasts[column], recordings[column].time
        begin = ahead.time[0]
        if row == 0:
            is_held_out = begin <= time[-1]
            what = "end of the recording, not fitted" if is_held_out else "after the recording"
            parts.letter(axes, column, what)
        _plot_samples(axes, time, samples[column][:, k], (begin - length / 2, begin + length))
        is_shown = ahead.time < begin + length
        axes.plot(ahead.time[is_shown], ahead.median[is_shown, k], color=MODEL_COLOR, lw=0.6,
                  zorder=3, label="forecast, median")  # fmt: skip
        low, high = ahead.low[is_shown, k], ahead.high[is_shown, k]
        parts.band(axes, ahead.time[is_shown], low, high, "90 % of samples", ec=BAND_EDGE, lw=0.4)
        axes.axvline(begin, **MARK_STYLE, label="start of the forecast")
    parts.legend(figure)
    return figure


def draw_assessment(assessment: Assessment, units: Mapping[str, str]) -> Figure:
    """Plot limit-cycle amplitudes against an input, with 95 % intervals and the galloping onset.

    assessment: along a range. units: of inputs, by name.
    """
    name = assessment.along
    cycles = [(c.at[name], cycle) for c in assessment.conditions for cycle in c.cycles]
    if not cycles:
        return parts.make_empty_figure(f"no limit cycle in this range of {name}")
    states = list(cycles[0][1].half_range)
    figure, (row,) = parts.panels(0.6 + 2.2, columns=len(states), sharex=True)
    for k, (axes, state) in enumerate(zip(row, states, strict=True)):
        parts.letter(axes, k, meaning(state) or state)
        for onset in assessment.onsets:
            axes.axvline(onset.value.value, **MARK_STYLE, label="onset")
            ends = np.clip((onset.value.low, onset.value.high), *assessment.span)
            axes.axvspan(*ends, color=SHADE, lw=0, zorder=0, label="onset, 95 %")
        for chain in _chains(assessment):
            x = [at for at, _ in chain]
            values = [cycle.half_range[state] for _, cycle in chain]
            y, low, high = np.array([(v.value, v.low, v.high) for v in values]).T
            if chain[0][1].stable:
                axes.plot(x, y, "o-", label="stable cycle", **CYCLE_LINE)
            else:
                axes.plot(x, y, "o--", label="unstable cycle", mfc="white", **CYCLE_LINE)
            parts.band(axes, x, low, high, "95 % interval", ec=BAND_EDGE, lw=0.4)
        unit = units.get(name, "")
        axes.set(xlabel=f"{name}, {unit}" if unit else name, xlim=assessment.span,
                 ylabel=", ".join(filter(None, ("amplitude", plain_unit(state)))))  # fmt: skip
        axes.set_ylim(bottom=0.0)
    parts.legend(figure)
    return figure


def _chains(assessment: Assessment) -> list[list[tuple[float, Cycle]]]:
    """Connect each limit cycle to the nearest one at the previous value of an input."""
    chains: list[list[tuple[float, Cycle]]] = []
    previous = np.nan
    for condition in assessment.conditions:
        now, open_ = condition.at[assessment.along], [c for c in chains if c[-1][0] == previous]
        for cycle in condition.cycles:
            alike = [c for c in open_ if c[-1][1].stable == cycle.stable]
            if alike:
                nearest = min(alike, key=lambda chain: _distance(chain[-1][1], cycle))
                open_.remove(nearest)
                nearest.append((now, cycle))
            else:
                chains.append([(now, cycle)])
        previous = now
    return chains


def _distance(one: Cycle, other: Cycle) -> float:
    return sum(abs(other.half_range[s].value - v.value) for s, v in one.half_range.items())


def _make_channel_panels(
    recording: Recording, columns: int
) -> tuple[Figure, dict[tuple[int, int, int], Axes], np.ndarray]:
    """Make panels by row, column and channel, a row for each with samples; return samples too."""
    sensed = Sensed.by(recording)
    samples = sensed.samples(recording)
    shown_channels = np.flatnonzero(np.isfinite(samples).any(axis=0))
    height = 0.6 + ROW_HEIGHT * len(shown_channels)
    figure, grid = parts.panels(height, len(shown_channels), columns, sharex="col", sharey="row")
    for row, k in zip(grid, shown_channels, strict=True):
        row[0].set_ylabel(fill(_format_label(sensed.names[k]), MAX_LABEL_LETTERS))
    for axes in grid[-1]:
        axes.set_xlabel("time, s")
    panels = {
        (row, column, int(k)): grid[row, column]
        for row, k in enumerate(shown_channels)
        for column in range(columns)
    }
    return figure, panels, samples


def _plot_samples(axes: Axes, time: np.ndarray, values: np.ndarray, span: Sequence[float]) -> None:
    inside = (time >= span[0]) & (time <= span[1])
    axes.plot(time[inside], values[inside], ls="", marker=".", ms=2, color=TRUE_COLOR, zorder=2,
              rasterized=True, label="samples")  # fmt: skip


def _format_label(name: str) -> str:
    return ", ".join(filter(None, (meaning(name) or name, plain_unit(name)))).replace("^2", "²")


def _envelope(time: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Reduce samples to the least and greatest of many stretches, as dense as a figure can show."""
    is_finite = np.isfinite(values)
    time, values = time[is_finite], values[is_finite]
    gaps = np.flatnonzero(np.diff(time) > MIN_REPORTED_GAP * np.median(np.diff(time))) + 1
    gap_centres = (time[gaps - 1] + time[gaps]) / 2
    places = np.arange(len(time))
    if len(time) > 2 * ENVELOPE_POINTS:
        long = -(-len(time) // ENVELOPE_POINTS)
        stretches = np.pad(values, (0, -len(time) % long), mode="edge").reshape(-1, long)
        ends = stretches.argmin(axis=1), stretches.argmax(axis=1)
        places = np.unique(places[::long] + np.array(ends))
    gap_rows = np.searchsorted(time[places], gap_centres)
    return np.insert(time[places], gap_rows, gap_centres), np.insert(
        values[places], gap_rows, np.nan
    )
