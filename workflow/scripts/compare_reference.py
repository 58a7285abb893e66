"""The study's tables beside the published ones."""

from pathlib import Path

import pandas as pd

from galloping.reproducibility.job import run
from galloping.reproducibility.published import DIFFERENCE_COLUMNS, compare_study
from galloping.storage import read_json, write_rows


def main() -> None:
    given, output = snakemake.input, snakemake.output
    published = {Path(path).stem: path for path in given.reference}
    settings = published.pop("settings", None)
    summary, differences = compare_study(
        {name: _table(path) for name, path in published.items()},
        read_json(settings) if settings else None,
        {Path(path).stem: _table(path) for path in given.tables},
        snakemake.params.settings["study"],
    )
    write_rows(output.summary, summary)
    write_rows(output.differences, differences, DIFFERENCE_COLUMNS)


def _table(path: str) -> pd.DataFrame:
    """A table as it is written: empty cells and the word "nan" are not the same."""
    return pd.read_csv(path, dtype=str, keep_default_na=False)


run(main, snakemake)
