"""The motions of a cell's models, thinned and summarised for figures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from galloping.intervals import QUANTILES_90

PLOT_RATE = 20.0  # Hz, an order of magnitude above the fastest harmonic that matters


@dataclass(frozen=True)
class Reconstruction:
    """Motion of the replicate with the median R2, and the band that 90 % of replicates stay in.

    time: (n,) s. representative, low, high: (n, n_states), NaN where motions ended early.
    """

    time: np.ndarray
    representative: np.ndarray
    low: np.ndarray
    high: np.ndarray


def summarise(
    time: np.ndarray, states: Sequence[np.ndarray], quality: np.ndarray
) -> Reconstruction:
    """The motions of all replicates.

    time: (n,) s. states: (n, n_states) of each replicate. quality: (n_replicates,), the higher
    the better.
    """
    stride = max(1, round(1 / (PLOT_RATE * (time[1] - time[0]))))
    middle = np.argsort(quality, kind="stable")[len(quality) // 2]
    thinned = np.stack([each[::stride] for each in states])
    low, high = np.quantile(thinned, QUANTILES_90, axis=0)
    return Reconstruction(time[::stride], thinned[middle], low, high)
