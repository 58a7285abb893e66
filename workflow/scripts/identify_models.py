"""Models identified by a family of methods from every replicate of one cell."""

from galloping.identification.cell import identify
from galloping.measurement.measuring import measure
from galloping.polynomial import library
from galloping.reproducibility.job import run
from galloping.study.files import identified, trajectories


def main() -> None:
    settings, cell = snakemake.params.settings, snakemake.wildcards
    motions = trajectories.read(snakemake.input.trajectory)
    name = (cell.case, cell.protocol, cell.cell)
    recordings = measure(motions, name=name, **settings["measurement"])
    terms = library(len(motions[0].names), settings["degree"])
    identified.write(
        snakemake.output.models, identify(settings["methods"], recordings, terms, name)
    )


run(main, snakemake)
