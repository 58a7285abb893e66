"""Whether a publication is whole, described as it should be, and in agreement with a fresh run."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

import pandas as pd

from galloping.publication import manifest
from galloping.publication.unpacked import NotAPublication, contradictions, settings
from galloping.publication.validation import structure
from galloping.reproducibility.comparison import compare_tables, describe
from galloping.reproducibility.reference import flat

SHOWN = 10  # differences of one table that are told one by one
OF_REFERENCE = ("reference_summary", "reference_differences")  # about other numbers than the run's
PLACES = ("results", "reference")  # settings on which no number depends


def faults(folder: Path) -> Iterator[str]:
    """One line for everything in an unpacked publication that is not as it was published."""
    found = list(manifest.faults(folder))
    yield from found
    yield from structure(folder)
    if not found:  # else their files are told already
        try:
            yield from contradictions(folder)
        except NotAPublication as error:
            yield str(error)


def differences(folder: Path, results: str) -> Iterator[str]:
    """One line for each number or text in which the tables of a publication and a run differ.

    results: the results folder of the run. Tolerances: `reproducibility.comparison`.
    """
    published = _tables(folder / settings(folder)["results"])
    found = _tables(Path(results))
    for name in sorted(published.keys() | found.keys()):
        if name not in found:
            yield f"{name}: not in {results}"
        elif name not in published:
            yield f"{name}: not in the archive"
        else:
            yield from (f"{name}: {line}" for line in _differences(published[name], found[name]))


def has_tables(results: str) -> bool:
    """Whether there is a run to compare with."""
    return bool(_tables(Path(results)))


def changed_settings(published: Mapping, present: Mapping) -> Iterator[str]:
    """One line for each setting in which two studies differ, but where their files are."""
    one, other = dict(flat(published)), dict(flat(present))
    for key in dict.fromkeys([*one, *other]):
        there, here = (found.get(key, "nothing") for found in (one, other))
        if key not in PLACES and there != here:
            yield f"{key}: {there} in the archive, {here} here"


def _tables(results: Path) -> dict[str, Path]:
    found = (results / "tables").glob("*.csv")
    return {f"tables/{path.name}": path for path in found if path.stem not in OF_REFERENCE}


def _differences(published: Path, found: Path) -> Iterator[str]:
    try:
        tables = [
            pd.read_csv(path, dtype=str, keep_default_na=False) for path in (published, found)
        ]
        rows = compare_tables(*tables)
    except ValueError as error:
        yield " ".join(str(error).split())
        return
    yield from (describe(row) for _, row in rows.head(SHOWN).iterrows())
    if len(rows) > SHOWN:
        yield f"{len(rows) - SHOWN} more differences"
