"""Scores of the oracles of STLSQ, FROLS and the weak form in one cell, chosen with the truth."""

import pandas as pd

from galloping.evaluation.oracle import oracle_rows
from galloping.evaluation.score import Truth
from galloping.measurement.measuring import measure
from galloping.polynomial import extended, library
from galloping.reproducibility.job import run
from galloping.study.files import tables
from galloping.study.loading import load


def main() -> None:
    settings, cell = snakemake.params.settings, snakemake.wildcards
    read = load(settings["reads"], dict(snakemake.input.items()))
    line, motions = read["model"].model, read["trajectory"]
    # the oracle also knows of terms that the library lacks
    line = line.on_library(extended(library(len(line.states), settings["degree"]), line))
    first = motions[0]
    truth = Truth(line, first.time, first.states, tuple(settings["steady_window"]), first.status)
    name = (cell.case, cell.protocol, cell.cell)
    replicates = measure(motions, name=name, **settings["measurement"])
    rows = oracle_rows(truth, replicates, settings["path_length"])
    tables.write(
        snakemake.output.scores, pd.DataFrame([{**settings["columns"], **r} for r in rows])
    )


run(main, snakemake)
