"""The study's tables beside the reference."""

from galloping.reproducibility.job import run
from galloping.storage import write_rows
from galloping.study.loading import load
from galloping.tables.reference.processor import processor
from galloping.tables.reference.study import DIFFERENCE_COLUMNS, Origin, compare_study


def main() -> None:
    settings, output = snakemake.params.settings, snakemake.output
    read = load(settings["reads"], dict(snakemake.input.items()))
    present = Origin(settings=settings["study"], processor=processor())
    summary, differences = compare_study(
        read["reference"], read.get("origin"), read["tables"], present
    )
    write_rows(output.summary, summary)
    write_rows(output.differences, differences, DIFFERENCE_COLUMNS)


run(main, snakemake)
