"""What every job leaves beside an output: what it was made from, and the digest of what it is; and
how files compare with it, quickly enough for the start of every run.

The receipt of `models/a.json` is `models/.a.json.receipt`, an output of the same job: it goes where
Snakemake takes the results. Snakemake's own records live in `.snakemake`, know times but not
contents, and stay behind when results are moved; receipts travel with the results and show an
edited, damaged or lost file.
"""

import hashlib
import json
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path

from galloping.storage import read_json, write_json

SUFFIX = ".receipt"
RECEIPTS = "receipts"  # the output of every rule that names them
CAPTION = "caption"  # a param for Snakemake's report alone: no job reads it
# Lies with Snakemake's records, and is lost with them: size, times and digest of what was read, of
# each study.
SEEN = Path(".snakemake/seen.json")


@dataclass(frozen=True)
class Receipt:
    """How one file was made.

    path, log: relative to the working folder. settings: of the job, with the digest of its code.
    inputs: digests of what the job read, by path. seconds: wall time of the job's own work.
    finished: when it ended (ISO 8601, UTC). kept: False where the file itself was left elsewhere on
    purpose, by restoring results from an archive that holds only a part of them.
    """

    path: str
    rule: str
    wildcards: dict[str, str]
    log: str
    settings: dict
    inputs: dict[str, str]
    sha256: str
    size: int
    seconds: float
    finished: str = ""
    kept: bool = True


def digest(path: str | Path) -> str:
    """SHA-256 of a file, in hex."""
    with Path(path).open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def receipt_path(path: str | Path) -> Path:
    """Where the receipt of a file lies."""
    path = Path(path)
    return path.with_name(f".{path.name}{SUFFIX}")


def as_written(settings: Mapping) -> dict:
    """Return settings as a receipt holds them, for comparison."""
    return json.loads(json.dumps({k: v for k, v in settings.items() if k != CAPTION}))


def consistent(receipt: Receipt, known: Mapping[str, Receipt]) -> bool:
    """Whether a file was made from its inputs as they are by their receipts, or as they lie here.

    An input of which neither is there, says nothing.
    """
    return all(
        made == (known[path].sha256 if path in known else digest(path))
        for path, made in receipt.inputs.items()
        if path in known or Path(path).exists()
    )


def write_receipt(receipt: Receipt, prefix: str = "") -> None:
    """Write a receipt beside its file, whether or not that is there.

    prefix: stands before the path of a local copy of results that are in a storage.
    """
    write_json(receipt_path(prefix + receipt.path), asdict(receipt))


def read_receipt(path: str | Path) -> Receipt | None:
    """Return the receipt of a file, or None if it has none that can be read."""
    try:
        receipt = Receipt(**read_json(receipt_path(path)))
    except (OSError, ValueError, TypeError, RecursionError):
        return None
    return receipt if _is_sound(receipt) else None


def _is_sound(receipt: Receipt) -> bool:
    """Whether the values of a receipt have their types: an editor may have damaged it."""
    by_name = (receipt.wildcards, receipt.inputs)
    texts = (receipt.path, receipt.rule, receipt.log, receipt.sha256, receipt.finished)
    return (
        all(isinstance(text, str) for text in texts)
        and all(
            isinstance(one, dict) and all(isinstance(value, str) for value in one.values())
            for one in by_name
        )
        and isinstance(receipt.settings, dict)
        and all(type(number) in (int, float) for number in (receipt.size, receipt.seconds))
        and isinstance(receipt.kept, bool)
    )


def grows(path: str | Path, settings: Mapping, key: str) -> bool:
    """Whether the file at `path` is what a job wrote whose settings differ in nothing but `key`."""
    receipt = read_receipt(path)
    if receipt is None or not receipt.kept or not Path(path).exists():
        return False
    before, now = ({**of, key: None} for of in (receipt.settings, as_written(settings)))
    return before == now and digest(path) == receipt.sha256


def receipts(results: str | Path) -> dict[str, Receipt]:
    """Return the receipts of a results folder by path, without those of results inside it."""
    found = (
        read_receipt(path.with_name(path.name[1 : -len(SUFFIX)]))
        for path in sorted(Path(results).rglob(f".*{SUFFIX}"))
    )
    return {r.path: r for r in found if r and r.log.startswith(f"{results}/logs/")}


@dataclass(frozen=True)
class Deviations:
    """Files that are not as their receipts say, by path.

    missing: should be here and are not. damaged: have other content. unknown: were here before,
    and no receipt tells of them any more. new: were not known when the study was last remembered.
    present: size, times, number and digest of what is here.
    """

    missing: tuple[str, ...]
    damaged: tuple[str, ...]
    unknown: tuple[str, ...]
    new: tuple[str, ...]
    present: dict[str, list]


def inspect(results: str, known: Mapping[str, Receipt], *, thorough: bool = False) -> Deviations:
    """Compare files with their receipts.

    known: receipts by path. thorough: read every file, also those whose size and times are as when
    last read.
    """
    states = {path: state for path in known if (state := _file_state(path))}
    seen = _read_seen().get(results, {})
    read = [p for p, state in states.items() if thorough or seen.get(p, [None])[:-1] != state]
    with ThreadPoolExecutor() as pool:
        digests = dict(zip(read, pool.map(digest, read), strict=True))
    present = {p: [*state, digests.get(p) or seen[p][-1]] for p, state in states.items()}
    return Deviations(
        missing=tuple(p for p, receipt in known.items() if receipt.kept and p not in present),
        damaged=tuple(p for p in present if present[p][-1] != known[p].sha256),
        unknown=tuple(path for path in seen if path not in known and Path(path).exists()),
        new=tuple(p for p in present if p not in seen),
        present=present,
    )


def remember(results: str, findings: Deviations) -> None:
    """Note what is here, which the next inspection need not read again."""
    seen = _read_seen()
    if (now := seen | {results: findings.present}) != seen:
        with suppress(OSError):  # only costs time: a full disk is told by what must write to it
            write_json(SEEN, now)


def _file_state(path: str) -> list[int] | None:
    """Return what changes when a file is written, even if its time is set back."""
    try:
        status = Path(path).stat()
    except OSError:
        return None
    return [status.st_size, status.st_mtime_ns, status.st_ctime_ns, status.st_ino]


def _read_seen() -> dict[str, dict[str, list]]:
    """By study, which may lie in the folder of another, and path. What is damaged is left out."""
    try:
        content = read_json(SEEN)
    except (OSError, ValueError, RecursionError):
        return {}
    studies = content.items() if isinstance(content, dict) else ()
    return {
        study: {path: state for path, state in of.items() if _is_state(state)}
        for study, of in studies
        if isinstance(of, dict)
    }


def _is_state(state: object) -> bool:
    """Whether a value is what `_file_state` gives, with a digest."""
    types = [type(each) for each in state] if isinstance(state, list) else []
    return types == [int, int, int, int, str]
