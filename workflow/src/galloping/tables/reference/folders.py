"""The tables of two results folders, compared."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from pathlib import Path

import pandas as pd

from galloping.tables.reference.comparison import compare_tables, describe

SHOWN = 10  # differences of one table that are told one by one
OF_REFERENCE = ("reference_summary", "reference_differences")  # about other numbers than the run's


def tables(results: Path) -> dict[str, Path]:
    """The tables of a study that do not tell of other studies, by name."""
    present = (results / "tables").glob("*.csv")
    return {f"tables/{path.name}": path for path in present if path.stem not in OF_REFERENCE}


def table_differences(
    published: Path, results: str, only: Collection[str] | None = None
) -> Iterator[str]:
    """One line for each number or text in which published tables and those of a run differ.

    published: the results folder of an unpacked archive. results: that of the run. only: of these
    files of the run; by default all tables of both. Tolerances: `tables.reference.comparison`.
    """
    there, here = tables(published), tables(Path(results))
    for name in sorted(there.keys() | here.keys()):
        if only is not None and f"{results}/{name}" not in only:
            continue
        if name not in here:
            yield f"{name}: not in {results}"
        elif name not in there:
            yield f"{name}: not in the archive"
        else:
            yield from (f"{name}: {line}" for line in _differences(there[name], here[name]))


def _differences(published: Path, here: Path) -> Iterator[str]:
    try:
        rows = compare_tables(
            *(pd.read_csv(path, dtype=str, keep_default_na=False) for path in (published, here))
        )
    except ValueError as error:
        yield " ".join(str(error).split())
        return
    yield from (describe(row) for _, row in rows.head(SHOWN).iterrows())
    if len(rows) > SHOWN:
        yield f"{len(rows) - SHOWN} more differences"
