"""Puts the results of a publication archive in place, without computing them again.

Usage: restore.py ARCHIVE [--replace] [--sha256 DIGEST] [--configfile FILE ...]
"""

import argparse
import sys
from pathlib import Path

from galloping.publication.archive import UnsafeArchive
from galloping.publication.restoration import NotRestorable, check_digest, restore
from galloping.reproducibility.inspection import inspect, make_command, remember
from galloping.reproducibility.lock import Obstacle, locked
from galloping.reproducibility.plan import planning
from galloping.reproducibility.receipts import receipts


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("archive", type=Path)
    parser.add_argument("--replace", action="store_true")
    parser.add_argument("--sha256", default="")
    parser.add_argument("--configfile", nargs="+", default=[])
    options = parser.parse_args()
    plan = planning(options.configfile)
    try:
        with locked(plan.results, make_command(options.configfile, "repair")):
            check_digest(options.archive, options.sha256)
            for line in restore(options.archive, plan, replacing=options.replace):
                print(line)
            remember(plan.results, inspect(plan.results, receipts(plan.results)))
    except Obstacle as error:
        sys.exit(str(error))
    except (UnsafeArchive, NotRestorable) as error:
        sys.exit(f"{error}\nNothing was restored.")
    except OSError as error:
        sys.exit(f"{error}: when this is mended, restore again")


if __name__ == "__main__":
    main()
