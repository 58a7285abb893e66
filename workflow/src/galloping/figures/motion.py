"""Motions as the study stores them."""

from __future__ import annotations

import os

import numpy as np


def read_motion(path: str | os.PathLike) -> dict[str, np.ndarray]:
    """All arrays of a trajectory (time, states) or of a reconstruction (time, low, ...).

    Of a trajectory's motions the first, which models are judged by.
    """
    with np.load(path) as file:
        arrays = {name: file[name] for name in file.files}
    if "states" in arrays:
        arrays["states"] = arrays["states"][0]
    return arrays
