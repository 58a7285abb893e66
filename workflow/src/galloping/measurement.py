"""Measurement protocols: what an instrument would have recorded of a trajectory."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from galloping.polynomial import PolynomialModel
from galloping.recording import Recording, Recordings
from galloping.seeds import generator


def _derivative(x, dx, level, scale, rng):
    """States exact, every state derivative with absolute noise `level` (Brunton et al. 2016)."""
    return x, dx + level * rng.standard_normal(dx.shape)


def _state(x, dx, level, scale, rng):
    """All states noisy, sigma = level times `scale`; no derivative measured."""
    return x + level * scale * rng.standard_normal(x.shape), None


def _displacement(x, dx, level, scale, rng):
    """As `state`, with the velocities (the second half of the states) not measured."""
    values, _ = _state(x, dx, level, scale, rng)
    values[:, x.shape[1] // 2 :] = np.nan
    return values, None


PROTOCOLS: dict[str, Callable] = {
    "derivative": _derivative,
    "state": _state,
    "displacement": _displacement,
}


def measure(
    model: PolynomialModel,
    time: np.ndarray,
    states: np.ndarray,
    *,
    protocol: str,
    level: float,
    points: int | None,
    relative: bool,
    seed: int,
    name: Sequence[str],
    replicates: int,
) -> Recordings:
    """Independent recordings of one motion or several under one protocol.

    time: (n,) s, states: (n_releases, n, n_states). level: noise level; for `state` times the
    standard deviation of each state if `relative`, else absolute. points: size of a random subset
    of the samples, drawn without replacement, or None for all. The recording of a release in a
    replicate depends on `seed`, `name` and these two only. Without noise and subset all
    replicates are equal, and one is returned.
    """
    count = replicates if level > 0 or points is not None else 1
    derivatives = [model(x) for x in states]

    def record(replicate: int, release: int) -> Recording:
        rng = generator(seed, "measurement", *name, replicate, release)
        rows = slice(None)
        if points is not None:
            rows = np.sort(rng.choice(len(time), size=points, replace=False))
        x = states[release]
        scale = x.std(axis=0) if relative else np.ones(x.shape[1])
        values, dx = PROTOCOLS[protocol](x[rows], derivatives[release][rows], level, scale, rng)
        return Recording(time[rows], model.states, values, dx)

    return Recordings(tuple(tuple(record(r, i) for i in range(len(states))) for r in range(count)))
