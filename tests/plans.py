"""Plans of studies in many folders, for half of what as many starts of Snakemake cost.

Reads lines from standard input: a folder and, after tabs, configuration files. In each folder, a
fork that has Snakemake already imported plans the study with that folder's code, and NEWER before
all else on the path; the plan is left in PLAN, the exit status is the answer on standard output.
"""

import gc
import json
import os
import sys
from dataclasses import asdict
from pathlib import Path

import pandas  # noqa: F401
import pydantic  # noqa: F401
import snakemake.api  # noqa: F401

NEWER = "newer"  # a folder of pretended installations
PLAN = "plan.json"


def plan(folder: Path, *configfiles: str) -> None:
    os.chdir(folder)
    output = os.open(f"{PLAN}.log", os.O_WRONLY | os.O_CREAT)
    os.dup2(output, sys.stdout.fileno())
    os.dup2(output, sys.stderr.fileno())
    sys.path[:1] = [str(folder / NEWER), str(folder / "workflow" / "src")]
    from galloping.reproducibility.plan import planning

    jobs = [asdict(job) for job in planning(configfiles).jobs]
    Path(PLAN).write_text(json.dumps(jobs), encoding="utf-8")
    os._exit(0)


if __name__ == "__main__":
    gc.freeze()  # else the collector of every fork goes through, and copies, all of Snakemake
    for line in sys.stdin:
        child = os.fork()
        if not child:
            folder, *configfiles = line.rstrip("\n").split("\t")
            plan(Path(folder), *configfiles)
        _, status = os.waitpid(child, 0)
        print(os.waitstatus_to_exitcode(status), flush=True)
