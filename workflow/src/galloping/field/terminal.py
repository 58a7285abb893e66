"""Progress on standard error: a bar on a terminal, elsewhere a line now and then."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from time import monotonic

import click

from galloping.passes import progress

FIRST, EVERY = 2.0, 10.0  # s, to the first line from the first pass, and from a line to the next
STEPS = 1000  # of the bar


@contextmanager
def shown() -> Iterator[None]:
    """Show how far the block is."""
    with ExitStack() as stack:
        stack.enter_context(progress(_Bar(stack) if sys.stderr.isatty() else _Lines()))
        yield


class _Bar:
    """A bar that appears with the first pass, and names what runs."""

    def __init__(self, stack: ExitStack) -> None:
        self._stack, self._bar = stack, None

    def __call__(self, what: str, share: float) -> None:
        if self._bar is None:
            bar = click.progressbar(
                length=STEPS, file=sys.stderr, width=0, item_show_func=lambda what: what
            )
            self._bar = self._stack.enter_context(bar)
        self._bar.update(int(share * STEPS) - self._bar.pos, what)
        self._bar.render_progress()


class _Lines:
    """A line every ten seconds of what takes longer than two."""

    def __init__(self) -> None:
        self._begin = self._next = None

    def __call__(self, what: str, share: float) -> None:
        now = monotonic()
        if self._begin is None:
            self._begin, self._next = now, now + FIRST
        if now < self._next:
            return
        self._next = now + EVERY
        passed = now - self._begin
        left = passed * (1.0 - share) / share
        click.echo(f"{passed:.0f} s: {what}; about {share:.0%} done, {left:.0f} s left", err=True)
