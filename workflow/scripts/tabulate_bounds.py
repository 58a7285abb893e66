"""Tables of what the data can tell, and how close each method comes to it."""

import numpy as np
import pandas as pd

from galloping.physics.equations import model
from galloping.polynomial import extended, library
from galloping.reproducibility.job import run
from galloping.storage import read_json, write_rows
from galloping.tables.bounds import efficiency, identifiability, weakest


def main() -> None:
    settings, given, output = snakemake.params.settings, snakemake.input, snakemake.output
    models = {}
    for case, path in zip(settings["cases"], given.models, strict=True):
        line = model(read_json(path)["coefficients"])
        terms = library(len(line.states), settings["degree"])
        models[case] = line.on_library(extended(terms, line))
    rows = []
    for cell, path in zip(settings["cells"], given.bounds, strict=True):
        with np.load(path) as file:
            std = file["std"]
        names = {
            "case": cell["case"],
            "recordings": cell["releases"],
            "protocol": cell["protocol"],
            "level": cell["level"],
            "points": cell["points"] or settings["samples"],
        }
        rows += identifiability(models[cell["case"]], std, names)
    write_rows(output.identifiability, rows)
    table = efficiency(pd.read_csv(given.scores), weakest(rows))
    write_rows(output.efficiency, table.to_dict("records"))
    rankings = pd.concat([pd.read_csv(path) for path in given.rankings])
    write_rows(output.further_recordings, rankings.to_dict("records"), list(rankings))


run(main, snakemake)
