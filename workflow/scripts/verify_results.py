"""Compares every file of a study with its receipt, and every receipt with the settings.

Usage: verify_results.py [--configfile FILE ...]
Ends with exit code 1 if anything is not as it should be.
"""

import argparse
import sys

from galloping.reproducibility.audit import audit
from galloping.reproducibility.plan import planning

FAULTS = {
    "damaged": "not what its job wrote (`make repair` makes it again)",
    "lost": "was made and is gone (`make` makes it again)",
    "outdated": "made with other settings or code (`make` makes it again)",
    "inconsistent": "made from another version of an input (`make repair` makes it again)",
    "unknown": "has no receipt (remove it, then `make`)",
    "absent": "not made yet (`make` makes it)",
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--configfile", nargs="+", default=[])
    with planning(parser.parse_args().configfile) as plan:
        found = audit(plan)
        results = plan.settings["results"]
    for state, meaning in FAULTS.items():
        for path in getattr(found, state):
            print(f"{path}: {meaning}")
    faults = sum(len(getattr(found, state)) for state in FAULTS)
    print(f"{results}: {len(found.sound)} files verified, {faults} at fault")
    if found.elsewhere:
        print(f"{len(found.elsewhere)} files are not here: the archive restored from has none")
    if found.left_over:
        print(f"{len(found.left_over)} files are no longer asked for (`make prune` removes them)")
    sys.exit(faults > 0)


if __name__ == "__main__":
    main()
