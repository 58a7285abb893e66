"""The study; one line says why when it cannot run or stops.

Usage: run_study.py [options for snakemake]
"""

import argparse
import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from datetime import UTC, datetime

from galloping.configuration.load import ConfigurationError, results_folder
from galloping.reproducibility.inspection import make_command
from galloping.reproducibility.obstacles import obstacle
from galloping.reproducibility.runs import note_run


def main(*options: str) -> int:
    parser = argparse.ArgumentParser(add_help=False, allow_abbrev=False)
    parser.add_argument("--configfile", nargs="+", default=[])
    parser.add_argument("--cores", nargs="?", const="")
    known, _ = parser.parse_known_args(options)
    if known.cores not in (None, "all") and not (known.cores.isdecimal() and int(known.cores)):
        sys.exit(
            f"CORES: {known.cores!r} is no number of cores; must be a whole number >= 1 or all"
        )
    repair = make_command(known.configfile, "repair")
    try:
        results = results_folder(["config/config.yaml", *known.configfile])
    except ConfigurationError as error:
        sys.exit(str(error))
    if line := obstacle(results, repair):
        sys.exit(line)
    began, start = datetime.now(UTC), time.perf_counter()
    status, interrupted = snakemake(*options)
    seconds = time.perf_counter() - start
    if line := last_word(status, interrupted, results, repair):
        print(line, file=sys.stderr)
    if known.cores:  # else it is a cluster's run
        outcome = "stopped" if status else "finished"
        with suppress(OSError):  # a full disk has been told
            note_run(results, began, seconds, cores(known.cores), outcome)
    return status


def snakemake(*options: str) -> tuple[int, bool]:
    """Run Snakemake; its exit code, negative if a signal killed it, and whether Ctrl-C came."""
    interrupts = []
    # Ctrl-C goes to Snakemake and its jobs as well: wait until they have ended.
    signal.signal(signal.SIGINT, lambda *_: interrupts.append(True))
    study = subprocess.Popen([sys.executable, "-m", "snakemake", *options])
    return study.wait(), bool(interrupts)


def last_word(status: int, interrupted: bool, results: str, repair: str) -> str | None:
    """Why Snakemake ended, where it may not have said so in a line."""
    if not status:
        return None
    if interrupted:
        return "Interrupted. Finished jobs are kept; run it again to go on."
    killed = "Snakemake was killed: run it again." if status < 0 else None
    return obstacle(results, repair) or killed


def cores(text: str) -> int:
    """The number of cores that Snakemake takes."""
    return os.cpu_count() if text == "all" else int(text)


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
