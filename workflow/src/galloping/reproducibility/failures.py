"""Why a run stopped, in a line."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

# The signal that ended a failed job, if one did, and the job's log.
FAILED = re.compile(
    r"(?:died with <Signals\.(?P<signal>\w+): \d+>\.\n(?:\[.*\]\n)?)?"
    r"Error in (?:rule|group) \w+:?\n(?: {4}.*\n)*? {4}log: (?P<log>[^\s,]+).*\(check log file"
)


def closing_line(logs: Iterable[str | Path]) -> str:
    """What ended a run and what to do next.

    logs: Snakemake's own of the run; the last line in the log of a failed job says why it failed,
    unless a signal ended it.
    """
    failed = {job for log in logs for job in _failed(Path(log)) if job[1] != "SIGINT"}
    causes = {_cause(*job) for job in failed}
    reason = "; ".join(sorted(causes)) or "it was interrupted, or Snakemake's last lines say why"
    return f"The study stopped: {reason}. Finished jobs are kept; run it again to go on."


def _failed(log: Path) -> set[tuple[Path, str | None]]:
    """Log and signal of the jobs that failed, by Snakemake's log of them.

    A job on a cluster has such a log itself.
    """
    jobs = {(Path(job["log"]), job["signal"]) for job in FAILED.finditer(_text(log))}
    return {failed for job in jobs for failed in _failed(job[0]) or {job}}


def _cause(log: Path, signal: str | None) -> str:
    if signal:
        return f"a job was killed by {signal} ({log})"
    lines = _text(log).split("\n")
    said = next((line for line in reversed(lines) if line.strip()), "see its message above")
    return f"{said.strip()} ({log})"


def _text(log: Path) -> str:
    try:
        return log.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ""
