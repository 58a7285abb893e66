"""Frozen dataclasses that hold arrays: never changed, compared and hashed by what they hold."""

from collections.abc import Callable
from dataclasses import fields
from types import MappingProxyType

import numpy as np


class Immutable:
    """Base of dataclasses of `frozen=True, eq=False`, whose arrays and dicts become read-only.

    Two are equal where all they hold is, NaN equal to NaN; equal ones have the same hash. Copies
    and pickles are read-only too. An array that can still be written elsewhere is copied.
    """

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
        return _made, (type(self), held)

    def _held(self) -> dict[str, object]:
        return {field.name: getattr(self, field.name) for field in fields(self)}

    def _key(self) -> tuple:
        return tuple(map(_comparable, self._held().values()))


def _made(of: type, held: dict[str, object]) -> object:
    return of(**held)


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


def _comparable(value: object) -> object:
    """Equal and hashed alike where the values are: of NaN there is one, of zero one sign."""
    if isinstance(value, MappingProxyType):
        return frozenset((name, _comparable(each)) for name, each in value.items())
    if isinstance(value, tuple):
        return tuple(map(_comparable, value))
    if isinstance(value, float) and np.isnan(value):
        return "nan"
    if isinstance(value, np.ndarray):
        alike = np.where(np.isnan(value), np.nan, value + 0.0)
        return value.shape, alike.tobytes()
    return value
