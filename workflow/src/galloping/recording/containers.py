"""Recordings from the users' containers: arrays, and frames of pandas, polars and xarray.

None of these packages is imported: a container is recognised by its methods.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias, TypeGuard

import numpy as np
from numpy.typing import ArrayLike, NDArray

from galloping.arrays import as_finite, as_floats, as_seconds, count_dimensions
from galloping.recording.samples import Frame, Input, Recording, index_of_times

Samples: TypeAlias = ArrayLike | Frame
Data: TypeAlias = Samples | Recording | Sequence[Samples | Recording]
SampleTimes: TypeAlias = ArrayLike | Sequence[ArrayLike] | None
OfOne: TypeAlias = Samples | Mapping[str, Input | float]
Driving: TypeAlias = OfOne | Callable[[float], ArrayLike] | Sequence[OfOne] | None


def is_several(data: object) -> TypeGuard[Sequence[Any]]:
    """Decide whether data are a list of recordings rather than one recording.

    Nested lists of numbers are one array.
    """
    if not isinstance(data, list | tuple) or not data:
        return False
    first = data[0]
    if isinstance(first, list | tuple):
        return bool(first) and isinstance(first[0], list | tuple)
    is_frame = isinstance(first, Recording | Mapping) or hasattr(first, "to_frame")
    return is_frame or np.ndim(first) > 0


@dataclass
class Table:
    """Columns of a user's array or data frame by name, with the index of the frame.

    is_named: whether the names are those of the container.
    """

    what: str
    columns: dict[str, Any]
    index: Any = None
    is_named: bool = True

    @classmethod
    def from_data(cls, what: str, data: Any) -> "Table":
        """Make a table from an array, a data frame or a mapping of columns.

        The columns of an array are `what` and a number. Raises ValueError, beginning with `what`,
        for anything else.
        """
        if hasattr(data, "to_pandas") and hasattr(data, "coords"):  # xarray
            data = data.reset_coords(drop=True).to_pandas()
        if hasattr(data, "to_frame") and not hasattr(data, "columns"):  # a series, a trajectory
            data = data.to_frame()
        if not hasattr(data, "columns") and not isinstance(data, Mapping):
            if count_dimensions(what, data) == 1:
                data = np.asanyarray(data)[:, np.newaxis]
            values = as_floats(what, data, (None, None))
            return cls(what, {f"{what}{k}": y for k, y in enumerate(values.T)}, is_named=False)
        names = list(data if isinstance(data, Mapping) else data.columns)
        if len(set(names)) < len(names):
            raise ValueError(f"{what}: {names!r:.60}; columns must have distinct names")
        return cls(what, {str(n): data[n] for n in names}, index_of_times(data))

    def pop(self, what: str, name: str) -> Any:
        """Remove a column by its name and return it; raise ValueError if it is missing.

        The message begins with `what`.
        """
        if name not in self.columns:
            names = ", ".join(self.columns)
            raise ValueError(f"{what}: no column {name!r}; must be one of {names:.60}")
        return self.columns.pop(name)

    def pop_times(self, t: Any = None) -> Any:
        """Remove the column of times and return it; without one, return the index.

        t: name of the column, by default `t`.
        """
        if isinstance(t, str):
            return self.pop("t", t)
        return self.columns.pop("t", self.index) if self.is_named else None

    def matrix(
        self, names: Sequence[str] | None = None
    ) -> tuple[tuple[str, ...], NDArray[np.float64]]:
        """Return the names of columns, and their values as a matrix of floats.

        names: of the requested columns or, if any is missing, new names of all.
        """
        names = tuple(self.columns if names is None else names)
        column_names = names if set(names) <= set(self.columns) else tuple(self.columns)
        if len(column_names) != len(names):
            have = f"{len(self.columns)} columns, {', '.join(self.columns):.60}"
            raise ValueError(f"{self.what}: has {have}; must be {', '.join(names):.60}")
        if not column_names:
            raise ValueError(f"{self.what}: has no columns")
        values = [as_floats(f"{self.what}: {n}", self.columns[n], (None,)) for n in column_names]
        if len({*map(len, values)}) > 1:
            raise ValueError(f"{self.what}: columns differ in length")
        return names, np.column_stack(values)


def _as_column_names(u: object) -> list[str] | None:
    """Return the names of columns if `u` is a list of such."""
    if isinstance(u, str):
        return [u]
    if isinstance(u, list | tuple) and u and all(isinstance(name, str) for name in u):
        return list(u)
    return None


def split_samples(
    x: Any, t: Any = None, u: Any = None, states: Sequence[str] | None = None
) -> tuple[NDArray[np.float64] | None, tuple[str, ...], NDArray[np.float64], Any]:
    """Split a user's data into sample times, state names, state values and inputs.

    Parameters are those of `make_recordings`. Times are None if unspecified. Inputs that are
    columns of `x` are a mapping, others are returned unchanged.
    """
    table = Table.from_data("x", x)
    times = table.pop_times(t)
    if isinstance(t, str) or t is None:
        t = times
    if columns := _as_column_names(u):
        u = {name: table.pop("u", name) for name in columns}
    names, values = table.matrix(states)
    if t is not None and count_dimensions("t", t) == 0:
        step = float(as_finite("t", t, ()))
        if step <= 0.0:
            raise ValueError(f"t: {t!r:.60}; must be a step > 0, or times that increase")
        t = step * np.arange(len(values))
    if t is not None:
        t = as_floats("t", as_seconds("t", t), (len(values),))
    return t, names, values, u


def make_recordings(
    x: Data,
    t: SampleTimes = None,
    u: Driving = None,
    x_dot: Data | None = None,
    *,
    states: Sequence[str] | None = None,
    inputs: Sequence[str] | None = None,
    between: str = "cubic",
) -> list[Recording]:
    """Make recordings from arrays, data frames or lists of these.

    x: states, (n, n_states) array, frame, `Recording`, or a list of these, of which each is one
    recording; NaN is missing. t: step or times of the samples, s, or the column of a frame that has
    them, or a list of these; by default the column `t` of a frame, or its index if that does not
    count rows. u: inputs at the times of `x`, (n,) or (n, n_inputs) array, frame, mapping of names
    (an `Input` of it is at its own times), or a list of these; or names of columns of the frame
    `x`. x_dot: measured rates of the states, (n, n_states) array, frame, or a list of these.
    states, inputs: names; by default those of columns, else x0, x1, ... and u0, u1, ... between:
    interpolation of inputs between samples, as of `Input`. Raises ValueError if something is
    missing or does not fit, in one line that names it.
    """
    if not is_several(x):
        return [_make_recording(x, t, u, x_dot, states, inputs, between)]
    driving: Any = [u] * len(x) if u is None or _as_column_names(u) else u
    rates: Any = [None] * len(x) if x_dot is None else x_dot
    for name, part in (("u", driving), ("x_dot", rates)):
        if not isinstance(part, list | tuple) or len(part) != len(x):
            raise ValueError(f"{name}: must be a list of {len(x)}, one for each recording of x")
    times = t if isinstance(t, list | tuple) and len(t) == len(x) else [t] * len(x)
    recordings = []
    for k, parts in enumerate(zip(x, times, driving, rates, strict=True)):
        try:
            recordings.append(_make_recording(*parts, states, inputs, between))
        except ValueError as error:
            raise ValueError(f"recording {k}: {error}") from None
    return recordings


def _make_recording(
    x: Any,
    t: Any,
    u: Any,
    x_dot: Any,
    states: Sequence[str] | None,
    inputs: Sequence[str] | None,
    between: str,
) -> Recording:
    if isinstance(x, Recording):
        if t is not None or u is not None or x_dot is not None:
            raise ValueError("t, u, x_dot: must be left out, since a Recording has its own")
        if states is not None and tuple(states) != x.states:
            have = f"x: has the states {', '.join(x.states)}"
            raise ValueError(f"{have}; must have {', '.join(states)}")
        return x
    time, names, values, driving = split_samples(x, t, u, states)
    if time is None:
        raise ValueError("t: is missing; must be the times of the samples or their step, in s")
    rates = None
    if x_dot is not None:
        table = Table.from_data("x_dot", x_dot)
        table.pop_times()
        rates = table.matrix(names)[1]
    driving = make_inputs(driving, time, inputs, between)
    return Recording(time, names, values, rates=rates, inputs=driving)


def make_inputs(
    u: Any, time: NDArray[np.float64], names: Sequence[str] | None = None, between: str = "cubic"
) -> dict[str, Any]:
    """Make inputs by name from an array, a data frame, a mapping or a function of time.

    u: inputs at `time`, (n,) or (n, n_inputs) array, frame, mapping of names, or function; None if
    there are none. An `Input` or a number of a mapping is unchanged. time: (n,) s. names: by
    default those of columns, else u0, u1, ... between: interpolation of inputs between samples, as
    of `Input`. Raises ValueError if an input does not fit, in one line that names it.
    """
    if u is None:
        return {}
    if isinstance(u, Mapping) and set(names or ()) <= set(u):
        columns = {str(name): u[name] for name in (u if names is None else names)}
    else:
        if callable(u):
            u = np.array([np.ravel(u(each)) for each in time])
        table = Table.from_data("u", u)
        table.pop_times()
        names, values = table.matrix(names)
        columns = dict(zip(names, values.T, strict=True))
    inputs: dict[str, Any] = {}
    for name, values in columns.items():
        if isinstance(values, Input):
            inputs[name] = values
        elif count_dimensions(f"u: {name}", values) == 0:
            inputs[name] = float(as_finite(f"u: {name}", values, ()))
        else:
            try:
                inputs[name] = Input(time, values, between)
            except ValueError as error:
                raise ValueError(f"u: {name}: {str(error).removeprefix('input: ')}") from None
    return inputs
