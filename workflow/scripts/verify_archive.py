"""Whether a publication archive is safe, whole and the one that was published, and agrees with the
study here.

Usage: verify_archive.py ARCHIVE [--sha256 DIGEST] [--configfile FILE ...]
Ends with exit code 1, and a line for each fault, if not.
"""

import argparse
import sys
import tempfile
from pathlib import Path

from galloping.configuration.load import ConfigurationError, configured, plain
from galloping.publication.archive import UnsafeArchive, unpack
from galloping.publication.restoration import (
    NotRestorable,
    changed_settings,
    check_digest,
    faults,
    settings,
)
from galloping.tables.comparison import table_differences, tables


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("archive", type=Path)
    parser.add_argument("--sha256", default="")
    parser.add_argument("--configfile", nargs="+", default=[])
    options = parser.parse_args()
    try:
        with tempfile.TemporaryDirectory() as folder:
            digest = check_digest(options.archive, options.sha256)
            unpack(options.archive, Path(folder))
            if lines := list(faults(Path(folder))):
                raise NotRestorable("\n".join(lines))
            print(f"{options.archive}: every file is as in its manifest; SHA-256 {digest}")
            if not options.sha256:
                print("Compare it with the published SHA-256, or give that: SHA256=...")
            verify(Path(folder), plain(configured(["config/config.yaml", *options.configfile])))
    except (UnsafeArchive, NotRestorable, ConfigurationError, OSError) as error:
        sys.exit(f"{error}\n{options.archive}: not as it was published")


def verify(folder: Path, study: dict) -> None:
    """Compare an unpacked archive with the study here. Exits with 1 if it differs."""
    results = study["results"]
    if not tables(Path(results)):
        print(f"{results}: no study here, so that no numbers were compared")
        return
    published = settings(folder)
    for line in changed_settings(published, study):
        print(f"Other settings: {line}")
    lines = list(table_differences(folder / published["results"], results))
    print(*lines, f"{results}: {'differs from' if lines else 'agrees with'} the archive", sep="\n")
    sys.exit(bool(lines))


if __name__ == "__main__":
    main()
