"""Arrays: checks of user input, immutable dataclasses of arrays, linear algebra on one thread."""

from collections.abc import Callable, Sequence
from dataclasses import fields
from datetime import UTC, datetime
from functools import partial
from numbers import Real
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ClassVar, ParamSpec, Protocol, TypeAlias, TypeVar, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray
from threadpoolctl import threadpool_limits

Arguments = ParamSpec("Arguments")
Returned = TypeVar("Returned")


class SupportsArray(Protocol):
    """Type-checking protocol of objects that numpy can convert to an array, such as a DataFrame."""

    def __array__(self) -> NDArray[Any]: ...


# Rows of numbers. Of numpy's ArrayLike, type checkers would reject a list that mixes int and float.
Matrix: TypeAlias = SupportsArray | Sequence[Sequence[float] | SupportsArray]


def as_floats(name: str, values: ArrayLike, shape: tuple[int | None, ...]) -> NDArray[np.float64]:
    """Convert values to a float array and check its shape; NaN is allowed.

    None in `shape` is any length. An array of floats is returned as it is, a masked one with NaN
    for masked values. Raises ValueError naming `name` if the values are not real numbers or have
    another shape.
    """
    try:
        array = np.asarray(values)
    except ValueError:
        raise ValueError(
            f"{name}: rows differ in length; must have {_describe_shape(shape)}"
        ) from None
    if array.dtype.kind == "O" and all(x is None or isinstance(x, Real) for x in array.flat):
        array = array.astype(float)  # None is missing
    if array.dtype.kind not in "iuf":
        kind = {"c": "complex numbers", "U": "text", "b": "truth values"}.get(
            array.dtype.kind, f"a {type(values).__name__} of {array.dtype}"
        )
        raise ValueError(f"{name}: {kind}; must be real numbers")
    fits = len(array.shape) == len(shape) and all(
        wanted in (None, length) for wanted, length in zip(shape, array.shape, strict=True)
    )
    if not fits:
        raise ValueError(f"{name}: has shape {array.shape}; must have {_describe_shape(shape)}")
    if np.ma.is_masked(values):
        array = np.where(np.ma.getmask(values), np.nan, array)
    return array.astype(float, copy=False)


def count_dimensions(name: str, values: ArrayLike) -> int:
    """Return the number of dimensions of values, 0 of a number; raise ValueError if ragged."""
    try:
        return np.ndim(values)
    except ValueError:
        raise ValueError(f"{name}: rows differ in length; must have equal lengths") from None


def as_finite(
    name: str, values: ArrayLike, shape: tuple[int | None, ...], infinite: bool = False
) -> NDArray[np.float64]:
    """Convert values to a float array of a given shape; raise ValueError for NaN or infinity.

    The arguments are those of `as_floats`. `infinite` allows infinity.
    """
    array = as_floats(name, values, shape)
    if np.isnan(array).any() or (np.isinf(array).any() and not infinite):
        raise ValueError(f"{name}: {array.tolist()!r:.60}; must be finite")
    return array


def checked_state(values: ArrayLike, states: tuple[str, ...]) -> NDArray[np.float64]:
    """Convert an initial state to an array; raise ValueError unless it has one number per state.

    states: names of the states. The message names states without a number.
    """
    start = as_finite("initial_state", values, (None,))
    if len(start) == len(states):
        return start
    lacking = f"; none for {', '.join(states[len(start) :])}" if len(start) < len(states) else ""
    raise ValueError(
        f"initial_state: {len(start)} numbers for the {len(states)} states {', '.join(states)}"
        + lacking
    )


def as_seconds(name: str, times: Any) -> Any:
    """Convert datetimes or durations to seconds since the first; return other values unchanged.

    times: of numpy, pandas or `datetime`. Raises ValueError if one is missing.
    """
    pandas: Any = getattr(times, "dt", times)
    in_utc = pandas.tz_convert(None) if getattr(pandas, "tz", None) is not None else times
    array = np.asarray(in_utc)
    if array.dtype.kind == "O" and array.size and all(isinstance(t, datetime) for t in array.flat):
        utc = [t.astimezone(UTC).replace(tzinfo=None) if t.tzinfo else t for t in array]
        array = np.array(utc, "datetime64[us]")
    if array.dtype.kind not in "mM":
        return times
    if np.isnat(array).any():
        raise ValueError(f"{name}: no time in row {np.argmax(np.isnat(array))}")
    return (array - array.ravel()[:1]) / np.timedelta64(1, "s")


def as_increasing(name: str, values: ArrayLike) -> NDArray[np.float64]:
    """Convert two or more finite, strictly increasing times to floats; else raise ValueError."""
    array = as_floats(name, values, (None,))
    is_good = np.isfinite(array)
    is_good[1:] &= ~(array[1:] <= array[:-1])
    if len(array) < 2 or not is_good.all():
        where = ""
        if not is_good.all():
            row = int(np.argmin(is_good))
            where = f"; row {row} has {array[row]:.16g}"
            where += f" after {array[row - 1]:.16g}" if row else ""
        raise ValueError(f"{name}: must be finite, strictly increasing, two samples or more{where}")
    return array


# Tolerance for rounding errors of counts, and of times in steps between samples: a number that is
# whole in one unit of time may not be exactly whole after conversion to another unit.
TIME_ROUNDING = 1e-6


def round_down(number: float) -> int:
    """Round down to an integer, but up if the number is less than 1e-6 below an integer."""
    return int(np.floor(number + TIME_ROUNDING))


def round_up(number: float) -> int:
    """Round up to an integer, but down if the number is less than 1e-6 above an integer."""
    return int(np.ceil(number - TIME_ROUNDING))


def finest_step(values: NDArray[np.float64]) -> float:
    """Return the least difference between two different finite values, 0 if there are none."""
    steps = np.diff(np.unique(values[np.isfinite(values)]))
    return float(steps.min()) if len(steps) else 0.0


def first_from(time: NDArray[np.float64], moments: ArrayLike) -> NDArray[np.int_]:
    """Return, for each given time, the index of the first sample at or after that time.

    time: (n,) increasing times of samples. moments: (...) in the unit of `time`. A sample that is
    early by rounding alone is at the moment. Returns (...) indices, n for a moment after the last
    sample.
    """
    return np.searchsorted(time, np.asarray(moments) - time_tie(time))


def time_tie(time: NDArray[np.float64]) -> float:
    """Return the time difference that counts as rounding between increasing sample times (n,)."""
    return float(TIME_ROUNDING * (time[-1] - time[0]) / max(len(time) - 1, 1))


def _describe_shape(shape: tuple[int | None, ...]) -> str:
    lengths = ["n" if length is None else str(length) for length in shape]
    return f"shape ({', '.join(lengths)}{',' if len(shape) == 1 else ''})"


class Immutable:
    """Base class of frozen dataclasses that makes their array and dict fields read-only.

    The dataclasses have `frozen=True, eq=False`. Two are equal if all their contents are, NaN equal
    to NaN; equal ones have the same hash. Copies and pickles are read-only too. An array that can
    still be written elsewhere is copied.
    """

    if TYPE_CHECKING:
        __dataclass_fields__: ClassVar[dict[str, Any]]

    def __post_init__(self) -> None:
        for name, value in self._held().items():
            object.__setattr__(self, name, _read_only(value))

    def __eq__(self, other: object) -> bool:
        return type(self) is type(other) and self._key() == other._key()

    def __hash__(self) -> int:
        return hash(self._key())

    def __reduce__(self) -> tuple[Callable, tuple]:
        held = {
            name: dict(value) if isinstance(value, MappingProxyType) else value
            for name, value in self._held().items()
        }
        return partial(type(self), **held), ()

    def _held(self) -> dict[str, object]:
        return {field.name: getattr(self, field.name) for field in fields(self)}

    def _key(self) -> tuple:
        return tuple(map(_as_comparable, self._held().values()))


def _read_only(value: object) -> object:
    if isinstance(value, dict):
        return MappingProxyType(dict(value))
    if not isinstance(value, np.ndarray):
        return value
    owner = value if value.base is None else value.base
    if value.flags.writeable or not isinstance(owner, np.ndarray) or owner.flags.writeable:
        value = np.array(value)
        value.flags.writeable = False
    return value


def _as_comparable(value: object) -> object:
    """Convert a value for comparison and hashing: NaN equals NaN, and zero has no sign."""
    if isinstance(value, MappingProxyType):
        return frozenset((name, _as_comparable(each)) for name, each in value.items())
    if isinstance(value, tuple):
        return tuple(map(_as_comparable, value))
    if isinstance(value, float) and np.isnan(value):
        return "nan"
    if isinstance(value, np.ndarray):
        alike = np.where(np.isnan(value), np.nan, value + 0.0)
        return value.shape, alike.tobytes()
    return value


def one_thread(function: Callable[Arguments, Returned]) -> Callable[Arguments, Returned]:
    """Wrap a function so that its linear algebra uses one thread, faster for small matrices."""
    limited = threadpool_limits.wrap(limits=1, user_api="blas")
    return cast("Callable[Arguments, Returned]", limited(function))  # which has no types
