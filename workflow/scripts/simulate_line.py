"""Trajectories of one line on its sampling grid, one for each initial displacement.

The states of a motion that diverges are all NaN, and its status gives the reason.
"""

import numpy as np

from galloping.reproducibility.job import run
from galloping.results import Motion
from galloping.study.files import read_model, write_trajectories
from galloping.trajectory.simulation import Simulator, time_grid


def simulate_line(model, trajectory, releases, duration, sampling_rate):
    """Simulate a line from each of its initial states, and write the trajectories."""
    line, time = read_model(model).model, time_grid(duration, sampling_rate)
    simulator = Simulator(line.states, line.terms)

    def motion(release):
        answer = simulator(line, np.array([release[name] for name in line.states]), time)
        states = answer.states if answer.status == "ok" else np.full_like(answer.states, np.nan)
        return Motion(line.states, time, states, line(states), answer.status)

    write_trajectories(trajectory, [motion(release) for release in releases])


if __name__ == "__main__":
    run(simulate_line, snakemake)
