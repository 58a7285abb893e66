"""Puts the results of a publication archive in place, without computing them again.

Usage: restore.py ARCHIVE [--replace] [--configfile FILE ...]
"""

import argparse
import sys
from pathlib import Path

from galloping.publication.archive import UnsafeArchive
from galloping.publication.restoration import NotRestorable, restore
from galloping.publication.unpacked import NotAPublication
from galloping.reproducibility.inspection import locked
from galloping.reproducibility.plan import planning


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("archive", type=Path)
    parser.add_argument("--replace", action="store_true")
    parser.add_argument("--configfile", nargs="+", default=[])
    options = parser.parse_args()
    if locked():
        sys.exit("A run is working in this folder, or was killed in it: see `make repair`.")
    try:
        with planning(options.configfile) as plan:
            for line in restore(options.archive, plan, replacing=options.replace):
                print(line)
    except (UnsafeArchive, NotAPublication, NotRestorable) as error:
        sys.exit(f"{error}\nNothing was restored.")
    except OSError as error:
        sys.exit(f"{error}: when this is mended, restore again")


if __name__ == "__main__":
    main()
