"""Steps between samples, for any sampling, and linear systems in white forces over them.

dx = A x dt + dW, of covariance G dt, has x(t + h) = exp(A h) x(t) + w, with the covariance of w
the integral of exp(A s) G exp(A s)' from 0 to h; both by the eigenvectors of A.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from galloping.identification.findings import Code
from galloping.identification.no_model import IdentificationError
from galloping.recording.samples import Factor, Input, evaluate_extended

# Number of ticks, to which times are rounded, in a median step. Equal steps then have equal length.
TICKS_PER_STEP = 1000
# Largest condition number of the eigenvectors, times machine epsilon.
MAX_CONDITION_ERROR = 1e-10


@dataclass(frozen=True)
class Steps:
    """Time steps between samples, with each distinct length stored once.

    lengths: (n_steps,) s, distinct lengths. index: (n,) of the step before each sample, -1
    before the first. time: (n,) s. inputs: those of the recording.
    """

    lengths: np.ndarray
    index: np.ndarray
    time: np.ndarray
    inputs: tuple[Input, ...] = ()

    @classmethod
    def from_times(cls, time: np.ndarray, inputs: Sequence[Input] = ()) -> "Steps":
        """Compute the time steps between increasing sample times (n,), s."""
        tick = np.median(np.diff(time)) / TICKS_PER_STEP
        counts = np.diff(np.round((time - time[0]) / tick).astype(np.int64))
        occurring, index = np.unique(np.maximum(counts, 1), return_inverse=True)
        return cls(occurring * tick, np.append(-1, index), time, tuple(inputs))

    def input_factors(self, substeps: np.ndarray, factors: Sequence[Factor]) -> np.ndarray:
        """Evaluate products of powers of the inputs at three times in each integration substep.

        Returns (3 n_substeps + 1, n_factors): at the beginning, half way and just before the end of
        each substep of all steps, and at the last time. substeps: (n_steps,) number in each step.
        The last result is cached, since a fit needs the same for nearly every model.
        """
        key = substeps.tobytes(), tuple(factors)
        if key not in self._factor_cache:
            self._factor_cache.clear()
            self._factor_cache[key] = self._input_factors(substeps, factors)
        return self._factor_cache[key]

    @cached_property
    def _factor_cache(self) -> dict[tuple, np.ndarray]:
        return {}

    def _input_factors(self, substeps: np.ndarray, factors: Sequence[Factor]) -> np.ndarray:
        halves = 2 * substeps[self.index[1:]]
        if not factors:
            return np.empty((halves.sum() // 2 * 3 + 1, 0))
        begins = np.cumsum(halves) - halves
        share = (np.arange(halves.sum()) - np.repeat(begins, halves)) / np.repeat(halves, halves)
        time = np.repeat(self.time[:-1], halves) + share * np.repeat(np.diff(self.time), halves)
        time = np.append(time, self.time[-1])
        values = []
        for one in self.inputs:
            signal, ends = evaluate_extended(one, time), time[2::2]
            limits = signal[2::2]
            if one.between == "zero":  # such an input may jump at the end of a step
                limits = evaluate_extended(one, np.nextafter(ends, -np.inf))
            within = np.stack([signal[:-1:2], signal[1::2], limits], axis=1)
            values.append(np.append(within, signal[-1]))
        powers = np.array(factors, float)[:, :, np.newaxis]
        return np.ascontiguousarray(np.prod(np.array(values) ** powers, axis=1).T)


def discretise(
    system: np.ndarray, forces: np.ndarray, lengths: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Compute transition matrices and noise covariances of a linear system over time steps.

    Both are (n_steps, n, n). lengths: (n_steps,) of the steps, s. system: (n, n), A; forces: (n,
    n), G. Raises IdentificationError if A has too few eigenvectors, as at critical damping.
    """
    values, vectors = np.linalg.eig(system)
    scaled = vectors / np.linalg.norm(vectors, axis=1)[:, np.newaxis]  # in any units of the states
    scaled = scaled / np.linalg.norm(scaled, axis=0)
    if np.linalg.cond(scaled) * np.finfo(float).eps > MAX_CONDITION_ERROR:
        raise IdentificationError(Code.MODES_ALIKE)
    inverse = np.linalg.inv(vectors)
    moved = np.exp(values * lengths[:, np.newaxis])
    transitions = ((vectors * moved[:, np.newaxis, :]) @ inverse).real
    rates = values[:, np.newaxis] + values.conj()
    grown = rates * lengths[:, np.newaxis, np.newaxis]
    slow = np.abs(grown) < 1e-8
    duration = lengths[:, np.newaxis, np.newaxis] * (1.0 + grown / 2.0)
    inside = np.where(slow, duration, np.expm1(grown) / np.where(rates == 0.0, 1.0, rates))
    of_modes = inside * (inverse @ forces @ inverse.conj().T)
    covariance = vectors @ of_modes @ vectors.conj().T
    return np.ascontiguousarray(transitions), np.ascontiguousarray(covariance.real)


def append_mean_rates(
    transitions: np.ndarray, disturbances: np.ndarray, lengths: np.ndarray, states: Sequence[int]
) -> tuple[np.ndarray, np.ndarray]:
    """Add the mean rates of some states over each step to a discretised linear system.

    states: their indices. Returns transitions and covariances with these rates appended.
    """
    unit, length = np.eye(transitions.shape[1]), lengths[:, np.newaxis, np.newaxis]
    rates = (transitions[:, states] - unit[states]) / length
    moved = np.concatenate([transitions, rates], axis=1)
    wider = np.concatenate([moved, np.zeros((*moved.shape[:2], len(states)))], axis=2)
    onto = np.concatenate([np.broadcast_to(unit, transitions.shape), unit[states] / length], axis=1)
    return wider, np.ascontiguousarray(onto @ disturbances @ onto.transpose(0, 2, 1))
