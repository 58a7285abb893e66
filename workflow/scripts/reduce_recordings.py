"""The reduced regression of every replicate of one cell."""

from galloping.identification.reduction import reduce, write
from galloping.polynomial import library
from galloping.recording import Recordings
from galloping.reproducibility.job import run


def main() -> None:
    replicates = Recordings.read(snakemake.input.recordings).replicates
    terms = library(len(replicates[0].states), snakemake.params.settings["degree"])
    write(snakemake.output.reduced, [reduce(recording, terms) for recording in replicates])


run(main, snakemake.log[0])
