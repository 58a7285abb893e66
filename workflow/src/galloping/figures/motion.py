"""Motions as the study stores them."""

from __future__ import annotations

import os

import numpy as np


def read_trajectory(path: str | os.PathLike) -> dict[str, np.ndarray]:
    """time (n,) and states (n, n_states) of a case's first motion, which models are judged by."""
    with np.load(path) as file:
        return {"time": file["time"], "states": file["states"][0]}


def read_reconstruction(path: str | os.PathLike, method: str) -> dict[str, np.ndarray]:
    """time, representative, low and high of one method's models of a cell."""
    with np.load(path) as file:
        stored = {name: file[f"{method}/{name}"] for name in ("representative", "low", "high")}
        return {"time": file["time"], **stored}
