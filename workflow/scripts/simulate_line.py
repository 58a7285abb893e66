"""Trajectories of one case on its sampling grid, one for each release.

A line that diverges has no motion to measure: its states are all NaN, its status says why.
"""

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
    states, status = [], []
    for release in settings["releases"]:
        start = np.array([release[name] for name in STATES])
        trajectory = simulator(line, start, time)
        moved = trajectory.status == "ok"
        states.append(trajectory.states if moved else np.full_like(trajectory.states, np.nan))
        status.append(trajectory.status)
    write_arrays(
        snakemake.output.trajectory, time=time, states=np.stack(states), status=np.array(status)
    )


run(main, snakemake)
