"""Whether a publication archive is safe, whole and well described, and agrees with this study.

Usage: verify_archive.py ARCHIVE [--configfile FILE ...]
Ends with exit code 1, and a line for each fault, if not.
"""

import argparse
import sys
import tempfile
from pathlib import Path

from galloping.publication.archive import UnsafeArchive, unpack
from galloping.publication.unpacked import settings
from galloping.publication.validation import PROFILE, conformance
from galloping.publication.verification import changed_settings, differences, faults, has_tables
from galloping.reproducibility.plan import planning
from galloping.reproducibility.receipts import digest


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("archive", type=Path)
    parser.add_argument("--configfile", nargs="+", default=[])
    options = parser.parse_args()
    try:
        with tempfile.TemporaryDirectory() as temporary:
            unpack(options.archive, Path(temporary))
            sys.exit(verify(options.archive, Path(temporary), options.configfile))
    except (UnsafeArchive, OSError) as error:
        sys.exit(f"Refused: {error}")


def verify(archive: Path, folder: Path, configfiles: list[str]) -> int:
    """Say what is wrong with an unpacked archive; the exit code."""
    if found := list(faults(folder)):
        print(*found, f"{archive}: {len(found)} faults; not as it was published", sep="\n")
        return 1
    print(f"{archive}: every file is as in its manifest; SHA-256 {digest(archive)}")
    try:
        checks, failed = conformance(folder)
    except ImportError:
        print("The profile's own checks were not made: roc-validator is not installed")
    else:
        if failed:
            print(*failed, f"{archive}: not a crate of profile {PROFILE}", sep="\n")
            return 1
        print(f"{archive}: passes the {checks} required checks of {PROFILE}")
    with planning(configfiles) as plan:
        present = plan.settings
    if not has_tables(present["results"]):
        print(f"{present['results']}: no study here, so that no numbers were compared")
        return 0
    for line in changed_settings(settings(folder), present):
        print(f"Other settings: {line}")
    lines = list(differences(folder, present["results"]))
    print(*lines, sep="\n", end="\n" if lines else "")
    print(f"{present['results']}: {'differs from' if lines else 'agrees with'} the archive")
    return int(bool(lines))


if __name__ == "__main__":
    main()
