"""A recording: what was measured, and the only thing identification ever sees."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from galloping.arrays import Immutable, floats, increasing, seconds
from galloping.inputs import Input


@dataclass(frozen=True, eq=False, repr=False)
class Recording(Immutable):
    """One measured time series.

    Lists become arrays, and all arrays read-only. time: (n,) in s, strictly increasing; dates and
    times, as of a DatetimeIndex, become s since the first. states: names of the n_states states.
    values: (n, n_states), measured states, NaN where a sample or a whole channel is missing.
    derivatives: (n, n_states) measured state derivatives, or None where none was measured;
    when given, the values are exact and the derivatives carry the noise (protocol `derivative`).
    rates: (n, n_states) what accelerometers and the like measure, the noisy rate of a state beside
    noisy values; NaN where missing, None where nothing measures one. unknown_offsets: (n_states,)
    whether a rate has an unknown constant offset that drifts slowly. unknown_scales: (n_states,)
    whether a value is known up to a factor only. Both None where there is none. known_noise:
    (2, n_states) standard deviation of a sample of each value and of each rate where it is known,
    else NaN; None where none is. inputs: by name, what was measured beside the motion and drives
    it, on the same clock, each at its own times.
    Raises ValueError for anything else, in one line.
    """

    time: NDArray[np.float64]
    states: tuple[str, ...]
    values: NDArray[np.float64]
    derivatives: NDArray[np.float64] | None = None
    rates: NDArray[np.float64] | None = None
    unknown_offsets: NDArray[np.bool_] | None = None
    unknown_scales: NDArray[np.bool_] | None = None
    known_noise: NDArray[np.float64] | None = None
    inputs: Mapping[str, Input] = field(default_factory=dict)

    def __post_init__(self) -> None:
        states = self.states
        if isinstance(states, str) or not all(isinstance(name, str) for name in states):
            raise ValueError(f"recording: states: {states!r:.60}; must be a list of names")
        states = tuple(states)
        if not states or len(set(states)) < len(states):
            raise ValueError(f"recording: states: {states!r:.60}; must be distinct, one or more")
        time = increasing("recording: time", seconds("recording: time", self.time))
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
        for name, one in self.inputs.items():
            if not isinstance(name, str) or name in states:
                raise ValueError(f"recording: inputs: {name!r:.60}; must be a name of no state")
            if not isinstance(one, Input):
                raise ValueError(
                    f"recording: inputs: {name}: a {type(one).__name__}; must be an Input"
                )
        for name, array in checked.items():
            object.__setattr__(self, name, array)
        super().__post_init__()

    def __repr__(self) -> str:
        first, last, step = self.time[0], self.time[-1], np.median(np.diff(self.time))
        held = {"": self.values, "d": self.rates, "derivative of ": self.derivatives}
        channels = []
        for prefix, array in held.items():
            for state, column in zip(self.states, () if array is None else array.T, strict=False):
                missing = 100 * np.mean(np.isnan(column))
                if missing < 100:
                    share = f" ({missing:.2g} % missing)" if missing else ""
                    channels.append(f"{prefix}{state}{share}")
        return (
            f"Recording of {', '.join(self.states)}\n"
            f"{len(self.time)} samples from {first:.6g} to {last:.6g} s, "
            f"{'every' if self.is_uniform else 'mostly every'} {step:.4g} s\n"
            f"measured: {', '.join(channels) or 'nothing'}"
            + (f"; inputs: {', '.join(self.inputs)}" if self.inputs else "")
        )

    @property
    def samples(self) -> int:
        """Number of samples of values and rates."""
        parts = [self.values] if self.rates is None else [self.values, self.rates]
        return sum(int(np.isfinite(part).sum()) for part in parts)

    @classmethod
    def from_frame(
        cls,
        frame: Mapping[str, ArrayLike],
        time: str | None = None,
        inputs: Sequence[str] = (),
        between: str = "cubic",
    ) -> Recording:
        """A recording from a pandas DataFrame, or a mapping of columns.

        time: name of the column of times, s or dates; every column beside it and the `inputs` is a
        state. By default it is `t`, or the index of the frame where there is no such column and the
        index holds dates. inputs: names of the columns that are inputs. between: as of `Input`, of
        all of them.
        Raises ValueError where such a column is missing or a column does not hold numbers.
        """
        names = list(frame)
        column = "t" if time is None else time
        index = getattr(frame, "index", None)
        if column in names:
            times = frame[column]
        elif time is None and seconds("recording: index", index) is not index:
            times = index
        else:
            raise ValueError(f"recording: no column {column!r}; must be one of {names!r:.60}")
        if isinstance(inputs, str):
            raise ValueError(f"recording: inputs: {inputs!r:.60}; must be a list of names")
        for name in inputs:
            if name not in names or name == column:
                raise ValueError(f"recording: inputs: no column {name!r}; there is {names!r:.60}")
        states = [name for name in names if name != column and name not in inputs]
        columns = {
            name: floats(f"recording: column {name!r}", frame[name], (None,))
            for name in (*states, *inputs)
        }
        if len({len(times), *map(len, columns.values())}) > 1:
            raise ValueError("recording: columns differ in length")
        values = np.array([columns[name] for name in states]).T.reshape(-1, len(states))
        own = {}
        for name in inputs:
            try:
                own[name] = Input(times, columns[name], between)
            except ValueError as error:
                raise ValueError(f"recording: column {name!r}: {error}") from None
        return cls(times, states, values, inputs=own)

    def __getitem__(self, rows: slice) -> Recording:
        """The samples of a slice, such as `recording[:100]`, two or more."""
        own = ("values", "derivatives", "rates")
        cut = {name: array[rows] for name in own if (array := getattr(self, name)) is not None}
        return replace(self, time=self.time[rows], **cut)

    def driven(self, names: Sequence[str], least: int = 2) -> list[Recording]:
        """The recording with the named inputs alone, in that order, where all of them are there.

        One recording a stretch of samples without a gap in an input, of `least` samples or more;
        itself where those are its inputs and no sample is left out.
        """
        inputs = {name: self.inputs[name] for name in names}
        there = np.ones(len(self.time), bool)
        begins = [np.empty(0)]
        for one in inputs.values():
            there &= one.covered(self.time)
            begins.append(np.array(one.stretches)[:, 0])
        piece = np.searchsorted(np.sort(np.concatenate(begins)), self.time, side="right")
        if there.all() and len(np.unique(piece)) == 1 and list(self.inputs) == list(names):
            return [self]
        rows = (np.flatnonzero(there & (piece == k)) for k in np.unique(piece))
        return [
            replace(self, inputs=inputs)[own[0] : own[-1] + 1] for own in rows if len(own) >= least
        ]

    @property
    def is_uniform(self) -> bool:
        """Whether the samples are equally spaced (to a thousandth of the spacing)."""
        steps = np.diff(self.time)
        return bool(np.ptp(steps) < 1e-3 * steps.mean())


def mean_inputs(names: Sequence[str], recordings: Sequence[Recording]) -> dict[str, float]:
    """Of the named inputs, over the samples of the recordings."""
    return {
        name: float(np.nanmean(np.concatenate([one.inputs[name](one.time) for one in recordings])))
        for name in names
    }
