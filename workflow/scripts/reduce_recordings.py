"""The reduced regression of every replicate of one cell."""

from galloping.identification.sparse.reduction import reduce, write
from galloping.polynomial import library
from galloping.recording import Recordings
from galloping.reproducibility.job import run


def main() -> None:
    replicates = Recordings.read(snakemake.input.recordings).replicates
    terms = library(len(replicates[0][0].states), snakemake.params.settings["degree"])
    write(snakemake.output.reduced, [reduce(recordings, terms) for recordings in replicates])


run(main, snakemake)
