"""The true motion of a line: what an instrument could measure."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Motion:
    """The motion of a line after one release.

    names: of the n_states states. time: (n,) s. states: (n, n_states), SI units.
    derivatives: (n, n_states), per second. status: `ok`, or why the motion ended early.
    """

    names: tuple[str, ...]
    time: np.ndarray
    states: np.ndarray
    derivatives: np.ndarray
    status: str = "ok"
