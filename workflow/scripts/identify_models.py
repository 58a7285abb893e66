"""Models identified by a family of methods from every noise realisation of one study cell."""

from galloping.identification.cell import identify
from galloping.model.polynomial import polynomial_library
from galloping.recording.measurement import recordings_of
from galloping.reproducibility.job import run
from galloping.study.files import read_trajectories, write_identified


def identify_models(case, protocol, cell, trajectory, models, measurement, degree, methods):
    """Identify models from simulated recordings with the methods of a family; write them."""
    motions, name = read_trajectories(trajectory), (case, protocol, cell)
    recordings = recordings_of(motions, name=name, **measurement)
    terms = polynomial_library(len(motions[0].names), degree)
    write_identified(models, identify(methods, recordings, terms, name))


if __name__ == "__main__":
    run(identify_models, snakemake)
