"""Runner of a script: output in the rule's log, one line for a failure, receipts for success.

Nothing here changes a number, so that the digest of code ignores this module.
"""

import errno
import sys
import time
import traceback
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from datetime import UTC, datetime
from inspect import signature
from pathlib import Path

from galloping.memory import keep_freed_memory
from galloping.reproducibility.receipts import (
    CAPTION,
    RECEIPT_SUFFIX,
    RECEIPTS,
    Receipt,
    as_written,
    digest,
    read_receipt,
    write_receipt,
)

# prefixes of the last line of a log; the log of a killed job has neither
FINISHED, FAILED = "Finished: ", "Failed: "
CODE = "code"  # param with the digest of a job's code, see `digest`
RESULTS = "results"  # folder of results, and the configuration key that names another folder


def run(function: Callable[..., None], job) -> None:
    """Call a script's function with the inputs, outputs and parameters of its Snakemake rule.

    The output of the function goes to the job's log. function: its arguments are the files of the
    rule's inputs and outputs, the values of its params and, if it has them, its wildcards, each by
    its name in the rule. A param is one value under its configuration key; `code` and `caption` are
    not passed. job: the `snakemake` object of the script. Its inputs must be unchanged since their
    jobs; its outputs get receipts. An error ends the process with exit code 1 and one line on the
    terminal; its traceback is in the log.
    """
    log = Path(job.log[0])
    keep_freed_memory()
    try:
        log.parent.mkdir(parents=True, exist_ok=True)
        with log.open("w", encoding="utf-8") as file:
            try:
                with redirect_stdout(file), redirect_stderr(file):
                    seconds = _run_function(function, job)
                print(f"{FINISHED}{seconds:.3f} s of work", file=file)
            except Exception as error:
                traceback.print_exc(file=file)
                print(f"{FAILED}{_error_line(error)}", file=file)
                raise
    except KeyboardInterrupt:  # Ctrl-C: the main process prints a message
        sys.exit(130)
    except Exception as error:
        sys.exit(f"{_error_line(error)} (details: {log})")


def failures(results: str, since: int) -> list[str]:
    """List the error messages of the jobs that failed during a run, each with its log file.

    since: when the run began, in nanoseconds of its file system's clock.
    """
    lines = []
    for log in sorted(Path(results, "logs").rglob("*.log")):
        if log.stat().st_mtime_ns >= since:
            last = log.read_text(encoding="utf-8", errors="replace").rstrip().rpartition("\n")[2]
            if last.startswith(FAILED):
                lines.append(f"{last.removeprefix(FAILED)} ({log})")
            elif not last.startswith(FINISHED):
                lines.append(f"a job was killed ({log})")
    return lines


def arguments(function: Callable[..., None], job) -> dict:
    """Collect the arguments with which `run` calls a script's function, from its job."""
    names = signature(function).parameters
    params = {name: each for name, each in job.params.items() if name not in (CODE, CAPTION)}
    values = {name: next(iter(each.values())) for name, each in params.items()}
    wildcards = {name: value for name, value in job.wildcards.items() if name in names}
    outputs = {name: files for name, files in job.output.items() if name != RECEIPTS}
    return {**wildcards, **dict(job.input.items()), **outputs, **values}


def _run_function(function: Callable[..., None], job) -> float:
    """Check the inputs, call the function, write receipts; return the seconds of work."""
    inputs = {str(path): digest(path) for path in job.input}
    for path, present in inputs.items():
        receipt = read_receipt(path)
        if receipt and receipt.sha256 != present:
            raise ValueError(f"{path} is not what its job wrote: repair the study")
    start = time.perf_counter()
    function(**arguments(function, job))
    seconds = round(time.perf_counter() - start, 3)
    finished = datetime.now(UTC).isoformat(timespec="seconds")
    # of the job's paths: not empty if they are local copies of results in a Snakemake storage
    prefix = str(job.log[0]).rpartition(f"{job.config.get(RESULTS, RESULTS)}/logs/")[0]
    for path in (str(path) for path in job.output if not path.endswith(RECEIPT_SUFFIX)):
        receipt = Receipt(
            path=path.removeprefix(prefix),
            rule=job.rule,
            wildcards=dict(job.wildcards.items()),
            log=str(job.log[0]).removeprefix(prefix),
            settings=as_written(dict(job.params.items())),
            inputs={name.removeprefix(prefix): present for name, present in inputs.items()},
            sha256=digest(path),
            size=Path(path).stat().st_size,
            seconds=seconds,
            finished=finished,
        )
        write_receipt(receipt, prefix)
    return seconds


def _error_line(error: Exception) -> str:
    if isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT):
        return f"The disk is full: {error.filename or error}; free some space and run again"
    return f"{type(error).__name__}: {error}"
