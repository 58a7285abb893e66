"""Oscillations that an identified model describes besides its equations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

# Largest damping ratio of an oscillation. Its amplitude falls to a seventh in a period.
MAX_DAMPING_RATIO = 0.3
MIN_MODE_PERIODS = 10  # least periods of a mode in a recording: slower motion is mostly drift


@dataclass(frozen=True)
class FurtherMode:
    """Growing or decaying sinusoid in a recording that the equations of its model do not contain.

    recording: index; state: that of the sensor. frequency: rad/s; growth: 1/s, of its amplitude.
    cosine, sine: in the unit of the state, at the first sample. frequency_error, growth_error:
    standard errors, zero if unknown. For a steady oscillation, growth_error is also zero.
    """

    recording: int
    state: str
    frequency: float
    growth: float
    cosine: float
    sine: float
    frequency_error: float = 0.0
    growth_error: float = 0.0

    @property
    def name(self) -> str:
        """Name of the mode in sentences, which gives its frequency."""
        return f"the mode at {self.frequency / (2.0 * np.pi):.3g} Hz"

    @property
    def is_steady(self) -> bool:
        """Whether the oscillation neither grows nor decays, like a response to a steady force."""
        return self.growth == 0.0

    def __call__(self, time: NDArray[np.float64]) -> NDArray[np.float64]:
        """Compute the contribution to the state, (n,), at `time` (n,), s from the first sample."""
        angle = self.frequency * time
        return np.exp(self.growth * time) * (
            self.cosine * np.cos(angle) + self.sine * np.sin(angle)
        )


@dataclass(frozen=True)
class Resonance:
    """Mode that random forces excite and for which the model has no coordinate.

    It is an oscillating force r in their equations, r'' + 2 damping frequency r' + frequency^2 r =
    a white force.

    frequency: rad/s. damping: ratio. errors: standard errors of both. onto: (n_states,) what r adds
    to each equation. drive: (n_states + n_resonances,) covariance per second of its white force
    with those in the equations and those of all resonances.
    """

    frequency: float
    damping: float
    errors: tuple[float, float]
    onto: tuple[float, ...]
    drive: tuple[float, ...]

    @property
    def is_mode(self) -> bool:
        """Whether the resonance is damped lightly enough to be a mode of the line.

        A resonance that decays faster, to half in a period, is a colour of the forces.
        """
        return self.damping < MAX_DAMPING_RATIO / 3.0

    @property
    def name(self) -> str:
        """Name of the resonance in sentences, which gives its frequency."""
        return f"the mode at {self.frequency / (2.0 * np.pi):.3g} Hz"


@dataclass(frozen=True)
class EnvelopePart:
    """Amplitude, frequency and growth rate of an oscillation in one stretch of a recording.

    recording: index among the stretches of the model. state: that of the sensor, or `dX` for a
    sensor of the rate of a state X. time: middle of the stretch, s on the recording's clock.
    amplitude: there, in the unit of the state. frequency: rad/s; growth: 1/s. frequency_error,
    growth_error: standard errors.
    """

    recording: int
    state: str
    time: float
    amplitude: float
    frequency: float
    growth: float
    frequency_error: float
    growth_error: float
