"""The Cramer-Rao bound of one cell, and scores of its models and of models at the bound."""

import pandas as pd

from galloping.bounds.cell import cell_bounds, deviations, models_at
from galloping.evaluation.cell import evaluate
from galloping.evaluation.score import Truth
from galloping.physics.equations import EQUATIONS
from galloping.polynomial import library
from galloping.reproducibility.job import run
from galloping.study.files import bounds, reconstructions, tables
from galloping.study.kinds import BOUND
from galloping.study.loading import load


def main() -> None:
    settings, output, cell = snakemake.params.settings, snakemake.output, snakemake.wildcards
    read = load(settings["reads"], dict(snakemake.input.items()))
    line, motions = read["model"].model, read["trajectory"]
    line = line.on_library(library(len(line.states), settings["degree"]))
    drawn = settings["measurement"], (cell.case, cell.protocol, cell.cell)
    known = cell_bounds(line, tuple(EQUATIONS), motions, *drawn)
    models = {BOUND: models_at(line, known, *drawn)}
    for family in read["identified"].values():
        models |= family
    first = motions[0]
    truth = Truth(line, first.time, first.states, tuple(settings["steady_window"]))
    rows, shown = evaluate(truth, models, deviations(line, known))
    bounds.write(output.bounds, deviations(line, known))
    tables.write(output.scores, pd.DataFrame([{**settings["columns"], **row} for row in rows]))
    reconstructions.write(output.reconstructions, shown)


run(main, snakemake)
