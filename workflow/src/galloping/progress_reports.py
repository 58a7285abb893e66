"""Progress reports of long computations; silent without a listener."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass

PASS_SHARE = 0.04  # share of the rest of a part that a pass does: the number of passes is unknown


@dataclass
class _State:
    """State of a progress report.

    listen: function that receives it. part: name of the running part, from `begin` to `end` of the
    whole, of which the share `done` is done.
    """

    listen: Callable[[str, float], object]
    part: str = ""
    begin: float = 0.0
    end: float = 1.0
    done: float = 0.0


_state: ContextVar[_State | None] = ContextVar("progress", default=None)


@contextmanager
def progress(listen: Callable[[str, float], object]) -> Iterator[None]:
    """Report the progress of computations inside a `with` block to a function.

    Parameters
    ----------
    listen : callable
        Called with the name of the present step and with the share of all work that is done, from 0
        to 1. The share never falls. It is an estimate, because iterations end when they have
        converged.

    Examples
    --------
    >>> with progress(lambda what, share: print(f"{what}, {share:.0%}")):
    ...     with part("identify", until=0.5):
    ...         passing("join segments")
    identify: join segments, 2%
    """
    token = _state.set(_State(listen))
    try:
        yield
    finally:
        _state.reset(token)


@contextmanager
def part(name: str, until: float) -> Iterator[None]:
    """Name a step of a computation for progress reports, as a context manager.

    until: share of the enclosing step, from 0 to 1, at which this one ends.
    """
    if (state := _state.get()) is None:
        yield
        return
    outer = state.part, state.begin, state.end
    end = state.begin + until * (state.end - state.begin)
    state.part, state.begin, state.end = name, state.done, end
    try:
        yield
    finally:
        state.part, state.begin, state.end = outer
        state.done = end


def passing(what: str) -> None:
    """Report to the listener of `progress` that an iteration of the step `what` begins."""
    if (state := _state.get()) is not None:
        state.done += PASS_SHARE * (state.end - state.done)
        state.listen(f"{state.part}: {what}" if state.part else what, state.done)
