"""Audit of a study's results, and their repair so that work can continue."""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from galloping.reproducibility.plan import Plan, find_current, record
from galloping.reproducibility.receipts import Receipt, inspect, read_receipts, receipt_path


@dataclass(frozen=True)
class Audit:
    """Result files of a study, classified as sound, damaged, missing, outdated and other states.

    Each planned file is in exactly one class of all but the last. sound: as planned and as written.
    elsewhere: the same, but the file was left elsewhere on purpose. damaged: changed since its job.
    missing: never made, or lost. outdated: made with other settings or code, or from other inputs.
    unknown: without a receipt. left_over: made, no longer planned.
    """

    sound: tuple[str, ...] = ()
    elsewhere: tuple[str, ...] = ()
    damaged: tuple[str, ...] = ()
    missing: tuple[str, ...] = ()
    outdated: tuple[str, ...] = ()
    unknown: tuple[str, ...] = ()
    left_over: tuple[Receipt, ...] = ()


def audit(plan: Plan) -> Audit:
    """Read each result file, and classify it by its receipt, settings and inputs."""
    receipts, maker = read_receipts(plan.results), plan.maker
    planned = {path: receipt for path, receipt in receipts.items() if path in maker}
    findings = inspect(plan.results, planned, thorough=True)

    def state(path: str) -> str:
        if path not in receipts:
            return "unknown" if Path(path).exists() else "missing"
        if path in findings.missing:
            return "missing"
        if path in findings.damaged:
            return "damaged"
        if not maker[path].has_made(receipts[path], receipts):
            return "outdated"
        return "sound" if Path(path).exists() else "elsewhere"

    states: dict[str, list[str]] = {}
    for path in sorted(maker):
        states.setdefault(state(path), []).append(path)
    return Audit(
        **{name: tuple(paths) for name, paths in states.items()},
        left_over=tuple(receipt for path, receipt in receipts.items() if path not in maker),
    )


def remove(receipt: Receipt) -> list[Path]:
    """Delete a result file with its record, log and benchmark, and return the deleted paths."""
    log = Path(receipt.log)
    parts = ["benchmarks" if part == "logs" else part for part in log.parts]
    benchmark = Path(*parts).with_suffix(".tsv")
    files = [Path(receipt.path), receipt_path(receipt.path), log, benchmark]
    present = [file for file in files if file.exists()]
    for file in present:
        file.unlink()
        with suppress(OSError):  # not empty
            file.parent.rmdir()
    return present


SET_ASIDE = "set_aside"


def adopt(plan: Plan) -> Iterator[str]:
    """Make Snakemake accept existing files that were made as planned, and move all others away.

    Yields messages. Needed if Snakemake lacks records of the results. A file is kept if its
    receipt, and those of all files before it, name the settings, code and inputs of the plan. Other
    files are set aside, to be made again. The caller ensures that files agree with their receipts.
    """
    receipts = read_receipts(plan.results)
    maker = plan.maker
    current = {path for path in find_current(plan, receipts) if Path(path).exists()}
    others = [p for p in sorted({*maker, *receipts} - current) if Path(p).exists()]
    for path in others:
        set_aside(plan.results, path)
    for path in receipts.keys() - maker.keys():
        receipt_path(path).unlink()  # else the file would count as missing
    record(plan)
    if current:
        yield f"{len(current)} files are as their receipts say and made as configured now: kept"
    if others:
        yield (
            f"{len(others)} files were made otherwise than configured now: set aside in "
            f"{plan.results}/{SET_ASIDE}"
        )


def set_aside(results: str, path: str) -> Path:
    """Move a result file to a separate folder under an unused name, and return the new path."""
    base = Path(results) / SET_ASIDE / Path(path).relative_to(results)
    target, number = base, 1
    while target.exists():
        number += 1
        target = base.with_name(f"{base.name}.{number}")
    target.parent.mkdir(parents=True, exist_ok=True)
    Path(path).replace(target)
    return target
