"""Makes a study fit to go on after a kill, a crash, an edit by hand or a lost .snakemake.

Usage: repair.py [--configfile FILE ...]
"""

import argparse
import sys
from pathlib import Path

from galloping.reproducibility.cluster import ClusterError
from galloping.reproducibility.inspection import unrecorded
from galloping.reproducibility.plan import planning
from galloping.reproducibility.receipts import receipts
from galloping.reproducibility.recovery import (
    StillRunning,
    adopt,
    release,
    set_aside_damaged,
    set_aside_unknown,
    sweep,
)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--configfile", nargs="+", default=[])
    try:
        for line in release(Path.cwd()):
            print(line)
        with planning(parser.parse_args().configfile) as plan:
            results = plan.settings["results"]
            for step in (sweep(results), set_aside_damaged(results), set_aside_unknown(plan)):
                for line in step:
                    print(line)
            if unrecorded(receipts(results)):
                for line in adopt(plan):
                    print(line)
    except (ClusterError, StillRunning) as error:
        sys.exit(str(error))


if __name__ == "__main__":
    main()
