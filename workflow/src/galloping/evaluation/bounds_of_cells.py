"""Bounds of a study cell, models drawn at them, and the most useful further recording."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from galloping.evaluation import bounds as cramer_rao
from galloping.evaluation.bounds import Bound, Experiment
from galloping.identification.findings import Code, Finding
from galloping.identification.identified_model import IdentifiedModel
from galloping.line.galerkin import EQUATIONS
from galloping.model.intervals import MIN_IDENTIFIABLE_RATIO, draw_normal
from galloping.model.polynomial import PolynomialModel, term_name
from galloping.recording.measurement import Motion, Noise, noises_of, recordings_of
from galloping.results import DISPLACEMENT_COLUMNS
from galloping.streams import make_generator
from galloping.trajectory.simulation import Simulator


def at_the_bound(
    model: PolynomialModel, found: Bound, rng: np.random.Generator, lacking: Sequence[str] = ()
) -> IdentifiedModel:
    """Create a model with the true terms and random errors at the Cramér-Rao bound.

    It is the result of an efficient method that knows the terms. lacking: names of the terms that
    the candidate library lacks. There is no such method, and no model, if any are lacking or a
    coefficient is undetermined.
    """
    if lacking:
        why = Finding.of(Code.TERMS_NOT_IN_LIBRARY, terms=", ".join(lacking))
        return IdentifiedModel.refused(model.states, model.terms, [why])
    if not np.all(np.isfinite(found.covariance)):
        why = Finding.of(Code.TERM_UNDETERMINED)
        return IdentifiedModel.refused(model.states, model.terms, [why])
    coefficients, free = model.coefficients.copy(), tuple(found.free.T)
    coefficients[free] = draw_normal(coefficients[free], found.covariance, 1, rng)[0]
    drawn_model = replace(model, coefficients=coefficients)
    return IdentifiedModel(drawn_model, standard_errors=cramer_rao.on_library(model, found))


def cell_bounds(
    model: PolynomialModel, motions: Sequence[Motion], measurement: Mapping, name: Sequence[str]
) -> list[Bound]:
    """Compute the Cramér-Rao bounds for a set of simulated recordings of one line.

    There is one bound, or one for each noise realisation if their times differ. motions,
    measurement, name: as for `recordings_of`. Empty without noise.
    """
    if measurement["level"] == 0:
        return []
    motions = motions[: measurement["recordings"]]
    protocol, level, relative = (measurement[k] for k in ("protocol", "level", "relative"))
    noises = noises_of(motions, protocol, level, relative)
    times_differ = measurement["samples"] < len(motions[0].time)
    replicates = measurement["replicates"] if times_differ else 1
    drawn = recordings_of(motions, name=name, **{**measurement, "replicates": replicates})
    time = motions[0].time
    samplings = [[np.searchsorted(time, one.time) for one in recordings] for recordings in drawn]
    return cramer_rao.bounds_of(model, tuple(EQUATIONS), motions, noises, samplings)


def models_at(
    model: PolynomialModel,
    bounds: Sequence[Bound],
    measurement: Mapping,
    name: Sequence[str],
    lacking: Sequence[str] = (),
) -> list[IdentifiedModel]:
    """Create models with random errors at the Cramér-Rao bound, one for each noise realisation.

    Without noise, the model is that of the line.
    """
    if not bounds:
        return [IdentifiedModel(model)]
    models = []
    for k in range(measurement["replicates"]):
        rng = make_generator(measurement["seed"], "bound", *name, k)
        models.append(at_the_bound(model, bounds[k % len(bounds)], rng, lacking))
    return models


def deviations(model: PolynomialModel, bounds: Sequence[Bound], candidates: int) -> np.ndarray:
    """Return the standard deviations of several Cramér-Rao bounds as one array.

    Returns (n_bounds, n_states, n_terms), NaN without noise. candidates: number of terms of the
    model, the first ones, in the candidate library. No method estimates the others: they have no
    bound, NaN.
    """
    if not bounds:
        return np.full((1, *model.coefficients.shape), np.nan)
    std = np.stack([cramer_rao.on_library(model, each) for each in bounds])
    std[:, :, candidates:] = np.nan
    return std


def ranked_releases(
    line: PolynomialModel, first: Motion, level: float, heights: Sequence[float]
) -> list[dict]:
    """Rank initial displacements for a second recording by the information they would add.

    The best is first. They are at rest at one of the `heights` (m) in either direction, a row each.
    first: the existing recording. level: of the noise on every state, over its deviation. Initial
    displacements from which the motion diverges, or leaves a state at rest, are left out. There are
    no rows if the motion of `first` does so, or if there is no noise.
    """
    if first.status != "ok" or level == 0:
        return []
    simulator = Simulator(line.states, line.terms)
    free = cramer_rao.free_terms(line, tuple(EQUATIONS))
    try:
        before = _noisy_information(line, free, first.time, first.states, level)
    except ValueError:  # the line diverges or does not move
        return []
    rows: list[dict] = []
    for state, height in product(DISPLACEMENT_COLUMNS, heights):
        start = first.states[0].copy()
        start[DISPLACEMENT_COLUMNS[state]] = height
        motion = simulator(line, start, first.time)
        if motion.status != "ok":
            continue
        try:
            added = _noisy_information(line, free, first.time, motion.states, level)
        except ValueError:
            continue
        bound = cramer_rao.bound_of(line, free, before + added)
        weakest = int(np.argmin(bound.t))
        equation, term = bound.free[weakest]
        rows.append({
            "initial_displacement": f"{state}(0) = {height:g} m",
            "level": level,
            "min_coefficient_over_bound": float(bound.t[weakest]),
            "weakest_term": f"{EQUATIONS[equation]} {term_name(line.terms[term], line.states)}",
            "identifiable": bool(bound.t[weakest] > MIN_IDENTIFIABLE_RATIO),
        })  # fmt: skip
    return sorted(rows, key=lambda row: -row["min_coefficient_over_bound"])


def _noisy_information(
    line: PolynomialModel, free: np.ndarray, time: np.ndarray, states: np.ndarray, level: float
) -> np.ndarray:
    """Compute the information of noisy states; raise ValueError if the line diverges or is still.

    level: of the noise on every state, over its deviation.
    """
    sigma = level * states.std(axis=0)
    cramer_rao.check_noise(line.states, Noise(sigma, np.full(len(sigma), np.inf)))
    return cramer_rao.information(line, free, Experiment(states[0], time, sigma))
