"""Runs a script's work: output in the rule's log, one line for a failure, receipts for success."""

from __future__ import annotations

import errno
import sys
import time
import traceback
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from datetime import UTC, datetime
from pathlib import Path

from galloping.reproducibility.receipts import (
    Receipt,
    as_written,
    digest,
    digests,
    read_receipt,
    write_receipt,
)


def run(work: Callable[[], None], job) -> None:
    """Call `work`; what it prints and warns goes to the job's log, whole tracebacks too.

    job: the `snakemake` object of the script. Its inputs must be what their jobs wrote; its outputs
    get receipts. An error ends the process with exit code 1 and one line on the terminal.
    """
    log = Path(job.log[0])
    try:
        log.parent.mkdir(parents=True, exist_ok=True)
        with log.open("w", encoding="utf-8") as file:
            try:
                with redirect_stdout(file), redirect_stderr(file):
                    _run(work, job)
            except Exception as error:
                traceback.print_exc(file=file)
                print(_line(error), file=file)
                raise
    except Exception as error:
        sys.exit(f"{_line(error)} (details: {log})")


def _run(work: Callable[[], None], job) -> None:
    inputs = digests(job.input)
    for path, found in inputs.items():
        receipt = read_receipt(path)
        if receipt and receipt.sha256 != found:
            raise ValueError(f"{path} is not what its job wrote: repair the study")
    start = time.perf_counter()
    work()
    seconds = time.perf_counter() - start
    finished = datetime.now(UTC).isoformat(timespec="seconds")
    for path in job.output:
        receipt = Receipt(
            path=str(path),
            rule=job.rule,
            wildcards=dict(job.wildcards.items()),
            log=str(job.log[0]),
            settings=as_written(job.params.settings),
            inputs=inputs,
            sha256=digest(path),
            size=Path(path).stat().st_size,
            seconds=round(seconds, 3),
            finished=finished,
        )
        write_receipt(receipt)


def _line(error: Exception) -> str:
    if isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT):
        return f"The disk is full: {error.filename or error}; free some space and run again"
    return f"{type(error).__name__}: {error}"
