"""Which claims of the paper are met at each value of a parameter that it leaves open."""

from galloping.evaluation.reproduction import VALUES, Plan, reproduction_rows
from galloping.reproducibility.job import run
from galloping.study.files import tables


def main() -> None:
    settings, name = snakemake.params.settings, snakemake.wildcards.parameter
    rows = reproduction_rows(Plan(**settings["plan"]), settings["case"], {name: VALUES[name]})
    tables.write(snakemake.output.table, rows)


run(main, snakemake)
