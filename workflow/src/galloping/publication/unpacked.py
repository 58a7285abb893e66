"""What an unpacked publication says of itself, read without trust in who made it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from pydantic import TypeAdapter, ValidationError

from galloping.configuration.load import ConfigurationError, load, plain, read
from galloping.publication.archive import is_plain
from galloping.publication.crate import CONFIGURATION, REPORT
from galloping.publication.publishing import RECEIPTS
from galloping.reproducibility.receipts import Receipt, digest

RECEIPT_LIST = TypeAdapter(list[Receipt])


class NotAPublication(ValueError):
    """A folder that is not an unpacked publication; the message says why in one line."""


def settings(folder: Path) -> dict:
    """The settings of the published study. Raises NotAPublication."""
    try:
        return plain(load(read(folder / CONFIGURATION)))
    except ConfigurationError as error:
        text = str(error).splitlines()[0].removeprefix(f"{folder}/")
        raise NotAPublication(f"{CONFIGURATION}: {text}") from None


def published_receipts(folder: Path) -> list[Receipt]:
    """The receipts of the published study; `kept` says which files are in the archive.

    Raises NotAPublication, also for a receipt of a file or log outside the results folder.
    """
    results = settings(folder)["results"]
    try:
        made = RECEIPT_LIST.validate_json((folder / RECEIPTS).read_bytes(), strict=True)
    except (OSError, ValidationError):
        raise NotAPublication(f"{RECEIPTS}: missing, or not a list of receipts") from None
    for receipt in made:
        for path, base in ((receipt.path, results), (receipt.log, f"{results}/logs")):
            if not (is_plain(path) and path.startswith(f"{base}/")):
                raise NotAPublication(f"{RECEIPTS}: {path!r} is not a plain path in {base}")
    return [replace(receipt, kept=(folder / receipt.path).is_file()) for receipt in made]


def contradictions(folder: Path) -> Iterator[str]:
    """One line for every result that is not what its receipt says. Raises NotAPublication."""
    made = {receipt.path: receipt for receipt in published_receipts(folder)}
    study = settings(folder)
    results, reference = study["results"], study["reference"]
    for path in sorted((folder / results).rglob("*")):
        name = path.relative_to(folder).as_posix()
        if path.is_dir() or name == f"{results}/{REPORT}" or name.startswith(f"{reference}/"):
            continue
        if name not in made:
            yield f"{name}: without a receipt of how it was made"
        elif digest(path) != made[name].sha256:
            yield f"{name}: not what its receipt says"
