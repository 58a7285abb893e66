"""Measurement protocols: what each measures of a motion, and how well.

A protocol is its noise on each state and on each state's derivative: from it follow the recordings
(`measuring`), the Cramer-Rao bound (`bounds.recordings`) and which methods can use them
(`identification.registry`).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

# What recordings hold: exact states with their derivatives, all states, not all of them, or
# derivatives beside states that are not exact, if there are any.
DERIVATIVES, ALL_STATES, DISPLACEMENTS_ALONE, RATES = (
    "derivatives", "states", "displacements", "rates",
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

    noise: from the noise level and the scale (2, n_states) of each state and of each derivative to
    a `Noise`; displacements come before velocities. meaning: in the words of the settings.
    by_default: whether a study has it that names none.
    """

    name: str
    noise: Callable[[float, np.ndarray], Noise]
    meaning: str
    by_default: bool = True

    @property
    def measures(self) -> str:
        """DERIVATIVES, ALL_STATES, DISPLACEMENTS_ALONE or RATES: what its recordings hold."""
        noise = self.noise(1.0, np.ones((2, 2)))
        if np.any(np.isfinite(noise.derivatives)):
            return RATES if np.any(noise.states) else DERIVATIVES
        return ALL_STATES if np.all(np.isfinite(noise.states)) else DISPLACEMENTS_ALONE

    @property
    def is_scaled(self) -> bool:
        """Whether its noise depends on the size of the motion."""
        one, other = (self.noise(1.0, np.full((2, 2), size)) for size in (1.0, 2.0))
        return bool(
            np.any(one.states != other.states) or np.any(one.derivatives != other.derivatives)
        )

    def noise_unit(self, relative: bool) -> str:
        """What a noise level counts in, in words. relative: as in `channel_scale`."""
        if relative and self.is_scaled:
            return "standard deviations"
        units = {DERIVATIVES: "m/s, m/s²", ALL_STATES: "m, m/s", DISPLACEMENTS_ALONE: "m"}
        return units.get(self.measures, "m/s²")


def _derivatives(level: float, scale: np.ndarray) -> Noise:
    """Absolute noise on every derivative (Brunton et al. 2016)."""
    return Noise(np.zeros(scale.shape[1]), np.full(scale.shape[1], level))


def _states(level: float, scale: np.ndarray) -> Noise:
    return Noise(level * scale[0], np.full(scale.shape[1], np.inf))


def _displacements(level: float, scale: np.ndarray) -> Noise:
    """As `_states`, without the velocities, which are the second half of the states."""
    noise = _states(level, scale)
    noise.states[scale.shape[1] // 2 :] = np.inf
    return noise


def _accelerations(level: float, scale: np.ndarray) -> Noise:
    """On the derivatives of the velocities, which are all that is measured."""
    noise = Noise(np.full(scale.shape[1], np.inf), level * scale[1])
    noise.derivatives[: scale.shape[1] // 2] = np.inf
    return noise


PROTOCOLS = (
    Protocol("derivative", _derivatives, "exact states with noisy derivatives"),
    Protocol("state", _states, "noisy states"),
    Protocol("displacement", _displacements, "noisy displacements without velocities"),
    # of the methods only `maximum_likelihood` can use it
    Protocol("acceleration", _accelerations, "noisy accelerations alone", by_default=False),
)
BY_NAME = {protocol.name: protocol for protocol in PROTOCOLS}
