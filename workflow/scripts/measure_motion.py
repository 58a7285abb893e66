"""Simulated recordings of one study cell, one for each noise realisation."""

from galloping.recording.measurement import recordings_of
from galloping.reproducibility.job import run
from galloping.study.files import read_trajectories, write_recordings


def measure_motion(case, protocol, cell, trajectory, recordings, measurement):
    """Simulate noisy recordings of a line from its true motion, and write them to a file."""
    motions = read_trajectories(trajectory)
    write_recordings(recordings, recordings_of(motions, name=(case, protocol, cell), **measurement))


if __name__ == "__main__":
    run(measure_motion, snakemake)
