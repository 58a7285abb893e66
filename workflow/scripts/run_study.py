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
from pathlib import Path

from galloping.configuration.load import ConfigurationError, results_folder
from galloping.reproducibility.inspection import make_command
from galloping.reproducibility.obstacles import other_run, unwritable
from galloping.reproducibility.runs import note_run


def main(*options: str) -> int:
    parser = argparse.ArgumentParser(add_help=False, allow_abbrev=False)
    parser.add_argument("--configfile", nargs="+", default=[])
    parser.add_argument("--cores")
    known, _ = parser.parse_known_args(options)
    folder, repair = Path.cwd(), make_command(known.configfile, "repair")
    if line := other_run(folder, repair) or unwritable([folder]):
        sys.exit(line)
    began, start = datetime.now(UTC), time.perf_counter()
    status = snakemake(*options)
    seconds = time.perf_counter() - start
    try:
        results = results_folder(["config/config.yaml", *known.configfile])
    except ConfigurationError:
        return status  # which Snakemake has told
    if status < 0:
        print(f"Snakemake was killed: `{repair}` takes it from there.", file=sys.stderr)
    elif status and (line := other_run(folder, repair) or unwritable([folder, Path(results)])):
        print(line, file=sys.stderr)  # another run may have started at the same time
    if known.cores:  # else it is a cluster's run
        outcome = "stopped" if status else "finished"
        with suppress(OSError):  # a full or read-only disk has been told
            note_run(results, began, seconds, cores(known.cores), outcome)
    return status


def snakemake(*options: str) -> int:
    """Run Snakemake; its exit code, negative if a signal killed it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for Snakemake; this waits for it
    study = subprocess.Popen(
        [sys.executable, "-m", "snakemake", *options],
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    return study.wait()


def cores(text: str) -> int:
    """The number of cores that Snakemake takes."""
    return os.cpu_count() if text == "all" else int(text)


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
