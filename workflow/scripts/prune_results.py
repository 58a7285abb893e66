"""Lists results that the settings no longer ask for, and removes them. Other files are left alone.

Usage: prune_results.py [--delete] [--configfile FILE ...]
"""

import argparse
import sys

from galloping.reproducibility.inspection import make_command
from galloping.reproducibility.lock import Obstacle, locked
from galloping.reproducibility.plan import planning
from galloping.reproducibility.repair import audit, remove


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--delete", action="store_true")
    parser.add_argument("--configfile", nargs="+", default=[])
    options = parser.parse_args()
    plan = planning(options.configfile)
    try:
        with locked(plan.results, make_command(options.configfile, "repair")):
            left_over = audit(plan).left_over
            for receipt in left_over:
                print(*(remove(receipt) if options.delete else [receipt.path]))
    except Obstacle as error:
        sys.exit(str(error))
    if not left_over:
        print(f"{plan.results}: nothing is left over; the settings ask for every result")
        return
    size = sum(receipt.size for receipt in left_over) / 1e6
    done = "removed" if options.delete else "to be removed by DELETE=yes"
    print(f"{plan.results}: {len(left_over)} left over files, {size:.1f} MB, {done}")


if __name__ == "__main__":
    main()
