"""Limit cycles at other wind speeds: predictions of identified models, and the truth."""

from functools import cache, partial

import numpy as np

from galloping.cycles.family import LIBRARY, initial_state
from galloping.cycles.prediction import Prediction, draw_splits, predict, split
from galloping.cycles.ranking import damping_ratios
from galloping.cycles.rows import prediction_rows, simulate_true_amplitudes
from galloping.line.galerkin import STATES
from galloping.reproducibility.job import run
from galloping.storage import write_rows
from galloping.streams import make_generator
from galloping.study.files import read_families
from galloping.trajectory.simulation import Simulator

simulator = cache(partial(Simulator, STATES))  # of the terms of a library


def _predict(identified, case, winds, rng) -> Prediction:
    speed, start = case["wind"]["speed"], np.array(initial_state(case))
    try:
        if identified.status == "refused":
            raise ValueError(identified.verdict)
        damping = damping_ratios(case)
        parts = split([identified], [speed], damping)
        draws = draw_splits(identified, speed, damping, rng)
        return predict(parts, speed, winds, start, draws, simulator(identified.model.terms))
    except (ValueError, np.linalg.LinAlgError) as error:
        return Prediction.nothing(winds, len(STATES), str(error))


def predict_winds(case, protocol, identified, prediction, line, winds, methods, seed):
    """Write limit cycles at other wind speeds: true, and predicted by identified models."""
    models = read_families(identified)
    true = simulate_true_amplitudes(line, winds, Simulator(STATES, LIBRARY))
    rows = []
    for method in methods:
        for k, model in enumerate(models[method]):
            rng = make_generator(seed, "prediction", case, protocol, method, k)
            cell = {"case": case, "protocol": protocol, "method": method, "replicate": k}
            rows += prediction_rows(cell, _predict(model, line, winds, rng), true, model.status)
    write_rows(prediction, rows)


if __name__ == "__main__":
    run(predict_winds, snakemake)
