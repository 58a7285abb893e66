"""Scores of the models of one cell, and their motions for the figures.

All methods of a cell in one job: importing and compiling the integrator costs more than
simulating the models of several methods.
"""

import numpy as np

from galloping.evaluation.reconstruction import summarise
from galloping.evaluation.score import Truth, reconstruct, score
from galloping.identification.model import read
from galloping.physics.equations import model
from galloping.polynomial import library
from galloping.reproducibility.job import run
from galloping.simulation import Simulator
from galloping.storage import read_json, write_arrays, write_rows


def main() -> None:
    settings, cell = snakemake.params.settings, snakemake.wildcards
    with np.load(snakemake.input.trajectory) as file:
        time, states = file["time"], file["states"][0]
    with np.load(snakemake.input.bounds) as file:
        std = file["std"]
    line = model(read_json(snakemake.input.model)["coefficients"])
    line = line.on_library(library(len(line.states), settings["degree"]))
    truth = Truth(line, time, states, tuple(settings["steady_window"]))
    simulator = Simulator(line.states, line.terms)
    rows, arrays = [], {}
    for method, path in zip(settings["methods"], snakemake.input.identified, strict=True):
        results = read(path)
        motions = [reconstruct(simulator, truth, found) for found in results]
        bounds = np.broadcast_to(std, (len(results), *line.coefficients.shape))
        scores = list(map(score, [truth] * len(results), results, motions, bounds))
        names = {
            "case": cell.case,
            "protocol": cell.protocol,
            "cell": cell.cell,
            "level": settings["level"],
            "points": settings["points"] or len(time),
            "recordings": settings["releases"],
            "method": method,
        }
        rows += [{**names, "replicate": i, **row} for i, row in enumerate(scores)]
        summary = summarise(motions, scores)
        arrays["time"] = summary.pop("time")
        arrays |= {f"{method}/{name}": values for name, values in summary.items()}
    write_rows(snakemake.output.scores, rows)
    write_arrays(snakemake.output.motions, **arrays)


run(main, snakemake)
