"""Trajectories of one case on its sampling grid, one for each release.

A line that diverges has no motion to measure: its states are all NaN, its status says why.
"""

import numpy as np

from galloping.measurement.motion import Motion
from galloping.reproducibility.job import run
from galloping.simulation import Simulator, time_grid
from galloping.study.files import models, trajectories


def main() -> None:
    settings = snakemake.params.settings
    line = models.read(snakemake.input.model).model
    time = time_grid(settings["duration"], settings["sampling_rate"])
    simulator = Simulator(line.states, line.terms)
    motions = []
    for release in settings["releases"]:
        start = np.array([release[name] for name in line.states])
        trajectory = simulator(line, start, time)
        states = trajectory.states
        if trajectory.status != "ok":
            states = np.full_like(states, np.nan)
        motions.append(Motion(line.states, time, states, line(states), trajectory.status))
    trajectories.write(snakemake.output.trajectory, motions)


run(main, snakemake)
