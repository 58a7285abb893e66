"""Compares every file of a study with its receipt, and every receipt with the settings.

Usage: verify_results.py [--configfile FILE ...]
Ends with exit code 1 if anything is not as it should be.
"""

import argparse
import sys

from galloping.reproducibility.inspection import make_command
from galloping.reproducibility.plan import planning
from galloping.reproducibility.repair import audit

FAULTS = {
    "damaged": "not what its job wrote: `{repair}` makes it again",
    "missing": "not here: `{run}` makes it",
    "outdated": "made with other settings, code or inputs: `{run}` makes it again",
    "unknown": "has no receipt that can be read: `{repair}` makes it again",
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--configfile", nargs="+", default=[])
    files = parser.parse_args().configfile
    run, repair = make_command(files), make_command(files, "repair")
    plan = planning(files)
    checked, faults = audit(plan), 0
    for state, meaning in FAULTS.items():
        for path in getattr(checked, state):
            print(f"{path}: {meaning.format(run=run, repair=repair)}")
            faults += 1
    print(f"{plan.results}: {len(checked.sound)} files verified, {faults} at fault")
    if checked.elsewhere:
        print(f"{len(checked.elsewhere)} files are not here: the archive restored from has none")
    if checked.left_over:
        print(f"{len(checked.left_over)} files are no longer asked for: see `make prune`")
    sys.exit(faults > 0)


if __name__ == "__main__":
    main()
