"""What sensors see of a motion, and where a motion must begin to follow samples best."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from galloping.identification.likelihood.integrals import (
    undisplaced,
    with_integrals,
    without_drift,
)
from galloping.identification.likelihood.smoothing import shortest_period
from galloping.identification.model import IdentifiedModel
from galloping.inputs import Input, at_times
from galloping.polynomial import PolynomialModel, velocity_pairs
from galloping.recording import Recording
from galloping.simulation import Simulator, Trajectory

ITERATIONS = 4  # of Gauss-Newton on the start, which is nearly linear over a few periods
NEARBY = 2  # of them, from a start that is near
STAGES = (1 / 6, 1 / 3, 2 / 3, 1.0)  # of the samples that a start is told from, one after another
STEP = 1e-5  # of finite differences of the start, relative to each state's size
SLOPE = 1 / 4  # of the fastest period, over which a first guess of a velocity is a slope,
FEWEST = 5  # but so many samples


@dataclass(frozen=True)
class Sensed:
    """What sensors tell of a motion: its states, and rates where no displacement is measured.

    rates: indices of the states whose rates are told from the others, as accelerometers alone do.
    """

    states: tuple[str, ...]
    rates: tuple[int, ...]

    @classmethod
    def by(cls, recording: Recording) -> Sensed:
        alone = {k for pair in undisplaced(recording).items() for k in pair}
        measured = [] if recording.rates is None else np.isfinite(recording.rates).any(axis=0)
        return cls(recording.states, tuple(k for k in np.flatnonzero(measured) if k in alone))

    @property
    def names(self) -> tuple[str, ...]:
        """Of the n_sensed channels."""
        return self.states + tuple(f"d{self.states[k]}" for k in self.rates)

    def samples(self, recording: Recording) -> np.ndarray:
        """(n, n_sensed), NaN where missing; rates without their unknown offsets."""
        columns = [recording.values]
        for k in self.rates:
            rate = recording.rates[:, k]
            if recording.unknown_offsets is not None and recording.unknown_offsets[k]:
                rate = without_drift(recording.time, rate)
            columns.append(rate[:, np.newaxis])
        return np.hstack(columns)

    def noise(self, identified: IdentifiedModel) -> np.ndarray:
        """(n_sensed,) of a sample, zero where not measured or not told by the method."""
        rates = self.names[len(self.states) :]
        told = [identified.diagnostics.get(f"noise_{name}", 0.0) for name in rates]
        return np.append(np.nan_to_num(identified.sigma[-1]), told)

    def of(
        self, model: PolynomialModel, states: np.ndarray, driven: np.ndarray | None = None
    ) -> np.ndarray:
        """(n, n_sensed) of a motion (n, n_states); driven: (n, n_inputs) values of its inputs."""
        if not self.rates:
            return states
        return np.hstack([states, model(states, driven)[:, self.rates]])


@dataclass(frozen=True)
class Driven:
    """Motions of a model and others with its terms, in the inputs of a recording if in any."""

    simulator: Simulator
    inputs: Mapping[str, Input]

    def __call__(self, model: PolynomialModel, start: np.ndarray, time: np.ndarray) -> Trajectory:
        return self.simulator(model, start, time, self.inputs)

    def at(self, time: np.ndarray) -> np.ndarray | None:
        """(n, n_inputs) values of the inputs."""
        return at_times(list(self.inputs.values()), time) if self.inputs else None


def simulator_of(model: PolynomialModel, recording: Recording | None = None) -> Driven:
    """For the model and others with its terms, in the inputs of the recording that it has."""
    simulator = Simulator(model.states, model.terms, model.coefficients != 0.0, model.inputs)
    return Driven(simulator, {name: recording.inputs[name] for name in model.inputs})


def first_guess(recording: Recording, begin: int) -> np.ndarray:
    """A state near the sample `begin`: interpolated values, slopes for unmeasured velocities."""
    recording = with_integrals(recording)
    time, states = recording.time, recording.states
    guess = np.zeros(len(states))
    displacement = {velocity: k for k, velocity in velocity_pairs(states).items()}
    for k in range(len(states)):
        known = np.isfinite(recording.values[:, k])
        if known.any():
            guess[k] = np.interp(time[begin], time[known], recording.values[known, k])
        elif k in displacement:
            source = recording.values[:, displacement[k]]
            known = np.isfinite(source)
            away = np.abs(time[known] - time[begin])
            within = max(
                SLOPE / 2 * shortest_period([recording]), np.partition(away, FEWEST)[FEWEST]
            )
            near = away <= within
            guess[k] = np.polyfit(time[known][near] - time[begin], source[known][near], 1)[0]
    return guess


@dataclass(frozen=True)
class Following:
    """Finds where a motion must begin to follow samples best.

    time: (n,) s, of the samples. sigma: (n_sensed,) their noise, zero where not measured.
    """

    simulator: Driven
    sensed: Sensed
    time: np.ndarray
    sigma: np.ndarray

    def start(
        self,
        model: PolynomialModel,
        guess: np.ndarray,
        values: np.ndarray,
        slopes: np.ndarray | None = None,
    ) -> np.ndarray | None:
        """(n_states,) at the first sample, None where the model diverges.

        guess: (n_states,) near it. values: (n, n_sensed) the samples, NaN where missing. slopes:
        those of a model and start near by, to spare their own.
        """
        sigma = self.sigma
        weight = np.isfinite(values) * np.where(sigma > 0, 1.0 / np.where(sigma > 0, sigma, 1), 0.0)
        target, start = np.nan_to_num(values), guess
        for stage in STAGES if slopes is None else STAGES[-1:]:
            n = max(int(stage * len(self.time)), min(len(self.time), 2 * len(guess)))
            for _ in range(ITERATIONS if slopes is None else NEARBY):
                motion = self.motion(model, start, self.time[:n])
                own = self.slopes(model, start, n) if slopes is None else slopes
                if not (np.all(np.isfinite(motion)) and np.all(np.isfinite(own))):
                    return None
                left = ((target[:n] - motion) * weight[:n]).ravel()
                design = (own * weight[:n]).reshape(len(start), -1).T
                start = start + np.linalg.lstsq(design, left, rcond=1e-12)[0]
        return start

    def motion(self, model: PolynomialModel, start: np.ndarray, time: np.ndarray) -> np.ndarray:
        """(n, n_sensed) of the model from a start, not finite where it diverges."""
        states = self.simulator(model, start, time).states
        return self.sensed.of(model, states, self.simulator.at(time))

    def slopes(self, model: PolynomialModel, start: np.ndarray, n: int) -> np.ndarray:
        """(n_states, n, n_sensed): change of n samples with each state at the first."""
        motion = self.motion(model, start, self.time[:n])
        size = STEP * (np.abs(start) + np.nanstd(motion[:, : len(start)], axis=0) + 1e-6)
        return np.array(
            [
                (self.motion(model, start + size * unit, self.time[:n]) - motion) / size[k]
                for k, unit in enumerate(np.eye(len(start)))
            ]
        )

    def misfit(self, motion: np.ndarray, values: np.ndarray) -> float:
        """chi^2 per sample of a motion (n, n_sensed), infinite where it diverges."""
        known = np.isfinite(values) & (self.sigma > 0)
        squares = ((values - motion) / np.where(self.sigma > 0, self.sigma, 1.0)) ** 2
        mean = np.mean(squares[known]) if known.any() else np.inf
        return float(mean) if np.isfinite(mean) else np.inf
