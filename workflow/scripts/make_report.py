"""Snakemake's report of a finished study, made again only when a result is newer than it.

Usage: make_report.py RESULTS [options for snakemake]
"""

import subprocess
import sys
from pathlib import Path


def main(results: str, *options: str) -> int:
    report = Path(results) / "report.html"
    shown = [*Path(results).glob("tables/*"), *Path(results).glob("figures/*")]
    shown += Path("workflow/report").iterdir()
    if report.exists() and all(f.stat().st_mtime <= report.stat().st_mtime for f in shown):
        return 0
    command = [sys.executable, "-m", "snakemake", "--quiet", "--report", str(report), *options]
    status = subprocess.run(command, check=False).returncode
    if status == 0:
        print(f"Open {report} in a browser; tables and figures are beside it.")
    return status


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
