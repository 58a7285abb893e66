"""The scores that are drawn against noise and amount of data, and their axes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from galloping.figures.panels import R2_LIMITS, prepare_r2, r2_place
from galloping.tables.scores import mean_error

DECADES = (1e-2, 1e2)  # percent: the axis of errors where there are none


@dataclass(frozen=True)
class Quantity:
    """Columns of scores.csv that share an axis.

    columns: each with the title of its panel; those with a name that scores.csv lacks are left out.
    label: of the axis. together: of an axis of one value a replicate, `combined` (n_rows,).
    """

    columns: Mapping[str, str]
    label: str
    together: str
    is_r2: bool = False

    def combined(self, scores: pd.DataFrame) -> pd.Series:
        """One value a row: the mean error over the orders, else that of the worse direction."""
        if self is QUANTITIES["coefficients"]:
            return mean_error(scores)
        both = scores[list(self.columns)]
        return both.min(axis=1) if self.is_r2 else both.max(axis=1)

    def limits(self, values: np.ndarray) -> tuple[float, float]:
        """Of places on the axis: R2 from zero on, errors over whole decades around all values."""
        if self.is_r2:
            low, high = map(r2_place, R2_LIMITS)
            return float(low), float(high)
        values = values[np.isfinite(values) & (values > 0)]
        low, high = (values.min(), values.max()) if values.size else DECADES
        return float(10 ** np.floor(np.log10(low))), float(10 ** np.ceil(np.log10(high)))

    def place(self, values: np.ndarray) -> np.ndarray:
        """Where values stand; R2 below zero stands beyond the axis."""
        values = np.asarray(values, float)
        if not self.is_r2:
            return values
        return np.where(values < R2_LIMITS[0], r2_place(R2_LIMITS[0]) - 1, r2_place(values))

    def prepare(self, axes: Axes, limits: tuple[float, float], label: str) -> None:
        """limits: as of `limits`."""
        if self.is_r2:
            prepare_r2(axes, label)
            return
        axes.set_yscale("log")
        axes.yaxis.set_major_formatter("{x:g}")
        axes.set(ylim=(limits[0] / 1.6, limits[1] * 1.6), ylabel=label)


QUANTITIES = {
    "coefficients": Quantity(
        {f"mean_error_{order}_percent": f"{order} terms" for order in
         ("linear", "quadratic", "cubic")},
        "mean error of\nthe coefficients, %",
        "mean error of\nall coefficients, %",
    ),
    "r2": Quantity(
        {"r2_q_v": "vertical, $q_v$", "r2_q_w": "horizontal, $q_w$"},
        "$R^2$ over the record",
        "$R^2$, worse direction",
        is_r2=True,
    ),
    "amplitude": Quantity(
        {"amplitude_error_q_v_percent": "vertical, $q_v$",
         "amplitude_error_q_w_percent": "horizontal, $q_w$"},
        "error of the steady\namplitude, %",
        "amplitude error, %,\nworse direction",
    ),
}  # fmt: skip
