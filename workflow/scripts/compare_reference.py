"""Comparison of the study's tables with the reference."""

from pathlib import Path

from galloping.reproducibility.job import run
from galloping.study.files import read_as_written, write_table
from galloping.tables.comparison import Origin, compare_study, describe_processor, read_origin


def compare_reference(tables, reference, origin, summary, differences, study):
    """Compare the tables of a study with the reference, and write summary and differences."""
    before, now = ({Path(p).stem: read_as_written(p) for p in of} for of in (reference, tables))
    made_with = read_origin(origin[0]) if origin else None
    present = Origin(settings=study, processor=describe_processor())
    rows, beyond = compare_study(before, made_with, now, present)
    write_table(summary, rows)
    write_table(differences, beyond)


if __name__ == "__main__":
    run(compare_reference, snakemake)
