"""A recording: what was measured, and the only thing identification ever sees."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from galloping.arrays import floats, increasing


@dataclass(frozen=True)
class Recording:
    """One measured time series.

    Lists become arrays. time: (n,) in s, strictly increasing. states: names of the n_states states.
    values: (n, n_states), measured states, NaN where a sample or a whole channel is missing.
    derivatives: (n, n_states) measured state derivatives, or None where none was measured;
    when given, the values are exact and the derivatives carry the noise (protocol `derivative`).
    rates: (n, n_states) what accelerometers and the like measure, the noisy rate of a state beside
    noisy values; NaN where missing, None where nothing measures one. unknown_offsets: (n_states,)
    whether a rate has an unknown constant offset that drifts slowly. unknown_scales: (n_states,)
    whether a value is known up to a factor only. Both None where there is none. known_noise:
    (2, n_states) standard deviation of a sample of each value and of each rate where it is known,
    else NaN; None where none is.
    Raises ValueError for anything else, in one line.
    """

    time: np.ndarray
    states: tuple[str, ...]
    values: np.ndarray
    derivatives: np.ndarray | None = None
    rates: np.ndarray | None = None
    unknown_offsets: np.ndarray | None = None
    unknown_scales: np.ndarray | None = None
    known_noise: np.ndarray | None = None

    def __post_init__(self) -> None:
        states = self.states
        if isinstance(states, str) or not all(isinstance(name, str) for name in states):
            raise ValueError(f"recording: states: {states!r:.60}; must be a list of names")
        states = tuple(states)
        if not states or len(set(states)) < len(states):
            raise ValueError(f"recording: states: {states!r:.60}; must be distinct, one or more")
        time = increasing("recording: time", self.time)
        shape = len(time), len(states)
        checked = {"time": time, "states": states}
        for name in ("values", "derivatives", "rates"):
            if (given := getattr(self, name)) is not None:
                array = checked[name] = floats(f"recording: {name}", given, shape)
                if np.isinf(array).any():
                    row, column = np.argwhere(np.isinf(array))[0]
                    raise ValueError(
                        f"recording: {name}: {array[row, column]:g} in row {row} of "
                        f"{checked['states'][column]}; must be finite, or NaN where missing"
                    )
        for name in ("unknown_offsets", "unknown_scales"):
            if (given := getattr(self, name)) is not None:
                checked[name] = array = np.asarray(given)
                if array.dtype != bool or array.shape != shape[1:]:
                    raise ValueError(
                        f"recording: {name}: {given!r:.60}; must be a truth value a state"
                    )
        if self.known_noise is not None:
            noise = floats("recording: known_noise", self.known_noise, (2, len(states)))
            checked["known_noise"] = noise
        for name, array in checked.items():
            object.__setattr__(self, name, array)

    @property
    def samples(self) -> int:
        """How many samples of values and rates there are."""
        parts = [self.values] if self.rates is None else [self.values, self.rates]
        return sum(int(np.isfinite(part).sum()) for part in parts)

    @classmethod
    def from_frame(cls, frame: Mapping[str, object], time: str = "t") -> Recording:
        """A recording from a pandas DataFrame, or a mapping of columns.

        time: name of the column of times, s; every other column is a state.
        Raises ValueError where that column is missing or a column does not hold numbers.
        """
        names = list(frame)
        if time not in names:
            raise ValueError(f"recording: no column {time!r}; must be one of {names!r:.60}")
        states = [name for name in names if name != time]
        columns = [floats(f"recording: column {name!r}", frame[name], (None,)) for name in states]
        if len({len(frame[time]), *map(len, columns)}) > 1:
            raise ValueError("recording: columns differ in length")
        return cls(frame[time], states, np.array(columns).T.reshape(-1, len(states)))

    def __getitem__(self, rows: slice) -> Recording:
        """The samples of a slice, such as `recording[:100]`, two or more."""
        own = ("values", "derivatives", "rates")
        cut = {name: array[rows] for name in own if (array := getattr(self, name)) is not None}
        return replace(self, time=self.time[rows], **cut)

    @property
    def is_uniform(self) -> bool:
        """Whether the samples are equally spaced (to a thousandth of the spacing)."""
        steps = np.diff(self.time)
        return bool(np.ptp(steps) < 1e-3 * steps.mean())
