"""bounds/{case}/{protocol}/{cell}.npz: the Cramer-Rao bound of a cell."""

from __future__ import annotations

import os

import numpy as np

from galloping.storage import write_arrays


def write(path: str | os.PathLike, deviations: np.ndarray) -> None:
    """Least standard deviation of each coefficient on the candidate library.

    deviations: (n_samplings, n_states, n_terms), NaN without noise and for terms without a bound.
    There is one sampling where all replicates share their times, else one for each replicate.
    """
    write_arrays(path, std=deviations)


def read(path: str | os.PathLike) -> np.ndarray:
    with np.load(path) as file:
        return file["std"]
