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


PROTOCOLS: dict[str, Callable] = {"derivative": _derivative, "state": _state}


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
    """Independent recordings of one trajectory under one protocol.

    time: (n,) s, states: (n, n_states). level: noise level; for `state` times the standard
    deviation of each state if `relative`, else absolute. points: size of a random subset of the
    samples, drawn without replacement, or None for all. Replicate r depends on `seed`, `name`
    and r only. Without noise and subset all replicates are equal, and one is returned.
    """
    dx = model(states)
    scale = states.std(axis=0) if relative else np.ones(states.shape[1])
    count = replicates if level > 0 or points is not None else 1
    recordings = []
    for replicate in range(count):
        rng = generator(seed, "measurement", *name, replicate)
        rows = slice(None)
        if points is not None:
            rows = np.sort(rng.choice(len(time), size=points, replace=False))
        values, derivatives = PROTOCOLS[protocol](states[rows], dx[rows], level, scale, rng)
        recordings.append(Recording(time[rows], model.states, values, derivatives))
    return Recordings(tuple(recordings))
