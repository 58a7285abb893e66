"""One table of `galloping.tables.registry`."""

from galloping.importing import imported
from galloping.reproducibility.job import run
from galloping.study.files import tables
from galloping.study.loading import load


def main() -> None:
    settings = snakemake.params.settings
    read = load(settings["reads"], dict(snakemake.input.items()))
    make = imported(settings["function"])
    tables.write(snakemake.output.table, make(**read, settings=settings["shown"]))


run(main, snakemake)
