"""Cramer-Rao bound of one cell, and models drawn at it."""

import numpy as np

from galloping.bounds.cell import Noise, at_the_bound, bound, on_library
from galloping.identification.model import IdentifiedModel, write
from galloping.physics.equations import EQUATIONS, model
from galloping.polynomial import extended, library
from galloping.recording import read_replicates
from galloping.reproducibility.job import run
from galloping.seeds import generator
from galloping.storage import read_json, write_arrays


def main() -> None:
    settings, cell = snakemake.params.settings, snakemake.wildcards
    line = model(read_json(snakemake.input.model)["coefficients"])
    terms = library(len(line.states), settings["degree"])
    line = line.on_library(extended(terms, line))
    with np.load(snakemake.input.trajectory) as file:
        time, motions = file["time"], file["states"][: settings["releases"]]
    replicates = read_replicates(snakemake.input.recordings)
    if np.isnan(motions).any():
        nothing = IdentifiedModel.refused(line.states, line.terms, "bound: the line diverges")
        write_arrays(snakemake.output.bounds, std=np.full((1, *line.coefficients.shape), np.nan))
        write(snakemake.output.models, [nothing] * len(replicates))
        return
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
    lacking = line.term_names[len(terms) :]
    models = [
        at_the_bound(line, found[k % len(found)], generator(settings["seed"], *name, k), lacking)
        for k in range(len(replicates))
    ]
    std = np.stack([on_library(line, one) for one in found])
    std[:, :, len(terms) :] = np.nan  # no method on the library estimates what it lacks
    write_arrays(snakemake.output.bounds, std=std)
    write(snakemake.output.models, models)


run(main, snakemake)
