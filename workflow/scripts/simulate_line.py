"""Trajectories of one case on its sampling grid, one for each release."""

import numpy as np

from galloping.physics.equations import STATES, model
from galloping.reproducibility.job import run
from galloping.simulation import Simulator, time_grid
from galloping.storage import read_json, write_arrays


def main() -> None:
    settings = snakemake.params.settings
    line = model(read_json(snakemake.input.model)["coefficients"])
    time = time_grid(settings["duration"], settings["sampling_rate"])
    simulator = Simulator(line.states, line.terms)
    states = []
    for release in settings["releases"]:
        start = np.array([release[name] for name in STATES])
        trajectory = simulator(line, start, time)
        if trajectory.status != "ok":
            raise ValueError(f"{snakemake.wildcards.case}: the line itself {trajectory.status}")
        states.append(trajectory.states)
    write_arrays(snakemake.output.trajectory, time=time, states=np.stack(states))


run(main, snakemake)
