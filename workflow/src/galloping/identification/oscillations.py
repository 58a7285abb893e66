"""Oscillations that an identified model describes beside its equations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

# Ratio, of a motion that swings: at it a swing falls to a seventh in a period.
MOST_DAMPING = 0.3


@dataclass(frozen=True)
class FurtherMode:
    """An oscillation of a recording that is not in its model: a sinusoid that grows or decays.

    recording: index; state: the one whose sensor reads it. frequency: rad/s; growth: 1/s, of its
    amplitude. cosine, sine: in the unit of the state, at the first sample. frequency_error,
    growth_error: standard errors, zero where they are not told and of the growth of a steady one.
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
        """What sentences call the mode."""
        return f"the mode at {self.frequency / (2.0 * np.pi):.3g} Hz"

    @property
    def is_steady(self) -> bool:
        """Whether it neither grows nor decays, as an oscillation driven by a steady force does."""
        return self.growth == 0.0

    def __call__(self, time: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n,) what it adds to the state at `time` (n,), s from the first sample."""
        angle = self.frequency * time
        return np.exp(self.growth * time) * (
            self.cosine * np.cos(angle) + self.sine * np.sin(angle)
        )


@dataclass(frozen=True)
class Resonance:
    """A mode that a model in random forces has beside those of its coordinates.

    It is a force r in their equations that swings by itself, r'' + 2 damping frequency r' +
    frequency^2 r = a white force.

    frequency: rad/s. damping: ratio. errors: standard errors of both. onto: (n_states,) what r adds
    to each equation. drive: (n_states + n_resonances,) covariance in a second of its white force
    with those in the equations and those of all resonances.
    """

    frequency: float
    damping: float
    errors: tuple[float, float]
    onto: tuple[float, ...]
    drive: tuple[float, ...]

    @property
    def is_mode(self) -> bool:
        """Whether the resonance is a mode of the line.

        What dies out faster, to half in a period, is how forces differ from white ones.
        """
        return self.damping < MOST_DAMPING / 3.0

    @property
    def name(self) -> str:
        """What sentences call the resonance."""
        return f"the mode at {self.frequency / (2.0 * np.pi):.3g} Hz"


@dataclass(frozen=True)
class EnvelopePart:
    """Frequency and damping of an oscillation in a stretch of a recording, for its amplitude there.

    Parameters
    ----------
    recording : int
        Index among the stretches that the model is of.
    state : str
        Whose sensor reads it, or `dX` for a sensor of the rate of a state X.
    time, amplitude : float
        Middle of the stretch, s on the recording's clock, and amplitude there, in the unit of the
        state.
    frequency, growth : float
        rad/s and 1/s.
    frequency_error, growth_error : float
        Standard errors.
    """

    recording: int
    state: str
    time: float
    amplitude: float
    frequency: float
    growth: float
    frequency_error: float
    growth_error: float
