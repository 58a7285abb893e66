"""Scores of the models of one cell and method, and their motions for the figures."""

import numpy as np

from galloping.equations import model
from galloping.evaluation.reconstruction import summarise
from galloping.evaluation.score import Truth, reconstruct, score
from galloping.identification import result
from galloping.polynomial import library
from galloping.reproducibility.job import run
from galloping.simulation import Simulator
from galloping.storage import read_json, write_arrays, write_rows


def main() -> None:
    settings, cell = snakemake.params.settings, snakemake.wildcards
    with np.load(snakemake.input.trajectory) as file:
        time, states = file["time"], file["states"][0]
    line = model(read_json(snakemake.input.model)["coefficients"])
    line = line.on_library(library(len(line.states), settings["degree"]))
    truth = Truth(line, time, states, tuple(settings["steady_window"]))
    simulator = Simulator(line.states, line.terms)
    results = result.read(snakemake.input.identified)
    motions = [reconstruct(simulator, truth, found) for found in results]
    with np.load(snakemake.input.bounds) as file:
        bounds = np.broadcast_to(file["std"], (len(results), *line.coefficients.shape))
    scores = [
        score(truth, found, motion, bound)
        for found, motion, bound in zip(results, motions, bounds, strict=True)
    ]
    names = {
        "case": cell.case,
        "protocol": cell.protocol,
        "cell": cell.cell,
        "level": settings["level"],
        "points": settings["points"] or len(time),
        "recordings": settings["releases"],
        "method": cell.method,
    }
    write_rows(
        snakemake.output.scores,
        [{**names, "replicate": i, **row} for i, row in enumerate(scores)],
    )
    write_arrays(snakemake.output.motion, **summarise(motions, scores))


run(main, snakemake.log[0])
