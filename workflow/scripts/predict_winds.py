"""Limit cycles at other wind speeds, predicted from identified models, beside the truth."""

from functools import cache

import numpy as np

from galloping.cycles.family import LIBRARY, initial_state
from galloping.cycles.prediction import Prediction, predict, split
from galloping.cycles.ranking import DAMPING
from galloping.cycles.rows import prediction_rows, steady_truth
from galloping.physics.equations import STATES
from galloping.reproducibility.job import run
from galloping.seeds import generator
from galloping.simulation import Simulator
from galloping.storage import write_rows
from galloping.study.loading import load


def _predicted(identified, case, winds, rng) -> Prediction:
    damping = {state: case["damping"][key] for state, key in DAMPING}
    speed, start = case["wind"]["speed"], np.array(initial_state(case))
    try:
        if identified.status == "refused":
            raise ValueError(identified.verdict)
        parts = split([identified], [speed], damping)
        terms = identified.model.terms
        return predict(parts, speed, winds, start, rng, _simulator(terms))
    except (ValueError, np.linalg.LinAlgError) as error:
        nothing = np.full((len(winds), len(STATES)), np.nan)
        unresolved = np.ones(len(winds))
        return Prediction(np.array(winds), nothing, nothing, nothing, unresolved, str(error))


@cache
def _simulator(terms) -> Simulator:
    return Simulator(STATES, terms)


def main() -> None:
    settings, names = snakemake.params.settings, dict(snakemake.wildcards.items())
    case, winds = settings["case"], settings["winds"]
    read = load(settings["reads"], dict(snakemake.input.items()))
    models = {method: of for family in read["identified"].values() for method, of in family.items()}
    true = steady_truth(case, winds, Simulator(STATES, LIBRARY))
    rows = []
    for method in settings["methods"]:
        for k, identified in enumerate(models[method]):
            rng = generator(settings["seed"], "prediction", *names.values(), method, k)
            cell = {**names, "method": method, "replicate": k}
            predicted = _predicted(identified, case, winds, rng)
            rows += prediction_rows(cell, predicted, true, identified.verdict)
    write_rows(snakemake.output.prediction, rows)


run(main, snakemake)
