"""Trajectories of a line with many modes at the sensors of its span, by initial displacement."""

from galloping.line.continuous import simulate_at_sensors
from galloping.reproducibility.job import run
from galloping.streams import make_generator
from galloping.study.files import write_trajectories
from galloping.trajectory.simulation import time_grid


def simulate_many_modes(case, trajectory, line, truth, releases, duration, sampling_rate, seed):
    """Simulate the noise-free motion of a many-mode line at its sensors, and write it."""
    time = time_grid(duration, sampling_rate)
    motions = [
        simulate_at_sensors(line, truth, release, time, make_generator(seed, "gusts", case, k))
        for k, release in enumerate(releases)
    ]
    write_trajectories(trajectory, motions)


if __name__ == "__main__":
    run(simulate_many_modes, snakemake)
