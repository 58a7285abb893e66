"""Cramer-Rao bound of one cell, and models drawn at it."""

import numpy as np

from galloping.bounds.cell import Noise, at_the_bound, bound, on_library
from galloping.identification.model import IdentifiedModel, write
from galloping.physics.equations import EQUATIONS, model
from galloping.polynomial import library
from galloping.recording import read_replicates
from galloping.reproducibility.job import run
from galloping.seeds import generator
from galloping.storage import read_json, write_arrays


def main() -> None:
    settings, cell = snakemake.params.settings, snakemake.wildcards
    line = model(read_json(snakemake.input.model)["coefficients"])
    line = line.on_library(library(len(line.states), settings["degree"]))
    with np.load(snakemake.input.trajectory) as file:
        time, motions = file["time"], file["states"][: settings["releases"]]
    replicates = read_replicates(snakemake.input.recordings)
    if settings["level"] == 0:
        write_arrays(snakemake.output.bounds, std=np.full((1, *line.coefficients.shape), np.nan))
        write(snakemake.output.models, [IdentifiedModel(line, "unjudged")])
        return
    noises = [Noise.of(cell.protocol, settings["level"], x, settings["relative"]) for x in motions]

    def of(recordings):
        starts = [
            motion[np.searchsorted(time, recording.time[0])]
            for motion, recording in zip(motions, recordings, strict=True)
        ]
        return bound(line, tuple(EQUATIONS), cell.protocol, recordings, starts, noises)

    # the bound depends on the times of the samples alone, which only subsets vary
    found = [
        of(recordings) for recordings in (replicates if settings["points"] else replicates[:1])
    ]
    name = ("bound", cell.case, cell.protocol, cell.cell)
    models = [
        at_the_bound(line, found[k % len(found)], generator(settings["seed"], *name, k))
        for k in range(len(replicates))
    ]
    write_arrays(snakemake.output.bounds, std=np.stack([on_library(line, one) for one in found]))
    write(snakemake.output.models, models)


run(main, snakemake)
