"""Lists and removes results that the settings no longer ask for. Other files are left alone.

Usage: prune_results.py [--configfile FILE ...]
"""

import argparse

from galloping.reproducibility.audit import audit, remove
from galloping.reproducibility.plan import planning


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--configfile", nargs="+", default=[])
    with planning(parser.parse_args().configfile) as plan:
        left_over = audit(plan).left_over
        results = plan.settings["results"]
    for receipt in left_over:
        print("removed", *remove(receipt))
    size = sum(receipt.size for receipt in left_over)
    print(f"{results}: {len(left_over)} left over files removed, {size / 1e6:.1f} MB")


if __name__ == "__main__":
    main()
