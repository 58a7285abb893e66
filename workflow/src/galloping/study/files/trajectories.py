"""trajectories/{case}.npz: the true motion of a line after each of its releases."""

from __future__ import annotations

import os
from collections.abc import Sequence

import numpy as np

from galloping.measurement.measuring import Motion
from galloping.storage import write_arrays


def write(path: str | os.PathLike, motions: Sequence[Motion]) -> None:
    """Motions of one system on one time grid."""
    write_arrays(
        path,
        names=np.array(motions[0].names),
        time=motions[0].time,
        states=np.stack([motion.states for motion in motions]),
        derivatives=np.stack([motion.derivatives for motion in motions]),
        status=np.array([motion.status for motion in motions]),
    )


def read(path: str | os.PathLike) -> tuple[Motion, ...]:
    """The motion of each release; the first one is what models are judged by."""
    with np.load(path) as file:
        names, time = tuple(map(str, file["names"])), file["time"]
        motions = zip(file["states"], file["derivatives"], file["status"].tolist(), strict=True)
        return tuple(Motion(names, time, *motion) for motion in motions)
