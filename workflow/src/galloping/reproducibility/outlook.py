"""What a run will do, said before it does it, and how far it is."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from statistics import fmean

from galloping.reproducibility.plan import Plan, PlannedJob
from galloping.reproducibility.receipts import Receipt
from galloping.reproducibility.repair import as_planned

START = 1.5  # s that a job takes to start, of which receipts do not tell
MOST = 3  # edits and rules that are told one by one


def outlook(plan: Plan, known: Mapping[str, Receipt], cores: int | None) -> Iterator[str]:
    """How many jobs of a study will run and about how long, what was edited, whose code changed.

    known: receipts by path. cores: that jobs share, None where a cluster has them.
    """
    kept = {path for path in as_planned(plan, dict(known)) if Path(path).exists()}
    kept |= {path for path, receipt in known.items() if not receipt.kept}
    jobs = [job for job in plan.jobs if not kept.issuperset(job.outputs)]
    if not jobs:
        return
    yield f"{len(jobs)} of {len(plan.jobs)} jobs will run, {_duration(jobs, known, cores)}"
    if edits := list(_edits(_settings(plan, known), plan.settings)):
        yield f"Edited since they last ran: {_first(edits)}."
    codes = {job.rule for job in jobs for path in job.outputs if _is_other_code(job, known, path)}
    if codes:
        yield f"Code or libraries changed behind: {_first(sorted(codes))}."


def spoken(seconds: float) -> str:
    """A duration in words."""
    for unit, length in (("h", 3600.0), ("min", 60.0)):
        if seconds >= 1.5 * length:
            return f"{seconds / length:.0f} {unit}"
    return f"{seconds:.0f} s"


def _duration(jobs: list[PlannedJob], known: Mapping[str, Receipt], cores: int | None) -> str:
    """By how long the same jobs took before, or others of their rule."""
    of_rule: dict[str, list[float]] = {}
    for receipt in known.values():
        of_rule.setdefault(receipt.rule, []).append(receipt.seconds)
    own = [[known[path].seconds for path in job.outputs if path in known] for job in jobs]
    times = [
        START + fmean(seconds or of_rule[job.rule])
        for job, seconds in zip(jobs, own, strict=True)
        if seconds or job.rule in of_rule
    ]
    if not times:
        return "for the first time: how long is not known yet"
    least = "at least " if len(times) < len(jobs) else ""
    if cores is None:
        return f"{least}about {spoken(sum(times))} of work"
    share = max(sum(times) / cores, max(times))
    return f"{least}about {spoken(share)} on {cores} core{'s' if cores > 1 else ''}"


def _settings(plan: Plan, known: Mapping[str, Receipt]) -> dict:
    """Those of the last whole run, as the report holds them; the present ones where it has none."""
    report = known.get(f"{plan.results}/report.html")
    study = report.settings.get("study", {}) if report else {}
    return study.get("study") or plan.settings  # else of an older version


def _first(items: list[str]) -> str:
    more = f" and {len(items) - MOST} more" if len(items) > MOST else ""
    return ", ".join(items[:MOST]) + more


def _edits(before: object, now: object, key: str = "") -> Iterator[str]:
    if isinstance(before, dict) and isinstance(now, dict):
        for name in [*before, *(name for name in now if name not in before)]:
            below = f"{key}.{name}" if key else str(name)
            if name not in now or name not in before:
                yield f"{below} {'added' if name in now else 'removed'}"
            else:
                yield from _edits(before[name], now[name], below)
    elif before != now:
        yield f"{key} from {before} to {now}"


def _is_other_code(job: PlannedJob, known: Mapping[str, Receipt], path: str) -> bool:
    return path in known and known[path].settings.get("code") != job.settings.get("code")
