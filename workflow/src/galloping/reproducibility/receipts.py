"""Receipts of results: inputs and settings of every output, and its digest.

A comparison of files with receipts is fast enough for the start of every run. The receipt of
`models/a.json` is `models/.a.json.receipt`, an output of the same job, stored with the results.
Snakemake's own records are in `.snakemake`, contain times but not contents, and stay behind when
results are moved; receipts move with the results and show an edited, damaged or lost file.
"""

import hashlib
import json
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path

from galloping.storage import read_json, write_json

RECEIPT_SUFFIX = ".receipt"
RECEIPTS = "receipts"  # name of an output of every rule
CAPTION = "caption"  # name of a param that only Snakemake's report uses
# Size, times, inode and digest of each result file, by study. The file is in Snakemake's folder, so
# that it is deleted together with Snakemake's records.
DIGEST_FILE = Path(".snakemake/seen.json")


@dataclass(frozen=True)
class Receipt:
    """Record of how a result file was made: its job, settings, inputs and SHA-256.

    path, log: relative to the working folder. settings: of the job, with the digest of its code.
    inputs: digests of the files that the job read, by path. seconds: wall time of the job's own
    work. finished: end time (ISO 8601, UTC). kept: False if the file itself was left elsewhere on
    purpose, by restoring results from an archive that contains only a part of them.
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
    """Compute the SHA-256 of a file as hexadecimal text; `folder` if the path is a folder."""
    if Path(path).is_dir():
        return "folder"
    with Path(path).open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def receipt_path(path: str | Path) -> Path:
    """Return the path of the record (receipt) of how a given file was made."""
    path = Path(path)
    return path.with_name(f".{path.name}{RECEIPT_SUFFIX}")


def as_written(settings: Mapping) -> dict:
    """Convert settings to the plain JSON types in which they are stored, to compare them."""
    return json.loads(json.dumps({k: v for k, v in settings.items() if k != CAPTION}))


def is_consistent(receipt: Receipt, receipts: Mapping[str, Receipt]) -> bool:
    """Decide whether a file was made from the present versions of its inputs, by their SHA-256.

    The present digest of an input is that of its receipt, else that of its contents. An input
    without both is ignored.
    """
    return all(
        made == (receipts[path].sha256 if path in receipts else digest(path))
        for path, made in receipt.inputs.items()
        if path in receipts or Path(path).exists()
    )


def write_receipt(receipt: Receipt, prefix: str = "") -> None:
    """Write the receipt of a file, which may be absent; `prefix` leads to a local copy."""
    write_json(receipt_path(prefix + receipt.path), asdict(receipt))


def read_receipt(path: str | Path) -> Receipt | None:
    """Read the record (receipt) of how a file was made; None if it is missing or damaged."""
    try:
        receipt = Receipt(**read_json(receipt_path(path)))
    except (OSError, ValueError, TypeError, RecursionError):
        return None
    return receipt if _is_sound(receipt) else None


def _is_sound(receipt: Receipt) -> bool:
    """Decide whether the values of a receipt have their types: an editor may have damaged it."""
    match receipt:
        case Receipt(
            path=str(), rule=str(), log=str(), sha256=str(), finished=str(), kept=bool(),
            size=int() | float(), seconds=int() | float(),
            settings=dict(), wildcards=dict(), inputs=dict(),
        ):  # fmt: skip
            texts = [*receipt.wildcards.values(), *receipt.inputs.values()]
            return all(isinstance(text, str) for text in texts)
    return False


def differs_only_in(path: str | Path, settings: Mapping, key: str) -> bool:
    """Decide whether an intact file was made with given settings, apart from those of one key."""
    receipt = read_receipt(path)
    if receipt is None or not receipt.kept or not Path(path).exists():
        return False
    before, now = ({**each, key: None} for each in (receipt.settings, as_written(settings)))
    return before == now and digest(path) == receipt.sha256


def read_receipts(results: str | Path) -> dict[str, Receipt]:
    """Read the receipts of a results folder by path, without those of copies and other results."""
    written = sorted(Path(results).rglob(f".*{RECEIPT_SUFFIX}"))
    paths = (str(path.with_name(path.name[1 : -len(RECEIPT_SUFFIX)])) for path in written)
    return {
        path: receipt
        for path in paths
        if (receipt := read_receipt(path))
        and receipt.path == path
        and receipt.log.startswith(f"{results}/logs/")
    }


@dataclass(frozen=True)
class Deviations:
    """Result files that are missing, damaged or without a record of how they were made.

    The files are given by path. missing: absent, with a receipt or remembered. damaged: with other
    content. unrecorded: remembered, now without a receipt. unseen: not remembered. present: size,
    times, inode number and digest of present files.
    """

    missing: tuple[str, ...]
    damaged: tuple[str, ...]
    unrecorded: tuple[str, ...]
    unseen: tuple[str, ...]
    present: dict[str, list]


def inspect(results: str, receipts: Mapping[str, Receipt], *, thorough: bool = False) -> Deviations:
    """Find result files that are missing, damaged or unrecorded, by comparison with their records.

    A receipt is the record of how a file was made. receipts: by path. thorough: read every
    file, also those with size and times of the last reading.
    """
    states = {path: state for path in receipts if (state := _file_state(path))}
    seen_states = _read_seen().get(results, {})
    paths = [
        p for p, state in states.items() if thorough or seen_states.get(p, [None])[:-1] != state
    ]
    with ThreadPoolExecutor() as pool:
        digests = dict(zip(paths, pool.map(digest, paths), strict=True))
    present = {p: [*state, digests.get(p) or seen_states[p][-1]] for p, state in states.items()}
    lost = [path for path in seen_states if path not in receipts and not Path(path).exists()]
    return Deviations(
        missing=(*(p for p, of in receipts.items() if of.kept and p not in present), *lost),
        damaged=tuple(p for p in present if present[p][-1] != receipts[p].sha256),
        unrecorded=tuple(
            path for path in seen_states if path not in receipts and Path(path).exists()
        ),
        unseen=tuple(p for p in present if p not in seen_states),
        present=present,
    )


def remember(results: str, findings: Deviations) -> None:
    """Store the state of all present files, so that only changed files are read next time.

    Missing files stay remembered: those without a receipt would not be missed otherwise.
    """
    studies = _read_seen()
    lost = {p: of for p, of in studies.get(results, {}).items() if p in findings.missing}
    if (now := studies | {results: lost | findings.present}) != studies:
        with suppress(OSError):  # a loss of time only; other writers report a full disk
            write_json(DIGEST_FILE, now)


def _file_state(path: str) -> list[int] | None:
    """Return properties that change when a file is written, even if its time is set back."""
    try:
        status = Path(path).stat()
    except OSError:
        return None
    return [status.st_size, status.st_mtime_ns, status.st_ctime_ns, status.st_ino]


def _read_seen() -> dict[str, dict[str, list]]:
    """Read remembered states by study, perhaps in another's folder, and path; skip damaged ones."""
    try:
        content = read_json(DIGEST_FILE)
    except (OSError, ValueError, RecursionError):
        return {}
    studies = content.items() if isinstance(content, dict) else ()
    return {
        study: {path: state for path, state in of.items() if _is_state(state)}
        for study, of in studies
        if isinstance(of, dict)
    }


def _is_state(state: object) -> bool:
    """Decide whether a value is a result of `_file_state`, with a digest."""
    types = [type(each) for each in state] if isinstance(state, list) else []
    return types == [int, int, int, int, str]
