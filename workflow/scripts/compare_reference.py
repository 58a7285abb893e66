"""The study's tables beside the reference."""

from pathlib import Path

import pandas as pd

from galloping.reproducibility.job import run
from galloping.reproducibility.processor import processor
from galloping.reproducibility.reference import (
    DIFFERENCE_COLUMNS,
    Origin,
    compare_study,
    read_origin,
)
from galloping.storage import write_rows


def main() -> None:
    given, output = snakemake.input, snakemake.output
    reference = {Path(path).stem: path for path in given.reference}
    origin = reference.pop("origin", None)
    summary, differences = compare_study(
        {name: _table(path) for name, path in reference.items()},
        read_origin(origin) if origin else None,
        {Path(path).stem: _table(path) for path in given.tables},
        Origin(settings=snakemake.params.settings["study"], processor=processor()),
    )
    write_rows(output.summary, summary)
    write_rows(output.differences, differences, DIFFERENCE_COLUMNS)


def _table(path: str) -> pd.DataFrame:
    """A table as it is written: empty cells and the word "nan" are not the same."""
    return pd.read_csv(path, dtype=str, keep_default_na=False)


run(main, snakemake)
