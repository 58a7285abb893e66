"""Coefficients of the galloping equations of one case."""

from galloping.physics.galerkin import derive
from galloping.reproducibility.job import run
from galloping.storage import write_json


def main() -> None:
    write_json(snakemake.output.model, derive(snakemake.params.settings["case"]))


run(main, snakemake)
