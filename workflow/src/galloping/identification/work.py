"""Limits of the work of a search for a model.

Work is counted, not timed, so that the same recording has the same result on every machine. The
unit is the second of a shared core, estimated from the sizes of computations: each part documents
its time where it counts.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass

from galloping.identification.findings import Code, Finding
from galloping.identification.identified_model import IdentifiedModel
from galloping.recording.samples import Recording

# Most work of a search in recordings sampled at up to REFERENCE_TIMES times, s. In longer ones it
# is larger in proportion. With 24 s, recordings that no model follows are refused sooner, and some
# lines in wild motion lose their exact model (docs/identification_parts.csv).
MAX_WORK = 36.0
REFERENCE_TIMES = 30_001  # largest number of sampled times with the limit MAX_WORK
OUTPUT_WORK = 12.0  # allowance for forecasts, limit cycles and figures, which are not counted, s


@dataclass
class Work:
    """Limit of the computing work of a search for a model, and the work done so far, in s.

    is_cut_short: whether anything was omitted for lack of work. outer: the work around this one.
    """

    most: float
    spent: float = 0.0
    is_cut_short: bool = False
    outer: Work | None = None

    @property
    def remaining(self) -> float:
        """Remaining work in seconds of computing; negative if the limit was exceeded."""
        return self.most - self.spent

    def downgrade_if_cut_short(self, identified: IdentifiedModel) -> IdentifiedModel:
        """Add a finding to a model if the work limit ended its search, so that it is not `ok`."""
        if not self.is_cut_short or identified.has_finding(Code.LIMIT_OF_WORK):
            return identified
        return identified.with_findings(Finding.of(Code.LIMIT_OF_WORK))


_UNLIMITED = Work(float("inf"))
_work: ContextVar[Work] = ContextVar("work", default=_UNLIMITED)


def work_limit(rows: int, most: float = MAX_WORK) -> float:
    """Compute the computing work allowed for a search, in s, from the number of sampling times."""
    return most * max(1.0, rows / REFERENCE_TIMES)


@contextmanager
def limit_work(recordings: Sequence[Recording], most: float = MAX_WORK) -> Iterator[Work]:
    """Limit the computing work in a `with` block, by the size of the recordings.

    The limit is that of a search in these recordings, or the remaining work if that is less. most:
    s, for recordings sampled at up to REFERENCE_TIMES times in all.
    """
    rows = sum(len(recording.time) for recording in recordings)
    with _nested_work(min(work_limit(rows, most), _work.get().remaining)) as work:
        yield work


@contextmanager
def sub_budget(share: float) -> Iterator[Work]:
    """Limit the computing work in a `with` block to a share of the remaining work.

    If the block omits anything for lack of work, so does the search around it.
    """
    outer = _work.get()
    with _nested_work(share * outer.remaining) as work:
        try:
            yield work
        finally:
            outer.is_cut_short |= work.is_cut_short


@contextmanager
def _nested_work(most: float) -> Iterator[Work]:
    outer = _work.get()
    work = Work(most, outer=outer)
    token = _work.set(work)
    try:
        yield work
    finally:
        _work.reset(token)
        outer.spent += work.spent


def count_work(seconds: float) -> None:
    """Add computing work that is done, in estimated seconds, to the work of the search."""
    _work.get().spent += seconds


def work_counted() -> tuple[float, float]:
    """Return the computing work done so far, and the most until all results are written, in s.

    The latter is infinite without a limit.
    """
    work: Work | None = _work.get()
    most, spent = _UNLIMITED.most, 0.0
    while work and work is not _UNLIMITED:
        most, spent, work = work.most, spent + work.spent, work.outer
    return spent, max(most - spent, 0.0) + OUTPUT_WORK


def is_exhausted() -> bool:
    """Decide whether the work limit is reached; if so, mark the search as ended early."""
    work = _work.get()
    exhausted = work.remaining <= 0.0
    work.is_cut_short |= exhausted
    return exhausted
