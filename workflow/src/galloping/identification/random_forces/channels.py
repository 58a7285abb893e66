"""What of a system its recordings measure, as rows of the states."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from galloping.identification.likelihood.integrals import without_drift
from galloping.identification.model import Unusable
from galloping.polynomial import velocity_pairs
from galloping.recording import Recording


@dataclass(frozen=True)
class Channels:
    """states: names of the n_states states. values, rates: indices of those that are measured, and
    of those whose rate is; the n_channels are in this order.
    """

    states: tuple[str, ...]
    values: tuple[int, ...]
    rates: tuple[int, ...]

    @classmethod
    def of(cls, recordings: list[Recording]) -> Channels:
        """Of recordings of one system."""

        def measured(name: str) -> tuple[int, ...]:
            given = [getattr(each, name) for each in recordings]
            there = [np.isfinite(each).any(axis=0) for each in given if each is not None]
            return tuple(np.flatnonzero(np.any(there, axis=0)).tolist()) if there else ()

        return cls(recordings[0].states, measured("values"), measured("rates"))

    @property
    def pairs(self) -> dict[int, int]:
        return velocity_pairs(self.states)

    @property
    def names(self) -> tuple[str, ...]:
        rates = (f"d{self.states[i]}" for i in self.rates)
        return (*(self.states[i] for i in self.values), *rates)

    def samples(self, recording: Recording) -> np.ndarray:
        """(n, n_channels), NaN where missing; rates without their unknown offsets."""
        columns = [recording.values[:, i] for i in self.values]
        for i in self.rates:
            rate = np.full(len(recording.time), np.nan)
            if recording.rates is not None:
                rate = recording.rates[:, i]
                drifts = recording.unknown_offsets is not None and recording.unknown_offsets[i]
                if drifts and np.isfinite(rate).any():
                    rate = without_drift(recording.time, rate)
            columns.append(rate)
        return np.array(columns).T

    def sensing(self, system: np.ndarray) -> np.ndarray:
        """(n_channels, n_states) of the linear system (n_states, n_states)."""
        return np.vstack([np.eye(len(system))[list(self.values)], system[list(self.rates)]])

    def displacement(self, i: int, rates: np.ndarray, seen: np.ndarray) -> np.ndarray:
        """(n_modes,) shapes of the coordinate `i`.

        rates: (n_modes,) eigenvalues, 1/s. seen: (n_channels, n_modes) shapes of the channels.
        Raises Unusable where no channel is of this coordinate.
        """
        velocity = self.pairs[i]
        of = [
            (self.values, i, 0), (self.values, velocity, 1), (self.rates, i, 1),
            (self.rates, velocity, 2),
        ]  # fmt: skip
        for held, state, times in of:
            if state in held:
                place = held.index(state) + (len(self.values) if held is self.rates else 0)
                return seen[place] / rates**times
        raise Unusable(f"no channel measures {self.states[i]}, its rate or its acceleration")
