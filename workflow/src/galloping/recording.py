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


@dataclass(frozen=True)
class Recordings:
    """Replicates: independent recordings of the same motion."""

    replicates: tuple[Recording, ...]

    def write(self, path: str | os.PathLike) -> None:
        """One .npz; what all replicates share (times, exact states) is stored once."""

        def stack(arrays: list[np.ndarray]) -> np.ndarray:
            shared = all(np.array_equal(arrays[0], a, equal_nan=True) for a in arrays[1:])
            return arrays[0][np.newaxis] if shared else np.stack(arrays)

        first = self.replicates[0]
        arrays = {
            "time": stack([r.time for r in self.replicates]),
            "values": stack([r.values for r in self.replicates]),
        }
        if first.derivatives is not None:
            arrays["derivatives"] = stack([r.derivatives for r in self.replicates])
        count = np.array(len(self.replicates))
        write_arrays(path, states=np.array(first.states), replicates=count, **arrays)

    @classmethod
    def read(cls, path: str | os.PathLike) -> Recordings:
        """Recordings as `write` left them."""
        with np.load(path) as file:
            states = tuple(map(str, file["states"]))
            count = int(file["replicates"])
            arrays = {key: file[key] for key in ("time", "values", "derivatives") if key in file}
        arrays = {key: np.broadcast_to(a, (count, *a.shape[1:])) for key, a in arrays.items()}
        derivatives = arrays.get("derivatives", [None] * count)
        return cls(
            tuple(
                Recording(time, states, values, dx)
                for time, values, dx in zip(
                    arrays["time"], arrays["values"], derivatives, strict=True
                )
            )
        )
