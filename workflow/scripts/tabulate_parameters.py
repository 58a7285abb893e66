"""Tables 1 and 2: parameters with unit and provenance."""

from galloping.reproducibility.job import run
from galloping.storage import write_rows
from galloping.tables import parameters


def main() -> None:
    cases = snakemake.params.settings["cases"]
    write_rows(snakemake.output.conductor, parameters.conductor(cases))
    write_rows(snakemake.output.spacers, parameters.spacers(cases))


run(main, snakemake)
