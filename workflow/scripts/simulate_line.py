"""Trajectory of one case on its sampling grid."""

import numpy as np

from galloping.equations import STATES, model
from galloping.reproducibility.job import run
from galloping.simulation import Simulator, time_grid
from galloping.storage import read_json, write_arrays


def main() -> None:
    settings = snakemake.params.settings
    line = model(read_json(snakemake.input.model)["coefficients"])
    time = time_grid(settings["duration"], settings["sampling_rate"])
    start = np.array([settings["initial_state"][name] for name in STATES])
    trajectory = Simulator(line.states, line.terms)(line, start, time)
    if trajectory.status != "ok":
        raise ValueError(f"{snakemake.wildcards.case}: the line itself {trajectory.status}")
    write_arrays(snakemake.output.trajectory, time=time, states=trajectory.states)


run(main, snakemake.log[0])
