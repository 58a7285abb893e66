"""Plans of studies in many folders, each with the code of its own; imports nothing slow."""

import gc
import os
import sys
from dataclasses import asdict
from pathlib import Path

NEWER = "newer"  # a folder of pretended installations


def plan(folder: Path, *configfiles: str) -> list[dict]:
    """The jobs of the study of a folder, whose NEWER stands before all else on the path."""
    gc.freeze()  # else the collector goes through, and copies, all of Snakemake
    os.chdir(folder)
    sys.path[:0] = [str(folder / NEWER), str(folder / "workflow" / "src")]
    from galloping.reproducibility.plan import make_plan

    try:
        return [asdict(job) for job in make_plan(configfiles).jobs]
    except SystemExit as end:  # would end the process, and the test would wait for ever
        raise RuntimeError(end.code) from end
