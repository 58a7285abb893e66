"""Snakemake's report of a finished study, made again only when a result is newer than it.

Usage: make_report.py [--configfile FILE ...]
"""

import argparse
import subprocess
import sys
from pathlib import Path

from galloping.configuration.load import results_folder


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--configfile", nargs="+", default=[])
    files = parser.parse_args().configfile
    results = Path(results_folder(["config/config.yaml", *files]))
    report = results / "report.html"
    shown = [*results.glob("tables/*"), *results.glob("figures/*")]
    shown += Path("workflow/report").rglob("*.rst")
    if report.exists() and all(f.stat().st_mtime <= report.stat().st_mtime for f in shown):
        return 0
    command = [sys.executable, "-m", "snakemake", "--quiet", "all", "--report", str(report)]
    command += ["--configfile", *files] if files else []
    status = subprocess.run(command, check=False).returncode
    if status == 0:
        print(f"Open {report} in a browser; tables and figures are beside it.")
    return status


if __name__ == "__main__":
    sys.exit(main())
