"""recordings/{case}/{protocol}/{cell}.npz: the recordings of a cell, made where asked for.

Identification measures the motion itself: the noise of a recording follows from its name.
"""

from __future__ import annotations

import os
from collections.abc import Sequence

import numpy as np

from galloping.recording import Recording
from galloping.storage import write_arrays

CHANNELS = ("time", "values", "derivatives", "rates")


def write(path: str | os.PathLike, replicates: Sequence[Sequence[Recording]]) -> None:
    """Recordings by replicate and release; what all replicates share is stored once."""
    arrays: dict[str, np.ndarray] = {
        "states": np.array(replicates[0][0].states),
        "shape": np.array([len(replicates), len(replicates[0])]),
    }
    for release, copies in enumerate(zip(*replicates, strict=True)):
        for channel in CHANNELS:
            if getattr(copies[0], channel) is not None:
                arrays[f"{channel}_{release}"] = _stack([getattr(c, channel) for c in copies])
    write_arrays(path, **arrays)


def read(path: str | os.PathLike) -> list[tuple[Recording, ...]]:
    """The recordings of each replicate."""
    with np.load(path) as file:
        arrays = dict(file)
    states = tuple(map(str, arrays.pop("states")))
    replicates, releases = arrays.pop("shape")

    def recording(replicate: int, release: int) -> Recording:
        channels = {
            channel: arrays[key][replicate % len(arrays[key])]
            for channel in CHANNELS
            if (key := f"{channel}_{release}") in arrays
        }
        return Recording(states=states, **channels)

    return [tuple(recording(r, i) for i in range(releases)) for r in range(replicates)]


def _stack(arrays: list[np.ndarray]) -> np.ndarray:
    """All replicates, or one in place of all that are equal."""
    shared = all(np.array_equal(arrays[0], a, equal_nan=True) for a in arrays[1:])
    return arrays[0][np.newaxis] if shared else np.stack(arrays)
