"""What the paper's printed numbers tell of what it leaves out."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from galloping.figures import panels
from galloping.figures.style import BAND, DOUBLE, MODEL, PAPER
from galloping.paper.unknowns import BASE, UNKNOWNS, Unknown

BINS = 30
COLUMNS = 4
LEAST = -12.0  # power of ten: readings that are less probable end there


def draw_region(samples: pd.DataFrame, readings: pd.DataFrame, settings: Mapping) -> Figure:
    """A panel for each unknown number, and one of all readings.

    samples: of `tables.inference.region_samples`, readings: of `readings`. settings: none are read.
    """
    rows = -(-len(UNKNOWNS) // COLUMNS)
    bars = 0.17 * len(readings)
    heights = [*([1.35] * rows), bars + 0.4]
    figure = Figure(figsize=(DOUBLE, sum(heights) + 0.5), layout="constrained")
    upper, lower = figure.subfigures(2, 1, height_ratios=[sum(heights[:-1]) + 0.5, heights[-1]])
    drawn = samples[samples["kind"] == "setting"]
    best = readings.set_index("reading").loc[BASE.name]
    for k, unknown in enumerate(UNKNOWNS):
        axes = upper.add_subplot(rows, COLUMNS, k + 1)
        panels.letter(axes, k, unknown.label)
        _histograms(axes, unknown, drawn, best[unknown.name])
    upper.legend(*axes.get_legend_handles_labels(), loc="outside upper center", ncols=3)
    axes = lower.subplots()
    panels.letter(axes, len(UNKNOWNS), "readings of the paper, beside the first")
    _bars(axes, readings)
    return figure


def _histograms(axes: Axes, unknown: Unknown, drawn: pd.DataFrame, best: float) -> None:
    edges = np.geomspace(unknown.low, unknown.high, BINS + 1)
    looks = {
        "log_probability": {"color": MODEL, "histtype": "stepfilled", "label": "all numbers"},
        "without_amplitudes": {
            "edgecolor": BAND, "histtype": "step", "lw": 1.6,
            "label": "without the errors of the amplitude",
        },
    }  # fmt: skip
    for known, look in looks.items():
        axes.hist(drawn.loc[drawn["known"] == known, unknown.name], bins=edges, **look)
    axes.axvline(best, color=PAPER, lw=1.0, label="most probable setting")
    axes.set_xscale("log")
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_xlim(unknown.low, unknown.high)
    axes.set_yticks([])
    axes.set_xlabel("SI units" if unknown.unit == "1" and not unknown.path else
                    "ratio" if unknown.unit == "1" else unknown.unit)  # fmt: skip


def _symbols(reading: str) -> str:
    """The name of a reading with its coefficients as symbols: `beta2 minus 0.1` as beta_2 -0.1."""
    return re.sub(r"\b(beta|eta)(\d)", r"$\\\1_\2$", reading.replace("minus ", "\N{MINUS SIGN}"))


def _bars(axes: Axes, readings: pd.DataFrame) -> None:
    places = np.arange(len(readings))
    powers = readings["power_of_ten"].to_numpy(float)
    shown = np.clip(np.where(np.isfinite(powers), powers, LEAST), LEAST, None)
    axes.barh(places, shown - LEAST, left=LEAST, height=0.65, color=MODEL)
    for place, power, verdict in zip(places, powers, readings["verdict"], strict=True):
        number = f"{power:.1f}, " if np.isfinite(power) else ""
        axes.text(max(power, LEAST) + 0.15 if np.isfinite(power) else LEAST + 0.15, place,
                  f"{number}{verdict}", va="center", size="small")  # fmt: skip
    axes.set_yticks(places, [_symbols(reading) for reading in readings["reading"]])
    axes.tick_params(axis="y", length=0)
    axes.set_ylim(len(readings) - 0.4, -0.6)
    axes.set_xlim(LEAST, max(2.0, np.nanmax(powers) + 2.0))
    axes.set_xlabel("power of ten by which a reading is more probable than the first")
