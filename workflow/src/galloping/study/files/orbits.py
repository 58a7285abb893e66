"""assessment/{case}/orbits.npz: settled orbits at mid-span."""

from __future__ import annotations

import os
from collections.abc import Mapping

import numpy as np

from galloping.storage import write_arrays


def write(path: str | os.PathLike, orbits: Mapping[float, np.ndarray]) -> None:
    """orbits: by wind speed in m/s, (n, 2) places (w, v) in m about rest."""
    write_arrays(path, **{f"{wind:.12g}": places for wind, places in orbits.items()})


def read(path: str | os.PathLike) -> dict[float, np.ndarray]:
    with np.load(path) as file:
        return {float(wind): file[wind] for wind in file}
