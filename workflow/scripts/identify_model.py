"""Models identified by one method from every replicate of one cell."""

from galloping.identification.cell import identify, imported
from galloping.identification.model import write
from galloping.physics.equations import STATES
from galloping.polynomial import library
from galloping.reproducibility.job import run


def main() -> None:
    settings, cell = snakemake.params.settings, snakemake.wildcards
    results = identify(
        imported(settings["function"]),
        imported(settings["reader"])(snakemake.input.evidence),
        options=settings["options"],
        seed=settings["seed"],
        name=(cell.case, cell.protocol, cell.cell, cell.method),
        states=STATES,
        terms=library(len(STATES), settings["degree"]),
    )
    write(snakemake.output.models, results)


run(main, snakemake)
