"""Scores of all models of one cell, and their motions for the figures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from galloping.evaluation.reconstruction import Reconstruction, summarise
from galloping.evaluation.score import Truth, score
from galloping.identification.model import IdentifiedModel
from galloping.simulation import Simulator, Trajectory


def evaluate(
    truth: Truth, models: Mapping[str, Sequence[IdentifiedModel]], deviations: np.ndarray
) -> tuple[list[dict], dict[str, Reconstruction]]:
    """One row of scores a model, and what the models of each method do.

    models: replicates by method. deviations: (1 or n_replicates, n_states, n_terms), the
    Cramer-Rao bound. All methods together: importing and compiling the integrator costs more than
    simulating the models of several methods.
    """
    simulator = Simulator(truth.model.states, truth.model.terms)
    rows, reconstructions = [], {}
    for method, replicates in models.items():
        motions = reconstruct(simulator, truth, replicates)
        bounds = np.broadcast_to(deviations, (len(replicates), *deviations.shape[1:]))
        scores = list(map(score, [truth] * len(motions), replicates, motions, bounds))
        rows += [{"method": method, "replicate": k, **row} for k, row in enumerate(scores)]
        quality = np.array([row["r2_q_v"] + row["r2_q_w"] for row in scores])
        states = np.stack([motion.states for motion in motions])
        reconstructions[method] = summarise(truth.time, states, quality)
    return rows, reconstructions


def reconstruct(
    simulator: Simulator, truth: Truth, replicates: Sequence[IdentifiedModel]
) -> list[Trajectory]:
    """The motion of each model from the true initial state."""
    motions = []
    for identified in replicates:
        if identified.status == "refused":
            nowhere = np.full_like(truth.states, np.nan)
            motions.append(Trajectory(truth.time, nowhere, identified.verdict))
        else:
            motions.append(simulator(identified.model, truth.states[0], truth.time))
    return motions
