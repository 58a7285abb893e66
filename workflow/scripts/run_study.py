"""The study and its report; one line says why when it cannot run or stops.

Usage: run_study.py [options for snakemake]
"""

import signal
import subprocess
import sys
from pathlib import Path

from galloping.reproducibility.inspection import locked
from galloping.reproducibility.processes import running


def main(*options: str) -> int:
    if locked():
        if live := running(Path.cwd()):
            sys.exit(
                f"Process {live[0].pid} is running a study in this folder: wait for it, or stop it."
            )
        sys.exit(
            "A run in this folder was killed and left its lock: `make repair` takes it from there."
        )
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for Snakemake; this waits for it
    study = subprocess.Popen(
        [sys.executable, "-m", "snakemake", *options],
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    status = study.wait()
    if status < 0:
        print("Snakemake was killed: `make repair` takes it from there.", file=sys.stderr)
    return status


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
