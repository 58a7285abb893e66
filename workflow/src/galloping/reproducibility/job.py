"""Runs a script's work with its output in the rule's log and one line for a failure."""

from __future__ import annotations

import sys
import traceback
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path


def run(work: Callable[[], None], log: str) -> None:
    """Call `work`; what it prints and warns goes to the file `log`, whole tracebacks too.

    An error ends the process with exit code 1 and one line on the terminal.
    """
    Path(log).parent.mkdir(parents=True, exist_ok=True)
    with Path(log).open("w", encoding="utf-8") as file:
        try:
            with redirect_stdout(file), redirect_stderr(file):
                work()
        except Exception as error:
            traceback.print_exc(file=file)
            sys.exit(f"{type(error).__name__}: {error} (details: {log})")
