"""Measurement protocols: what each measures of a motion, and how well.

A protocol is its noise, on all states, on all displacements, or on all derivatives: from it follow
the recordings (`measuring`), the Cramer-Rao bound (`bounds.cell`) and which methods can use them
(`identification.registry`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

# What recordings hold: states with their derivatives, all states, or not all of them.
DERIVATIVES, ALL_STATES, DISPLACEMENTS_ALONE = (
    "derivatives", "states", "displacements",
)  # fmt: skip


@dataclass(frozen=True)
class Noise:
    """Standard deviation of the noise on each channel: 0 where exact, inf where not measured.

    states, derivatives: (n_states,), of the states in their units and of their derivatives. It is
    drawn white and Gaussian (`measuring.measure`).
    """

    states: np.ndarray
    derivatives: np.ndarray


@dataclass(frozen=True)
class Protocol:
    """One way to measure a motion.

    noise: from the noise level and a scale of each state (n_states,) to a `Noise`; displacements
    come before velocities. meaning: in the words of the settings. label, color, marker: in figures.
    """

    name: str
    noise: Callable[[float, np.ndarray], Noise]
    meaning: str
    label: str
    color: str
    marker: str

    @property
    def measures(self) -> str:
        """DERIVATIVES, ALL_STATES or DISPLACEMENTS_ALONE: what its recordings hold."""
        noise = self.noise(1.0, np.ones(2))
        if np.any(np.isfinite(noise.derivatives)):
            return DERIVATIVES
        return ALL_STATES if np.all(np.isfinite(noise.states)) else DISPLACEMENTS_ALONE

    @property
    def is_scaled(self) -> bool:
        """Whether its noise depends on the size of the states."""
        return bool(
            np.any(self.noise(1.0, np.ones(2)).states != self.noise(1.0, np.full(2, 2.0)).states)
        )


def _derivatives(level: float, scale: np.ndarray) -> Noise:
    """Absolute noise on every derivative (Brunton et al. 2016)."""
    return Noise(np.zeros(len(scale)), np.full(len(scale), level))


def _states(level: float, scale: np.ndarray) -> Noise:
    return Noise(level * scale, np.full(len(scale), np.inf))


def _displacements(level: float, scale: np.ndarray) -> Noise:
    """As `_states`, without the velocities, which are the second half of the states."""
    noise = _states(level, scale)
    noise.states[len(scale) // 2 :] = np.inf
    return noise


PROTOCOLS = (
    Protocol(
        name="derivative",
        noise=_derivatives,
        meaning="exact states with noisy derivatives",
        label="derivative",
        color="#11115a",
        marker="o",
    ),
    Protocol(
        name="state",
        noise=_states,
        meaning="noisy states",
        label="state",
        color="#e69f00",
        marker="D",
    ),
    Protocol(
        name="displacement",
        noise=_displacements,
        meaning="noisy displacements without velocities",
        label="displacement",
        color="#2fa86a",
        marker="s",
    ),
)
BY_NAME = {protocol.name: protocol for protocol in PROTOCOLS}


def channel_scale(states: np.ndarray, relative: bool) -> np.ndarray:
    """What a noise level is in units of: (n, n_states) -> (n_states,).

    relative: the standard deviation of each state, else one SI unit.
    """
    return states.std(axis=0) if relative else np.ones(states.shape[1])
