"""A recording: what was measured, and the only thing identification ever sees."""

from __future__ import annotations

import os
from dataclasses import dataclass

import numpy as np

from galloping.storage import write_arrays


@dataclass(frozen=True)
class Recording:
    """One measured time series.

    time: (n,) in s, strictly increasing. states: names of the n_states states.
    values: (n, n_states), measured states, NaN where a sample or a whole channel is missing.
    derivatives: (n, n_states) measured state derivatives, or None where none was measured;
    when given, the values are exact and the derivatives carry the noise (protocol `derivative`).
    rates: (n, n_states) what accelerometers and the like measure, the noisy rate of a state beside
    noisy values; NaN where missing, None where nothing measures one. unknown_offsets: (n_states,)
    whether a rate has an unknown constant offset that drifts slowly. unknown_scales: (n_states,)
    whether a value is known up to a factor only. Both None where there is none.
    """

    time: np.ndarray
    states: tuple[str, ...]
    values: np.ndarray
    derivatives: np.ndarray | None = None
    rates: np.ndarray | None = None
    unknown_offsets: np.ndarray | None = None
    unknown_scales: np.ndarray | None = None

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


@dataclass(frozen=True)
class Recordings:
    """Replicates of one cell, each one or several recordings that share one model."""

    replicates: tuple[tuple[Recording, ...], ...]

    def write(self, path: str | os.PathLike) -> None:
        """One .npz; what all replicates share (times, exact states) is stored once."""
        arrays: dict[str, np.ndarray] = {
            "states": np.array(self.replicates[0][0].states),
            "replicates": np.array(len(self.replicates)),
        }
        for i, copies in enumerate(zip(*self.replicates, strict=True)):
            for field in FIELDS:
                if getattr(copies[0], field) is not None:
                    stacked = [getattr(copy, field) for copy in copies]
                    arrays[f"{field}_{i}"] = _stack(stacked)
        write_arrays(path, **arrays)

    @classmethod
    def read(cls, path: str | os.PathLike) -> Recordings:
        """Recordings as `write` left them."""
        with np.load(path) as file:
            arrays = {key: file[key] for key in file.files}
        states = tuple(map(str, arrays.pop("states")))
        count = int(arrays.pop("replicates"))
        releases = sum(key.startswith("time_") for key in arrays)

        def one(replicate: int, i: int) -> Recording:
            parts = {
                field: arrays[key][replicate % len(arrays[key])]
                for field in FIELDS
                if (key := f"{field}_{i}") in arrays
            }
            return Recording(states=states, **parts)

        return cls(tuple(tuple(one(r, i) for i in range(releases)) for r in range(count)))


def read_replicates(path: str | os.PathLike) -> tuple[tuple[Recording, ...], ...]:
    """The recordings of each replicate in a file."""
    return Recordings.read(path).replicates


FIELDS = ("time", "values", "derivatives")


def _stack(arrays: list[np.ndarray]) -> np.ndarray:
    """All replicates, or one in place of all that are equal."""
    shared = all(np.array_equal(arrays[0], a, equal_nan=True) for a in arrays[1:])
    return arrays[0][np.newaxis] if shared else np.stack(arrays)
