"""Writes the publication of a finished study: a folder, and an archive of it.

Usage: publish.py [--configfile FILE ...] [--allow dirty,incomplete,outdated]
"""

import argparse
import sys

from galloping.publication.publishing import ALLOWABLE, NotPublishable, publish
from galloping.reproducibility.inspection import make_command
from galloping.reproducibility.lock import Obstacle, locked
from galloping.reproducibility.plan import planning
from galloping.reproducibility.receipts import digest


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--configfile", nargs="+", default=[])
    parser.add_argument("--allow", default="")
    options = parser.parse_args()
    allowed = options.allow.split(",") if options.allow else []
    if unknown := [kind for kind in allowed if kind not in ALLOWABLE]:
        sys.exit(f"ALLOW: {unknown[0]!r} is not allowed; must be of {', '.join(ALLOWABLE)}")
    plan = planning(options.configfile)
    try:
        with locked(plan.results, make_command(options.configfile, "repair")):
            archive = publish(plan, allowed)
    except Obstacle as error:
        sys.exit(str(error))
    except NotPublishable as error:
        sys.exit(
            f"{error}\nNot published. `make` completes a study, `make repair` mends it; "
            f"ALLOW=dirty,incomplete,outdated publishes all the same and records it."
        )
    print(f"{archive}: {archive.stat().st_size / 1e6:.1f} MB, SHA-256 {digest(archive)}")
    print("Publish this SHA-256 elsewhere than the archive: by it alone others know its numbers.")


if __name__ == "__main__":
    main()
