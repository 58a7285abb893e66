"""Which claims of the paper hold at each value of a setting that it leaves open."""

from galloping.paper.amounts import Amounts
from galloping.paper.variations import variation_rows
from galloping.reproducibility.job import run
from galloping.study.files import tables
from galloping.study.loading import load


def main() -> None:
    settings = snakemake.params.settings
    plan = dict(settings["plan"])
    amounts, values = Amounts(**plan.pop("amounts")), {settings["parameter"]: settings["values"]}
    drawn = load(settings["reads"], dict(snakemake.input.items()))["drawn"]
    rows = variation_rows(settings["case"], plan, amounts, values, settings["name"], drawn)
    tables.write(snakemake.output.table, rows)


run(main, snakemake)
