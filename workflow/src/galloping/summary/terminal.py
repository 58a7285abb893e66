"""Output of the command: rows and JSON, and progress on standard error."""

import csv
import json
import math
import sys
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager
from time import monotonic
from typing import Any

import click

from galloping.progress_reports import progress

FIRST_LINE_DELAY, LINE_INTERVAL = 2.0, 10.0  # s: time to the first line, and between two lines
BAR_STEPS = 1000  # steps of the progress bar
MIN_COUNTED_TIME = 0.5  # s of counted work between two lines that determines a core's speed
MAX_TIME_RATIO = 20.0  # measured over counted time; above, the time is that of compilation
NEARLY_DONE = 0.95  # share of the work above which the rest cannot be estimated
SEARCH_SHARE = 0.45  # share of a first search of unknown duration in all work


@contextmanager
def show_progress() -> Iterator[None]:
    """Show on standard error the progress of the computations in a `with` block."""
    with ExitStack() as stack:
        stack.enter_context(progress(_Bar(stack) if sys.stderr.isatty() else _Lines()))
        yield


class _Bar:
    """Progress bar that appears with the first pass, and names the running part."""

    def __init__(self, stack: ExitStack) -> None:
        self._stack = stack
        self._bar: Any = None  # of click, once there is a pass

    def __call__(self, what: str, share: float) -> None:
        if self._bar is None:
            bar = click.progressbar(
                length=BAR_STEPS, file=sys.stderr, width=0, item_show_func=lambda what: what
            )
            self._bar = self._stack.enter_context(bar)
        self._bar.update(int(share * BAR_STEPS) - self._bar.pos, what)
        self._bar.render_progress()


class _Lines:
    """Progress lines, one every ten seconds, of computations longer than two.

    The most that may remain is estimated by the speed of the core since the last line.
    """

    def __init__(self) -> None:
        self._begin = self._next = -math.inf  # s, on the clock
        self._last, self._slow = (0.0, 0.0), math.inf  # s, passed and counted; s for one counted

    def __call__(self, what: str, share: float) -> None:
        now = monotonic()
        if math.isinf(self._begin):
            self._begin, self._next = now, now + FIRST_LINE_DELAY
        if now < self._next:
            return
        self._next = now + LINE_INTERVAL
        elapsed = now - self._begin
        from galloping.identification.work import work_counted  # NumPy

        spent, more = work_counted()
        took, computed = elapsed - self._last[0], spent - self._last[1]
        self._last = elapsed, spent
        if computed >= MIN_COUNTED_TIME and took <= MAX_TIME_RATIO * computed:
            self._slow = took / computed
        seconds, most = elapsed * (1.0 - share) / share, self._slow * more
        remaining = f"{seconds:.0f} s left"
        if not math.isinf(most):
            seconds = min(seconds, most)
            if share <= SEARCH_SHARE:
                seconds = math.sqrt(seconds * most)
            remaining = f"{seconds:.0f} s left, {most:.0f} s at most"
        is_nearly_done = share > NEARLY_DONE
        done = "nearly done" if is_nearly_done else f"about {share:.0%} done, {remaining}"
        click.echo(f"{elapsed:.0f} s: {what}; {done}", err=True)


def json_text(content: object, **options: Any) -> str:
    """Format a value as JSON text, with null for NaN and infinity."""

    def plain(value: object) -> object:
        if isinstance(value, dict):
            return {key: plain(inner) for key, inner in value.items()}
        if isinstance(value, list | tuple):
            return [plain(inner) for inner in value]
        return None if isinstance(value, float) and not math.isfinite(value) else value

    return json.dumps(plain(content), allow_nan=False, **options)


def print_rows(rows: Iterable[dict], as_json: bool) -> None:
    """Print rows one by one as CSV or as a JSON list, which is closed even after an error."""
    from galloping.storage import as_cell

    table = csv.writer(sys.stdout, lineterminator="\n")
    separator = "["
    try:
        for row in rows:
            if as_json:
                click.echo(separator + json_text(row), nl=False)
            else:
                if separator == "[":
                    table.writerow(row)
                table.writerow(map(as_cell, row.values()))
            separator = ",\n"
    finally:
        if as_json:
            click.echo("]" if separator != "[" else "[]")
