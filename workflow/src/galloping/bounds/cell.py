"""The Cramer-Rao bound of a cell, and which further recording would help most."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from galloping.bounds.information import (
    Bound,
    Experiment,
    derivative_bound,
    ranked_experiments,
    state_bound,
)
from galloping.identification.model import IdentifiedModel
from galloping.polynomial import PolynomialModel
from galloping.recording import Recording

# |c| / bound from which a selection with penalty 2 ln N can be trusted.
IDENTIFIABLE = 7.6


@dataclass(frozen=True)
class Noise:
    """Noise of one recording: sigma (n_states,), infinite for a state that is not measured."""

    sigma: np.ndarray

    @classmethod
    def of(cls, protocol: str, level: float, states: np.ndarray, relative: bool) -> Noise:
        """What a protocol adds at a level to the motion `states` (n, n_states)."""
        count = states.shape[1]
        if protocol == "derivative":
            return cls(np.full(count, level))
        sigma = level * (states.std(axis=0) if relative else np.ones(count))
        if protocol == "displacement":
            sigma[count // 2 :] = np.inf
        return cls(sigma)


def free_terms(model: PolynomialModel, equations: Sequence[int]) -> np.ndarray:
    """(n_free, 2) pairs (equation, term) of the terms present in the unknown `equations`."""
    pairs = np.argwhere(model.support)
    return pairs[np.isin(pairs[:, 0], equations)]


def bound(
    model: PolynomialModel,
    equations: Sequence[int],
    protocol: str,
    recordings: Sequence[Recording],
    starts: Sequence[np.ndarray],
    noises: Sequence[Noise],
) -> Bound:
    """The bound on the present terms from recordings of one system, one noise for each.

    starts: (n_states,) true state at the first sample of each recording.
    """
    free = free_terms(model, equations)
    if protocol == "derivative":
        # one system, one noise: the rows of all recordings in one regression
        x = np.concatenate([recording.values for recording in recordings])
        return derivative_bound(model, free, x, noises[0].sigma)
    experiments = [
        Experiment(start, recording.time, noise.sigma)
        for recording, start, noise in zip(recordings, starts, noises, strict=True)
    ]
    return state_bound(model, free, experiments)


def on_library(model: PolynomialModel, found: Bound) -> np.ndarray:
    """Standard deviations of a bound as (n_states, n_terms), NaN for terms without one."""
    std = np.full(model.coefficients.shape, np.nan)
    std[tuple(found.free.T)] = found.std
    return std


def at_the_bound(model: PolynomialModel, found: Bound, rng: np.random.Generator) -> IdentifiedModel:
    """What an efficient method that knows the terms would find: one draw at the bound.

    Where the data leave a coefficient undetermined there is no such method, and no model.
    """
    if not np.all(np.isfinite(found.covariance)):
        reason = "bound: a term is undetermined"
        return IdentifiedModel.refused(model.states, model.terms, reason)
    values, vectors = np.linalg.eigh(found.covariance)
    draw = vectors @ (np.sqrt(np.maximum(values, 0)) * rng.standard_normal(len(values)))
    coefficients = model.coefficients.copy()
    coefficients[tuple(found.free.T)] += draw
    drawn = replace(model, coefficients=coefficients)
    return IdentifiedModel(drawn, "unjudged", standard_errors=on_library(model, found))


def rank_releases(
    model: PolynomialModel,
    equations: Sequence[int],
    time: np.ndarray,
    level: float,
    done: Sequence[tuple[np.ndarray, np.ndarray]],
    options: Sequence[tuple[np.ndarray, np.ndarray]],
) -> list[tuple[int, Bound]]:
    """Which further release would help most: `ranked_experiments`, protocol `state`.

    done, options: pairs of an initial state (n_states,) and the motion from it (n, n_states).
    """

    def experiment(release: tuple[np.ndarray, np.ndarray]) -> Experiment:
        start, states = release
        return Experiment(start, time, Noise.of("state", level, states, True).sigma)

    return ranked_experiments(
        model,
        free_terms(model, equations),
        list(map(experiment, done)),
        list(map(experiment, options)),
    )
