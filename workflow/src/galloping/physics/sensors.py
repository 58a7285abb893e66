"""Sensors along the span: what they read of a moving line, and how it becomes modal states."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from galloping.physics.continuous import Span, shapes_at

QUANTITIES = ("displacement", "velocity", "acceleration")
QUARTERS = (0.25, 0.5, 0.75)  # of the span: three sensors that tell the first three modes apart


def readings(
    line: Span,
    states: np.ndarray,
    where: Sequence[float],
    quantity: str,
    speed: np.ndarray | None = None,
) -> np.ndarray:
    """(n, n_sensors, 2) vertical and horizontal readings, without noise.

    states: (n, 4 n_modes), of `continuous.simulate`. where: positions, m. quantity: one of
    `QUANTITIES`, m, m/s, m/s2. speed: (n,) wind at the samples, of which only an acceleration
    depends; the mean wind where not given. Raises ValueError for an unknown quantity.
    """
    if quantity not in QUANTITIES:
        raise ValueError(f"quantity: {quantity} is none of {', '.join(QUANTITIES)}")
    half = states.shape[1] // 2
    if quantity == "displacement":
        coordinates = states[:, :half]
    elif quantity == "velocity":
        coordinates = states[:, half:]
    else:
        wind = np.full(len(states), line.speed) if speed is None else speed
        rates = [line.rates(x, u) for x, u in zip(states, wind, strict=True)]
        coordinates = np.array(rates)[:, half:]
    both = coordinates.reshape(len(states), 2, line.modes)
    return np.einsum("dsk,ndk->nsd", shapes_at(line, where), both)


def first_modes(values: np.ndarray, where: Sequence[float], span: float) -> np.ndarray:
    """Coordinates of as many sine modes as there are sensors: the matrix of sines inverted.

    values: (n, n_sensors, ...). where: positions, m, inside the span. Same shape, by mode.
    """
    order = np.arange(1, len(where) + 1)
    sines = np.sin(np.pi * np.outer(np.asarray(where, dtype=float), order) / span)
    return np.einsum("ks,ns...->nk...", np.linalg.inv(sines), values)
