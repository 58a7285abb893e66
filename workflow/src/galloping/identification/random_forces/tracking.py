"""A model in white forces that follows its recordings by the filter."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from galloping.identification.model import IdentifiedModel
from galloping.identification.random_forces.channels import Channels
from galloping.identification.random_forces.discrete import Steps, discretised
from galloping.identification.random_forces.kalman import kalman_filter
from galloping.polynomial import PolynomialModel
from galloping.recording import Recording

DIFFUSE = 1e3  # standard deviation of the first state, in that of the motion


@dataclass(frozen=True)
class Data:
    """samples: (n, n_channels) of a recording, NaN where missing; steps: between them."""

    samples: np.ndarray
    steps: Steps


@dataclass(frozen=True)
class Filtered:
    """innovations, variances: (n, n_channels) of samples, NaN where missing. means: (n, n_states)
    after each. mean, covariance: of the states after the last.
    """

    innovations: np.ndarray
    variances: np.ndarray
    means: np.ndarray
    mean: np.ndarray
    covariance: np.ndarray


@dataclass(frozen=True)
class Tracker:
    """A model, its forces and its instruments.

    forces: (n_states, n_states) covariance in a second. noise: (n_channels,) deviations of a
    sample. size: (n_states,) of the motion. Raises numpy.linalg.LinAlgError where it has no rest.
    """

    model: PolynomialModel
    forces: np.ndarray
    channels: Channels
    noise: np.ndarray
    size: np.ndarray

    @cached_property
    def system(self) -> np.ndarray:
        """(n_states, n_states) the linear part of the equations."""
        exponents = np.array(self.model.terms)
        first = exponents.sum(axis=1) == 1
        return self.model.coefficients[:, first] @ exponents[first]

    @cached_property
    def rest(self) -> np.ndarray:
        """(n_states,) where the linear part is in equilibrium."""
        constant = np.sum(np.array(self.model.terms), axis=1) == 0
        return -np.linalg.solve(self.system, self.model.coefficients[:, constant].sum(axis=1))

    @cached_property
    def sensing(self) -> np.ndarray:
        """(n_channels, n_states)."""
        return np.ascontiguousarray(self.channels.sensing(self.system))

    @property
    def shift(self) -> np.ndarray:
        """(n_channels,) what the channels show at rest."""
        shift = np.zeros(len(self.sensing))
        shift[: len(self.channels.values)] = self.rest[list(self.channels.values)]
        return shift

    def over(self, data: Data) -> Filtered:
        """Raises numpy.linalg.LinAlgError where the model cannot be discretised."""
        transitions, disturbances = discretised(self.system, self.forces, data.steps.lengths)
        x, p = np.zeros(len(self.rest)), np.diag((DIFFUSE * self.size) ** 2)
        innovations, variances, means = kalman_filter(
            data.samples - self.shift, data.steps.of, transitions, disturbances, self.sensing,
            self.noise**2, x, p,
        )  # fmt: skip
        return Filtered(innovations, variances, means + self.rest, x + self.rest, p)

    def first_state(self, data: Data, count: int) -> np.ndarray:
        """(n_states,) at the first sample, as `count` samples tell it.

        By the filter of the states beside what they were at first, which does not change.
        """
        n = len(self.rest)
        moved, disturbed = discretised(self.system, self.forces, data.steps.lengths)
        transitions, disturbances = np.zeros((2, len(moved), 2 * n, 2 * n))
        transitions[:, :n, :n], disturbances[:, :n, :n] = moved, disturbed
        transitions[:, n:, n:] = np.eye(n)
        x, p = np.zeros(2 * n), np.kron(np.ones((2, 2)), np.diag((DIFFUSE * self.size) ** 2))
        kalman_filter(
            data.samples[:count] - self.shift, data.steps.of[:count], transitions, disturbances,
            np.hstack([self.sensing, np.zeros_like(self.sensing)]), self.noise**2, x, p,
        )  # fmt: skip
        return x[n:] + self.rest


def sizes(
    recordings: list[Recording], channels: Channels, period: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(n_states,) deviations of the states, told by those of the channels at a period, s; and
    the means and deviations of the channels.
    """
    together = np.concatenate([channels.samples(each) for each in recordings])
    mean, deviation = np.nanmean(together, axis=0), np.nanstd(together, axis=0)
    omega, size = 2.0 * np.pi / period, np.ones(len(channels.states))
    for i, velocity in channels.pairs.items():
        swing = channels.displacement(i, np.array([1j * omega]), deviation[:, np.newaxis])
        size[i] = np.abs(swing[0])
        size[velocity] = omega * size[i]
    return size, mean, deviation


def tracker(found: IdentifiedModel, recording: Recording) -> tuple[Tracker, Data]:
    """Of an identified model that random forces move, and a recording of its system.

    Raises ValueError where the model does not know the noise of a channel.
    """
    channels, states = Channels.of([recording]), found.model.states
    noise = [found.sigma[-1, i] for i in channels.values]
    noise += [found.diagnostics.get(f"noise_d{states[i]}", np.nan) for i in channels.rates]
    for name, value in zip(channels.names, noise, strict=True):
        if not np.isfinite(value):
            raise ValueError(
                f"the model knows no noise of {name}: its recordings had no such sensor"
            )
    unsized = Tracker(found.model, found.forces, channels, np.array(noise), np.ones(len(states)))
    fastest = np.abs(np.linalg.eigvals(unsized.system)).max()
    size, _, _ = sizes([recording], channels, 2.0 * np.pi / fastest)
    data = Data(channels.samples(recording), Steps.between(recording.time))
    return replace(unsized, size=size), data
