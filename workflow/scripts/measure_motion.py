"""Replicated recordings of one cell."""

from galloping.measurement.measuring import measure
from galloping.reproducibility.job import run
from galloping.study.files import recordings, trajectories


def main() -> None:
    cell = snakemake.wildcards
    motions = trajectories.read(snakemake.input.trajectory)
    name = (cell.case, cell.protocol, cell.cell)
    measured = measure(motions, name=name, **snakemake.params.settings["measurement"])
    recordings.write(snakemake.output.recordings, measured)


run(main, snakemake)
