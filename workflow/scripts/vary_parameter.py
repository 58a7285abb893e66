"""Which claims of the paper are met at each value of a parameter that it leaves open."""

from galloping.reproducibility.job import run
from galloping.study.files import tables
from galloping.tables.reproduction import ReproductionPlan, reproduction_rows


def main() -> None:
    settings = snakemake.params.settings
    values = {settings["parameter"]: settings["values"]}
    rows = reproduction_rows(ReproductionPlan(**settings["plan"]), settings["case"], values)
    tables.write(snakemake.output.table, rows)


run(main, snakemake)
