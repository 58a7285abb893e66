"""A publication of others: whether it is whole and agrees with a study here, and its results put in
place. Read without trust in who made it."""

import os
import tempfile
import time
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

from pydantic import TypeAdapter, ValidationError

from galloping.configuration.load import ConfigurationError, load, plain, read
from galloping.publication.archive import (
    NotRestorable,
    files_of,
    is_plain,
    manifest_faults,
    unpack,
)
from galloping.publication.publishing import CONFIGURATION, RECEIPTS
from galloping.reproducibility.plan import Plan
from galloping.reproducibility.receipts import (
    Receipt,
    digest,
    read_receipt,
    receipt_path,
    receipts,
    write_receipt,
)
from galloping.reproducibility.repair import adopt, audit, set_aside
from galloping.storage import partial_prefix
from galloping.tables.comparison import flat, table_differences

PLACES = ("results", "reference")  # settings on which no number depends
RECEIPT_LIST = TypeAdapter(list[Receipt])


def check_digest(archive: str | Path, expected: str | None) -> str:
    """The SHA-256 of an archive. expected: of the published one. Raises NotRestorable."""
    present = digest(archive)
    if expected and present != expected.lower():
        raise NotRestorable(f"{archive}: SHA-256 {present}, not {expected}")
    return present


def settings(folder: Path) -> dict:
    """The settings of an unpacked publication. Raises NotRestorable."""
    try:
        return plain(load(read(folder / CONFIGURATION)))
    except ConfigurationError as error:
        text = str(error).splitlines()[0].removeprefix(f"{folder}/")
        raise NotRestorable(f"{CONFIGURATION}: {text}") from None


def published_receipts(folder: Path) -> dict[str, Receipt]:
    """The receipts of an unpacked publication by path; `kept` says which files are in it.

    Raises NotRestorable, also for a receipt of a file or log outside the results folder.
    """
    results = settings(folder)["results"]
    try:
        made = RECEIPT_LIST.validate_json((folder / RECEIPTS).read_bytes(), strict=True)
    except (OSError, ValidationError):
        raise NotRestorable(f"{RECEIPTS}: missing, or not a list of receipts") from None
    for receipt in made:
        for path, base in ((receipt.path, results), (receipt.log, f"{results}/logs")):
            if not (is_plain(path) and path.startswith(f"{base}/")):
                raise NotRestorable(f"{RECEIPTS}: {path!r} is not a plain path in {base}")
    return {r.path: replace(r, kept=(folder / r.path).is_file()) for r in made}


def faults(folder: Path) -> Iterator[str]:
    """One line for everything in an unpacked publication that contradicts its own records."""
    if lines := list(manifest_faults(folder)):
        yield from lines  # receipts would say the same again
        return
    try:
        made, study = published_receipts(folder), settings(folder)
    except NotRestorable as error:
        yield str(error)
        return
    apart = f"{study['reference']}/"
    for name in files_of(folder):
        if name.startswith(f"{study['results']}/") and not name.startswith(apart):
            if name not in made:
                yield f"{name}: without a receipt of how it was made"
            elif digest(folder / name) != made[name].sha256:
                yield f"{name}: not what its receipt says"


def changed_settings(published: Mapping, present: Mapping) -> Iterator[str]:
    """One line for each setting in which two studies differ, but where their files are."""
    one, other = dict(flat(published)), dict(flat(present))
    for key in dict.fromkeys([*one, *other]):
        there, here = (found.get(key, "nothing") for found in (one, other))
        if key not in PLACES and there != here:
            yield f"{key}: {there} in the archive, {here} here"


def restore(archive: Path, plan: Plan, *, replacing: bool = False) -> Iterator[str]:
    """Put the results of an archive where the plan wants them; says what was done.

    No result is written before the archive is found whole and in agreement with what was computed
    here. Afterwards Snakemake takes a file as made if its receipt, and those of all that it was
    made from, are of the plan's jobs with the plan's settings; others are set aside. replacing: set
    results aside that are not those of the archive. Raises NotRestorable.
    """
    results = plan.results
    # on the file system of the results; `make repair` sweeps it if this process is killed
    with tempfile.TemporaryDirectory(prefix=partial_prefix(), dir=results) as temporary:
        folder = Path(temporary)
        unpack(archive, folder)
        if lines := list(faults(folder)):
            raise NotRestorable("\n".join(lines))
        published = settings(folder)
        if published["results"] != results:
            raise NotRestorable(
                f"results: {published['results']!r} in the archive, not {results!r}"
            )
        if not list(changed_settings(published, plan.settings)):
            lines = list(table_differences(folder / results, results, only=audit(plan).sound))
            if lines:
                why = "the same study, computed here, has other numbers: see `make verify`"
                raise NotRestorable("\n".join([*lines, why]))
        made = published_receipts(folder)
        digests = {path: receipt.sha256 for path, receipt in made.items()}
        others = [path for path in _present(plan) if digests.get(path) != digest(path)]
        if others and not replacing:
            more = f" and {len(others) - 1} more" if others[1:] else ""
            told = "not as in the archive; REPLACE=yes sets what differs aside"
            raise NotRestorable(f"{others[0]}{more}: {told}")
        for path in others:
            set_aside(results, path)
            receipt_path(path).unlink(missing_ok=True)
        placed = [p for p in digests if (folder / p).exists() and not Path(p).exists()]
        for path in placed:
            Path(path).parent.mkdir(parents=True, exist_ok=True)
            (folder / path).replace(path)
        for path, receipt in made.items():
            # one of a file that was here before, stays
            if path in placed or not (Path(path).exists() and read_receipt(path)):
                write_receipt(replace(receipt, kept=Path(path).exists()))
    now = time.time_ns()
    for path in _present(plan):
        os.utime(path, ns=(now, now))  # none is newer than what was made from it
    if others:
        yield f"{len(others)} other files set aside in {results}/set_aside"
    yield f"{len(placed)} files restored"
    yield from adopt(plan)


def _present(plan: Plan) -> list[str]:
    """The files of the study that are in place: planned, or made."""
    known = {*plan.maker, *receipts(plan.results)}
    return sorted(path for path in known if Path(path).exists())
