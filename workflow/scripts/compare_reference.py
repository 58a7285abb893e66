"""The study's tables beside the reference."""

from galloping.reproducibility.job import run
from galloping.study.files import tables
from galloping.study.loading import load
from galloping.tables.reference import Origin, compare_study, processor


def main() -> None:
    settings, output = snakemake.params.settings, snakemake.output
    read = load(settings["reads"], dict(snakemake.input.items()))
    present = Origin(settings=settings["study"], processor=processor())
    summary, differences = compare_study(
        read["reference"], read.get("origin"), read["tables"], present
    )
    tables.write(output.summary, summary)
    tables.write(output.differences, differences)


run(main, snakemake)
