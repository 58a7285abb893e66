"""Trajectories of one case on its sampling grid, one for each release.

A line that diverges has no motion to measure: its states are all NaN, its status says why.
"""

from functools import partial

import numpy as np

from galloping.importing import imported
from galloping.measurement.measuring import Motion
from galloping.reproducibility.job import run
from galloping.seeds import generator
from galloping.simulation import Simulator, time_grid
from galloping.study.files import models, trajectories


def _modelled(line, simulator, time, release):
    start = np.array([release[name] for name in line.states])
    trajectory = simulator(line, start, time)
    states = trajectory.states
    if trajectory.status != "ok":
        states = np.full_like(states, np.nan)
    return Motion(line.states, time, states, line(states), trajectory.status)


def main() -> None:
    settings, case = snakemake.params.settings, snakemake.wildcards.case
    time = time_grid(settings["duration"], settings["sampling_rate"])
    releases = settings["releases"]
    if "continuous" in settings:
        moved = partial(imported(settings["continuous"]), settings["line"], settings["truth"])
        draws = [generator(settings["seed"], "gusts", case, k) for k in range(len(releases))]
        motions = [moved(start, time, rng) for start, rng in zip(releases, draws, strict=True)]
    else:
        line = models.read(snakemake.input.model).model
        simulator = Simulator(line.states, line.terms)
        motions = [_modelled(line, simulator, time, release) for release in releases]
    trajectories.write(snakemake.output.trajectory, motions)


run(main, snakemake)
