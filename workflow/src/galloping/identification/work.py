"""How much a search for a model may compute: counted, not timed, so that the same recording is
answered alike on every machine.

Counted are derivatives of what a solution says of the samples, and what takes as long: 1e8 take two
to five seconds of a core.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, replace

from galloping.identification.model import IdentifiedModel
from galloping.recording import Recording

MOST = 2e9  # of a search in recordings of up to ROWS samples, and in proportion of longer ones
ROWS = 30_001
SEGMENT = 1.2e4  # matching a segment takes as long
ENDED = "the search for a model ended at its limit of work"


@dataclass
class Work:
    """left: what a search may still do. ended: whether something was left undone for it."""

    left: float
    ended: bool = False

    def told(self, found: IdentifiedModel) -> IdentifiedModel:
        """The best model of a search; where that ended early it says so, and is not `ok`."""
        if not self.ended:
            return found
        doubted = "approximate" if found.is_forced else "not identifiable"
        status = doubted if found.status == "ok" else found.status
        clauses = [part for part in found.reason.split("; ") if part and part != ENDED]
        return replace(found, status=status, reason="; ".join([*clauses, ENDED]))


_UNLIMITED = Work(float("inf"))
_work: ContextVar[Work] = ContextVar("work")


def allowed(rows: int, most: float = MOST) -> float:
    """The work of a search in so many samples."""
    return most * max(1.0, rows / ROWS)


@contextmanager
def limited(recordings: Sequence[Recording], most: float = MOST) -> Iterator[Work]:
    """The block has the work of a search in these recordings, or what is left of that around it.

    most: of recordings of up to ROWS samples in all.
    """
    around = _work.get(_UNLIMITED)
    rows = sum(len(recording.time) for recording in recordings)
    given = min(allowed(rows, most), around.left)
    work = Work(given)
    token = _work.set(work)
    try:
        yield work
    finally:
        _work.reset(token)
        around.left -= given - work.left


def spend(amount: float) -> None:
    """Count work that is done."""
    _work.get(_UNLIMITED).left -= amount


def is_spent() -> bool:
    """Whether no work is left; what is not begun for that makes the search one that ended early."""
    work = _work.get(_UNLIMITED)
    work.ended |= work.left <= 0.0
    return work.left <= 0.0
