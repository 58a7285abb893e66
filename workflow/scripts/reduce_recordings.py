"""The reduced regression of every replicate of one cell."""

from galloping.identification.sparse.reduction import reduce, write
from galloping.polynomial import library
from galloping.recording import read_replicates
from galloping.reproducibility.job import run


def main() -> None:
    replicates = read_replicates(snakemake.input.recordings)
    terms = library(len(replicates[0][0].states), snakemake.params.settings["degree"])
    write(snakemake.output.reduced, [reduce(recordings, terms) for recordings in replicates])


run(main, snakemake)
