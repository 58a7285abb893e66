"""Cramer-Rao bound of one cell, for each replicate whose samples differ."""

import numpy as np

from galloping.equations import EQUATIONS, model
from galloping.evaluation.limit import Noise, bound, on_library
from galloping.polynomial import library
from galloping.recording import Recordings
from galloping.reproducibility.job import run
from galloping.storage import read_json, write_arrays


def main() -> None:
    settings, protocol = snakemake.params.settings, snakemake.wildcards.protocol
    line = model(read_json(snakemake.input.model)["coefficients"])
    line = line.on_library(library(len(line.states), settings["degree"]))
    with np.load(snakemake.input.trajectory) as file:
        time, motions = file["time"], file["states"][: settings["releases"]]
    replicates = Recordings.read(snakemake.input.recordings).replicates
    if settings["level"] == 0:
        std = [np.full(line.coefficients.shape, np.nan)]
    else:
        noises = [Noise.of(protocol, settings["level"], x, settings["relative"]) for x in motions]
        differing = replicates if settings["points"] else replicates[:1]
        std = []
        for recordings in differing:
            starts = [
                motion[np.searchsorted(time, recording.time[0])]
                for motion, recording in zip(motions, recordings, strict=True)
            ]
            found = bound(line, tuple(EQUATIONS), protocol, recordings, starts, noises)
            std.append(on_library(line, found))
    write_arrays(snakemake.output.bounds, std=np.stack(std))


run(main, snakemake.log[0])
