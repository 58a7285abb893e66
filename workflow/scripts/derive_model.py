"""Equations of the galloping of one case."""

from galloping.physics.galerkin import derive
from galloping.reproducibility.job import run
from galloping.study.files import models


def main() -> None:
    models.write(snakemake.output.model, derive(snakemake.params.settings["line"]))


run(main, snakemake)
