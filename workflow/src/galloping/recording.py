"""A recording: what was measured, and the only thing identification ever sees."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Recording:
    """One measured time series.

    time: (n,) in s, strictly increasing. states: names of the n_states states.
    values: (n, n_states), measured states, NaN where a sample or a whole channel is missing.
    derivatives: (n, n_states) measured state derivatives, or None where none was measured;
    when given, the values are exact and the derivatives carry the noise (protocol `derivative`).
    """

    time: np.ndarray
    states: tuple[str, ...]
    values: np.ndarray
    derivatives: np.ndarray | None = None

    def __post_init__(self) -> None:
        n = len(self.time)
        if n < 2 or not np.all(np.diff(self.time) > 0):
            raise ValueError(
                "recording: time must be strictly increasing, with two samples or more"
            )
        if self.values.shape != (n, len(self.states)):
            raise ValueError(
                f"recording: values have shape {self.values.shape}, "
                f"expected ({n}, {len(self.states)})"
            )
        if self.derivatives is not None and self.derivatives.shape != self.values.shape:
            raise ValueError("recording: derivatives and values must have the same shape")

    @property
    def is_uniform(self) -> bool:
        """Whether the samples are equally spaced (to a thousandth of the spacing)."""
        steps = np.diff(self.time)
        return bool(np.ptp(steps) < 1e-3 * steps.mean())
