"""Many draws of the paper's study by its own method, in the cells that its claims are about."""

from galloping.paper.amounts import Amounts
from galloping.paper.draws import paper_draws
from galloping.reproducibility.job import run
from galloping.study.files import tables


def main() -> None:
    settings = snakemake.params.settings
    plan = dict(settings["plan"])
    amounts = Amounts(**plan.pop("amounts"))
    drawn = paper_draws(settings["case"], name=(settings["name"],), amounts=amounts, **plan)
    tables.write(snakemake.output.draws, drawn)


run(main, snakemake)
