"""Snakemake's summaries of many folders, for half of what as many starts of Snakemake cost.

Reads folders from standard input. In each, a fork that has Snakemake already imported runs
`snakemake --summary` of the smoke study, with NEWER before all else on the path; what it prints is
left in SUMMARY, and the exit status is the answer on standard output.
"""

import gc
import os
import sys
from pathlib import Path

from snakemake.cli import main

NEWER = "newer"  # a folder of pretended installations
SUMMARY = "summary.txt"


def summarise(folder: Path) -> None:
    os.chdir(folder)
    output = os.open(SUMMARY, os.O_WRONLY | os.O_CREAT)
    os.dup2(output, sys.stdout.fileno())
    os.dup2(output, sys.stderr.fileno())
    os.environ["PYTHONPATH"] = str(folder / NEWER)
    sys.path[0] = os.environ["PYTHONPATH"]
    main(["--summary", "--cores", "1", "--configfile", "config/smoke.yaml"])


if __name__ == "__main__":
    gc.freeze()  # else the collector of every fork goes through, and copies, all of Snakemake
    for line in sys.stdin:
        child = os.fork()
        if not child:
            summarise(Path(line.rstrip("\n")))
        _, status = os.waitpid(child, 0)
        print(os.waitstatus_to_exitcode(status), flush=True)
