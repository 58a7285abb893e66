"""Recordings, the only data of an identification, and their inputs.

An input, such as the wind speed, is a known function of time, interpolated from samples. A model
multiplies monomials of its states by factors, monomials of its inputs, whose exponents may be
negative.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from numbers import Real
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias

import numpy as np
from numpy.polynomial.legendre import Legendre, legvander
from numpy.typing import ArrayLike, NDArray

from galloping.arrays import Immutable, Matrix, as_floats, as_increasing, as_seconds, time_tie

if TYPE_CHECKING:
    from datetime import datetime

    from scipy.interpolate import CubicSpline


class Frame(Protocol):
    """Type-checking protocol of a pandas DataFrame or a mapping of columns."""

    def __iter__(self) -> Iterator[Any]: ...
    def __getitem__(self, name: Any, /) -> Any: ...


Times: TypeAlias = "ArrayLike | Sequence[datetime]"
INTERPOLATIONS = ("zero", "linear", "cubic")
# Longest gap of an input that is interpolated, in median steps. Shorter gaps are reported as well,
# but an input is known well enough if three of its samples are missing.
MAX_INTERPOLATED_STEPS = 4.5
# Number of points of the Gauss-Legendre quadrature between two knots: exact for products of a
# cubic and a polynomial of degree eight.
QUADRATURE_POINTS = 6
WINDOW_POINTS = 24  # number of points of a window at which the error of a polynomial is computed


@dataclass(frozen=True, eq=False, repr=False)
class Input(Immutable):
    """Measured input of a system, such as a wind speed, as a function of time.

    Parameters
    ----------
    time : (m,) array
        Times, s, strictly increasing, on the clock of the recording.
    values : (m,) array
        NaN marks missing samples.
    between : {"cubic", "linear", "zero"}
        The input between samples. `cubic`, a spline, is the default, because most measured
        quantities are smooth on the scale of their sampling; `zero` holds the last sample.
    error : float
        Relative standard deviation of an unknown constant factor on the values, such as that of a
        calibration.
    alternatives : tuple of Input
        The same input with other kinds of interpolation. The command selects one by the motion
        (`identification.interpolation`); methods ignore them.

    Raises
    ------
    ValueError
        For anything else, in one line.
    """

    time: NDArray[np.float64]
    values: NDArray[np.float64]
    between: str = "cubic"
    error: float = 0.0
    alternatives: tuple["Input", ...] = ()

    if TYPE_CHECKING:  # an argument may be a list; the attribute is an array

        def __init__(
            self,
            time: Times,
            values: ArrayLike,
            between: str = ...,
            error: float = ...,
            alternatives: tuple["Input", ...] = ...,
        ) -> None: ...

    def __post_init__(self) -> None:
        time = as_increasing("input: time", as_seconds("input: time", self.time))
        values = as_floats("input: values", self.values, time.shape)
        if np.isinf(values).any():
            raise ValueError(f"input: values: {values[np.isinf(values)][0]:g}; must be finite")
        if np.isfinite(values).sum() < 2:
            raise ValueError("input: values: fewer than two are there")
        if self.between not in INTERPOLATIONS:
            raise ValueError(
                f"input: between: {self.between!r:.60}; must be {', '.join(INTERPOLATIONS)}"
            )
        if not isinstance(self.error, Real) or not 0.0 <= self.error < 1.0:
            raise ValueError(f"input: error: {self.error!r:.60}; must be a number in [0, 1)")
        object.__setattr__(self, "time", time)
        object.__setattr__(self, "values", values)
        super().__post_init__()

    def __repr__(self) -> str:
        gone = np.isnan(self.values).mean()
        return (
            f"Input: {len(self.time)} samples from {self.time[0]:.6g} to {self.time[-1]:.6g} s"
            f"{f' ({100 * gone:.2g} % missing)' if gone else ''}, {self.between} between them"
        )

    @cached_property
    def stretches(self) -> tuple[tuple[float, float], ...]:
        """First and last time, s, of each stretch of samples without a gap.

        In a held input, a gap is a missing sample, or more missing samples than usual if a logger
        does not write it in every row. In other inputs, it is a time between samples longer than
        MAX_INTERPOLATED_STEPS median steps.
        """
        return tuple((float(time[0]), float(time[-1])) for time, _ in self._pieces)

    @cached_property
    def _pieces(self) -> list[tuple[np.ndarray, np.ndarray]]:
        is_finite = np.isfinite(self.values)
        time, values = self.time[is_finite], self.values[is_finite]
        if self.between == "zero":
            rows = np.diff(np.flatnonzero(is_finite))
            is_gap = rows > 1.5 * np.median(rows)
        else:
            steps = np.diff(time)
            is_gap = steps > MAX_INTERPOLATED_STEPS * np.median(steps)
        edges = np.flatnonzero(is_gap) + 1
        pieces = zip(np.split(time, edges), np.split(values, edges), strict=True)
        return [piece for piece in pieces if len(piece[0]) > 1]

    def covered(self, time: ArrayLike) -> NDArray[np.bool_]:
        """Decide for each time whether the input is known there, that is, not in a gap.

        A time that is outside by rounding alone is inside.
        """
        time = np.asarray(time, float)
        inside = np.zeros(time.shape, bool)
        for piece, _ in self._pieces:
            inside |= self._is_within(piece, time)
        return inside

    def has_zero(self, time: NDArray[np.float64]) -> bool:
        """Decide whether the input is zero during given times, at a sample or between two."""
        during = (self.time >= time[0]) & (self.time <= time[-1]) & np.isfinite(self.values)
        signs = np.sign(self.values[during])
        return bool(np.any(signs == 0.0) or (self.between != "zero" and np.any(np.diff(signs))))

    def _is_within(
        self, piece: NDArray[np.float64], time: NDArray[np.float64]
    ) -> NDArray[np.bool_]:
        tie = time_tie(self.time)
        return (time >= piece[0] - tie) & (time <= piece[-1] + tie)

    @cached_property
    def _splines(self) -> "list[CubicSpline]":
        from scipy.interpolate import CubicSpline  # slow to import

        return [CubicSpline(*piece) for piece in self._pieces]

    def __call__(self, time: ArrayLike) -> NDArray[np.float64]:
        """Evaluate the input at those times, (n,), NaN in gaps."""
        time = np.asarray(time, float)
        evaluated = np.full(time.shape, np.nan)
        for k, (sample_times, values) in enumerate(self._pieces):
            inside = self._is_within(sample_times, time)
            moments = np.clip(time[inside], sample_times[0], sample_times[-1])
            if self.between == "zero":
                evaluated[inside] = values[np.searchsorted(sample_times, moments, side="right") - 1]
            elif self.between == "linear":
                evaluated[inside] = np.interp(moments, sample_times, values)
            else:
                evaluated[inside] = self._splines[k](moments)
        return evaluated

    def mean_around(self, time: ArrayLike, width: float) -> NDArray[np.float64]:
        """Average the input over an interval of `width` seconds centred at each time.

        Parts of an interval in gaps do not count. NaN at times that are not covered themselves.
        """
        time = np.asarray(time, float)
        means = np.full(time.shape, np.nan)
        for k, (sample_times, values) in enumerate(self._pieces):
            inside = self._is_within(sample_times, time)
            ends = np.clip(
                time[inside] + width * np.array([[-0.5], [0.5]]), sample_times[0], sample_times[-1]
            )
            if self.between == "cubic":
                integral = self._splines[k].antiderivative()(ends)
            else:
                last = values[:-1] if self.between == "zero" else (values[:-1] + values[1:]) / 2.0
                row = np.clip(
                    np.searchsorted(sample_times, ends, side="right") - 1, 0, len(sample_times) - 2
                )
                elapsed = ends - sample_times[row]
                integral = np.append(0.0, np.cumsum(last * np.diff(sample_times)))[row]
                integral += values[row] * elapsed
                if self.between == "linear":
                    integral += 0.5 * (np.diff(values) / np.diff(sample_times))[row] * elapsed**2
            means[inside] = np.diff(integral, axis=0)[0] / np.diff(ends, axis=0)[0]
        return means


def index_of_times(frame: object) -> Any:
    """Return the index of a data frame as times; None without one, or if it counts rows.

    An index of whole numbers without a name counts rows, also of a part of a frame.
    """
    index = getattr(frame, "index", None)
    kind = getattr(getattr(index, "dtype", None), "kind", "")
    return None if kind in ("i", "u") and getattr(index, "name", None) is None else index


Factor = tuple[int, ...]


def inputs_at_times(inputs: Sequence[Input], time: NDArray[np.float64]) -> NDArray[np.float64]:
    """Evaluate inputs at given times, as one column per input with NaN in gaps."""
    return np.stack([one(time) for one in inputs], axis=1) if inputs else np.empty((len(time), 0))


def inputs_on_grid(inputs: Sequence[Input], time: NDArray[np.float64]) -> NDArray[np.float64]:
    """Evaluate inputs on a uniform time grid, as one column per input with NaN in gaps.

    A held input is averaged over a step about the point, which preserves the integral that moves a
    system.
    """
    if not inputs:
        return np.empty((len(time), 0))
    step = float(time[1] - time[0])
    columns = [one.mean_around(time, step) if one.between == "zero" else one(time)
               for one in inputs]  # fmt: skip
    return np.stack(columns, axis=1)


def fit_windows(
    inputs: Sequence[Input],
    factors: Sequence[Factor],
    start: float,
    step: float,
    windows: int,
    degree: int,
) -> NDArray[np.float64]:
    """Fit products of inputs by polynomials in time over consecutive windows of equal length.

    The windows have a length of `step` s and begin at `start`. factors: exponents of the inputs,
    each a monomial of them. Returns (windows, degree + 1, n_factors), coefficients of the powers of
    the time since a window's start over `step`: the polynomial of that degree that is nearest in
    the mean square (Legendre). Its error moves the states at the window's end only through
    components of their own motion beyond that degree. Times of a window that an input does not
    cover have its nearest value.
    """
    polynomials = np.zeros((windows, degree + 1, len(factors)))
    if not factors:
        return polynomials
    edges = start + step * np.arange(windows + 1)
    knots = [one.time[(one.time > edges[0]) & (one.time < edges[-1])] for one in inputs]
    breaks = np.unique(np.concatenate([edges, *knots]))
    window = np.clip(np.searchsorted(edges, breaks[:-1], side="right") - 1, 0, windows - 1)
    points, weights = np.polynomial.legendre.leggauss(QUADRATURE_POINTS)
    half = np.diff(breaks)[:, None] / 2.0
    time = breaks[:-1, None] + half * (1.0 + points)
    signals = np.stack([evaluate_extended(one, time) for one in inputs])
    position = np.clip((time - edges[window][:, None]) / step, 0.0, 1.0)
    basis = legvander(2.0 * position - 1.0, degree) * (2 * np.arange(degree + 1) + 1.0)
    weighted = basis * (half * weights / step)[..., None]
    first = np.searchsorted(window, np.arange(windows))
    for k, factor in enumerate(factors):
        values = np.prod(signals ** np.array(factor, float)[:, None, None], axis=0)
        moments = np.einsum("sp,spd->sd", values, weighted)
        polynomials[:, :, k] = np.add.reduceat(moments, first) @ powers_of_legendre(degree)
    return polynomials


def fit_errors(
    inputs: Sequence[Input],
    factors: Sequence[Factor],
    start: float,
    step: float,
    powers: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Compute the RMS errors of polynomials fitted by `fit_windows`, and of their integrals.

    powers: the polynomials of `fit_windows`. Returns (3, n_factors): of the factors less their
    polynomials, and of the first and second integral of this difference within the windows.
    """
    windows, n_powers, _ = powers.shape
    position = (np.arange(WINDOW_POINTS) + 0.5) / WINDOW_POINTS
    time = start + step * (np.arange(windows)[:, None] + position)
    signals = np.stack([evaluate_extended(one, time) for one in inputs])
    errors = []
    for k, factor in enumerate(factors):
        values = np.prod(signals ** np.array(factor, float)[:, None, None], axis=0)
        rest = values - powers[:, :, k] @ position ** np.arange(n_powers)[:, None]
        once = np.cumsum(rest, axis=1) * step / WINDOW_POINTS
        twice = np.cumsum(once, axis=1) * step / WINDOW_POINTS
        errors.append([np.sqrt(np.mean(each**2)) for each in (rest, once, twice)])
    return np.array(errors).T.reshape(3, len(factors))


def evaluate_extended(one: Input, time: np.ndarray) -> np.ndarray:
    """Evaluate an input at given times, with times in gaps moved to the nearest sample."""
    ends = np.array(one.stretches)
    stretch = np.clip(np.searchsorted(ends[:, 0], time, side="right") - 1, 0, len(ends) - 1)
    later = np.minimum(stretch + 1, len(ends) - 1)
    last, following = ends[stretch, 1], ends[later, 0]
    sooner = (later > stretch) & (time > last) & (following - time < time - last)
    nearest = np.where(sooner, following, last)
    inside = (time >= ends[stretch, 0]) & (time <= last)
    return one(np.where(inside, time, np.where(time < ends[0, 0], ends[0, 0], nearest)))


@cache
def powers_of_legendre(degree: int) -> NDArray[np.float64]:
    """Return the coefficients of Legendre polynomials, shifted to [0, 1], by powers.

    The rows of the matrix (degree + 1, degree + 1) are the polynomials.
    """
    rows = np.zeros((degree + 1, degree + 1))
    for k in range(degree + 1):
        powers = Legendre.basis(k, domain=[0, 1]).convert(kind=np.polynomial.Polynomial).coef
        rows[k, : len(powers)] = powers
    return rows


# --- recordings ---


@dataclass(frozen=True, eq=False, repr=False)
class Recording(Immutable):
    """Measured time series of the states of a system, and of its inputs.

    Lists become arrays, and all arrays are read-only. Recordings with equal contents are equal, and
    have the same hash.

    Parameters
    ----------
    time : (n,) array
        Times, s, strictly increasing; dates, as of a DatetimeIndex, become s since the first one.
    states : tuple of str
        Names of the n_states states; a state named dX is the rate of X.
    values : (n, n_states) array
        Measured states; NaN, or the mask of an array, marks missing samples and missing channels.
        Names of the columns of a DataFrame must be those of the states, in their order.
    rates : (n, n_states) array, optional
        Measured rates of the states, as of accelerometers, in the same form.
    unknown_offsets : (n_states,) boolean array, optional
        Whether a rate has an unknown, slowly drifting offset.
    unknown_scales : (n_states,) boolean array, optional
        Whether a value is known only up to a factor.
    known_noise : (2, n_states) array, optional
        Known standard deviations of the noise of values and of rates; NaN if unknown.
    inputs : mapping of str to Input
        Measured quantities that drive the motion, by name, on the same clock, each at its own
        times.
    exact : bool
        Whether the values have no noise, but the rates do (protocol `derivative`).

    Raises
    ------
    ValueError
        For anything else, in one line.
    """

    time: NDArray[np.float64]
    states: tuple[str, ...]
    values: NDArray[np.float64]
    rates: NDArray[np.float64] | None = None
    unknown_offsets: NDArray[np.bool_] | None = None
    unknown_scales: NDArray[np.bool_] | None = None
    known_noise: NDArray[np.float64] | None = None
    inputs: Mapping[str, Input] = field(default_factory=dict)
    exact: bool = False

    if TYPE_CHECKING:

        def __init__(
            self,
            time: Times,
            states: Sequence[str],
            values: Matrix,
            rates: Matrix | None = ...,
            unknown_offsets: ArrayLike | None = ...,
            unknown_scales: ArrayLike | None = ...,
            known_noise: Matrix | None = ...,
            inputs: Mapping[str, Input] = ...,
            exact: bool = ...,
        ) -> None: ...

    def __post_init__(self) -> None:
        states = self.states
        if isinstance(states, str) or not all(isinstance(name, str) for name in states):
            raise ValueError(f"recording: states: {states!r:.60}; must be a list of names")
        states = tuple(states)
        if not states or len(set(states)) < len(states):
            raise ValueError(f"recording: states: {states!r:.60}; must be distinct, one or more")
        time = as_increasing("recording: time", as_seconds("recording: time", self.time))
        shape = len(time), len(states)
        checked: dict[str, Any] = {"time": time, "states": states}
        for name, prefix in (("values", ""), ("rates", "d")):
            if (data := getattr(self, name)) is not None or name == "values":
                labels = tuple(getattr(data, "columns", states))
                wanted = states, tuple(prefix + state for state in states)
                if any(isinstance(label, str) for label in labels) and labels not in wanted:
                    must = f"must be {', '.join(states)}, as the states"
                    raise ValueError(f"recording: {name}: columns {labels!r:.60}; {must}")
                array = checked[name] = as_floats(f"recording: {name}", data, shape)
                if np.isinf(array).any():
                    row, column = np.argwhere(np.isinf(array))[0]
                    raise ValueError(
                        f"recording: {name}: {array[row, column]:g} in row {row} of "
                        f"{checked['states'][column]}; must be finite, or NaN where missing"
                    )
        if self.exact and self.rates is None:
            raise ValueError("recording: exact: True; must be False without rates")
        for name in ("unknown_offsets", "unknown_scales"):
            if (data := getattr(self, name)) is not None:
                checked[name] = array = np.asarray(data)
                if array.dtype != bool or array.shape != shape[1:]:
                    raise ValueError(
                        f"recording: {name}: {data!r:.60}; must be a truth value a state"
                    )
        if self.known_noise is not None:
            noise = as_floats("recording: known_noise", self.known_noise, (2, len(states)))
            if np.any(noise <= 0.0):
                raise ValueError("recording: known_noise: must be > 0, or NaN where unknown")
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
        first, last = self.time[[0, -1]]
        arrays = {"exact " if self.exact else "": self.values, "d": self.rates}
        channels = []
        for prefix, array in arrays.items():
            for state, column in zip(self.states, () if array is None else array.T, strict=False):
                missing = 100 * np.mean(np.isnan(column))
                if missing < 100:
                    share = f" ({missing:.2g} % missing)" if missing else ""
                    channels.append(f"{prefix}{state}{share}")
        return (
            f"Recording of {', '.join(self.states)}\n"
            f"{len(self.time)} samples from {first:.6g} to {last:.6g} s, "
            f"{'every' if self.is_uniform else 'mostly every'} {self.step:.4g} s\n"
            f"measured: {', '.join(channels) or 'nothing'}"
            + (f"; inputs: {', '.join(self.inputs)}" if self.inputs else "")
        )

    @property
    def samples(self) -> int:
        """Number of measured state values and derivatives that have noise."""
        noisy = {"values": not self.exact, "rates": self.rates is not None}
        parts = (getattr(self, name) for name, counts in noisy.items() if counts)
        return sum(int(np.isfinite(part).sum()) for part in parts)

    @classmethod
    def from_frame(
        cls,
        frame: Frame,
        time: str | None = None,
        inputs: Sequence[str] = (),
        between: str = "cubic",
    ) -> "Recording":
        """Make a recording from a pandas DataFrame, or a mapping of columns.

        Parameters
        ----------
        frame : DataFrame or mapping
            Every column except the times and the `inputs` is a state.
        time : str, optional
            Name of the column of times, s or dates; by default `t`. Without such a column, the
            index of the frame is used if it does not count rows.
        inputs : sequence of str
            Names of the columns that are inputs.
        between : str
            The inputs between their samples, as in `Input`.

        Returns
        -------
        Recording

        Raises
        ------
        ValueError
            If a column is missing, or contains something else than numbers.
        """
        names = list(frame)
        column = "t" if time is None else time
        times = frame[column] if column in names else None
        if time is None and times is None:
            times = index_of_times(frame)
        if times is None:
            raise ValueError(f"recording: no column {column!r}; must be one of {names!r:.60}")
        if isinstance(inputs, str):
            raise ValueError(f"recording: inputs: {inputs!r:.60}; must be a list of names")
        for name in inputs:
            if name not in names or name == column:
                raise ValueError(f"recording: inputs: no column {name!r}; there is {names!r:.60}")
        states = [name for name in names if name != column and name not in inputs]
        columns = {
            name: as_floats(f"recording: column {name!r}", frame[name], (None,))
            for name in (*states, *inputs)
        }
        if len({len(times), *map(len, columns.values())}) > 1:
            raise ValueError("recording: columns differ in length")
        values = np.array([columns[name] for name in states]).T.reshape(len(times), len(states))
        driving = {}
        for name in inputs:
            try:
                driving[name] = Input(times, columns[name], between)
            except ValueError as error:
                raise ValueError(f"recording: column {name!r}: {error}") from None
        return cls(times, states, values, inputs=driving)

    def __getitem__(self, rows: slice) -> "Recording":
        """Return the samples of a slice, such as `recording[:100]`, two or more."""
        rates = None if self.rates is None else self.rates[rows]
        return replace(self, time=self.time[rows], values=self.values[rows], rates=rates)

    def driven(self, names: Sequence[str], least: int = 2) -> "list[Recording]":
        """Return as recordings the stretches in which all named inputs are present.

        Each stretch is a recording with these inputs, in that order, and has `least` samples or
        more. The recording itself is returned if it has just these inputs and no sample is omitted.
        """
        inputs = {name: self.inputs[name] for name in names}
        covered = np.ones(len(self.time), bool)
        begins = [np.empty(0)]
        for one in inputs.values():
            covered &= one.covered(self.time)
            begins.append(np.array(one.stretches)[:, 0] - time_tie(one.time))
        piece = np.searchsorted(np.sort(np.concatenate(begins)), self.time, side="right")
        if covered.all() and len(np.unique(piece)) == 1:
            return [self if list(self.inputs) == list(names) else replace(self, inputs=inputs)]
        parts = (np.flatnonzero(covered & (piece == k)) for k in np.unique(piece))
        driven = replace(self, inputs=inputs)
        return [driven[rows[0] : rows[-1] + 1] for rows in parts if len(rows) >= least]

    @property
    def step(self) -> float:
        """Median time between samples of the channel that is sampled most often, s."""
        rates = np.empty((len(self.time), 0)) if self.rates is None else self.rates
        return sampling_step(self.time, np.hstack([self.values, rates]))

    @property
    def is_uniform(self) -> bool:
        """Whether the samples are equally spaced (to a thousandth of the spacing)."""
        steps = np.diff(self.time)
        return bool(np.ptp(steps) < 1e-3 * steps.mean())


def sampling_step(time: NDArray[np.float64], values: NDArray[np.float64]) -> float:
    """Compute the median time between samples of the channel that is sampled most often, s.

    time: (n,). values: (n, n_channels), NaN where missing: loggers may write the sensors in turn.
    """
    is_finite = np.isfinite(values)
    times = [time[column] for column in is_finite.T if not column.all() and column.sum() > 1]
    times += [time] if not is_finite.size or is_finite.all(axis=0).any() else []
    steps = [np.median(np.diff(each)) for each in times]
    return float(min(steps, default=np.median(np.diff(time))))


def typical_inputs(names: Sequence[str], recordings: Sequence[Recording]) -> dict[str, float]:
    """Choose a typical value of each named input over recordings, near its mean.

    It is the mean or, for an input that is held between its samples, the sample nearest to the
    mean, since it never had another value.
    """
    typical = mean_inputs(names, recordings)
    for name, mean in typical.items():
        inputs = [one.inputs[name] for one in recordings]
        if all(one.between == "zero" for one in inputs):
            values = np.concatenate([one.values[np.isfinite(one.values)] for one in inputs])
            typical[name] = float(values[np.argmin(np.abs(values - mean))])
    return typical


def mean_inputs(names: Sequence[str], recordings: Sequence[Recording]) -> dict[str, float]:
    """Compute the mean of each named input over all samples of the recordings."""
    return {
        name: float(np.nanmean(np.concatenate([one.inputs[name](one.time) for one in recordings])))
        for name in names
    }
