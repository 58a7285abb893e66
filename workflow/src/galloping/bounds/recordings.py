"""The Cramer-Rao bound from recordings of a line, models drawn at it, and which further recording
would help identification most.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from galloping.bounds.information import (
    Bound,
    Experiment,
    bound_of,
    derivative_bound,
    fisher_information,
    ranked_experiments,
    weighted_sensitivities,
)
from galloping.identification.model import IdentifiedModel
from galloping.intervals import IDENTIFIABLE
from galloping.measurement.measuring import Motion, measure, noises_of
from galloping.measurement.protocols import Noise
from galloping.physics.equations import EQUATIONS
from galloping.polynomial import PolynomialModel, term_name
from galloping.seeds import generator
from galloping.simulation import Simulator


def free_terms(model: PolynomialModel, equations: Sequence[int]) -> np.ndarray:
    """(n_free, 2) pairs (equation, term) of the terms present in the unknown `equations`."""
    pairs = np.argwhere(model.support)
    return pairs[np.isin(pairs[:, 0], equations)]


def bounds_of(
    model: PolynomialModel,
    equations: Sequence[int],
    motions: Sequence[Motion],
    noises: Sequence[Noise],
    samplings: Sequence[Sequence[np.ndarray | slice]],
) -> list[Bound]:
    """The bound on the present terms from recordings of one system, by each of some samplings.

    motions, noises: one for each recording. samplings: indices of the samples of each recording.
    Raises ValueError for derivatives of exact states where their noise differs.
    """
    free = free_terms(model, equations)
    rates = [n.derivatives if np.any(np.isfinite(n.derivatives)) else None for n in noises]
    if not any(np.any(noise.states) for noise in noises):
        if any(np.any(noise.derivatives != noises[0].derivatives) for noise in noises):
            raise ValueError("bound: derivatives of exact states need the same noise")
        # one system, one noise: the rows of all recordings in one regression
        x = ([m.states[k] for m, k in zip(motions, rows, strict=True)] for rows in samplings)
        sigma = noises[0].derivatives
        return [derivative_bound(model, free, np.concatenate(each), sigma) for each in x]
    # a motion is followed once: to be free where it starts is to be free where samples begin
    whole = [
        weighted_sensitivities(
            model, free, Experiment(motion.states[0], motion.time, noise.states, rate)
        )
        for motion, noise, rate in zip(motions, noises, rates, strict=True)
    ]
    totals = (
        sum(fisher_information(each[k], len(free)) for each, k in zip(whole, rows, strict=True))
        for rows in samplings
    )
    return [bound_of(model, free, total) for total in totals]


def on_library(model: PolynomialModel, found: Bound) -> np.ndarray:
    """Standard deviations of a bound as (n_states, n_terms), NaN for terms without one."""
    std = np.full(model.coefficients.shape, np.nan)
    std[tuple(found.free.T)] = found.std
    return std


def at_the_bound(
    model: PolynomialModel, found: Bound, rng: np.random.Generator, lacking: Sequence[str] = ()
) -> IdentifiedModel:
    """What an efficient method that knows the terms would find: one draw at the bound.

    lacking: names of the terms that the candidate library lacks. Where there are any, or the data
    leave a coefficient undetermined, there is no such method, and no model.
    """
    if lacking:
        reason = f"bound: the library lacks {', '.join(lacking)}"
        return IdentifiedModel.refused(model.states, model.terms, reason)
    if not np.all(np.isfinite(found.covariance)):
        reason = "bound: a term is undetermined"
        return IdentifiedModel.refused(model.states, model.terms, reason)
    values, vectors = np.linalg.eigh(found.covariance)
    draw = vectors @ (np.sqrt(np.maximum(values, 0)) * rng.standard_normal(len(values)))
    coefficients = model.coefficients.copy()
    coefficients[tuple(found.free.T)] += draw
    drawn = replace(model, coefficients=coefficients)
    return IdentifiedModel(drawn, "unjudged", standard_errors=on_library(model, found))


def cell_bounds(
    model: PolynomialModel,
    equations: Sequence[int],
    motions: Sequence[Motion],
    measurement: Mapping,
    name: Sequence[str],
) -> list[Bound]:
    """The bounds of a cell: one for all replicates, or each its own where their times differ.

    motions, measurement, name: what its recordings are drawn from, see `measure`. None without
    noise.
    """
    if measurement["level"] == 0:
        return []
    motions = motions[: measurement["recordings"]]
    protocol, level, relative = (measurement[k] for k in ("protocol", "level", "relative"))
    noises = noises_of(motions, protocol, level, relative)
    times_differ = measurement["samples"] < len(motions[0].time)
    replicates = measurement["replicates"] if times_differ else 1
    samplings = [
        [np.searchsorted(motions[0].time, recording.time) for recording in recordings]
        for recordings in measure(motions, name=name, **{**measurement, "replicates": replicates})
    ]
    return bounds_of(model, equations, motions, noises, samplings)


def models_at(
    model: PolynomialModel,
    bounds: Sequence[Bound],
    measurement: Mapping,
    name: Sequence[str],
    lacking: Sequence[str] = (),
) -> list[IdentifiedModel]:
    """What an efficient method would find from each replicate; without noise, the line itself.

    lacking: names of the terms that the candidate library lacks.
    """
    if not bounds:
        return [IdentifiedModel(model, "unjudged")]
    return [
        at_the_bound(
            model,
            bounds[k % len(bounds)],
            generator(measurement["seed"], "bound", *name, k),
            lacking,
        )
        for k in range(measurement["replicates"])
    ]


def no_models(model: PolynomialModel, measurement: Mapping, reason: str) -> list[IdentifiedModel]:
    """None from any replicate, for `reason`."""
    refused = IdentifiedModel.refused(model.states, model.terms, f"bound: {reason}")
    return [refused] * measurement["replicates"]


def deviations(model: PolynomialModel, bounds: Sequence[Bound], candidates: int) -> np.ndarray:
    """(n_bounds, n_states, n_terms) standard deviations, NaN without noise.

    candidates: how many terms of the model, the first, the candidate library has. No method
    estimates the others: they have no bound, NaN.
    """
    if not bounds:
        return np.full((1, *model.coefficients.shape), np.nan)
    std = np.stack([on_library(model, each) for each in bounds])
    std[:, :, candidates:] = np.nan
    return std


def ranked_releases(
    line: PolynomialModel, first: Motion, level: float, heights: Sequence[float]
) -> list[dict]:
    """One row a release from rest at one of the `heights` (m) in either direction, the best first.

    first: the recording that there is. level: of the noise on every state, in units of its
    deviation. Releases from which the line's motion ends early are left out; where that of `first`
    does, or there is no noise, which leaves nothing to learn, all are.
    """
    if first.status != "ok" or level == 0:
        return []
    simulator = Simulator(line.states, line.terms)
    names, options = [], []
    for state in ("q_v", "q_w"):
        for height in heights:
            start = first.states[0].copy()
            start[line.states.index(state)] = height
            motion = simulator(line, start, first.time)
            if motion.status == "ok":
                names.append(f"{state}(0) = {height:g} m")
                options.append(_noisy(first.time, motion.states, level))
    done = [_noisy(first.time, first.states, level)]
    rows = []
    for k, bound in ranked_experiments(line, free_terms(line, tuple(EQUATIONS)), done, options):
        weakest = int(np.argmin(bound.t))
        equation, term = bound.free[weakest]
        rows.append(
            {
                "release": names[k],
                "level": level,
                "weakest_t": float(bound.t[weakest]),
                "weakest_term": f"{EQUATIONS[equation]} {term_name(line.terms[term], line.states)}",
                "identifiable": bool(bound.t[weakest] > IDENTIFIABLE),
            }
        )
    return rows


def _noisy(time: np.ndarray, states: np.ndarray, level: float) -> Experiment:
    return Experiment(states[0], time, level * states.std(axis=0))
