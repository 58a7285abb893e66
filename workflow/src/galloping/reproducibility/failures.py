"""Why a run stopped, in a line."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

FAILED = re.compile(r"^ {4}log: (\S+) \(check log file", re.MULTILINE)


def closing_line(logs: Iterable[str | Path]) -> str:
    """What ended a run and what to do next.

    logs: Snakemake's own of the run; the last line in the log of a failed job says why it failed.
    """
    causes = {_cause(job) for log in logs for job in _failed(Path(log))}
    reason = "; ".join(sorted(causes)) or "it was interrupted, or Snakemake's last lines say why"
    return f"The study stopped: {reason}. Finished jobs are kept; run it again to go on."


def _failed(log: Path) -> set[Path]:
    """Logs of the jobs that failed, by a log of Snakemake; each job on a cluster has such a log."""
    jobs = {Path(job) for job in FAILED.findall(_text(log))}
    return {failed for job in jobs for failed in _failed(job) or {job}}


def _cause(log: Path) -> str:
    lines = _text(log).split("\n")
    said = next((line for line in reversed(lines) if line.strip()), "see its message above")
    return f"{said.strip()} ({log})"


def _text(log: Path) -> str:
    try:
        return log.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ""
