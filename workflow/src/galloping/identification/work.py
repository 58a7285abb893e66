"""Limits of the work of a search for a model.

Work is counted, not timed, so that the same recording is answered alike on every machine.

Work is counted in seconds of a core that others use as well, by the sizes of what is computed:
each part says where it counts how long it takes there.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass

from galloping.identification.identified_model import IdentifiedModel
from galloping.identification.observations import Code, Finding
from galloping.recording.samples import Recording

# s, of a search in recordings sampled at up to TIMES times, and in proportion of longer ones.
# With 24 what no model follows is refused sooner, and some lines of wild motion lose their exact
# model (docs/identification_parts.csv).
MOST = 36.0
TIMES = 30_001
AFTER = 12.0  # s, that forecasts, limit cycles and figures take, which are not counted


@dataclass
class Work:
    """Work of a search, counted.

    most: s, that a search may compute. spent: s, that it has computed. ended: whether anything was
    left undone for lack of work. around: the work that this is a part of.
    """

    most: float
    spent: float = 0.0
    ended: bool = False
    around: Work | None = None

    @property
    def remaining(self) -> float:
        """s, that may still be computed; negative where too much was."""
        return self.most - self.spent

    def downgrade_if_ended(self, found: IdentifiedModel) -> IdentifiedModel:
        """Add a finding to the model of a search that ended early, which then is not `ok`."""
        if not self.ended or found.has_finding(Code.LIMIT_OF_WORK):
            return found
        return found.with_findings(Finding.of(Code.LIMIT_OF_WORK))


_UNLIMITED = Work(float("inf"))
_work: ContextVar[Work] = ContextVar("work", default=_UNLIMITED)


def work_limit(rows: int, most: float = MOST) -> float:
    """s, the work of a search in recordings of so many times of sampling."""
    return most * max(1.0, rows / TIMES)


@contextmanager
def limit_work(recordings: Sequence[Recording], most: float = MOST) -> Iterator[Work]:
    """Give the block the work of a search in these recordings, or what is left of that around it.

    most: s, for recordings sampled at up to TIMES times in all.
    """
    rows = sum(len(recording.time) for recording in recordings)
    with _nested_work(min(work_limit(rows, most), _work.get().remaining)) as work:
        yield work


@contextmanager
def sub_budget(share: float) -> Iterator[Work]:
    """Give the block a share of the work that is left.

    What the block leaves undone for lack of work counts as left undone by the search around it.
    """
    around = _work.get()
    with _nested_work(share * around.remaining) as work:
        try:
            yield work
        finally:
            around.ended |= work.ended


@contextmanager
def _nested_work(most: float) -> Iterator[Work]:
    around = _work.get()
    work = Work(most, around=around)
    token = _work.set(work)
    try:
        yield work
    finally:
        _work.reset(token)
        around.spent += work.spent


def count_work(seconds: float) -> None:
    """Count work that is done."""
    _work.get().spent += seconds


def work_counted() -> tuple[float, float]:
    """Return the work counted so far, s, and what is left at most until all is written, s.

    Infinite without a limit.
    """
    work: Work | None = _work.get()
    most, spent = _UNLIMITED.most, 0.0
    while work and work is not _UNLIMITED:
        most, spent, work = work.most, spent + work.spent, work.around
    return spent, max(most - spent, 0.0) + AFTER


def is_exhausted() -> bool:
    """Whether no work is left; what is not begun for that makes the search one that ended early."""
    work = _work.get()
    work.ended |= work.remaining <= 0.0
    return work.remaining <= 0.0
