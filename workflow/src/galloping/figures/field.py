"""Recordings of a user: what they are worth, the model beside them, and where they go from here."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import NullLocator

from galloping.field.forecast import Forecast, Sensed
from galloping.field.quality import GAP, spectrum
from galloping.field.units import state_unit
from galloping.figures import panels
from galloping.figures.style import BAND, DOUBLE, MODEL, PAPER, TRUE
from galloping.recording import Recording

if TYPE_CHECKING:
    from galloping.field.mapping import ColumnMapping
    from galloping.field.read import Series

ROW = 1.7  # inches, of a row of panels
POINTS = 1500  # of an envelope: more than a figure has pixels
DECADES = 6  # of a spectrum
EDGE = "#a8741a"  # of the band, so that it is seen in grey


def draw_quality(
    series: Sequence[Series], reports: Sequence[dict], mapping: ColumnMapping
) -> Figure:
    """A row for each channel of each file: the samples with gaps shaded, and their spectrum."""
    rows = [(k, c) for k in range(len(series)) for c in range(len(mapping.channels))]
    figure = Figure(figsize=(DOUBLE, 0.5 + ROW * len(rows)), layout="constrained")
    grid = figure.subplots(len(rows), 2, squeeze=False, width_ratios=(2, 1))
    for (k, c), (left, right) in zip(rows, grid, strict=True):
        channel, values, time = mapping.channels[c], series[k].values[:, c], series[k].time
        unit = _unit(channel.measures)
        report = reports[k]
        panels.letter(left, 2 * rows.index((k, c)), f"{channel.column} of {report['file']}")
        panels.letter(right, 2 * rows.index((k, c)) + 1, "spectrum")
        left.plot(*_envelope(time, values), color=MODEL, lw=0.5)
        for gap in report["sampling"]["gaps"]:
            left.axvspan(gap["from_s"], gap["from_s"] + gap["length_s"], color=BAND, lw=0)
        left.set(xlabel="time, s", ylabel=f"{channel.measures}{unit}", xlim=(time[0], time[-1]))
        known = np.isfinite(values)
        frequency, share = spectrum(time[known], values[known], float(np.median(np.diff(time))))
        share = np.maximum(share, share.max() * 10.0**-DECADES)
        described = report["channels"][channel.column]
        for dominant in described["dominant_frequencies_hz"][:1]:
            right.axvline(dominant, color=PAPER, lw=0.8, ls=":")
            right.annotate(
                f"{dominant:.3g} Hz", (dominant, 1.0), xycoords=("data", "axes fraction"),
                xytext=(2, -2), textcoords="offset points", va="top", color=PAPER, size="x-small",
            )  # fmt: skip
        top = max([5 * d for d in described["dominant_frequencies_hz"]], default=frequency[-1])
        shown = frequency <= min(top, frequency[-1])
        right.semilogy(*_envelope(frequency[shown], share[shown]), color=MODEL, lw=0.6)
        right.yaxis.set_minor_locator(NullLocator())
        right.set(xlim=(0, min(top, frequency[-1])), xlabel="frequency, Hz", ylabel="share")
    handles = [Patch(fc=BAND, label="gap"), Line2D([], [], color=PAPER, ls=":", label="dominant")]
    figure.legend(handles=handles, loc="outside upper right", ncols=2)
    return figure


def draw_fit(recording: Recording, motions: Sequence[tuple[np.ndarray, np.ndarray]]) -> Figure:
    """Samples and the model's motion, in a column for each of some stretches of the recording.

    motions: of each stretch the times (n,), s, and the channels (n, n_sensed) of the model.
    """
    sensed = Sensed.by(recording)
    samples = sensed.samples(recording)
    shown = np.flatnonzero(np.isfinite(samples).any(axis=0))
    if not motions:
        return _empty("the recording gives no model to draw beside it")
    figure = Figure(figsize=(DOUBLE, 0.6 + ROW * len(shown)), layout="constrained")
    grid = figure.subplots(len(shown), len(motions), squeeze=False, sharex="col", sharey="row")
    for row, k in zip(grid, shown, strict=True):
        name = sensed.names[k]
        row[0].set_ylabel(f"{name}{_unit(name)}")
        for axes, (time, motion) in zip(row, motions, strict=True):
            inside = (recording.time >= time[0]) & (recording.time <= time[-1])
            _samples(axes, recording.time[inside], samples[inside, k])
            axes.plot(time, motion[:, k], color=MODEL)
    for axes in grid[-1]:
        axes.set_xlabel("time, s")
    _legend(figure, [_dots(), Line2D([], [], color=MODEL, label="model, from a start of its own")])
    return figure


def draw_forecast(
    recording: Recording, parts: Sequence[Forecast], held_out: float, length: float
) -> Figure:
    """The end of the recording, the forecast of what was held out, and the one after it.

    held_out: s, where the held-out part begins. length: s, of what is shown of each part.
    """
    sensed = Sensed.by(recording)
    samples = sensed.samples(recording)
    shown = np.flatnonzero(np.isfinite(samples).any(axis=0))
    if not parts:
        return _empty("the recording gives no model to forecast with")
    figure = Figure(figsize=(DOUBLE, 0.6 + ROW * len(shown)), layout="constrained")
    grid = figure.subplots(len(shown), len(parts), squeeze=False, sharey="row", sharex="col")
    for row, k in zip(grid, shown, strict=True):
        name = sensed.names[k]
        row[0].set_ylabel(f"{name}{_unit(name)}")
        for axes, part in zip(row, parts, strict=True):
            begin = part.time[0]
            near = (recording.time > begin - length / 2) & (recording.time < begin + length)
            _samples(axes, recording.time[near], samples[near, k])
            own = part.time < begin + length
            axes.fill_between(
                part.time[own], part.low[own, k], part.high[own, k], fc=BAND, ec=EDGE, lw=0.4,
                zorder=1,
            )  # fmt: skip
            axes.plot(part.time[own], part.median[own, k], color=MODEL, lw=0.6, zorder=3)
            axes.axvline(begin, color=PAPER, lw=0.8, ls=":")
    for axes, part in zip(grid[0], parts, strict=True):
        what = "held out" if part.time[0] <= held_out else "after the recording"
        panels.letter(axes, list(grid[0]).index(axes), what)
    for axes in grid[-1]:
        axes.set_xlabel("time, s")
    handles = [
        _dots(),
        Line2D([], [], color=MODEL, label="forecast, median"),
        Patch(fc=BAND, ec=EDGE, lw=0.4, label="90 % of samples"),
        Line2D([], [], color=PAPER, lw=0.8, ls=":", label="begin of the forecast"),
    ]
    _legend(figure, handles)
    return figure


def _empty(reason: str) -> Figure:
    figure = Figure(figsize=(DOUBLE, ROW))
    panels.nothing(figure.subplots(), reason)
    return figure


def _legend(figure: Figure, handles: list) -> None:
    figure.legend(handles=handles, loc="outside upper center", ncols=len(handles))


def _samples(axes: Axes, time: np.ndarray, values: np.ndarray) -> None:
    axes.plot(time, values, ls="", marker=".", ms=2, color=TRUE, zorder=2, rasterized=True)


def _dots() -> Line2D:
    return Line2D([], [], ls="", marker=".", color=TRUE, label="samples")


def _unit(name: str) -> str:
    unit = state_unit(name)
    return "" if unit == "1" else f", {unit}"


def _envelope(time: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The least and greatest samples of many stretches: as dense as a figure can show."""
    known = np.isfinite(values)
    time, values = time[known], values[known]
    gaps = np.flatnonzero(np.diff(time) > GAP * np.median(np.diff(time))) + 1
    between = (time[gaps - 1] + time[gaps]) / 2
    if len(time) <= 2 * POINTS:
        return np.insert(time, gaps, between), np.insert(values, gaps, np.nan)
    edges = np.linspace(0, len(time), POINTS + 1).astype(int)[:-1]
    ends = np.append(edges[1:], len(time))
    places = np.unique(
        [
            place
            for a, b in zip(edges, ends, strict=True)
            for place in (a + np.argmin(values[a:b]), a + np.argmax(values[a:b]))
        ]
    )
    apart = np.searchsorted(time[places], between)
    return np.insert(time[places], apart, between), np.insert(values[places], apart, np.nan)
