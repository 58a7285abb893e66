"""Motions of one case on its sampling grid, one for each release."""

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
        if trajectory.status != "ok":
            raise ValueError(f"{snakemake.wildcards.case}: the line itself {trajectory.status}")
        motions.append(Motion(line.states, time, trajectory.states, line(trajectory.states)))
    trajectories.write(snakemake.output.trajectory, motions)


run(main, snakemake)
