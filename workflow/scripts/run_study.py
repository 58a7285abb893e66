"""The study; one line says why when it cannot run or stops.

Usage: run_study.py [options for snakemake]
"""

import argparse
import signal
import subprocess
import sys
from pathlib import Path

from galloping.reproducibility.inspection import locked, repair_command
from galloping.reproducibility.processes import orphans, running


def main(*options: str) -> int:
    parser = argparse.ArgumentParser(add_help=False, allow_abbrev=False)
    parser.add_argument("--configfile", nargs="+", default=[])
    repair = repair_command(parser.parse_known_args(options)[0].configfile)
    if line := obstacle(repair):
        sys.exit(line)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for Snakemake; this waits for it
    study = subprocess.Popen(
        [sys.executable, "-m", "snakemake", *options],
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    status = study.wait()
    if status < 0:
        print(f"Snakemake was killed: `{repair}` takes it from there.", file=sys.stderr)
    elif status and (line := obstacle(repair)):  # another run started at the same time
        print(line, file=sys.stderr)
    return status


def obstacle(repair: str) -> str | None:
    """Why no run can start in this folder, and what to do about it."""
    folder = Path.cwd()
    if locked() and (live := running(folder)):
        return f"Process {live[0].pid} is running a study in this folder: wait for it, or stop it."
    if locked() or orphans(folder):
        return f"A run in this folder was killed: `{repair}` takes it from there."
    return None


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
