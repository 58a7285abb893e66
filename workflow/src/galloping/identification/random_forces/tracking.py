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
    after each. mean, covariance: of the states, and of slow forces, after the last. count: of the
    samples, more than of the finite innovations where the filter fails.
    """

    innovations: np.ndarray
    variances: np.ndarray
    means: np.ndarray
    mean: np.ndarray
    covariance: np.ndarray
    count: int


@dataclass(frozen=True)
class Forces:
    """white: (n_states, n_states) covariance in a second of white forces in the equations. slow:
    (n_states, n_states) of what drives forces that decay at `rates` (n_states,), 1/s, as those of
    gusts do; zero where there are none.
    """

    white: np.ndarray
    slow: np.ndarray
    rates: np.ndarray

    @cached_property
    def places(self) -> np.ndarray:
        """(n_slow,) indices of the equations with a slow force."""
        return np.flatnonzero(np.diag(self.slow))

    @classmethod
    def of(cls, found: IdentifiedModel) -> Forces:
        """Those of an identified model."""
        rates = [found.diagnostics.get(f"slow_rate_{s}", 1.0) for s in found.model.states]
        return cls(found.forces, found.slow_forces, np.array(rates))

    def density(self, omega: float) -> np.ndarray:
        """(n_states, n_states) two-sided, at a frequency, rad/s: covariance in a second of the
        white forces that move a mode there as much.
        """
        return self.white + self.slow / (self.rates**2 + omega**2)


@dataclass(frozen=True)
class Tracker:
    """A model, its forces and its instruments.

    noise: (n_channels,) deviations of a sample. size: (n_states,) of the motion. Raises
    numpy.linalg.LinAlgError where the model has no rest. With slow forces, the filter is of the
    states and of those.
    """

    model: PolynomialModel
    forces: Forces
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
        try:
            return -np.linalg.solve(self.system, self.model.coefficients[:, constant].sum(axis=1))
        except np.linalg.LinAlgError:
            raise np.linalg.LinAlgError("a stiffness cannot be told in random forces") from None

    @cached_property
    def driven(self) -> tuple[np.ndarray, np.ndarray]:
        """The linear system and its white forces, those that drive slow ones included, (m, m)."""
        n, places = len(self.rest), self.forces.places
        m = n + len(places)
        system, white = np.zeros((m, m)), np.zeros((m, m))
        system[:n, :n], white[:n, :n] = self.system, self.forces.white
        system[places, np.arange(n, m)] = 1.0
        system[n:, n:] = -np.diag(self.forces.rates[places])
        white[n:, n:] = self.forces.slow[np.ix_(places, places)]
        return system, white

    @cached_property
    def sensing(self) -> np.ndarray:
        """(n_channels, m)."""
        sensed = self.channels.sensing(self.system)
        forces = np.zeros((len(sensed), len(self.forces.places)))
        for k, i in enumerate(self.channels.rates, start=len(self.channels.values)):
            forces[k] = self.forces.places == i
        return np.ascontiguousarray(np.hstack([sensed, forces]))

    @property
    def shift(self) -> np.ndarray:
        """(n_channels,) what the channels show at rest."""
        shift = np.zeros(len(self.sensing))
        shift[: len(self.channels.values)] = self.rest[list(self.channels.values)]
        return shift

    @property
    def first_covariance(self) -> np.ndarray:
        """(m, m) before anything was measured."""
        slow = np.diag(self.forces.slow) / (2.0 * self.forces.rates)
        return np.diag(np.append((DIFFUSE * self.size) ** 2, slow[self.forces.places]))

    def over(self, data: Data) -> Filtered:
        """Raises numpy.linalg.LinAlgError where the model cannot be discretised."""
        transitions, disturbances = discretised(*self.driven, data.steps.lengths)
        p, n = self.first_covariance, len(self.rest)
        x = np.zeros(len(p))
        innovations, variances, means = kalman_filter(
            data.samples - self.shift, data.steps.of, transitions, disturbances, self.sensing,
            self.noise**2, x, p,
        )  # fmt: skip
        x[:n] += self.rest
        count = int(np.isfinite(data.samples).sum())
        return Filtered(innovations, variances, means[:, :n] + self.rest, x, p, count)

    def first_state(self, data: Data, count: int) -> np.ndarray:
        """(n_states,) at the first sample, as `count` samples tell it.

        By the filter of the states beside what they were at first, which does not change.
        """
        moved, disturbed = discretised(*self.driven, data.steps.lengths)
        m, n = moved.shape[1], len(self.rest)
        transitions, disturbances = np.zeros((2, len(moved), 2 * m, 2 * m))
        transitions[:, :m, :m], disturbances[:, :m, :m] = moved, disturbed
        transitions[:, m:, m:] = np.eye(m)
        x, p = np.zeros(2 * m), np.kron(np.ones((2, 2)), self.first_covariance)
        kalman_filter(
            data.samples[:count] - self.shift, data.steps.of[:count], transitions, disturbances,
            np.hstack([self.sensing, np.zeros_like(self.sensing)]), self.noise**2, x, p,
        )  # fmt: skip
        return x[m : m + n] + self.rest


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
    unsized = Tracker(
        found.model, Forces.of(found), channels, np.array(noise), np.ones(len(states))
    )
    fastest = np.abs(np.linalg.eigvals(unsized.system)).max()
    size, _, _ = sizes([recording], channels, 2.0 * np.pi / fastest)
    data = Data(channels.samples(recording), Steps.between(recording.time))
    return replace(unsized, size=size), data
