"""Measurement equations: channels of recordings as rows of the states."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from galloping.identification.findings import Code
from galloping.identification.no_model import IdentificationError
from galloping.identification.preparation.smoothing import rate_without_offset
from galloping.model.polynomial import velocity_pairs
from galloping.recording.samples import Recording

# Largest ratio of a step between samples to the median step if no sample is missing. The limit is
# lower than for other gaps, since a mean rate is the mean over the whole step.
MAX_STEP_RATIO = 1.5
MAX_CONDITION = 1e6  # largest condition number of modes' vectors: more similar ones give no system


@dataclass(frozen=True)
class Channels:
    """Measured channels of a system: which states, and which rates of states, are recorded.

    states: names of the n_states states. values, rates: indices of those that are measured, and of
    those whose rate is; the n_channels are in this order. averaged: whether a rate is the mean
    since the last sample, including its force, as of an accelerometer; else it is the rate at the
    sample, without white forces.
    """

    states: tuple[str, ...]
    values: tuple[int, ...]
    rates: tuple[int, ...]
    averaged: bool = False

    @classmethod
    def from_recordings(cls, recordings: Sequence[Recording]) -> "Channels":
        """Determine which states and rates the recordings of one system measure."""

        def measured(name: str) -> tuple[int, ...]:
            given = [getattr(each, name) for each in recordings]
            has_samples = [np.isfinite(each).any(axis=0) for each in given if each is not None]
            return tuple(np.flatnonzero(np.any(has_samples, axis=0)).tolist())

        return cls(recordings[0].states, measured("values"), measured("rates"))

    @property
    def pairs(self) -> dict[int, int]:
        """Dictionary from the index of each coordinate to the index of its velocity."""
        return velocity_pairs(self.states)

    @property
    def lagged(self) -> tuple[int, ...]:
        """Indices of states whose values at the previous sample the Kalman filter stores."""
        return self.rates if self.averaged else ()

    @cached_property
    def observed(self) -> np.ndarray:
        """Index of the state that each channel, or whose rate it, measures, (n_channels,)."""
        return np.array([*self.values, *self.rates], int)

    @cached_property
    def is_rate(self) -> np.ndarray:
        """Whether each channel measures a rate, (n_channels,) boolean."""
        return np.arange(len(self.observed)) >= len(self.values)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the channels: a state's name, after a d if its rate is measured."""
        rates = (f"d{self.states[i]}" for i in self.rates)
        return (*(self.states[i] for i in self.values), *rates)

    def samples(self, recording: Recording) -> np.ndarray:
        """Extract the samples of all channels from a recording, (n_samples, n_channels).

        Missing samples are NaN. Rates are without their unknown offsets. A mean since the last
        sample is missing if there is no last sample, or a gap.
        """
        columns = [recording.values[:, i] for i in self.values]
        steps = np.diff(recording.time, prepend=-np.inf)
        is_after_gap = self.averaged & (steps > MAX_STEP_RATIO * np.median(steps))
        for i in self.rates:
            columns.append(np.where(is_after_gap, np.nan, rate_without_offset(recording, i)))
        return np.array(columns).T

    def noise_by_state(self, noise: np.ndarray) -> tuple[np.ndarray, dict[str, float]]:
        """Sort the channels' noise standard deviations into those of states and those of rates.

        noise: (n_recordings, n_channels). Returns the noise of states, (n_recordings, n_states),
        NaN if not measured, and the largest of each rate, as `noise_` and the rate's name.
        """
        count = len(self.values)
        sigma = np.full((len(noise), len(self.states)), np.nan)
        sigma[:, list(self.values)] = noise[:, :count]
        largest = np.fmax.reduce(noise[:, count:], axis=0).tolist()
        names = (f"noise_{name}" for name in self.names[count:])
        return sigma, dict(zip(names, largest, strict=True))

    def sensing(self, system: np.ndarray) -> np.ndarray:
        """Compute the measurement matrix of the channels for a linear system dx/dt = A x.

        Returns (n_channels, n_states); rates are those at the sample.
        """
        return np.vstack([np.eye(len(system))[list(self.values)], system[list(self.rates)]])

    def response(self, system: np.ndarray, omega: np.ndarray) -> np.ndarray:
        """Compute the frequency response of the channels to forces on the states.

        Returns (n, n_channels, n_states). system: (n_states, n_states), of the states first. omega:
        (n,), rad/s.
        """
        unit = np.eye(len(system))
        s = 1j * omega[:, np.newaxis, np.newaxis]
        sensing = np.broadcast_to(self.sensing(system), (len(omega), len(self.names), len(unit)))
        if self.averaged:
            rates = s * unit[list(self.rates)]
            sensing = np.concatenate([sensing[:, : len(self.values)], rates], axis=1)
        return sensing @ np.linalg.inv(s * unit - system)

    def derivatives(self, i: int) -> list[tuple[int, int]]:
        """List the channels that measure a coordinate or a derivative of it.

        i: index of the coordinate. Returns the index of each channel and the order of its
        derivative, the lowest first.
        """
        states = ((i, 0), (self.pairs[i], 1))
        values = [(self.values.index(state), n) for state, n in states if state in self.values]
        rates = [(self.rates.index(state), n) for state, n in states if state in self.rates]
        return values + [(len(self.values) + place, n + 1) for place, n in rates]

    def displacement(self, i: int, rates: np.ndarray, shapes: np.ndarray) -> np.ndarray:
        """Compute a coordinate's displacement in each mode from the mode shapes of the channels.

        i: index of the coordinate. Returns (n_modes,). rates: (n_modes,) eigenvalues, 1/s. shapes:
        (n_channels, n_modes) of the channels. Raises IdentificationError if no channel
        measures this coordinate.
        """
        if not (derivatives := self.derivatives(i)):
            raise IdentificationError(Code.NOT_SENSED, self.states[i])
        channel, order = derivatives[0]
        return shapes[channel] / rates**order

    def system_with_modes(self, rates: np.ndarray, shapes: np.ndarray) -> np.ndarray:
        """Compute the matrix of the linear system with given modes, one for each coordinate.

        Returns (n_states, n_states). rates: (n_coordinates,) eigenvalues, 1/s. shapes: (n_channels,
        n_coordinates) of the channels, in any unit. Raises IdentificationError if a
        coordinate is in no channel, or the shapes are nearly dependent.
        """
        coordinates, velocities = list(self.pairs), list(self.pairs.values())
        displacements = np.array([self.displacement(i, rates, shapes) for i in coordinates])
        values = np.append(rates, rates.conj())
        displacements = np.hstack([displacements, displacements.conj()])
        basis = np.vstack([displacements, displacements * values])
        scaled = np.vstack([displacements, displacements * values / np.abs(values).mean()])
        if not np.linalg.cond(scaled / np.linalg.norm(scaled, axis=0)) < MAX_CONDITION:
            raise IdentificationError(Code.NO_OSCILLATION)
        order = coordinates + velocities
        system = np.zeros((len(order),) * 2)
        system[np.ix_(order, order)] = (basis * values @ np.linalg.inv(basis)).real
        system[coordinates] = 0.0
        system[coordinates, velocities] = 1.0
        return system
