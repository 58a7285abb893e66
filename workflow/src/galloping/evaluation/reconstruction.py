"""The motions of a cell's models, thinned and summarised for figures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from galloping.simulation import Trajectory

PLOT_RATE = 20.0  # Hz, an order of magnitude above the fastest harmonic that matters
BAND = (0.05, 0.95)


def summarise(
    motions: Sequence[Trajectory], scores: Sequence[Mapping[str, float]]
) -> dict[str, np.ndarray]:
    """Motion of the replicate with the median R2, and the band that 90 % of replicates stay in.

    Returns time (n,) s, representative, low, high (n, n_states); NaN where motions ended early.
    """
    time = motions[0].time
    stride = max(1, round(1 / (PLOT_RATE * (time[1] - time[0]))))
    quality = np.array([row["r2_q_v"] + row["r2_q_w"] for row in scores])
    middle = np.argsort(quality, kind="stable")[len(quality) // 2]
    states = np.stack([motion.states[::stride] for motion in motions])
    low, high = np.quantile(states, BAND, axis=0)
    return {
        "time": time[::stride],
        "representative": states[middle],
        "low": low,
        "high": high,
    }
