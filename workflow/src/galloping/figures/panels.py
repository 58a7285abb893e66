"""What panels share: axes over noise and data amount, R2 near one, medians with intervals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from matplotlib import rcParams
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import NullFormatter, NullLocator

from galloping.figures.style import method_style

R2_LIMITS = (0.0, 0.9999)
R2_TICKS = (0.0, 0.9, 0.95, 0.99, 0.999, 0.9999)


def nothing(axes: Axes, reason: str) -> None:
    """An empty panel that says why."""
    axes.set(xticks=[], yticks=[])
    axes.spines[:].set_visible(False)
    axes.text(0.5, 0.5, reason, transform=axes.transAxes, ha="center", va="center", color="#5f5f5f")


def letter(axes: Axes, index: int, text: str) -> None:
    """(a), (b), ... and what the panel shows."""
    axes.set_title(f"({chr(ord('a') + index % 26)}) {text}", loc="left")


@dataclass(frozen=True)
class LogAxis:
    """A logarithmic axis of positive values, with zero in a place of its own at the left."""

    values: tuple[float, ...]

    @classmethod
    def of(cls, values: Sequence[float]) -> LogAxis:
        return cls(tuple(sorted({float(v) for v in values})))

    @property
    def _positive(self) -> tuple[float, ...]:
        return tuple(v for v in self.values if v > 0)

    @property
    def _zero(self) -> float:
        return self._positive[0] / 2 if self._positive else 1.0

    def position(self, value: float, shift: float = 0.0) -> float:
        """Where a value stands; shift: in decades, to keep methods apart."""
        return (value if value > 0 else self._zero) * 10**shift

    def prepare(self, axes: Axes, label: str) -> None:
        places = [self.position(v) for v in self.values]
        axes.set_xscale("log")
        axes.set_xlim(min(places) / 1.3, max(places) * 1.3)
        axes.set_xticks(
            places, [_short(v) for v in self.values], fontsize=0.75 * rcParams["font.size"]
        )
        axes.xaxis.set_minor_locator(NullLocator())
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.set_xlabel(label)
        if 0 in self.values and self._positive:
            axes.axvline(np.sqrt(self._zero * self._positive[0]), color="#bbbbbb", lw=0.6, ls=":")


def _short(value: float) -> str:
    return f"{value / 1000:g}k" if value >= 1000 else f"{value:g}"


def r2_place(r2: float | np.ndarray) -> float | np.ndarray:
    """-log10(1 - R2), which spreads the values near one."""
    return -np.log10(1 - np.clip(r2, *R2_LIMITS))


def prepare_r2(axes: Axes, label: str, vertical: bool = True) -> None:
    """An axis of `r2_place`, labelled in R2; vertical: the y axis, else the x axis."""
    low, high = map(r2_place, R2_LIMITS)
    places, labels = [r2_place(r) for r in R2_TICKS], [f"{r:g}" for r in R2_TICKS]
    labels[0], labels[-1] = "≤ 0", "≥ 0.9999"
    limits = (low - 0.25, high + 0.25)
    if vertical:
        axes.set(ylim=limits, ylabel=label)
        axes.set_yticks(places, labels)
    else:
        axes.set(xlim=limits, xlabel=label)
        axes.set_xticks(places, labels)


def series(
    axes: Axes,
    x: Sequence[float],
    medians: Sequence[float],
    lows: Sequence[float],
    highs: Sequence[float],
    method: str,
    limits: tuple[float, float],
    joined: Sequence[bool] | None = None,
) -> None:
    """Medians of one method, intervals as bars; those `joined` (all) lie on one line.

    Values beyond `limits`, failures (inf) among them, stand at the limit as open triangles.
    """
    style = method_style(method)
    x, medians = np.asarray(x, float), np.asarray(medians, float)
    inside = np.clip(medians, *limits)
    axes.vlines(x, np.clip(lows, *limits), np.clip(highs, *limits), color=style.color, lw=0.7)
    line = np.ones(len(x), bool) if joined is None else np.asarray(joined, bool)
    axes.plot(x[line], inside[line], color=style.color, ls=style.line, zorder=3)
    for chosen, marker, face in (
        ((medians >= limits[0]) & (medians <= limits[1]), style.marker, style.color),
        (medians < limits[0], "v", "white"),
        (medians > limits[1], "^", "white"),
    ):
        axes.plot(
            x[chosen], inside[chosen], ls="", marker=marker, mfc=face, mec=style.color,
            mew=0.7, zorder=4,
        )  # fmt: skip


def shifts(methods: Sequence[str], step: float) -> dict[str, float]:
    """Small displacements, in decades, that keep the methods' bars apart."""
    middle = (len(methods) - 1) / 2
    return {method: step * (k - middle) for k, method in enumerate(methods)}


def in_order(table: pd.DataFrame, column: str, order: Sequence[str]) -> list[str]:
    """The entries of `order` that a column of the table holds."""
    present = set(table[column])
    return [name for name in order if name in present]


def method_legend(
    figure: Figure, methods: Sequence[str], extra: Sequence[Line2D] = (), columns: int = 5
) -> None:
    """All methods and marks, above the panels."""
    entries = []
    for method in methods:
        style = method_style(method)
        entries.append(
            Line2D([], [], color=style.color, ls=style.line, marker=style.marker,
                   label=style.label)
        )  # fmt: skip
    clipped = Line2D(
        [], [], ls="", marker="v", mfc="white", mec="k", mew=0.7, label="beyond the axis"
    )
    figure.legend(
        handles=[*entries, *extra, clipped], loc="outside upper center", ncols=columns,
        columnspacing=1.4, handlelength=2.8,
    )  # fmt: skip


def r2_series(
    axes: Axes,
    x: Sequence[float],
    medians: Sequence[float],
    lows: Sequence[float],
    highs: Sequence[float],
    method: str,
    joined: Sequence[bool] | None = None,
) -> None:
    """`series` of R2 on an axis of `prepare_r2`: open triangles stand for R2 of zero or less."""
    low, high = map(r2_place, R2_LIMITS)
    places = np.where(np.asarray(medians, float) < R2_LIMITS[0], low - 1, r2_place(medians))
    series(axes, x, places, r2_place(lows), r2_place(highs), method, (low, high), joined)
