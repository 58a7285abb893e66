"""What is wrong, missing or left over in a study's results, against its plan and its receipts."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from galloping.reproducibility.inspection import inspect
from galloping.reproducibility.plan import Plan
from galloping.reproducibility.receipts import Receipt, consistent, receipt_path, receipts


@dataclass(frozen=True)
class Audit:
    """Files by state; each planned file is in exactly one of all but the last.

    sound: as planned and as written. elsewhere: the same, but the file was left elsewhere on
    purpose. damaged: not what its job wrote. missing: never made, or gone. outdated: made with
    other settings or code, or from other inputs. unknown: without a receipt. left_over: made, no
    longer planned.
    """

    sound: tuple[str, ...] = ()
    elsewhere: tuple[str, ...] = ()
    damaged: tuple[str, ...] = ()
    missing: tuple[str, ...] = ()
    outdated: tuple[str, ...] = ()
    unknown: tuple[str, ...] = ()
    left_over: tuple[Receipt, ...] = ()


def audit(plan: Plan) -> Audit:
    """Read every file of a study and compare it with its receipt, its settings and its inputs."""
    known, maker = receipts(plan.results), plan.maker
    planned = {path: receipt for path, receipt in known.items() if path in maker}
    findings = inspect(plan.results, planned, thorough=True)

    def state(path: str) -> str:
        if path not in known:
            return "unknown" if Path(path).exists() else "missing"
        if path in findings.missing:
            return "missing"
        if path in findings.damaged:
            return "damaged"
        if not (maker[path].made(known[path]) and consistent(known[path], known)):
            return "outdated"
        return "sound" if Path(path).exists() else "elsewhere"

    states: dict[str, list[str]] = {}
    for path in sorted(maker):
        states.setdefault(state(path), []).append(path)
    return Audit(
        **{name: tuple(paths) for name, paths in states.items()},
        left_over=tuple(receipt for path, receipt in known.items() if path not in maker),
    )


def remove(receipt: Receipt) -> list[Path]:
    """Remove a file with its receipt, log and benchmark; those that there were."""
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
