"""Advice on the further recording that would best improve the least certain term."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import floor, log10

import numpy as np

from galloping.arrays import round_down, round_up
from galloping.behaviour.dynamics import Surroundings
from galloping.evaluation.bounds import Experiment, bound_of, information
from galloping.identification.findings import Code
from galloping.identification.identified_model import IdentifiedModel
from galloping.model.polynomial import term_name, velocity_pairs
from galloping.readers.units import coefficient_unit, is_span, state_unit
from galloping.recording.samples import Recording

RELEASE_FACTOR = 1.5  # proposed initial displacement over the largest recorded one, from rest
MAX_RELEASE_FACTOR = 2.0  # later displacement over the same; the model is unknown beyond
MAX_PERIODS = 60  # length of a further recording, periods
# samples in the sum of information; a higher rate is represented by a smaller noise
SAMPLES_PER_PERIOD = 40


@dataclass(frozen=True)
class Advice:
    """Error of the least certain coefficient, now and after each of several further recordings.

    The errors follow from the Cramér-Rao bound. term: the least certain one, with its equation.
    coefficient, standard_error: now, in `unit`. duration_s: of a further recording. options:
    standard error after each further recording, by its description, the best first.
    """

    term: str
    coefficient: float
    standard_error: float
    unit: str
    duration_s: float
    options: Mapping[str, float]


def advise(identified: IdentifiedModel, recording: Recording, period: float) -> Advice | None:
    """Predict how much one more recording would reduce the least certain coefficient's error.

    The further recording has the sensors of the last one. period: s, of the motion. Returns None if
    there is no exact model, since errors of an approximate one are not noise; if the motion only
    repeats, since other terms describe it too; and if no channel measures a state.
    """
    exact = identified.status in ("ok", "not identifiable") and len(identified.covariance)
    driven = identified.is_forced or identified.model.inputs  # which differ in another recording
    repeats = identified.has_finding(Code.MOTION_REPEATS)
    if driven or repeats or not exact or not np.isfinite(identified.sigma[-1]).any():
        return None
    model, states = identified.model, identified.model.states
    is_free = np.diag(identified.covariance) > 0.0
    if not is_free.any():
        return None
    free = np.argwhere(identified.support)[is_free]
    prior_information = np.linalg.inv(identified.covariance[np.ix_(is_free, is_free)])
    now = bound_of(model, free, prior_information)
    weakest = int(np.argmin(now.t))
    if not np.isfinite(now.std[weakest]):  # lost in rounding
        return None
    equation, term = free[weakest]
    duration = min(recording.time[-1] - recording.time[0], MAX_PERIODS * period)
    step = recording.step
    thin = max(round_down(period / SAMPLES_PER_PERIOD / step), 1)
    sigma = np.where(np.isfinite(identified.sigma[-1]), identified.sigma[-1], np.inf)
    first = Experiment(
        identified.initial_states[0],
        thin * step * np.arange(round_up(duration / (thin * step))),
        sigma / np.sqrt(thin),
    )
    ranked = []
    for name, option in _list_further_recordings(first, identified, recording).items():
        try:
            total = prior_information + information(model, free, option)
        except ValueError:  # by this model the motion would not stay bounded
            continue
        error = float(bound_of(model, free, total).std[weakest])
        if np.isfinite(error):
            ranked.append((name, error))
    return Advice(
        f"{term_name(model.terms[term], states)} in d({states[equation]})/dt",
        float(model.coefficients[equation, term]),
        float(now.std[weakest]),
        coefficient_unit(states[equation], model.terms[term], states),
        float(duration),
        dict(sorted(ranked, key=lambda option: option[1])),
    )


def _list_further_recordings(
    first: Experiment, identified: IdentifiedModel, recording: Recording
) -> dict[str, Experiment]:
    states = identified.model.states
    pairs = velocity_pairs(states)
    around = Surroundings.of([recording])
    equilibrium = around.rest(identified.model)
    rest = around.middle if equilibrium is None else equilibrium
    twice = first.time[1] * np.arange(2 * len(first.time))
    of_span = is_span(states)  # which nobody can start in the same state again
    again = "another event like this one" if of_span else "the same motion again"
    options = {
        again: first,
        f"{again}, twice as long": replace(first, time=twice),
        f"{again}, sampled twice as often": replace(first, sigma=first.sigma / np.sqrt(2.0)),
    }
    motion = identified.simulate(first.initial_state, first.time).states
    bounded = np.all(np.isfinite(motion[-1]))
    if bounded:
        options["the time after this one"] = replace(first, initial_state=motion[-1])
    released = () if of_span else pairs or range(len(states))  # nobody pulls at a line
    for k in released:
        if np.isfinite(recording.values[:, k]).any():
            recorded = np.nanmax(np.abs(recording.values[:, k] - rest[k]))
            if not recorded:
                continue
            away = RELEASE_FACTOR * recorded
            height = round(rest[k] + away, 1 - floor(log10(away)))
            start = first.initial_state.copy()
            start[list(pairs.values())] = 0.0
            start[k] = height
            distances = np.abs(identified.simulate(start, first.time).states[:, k] - rest[k])
            if not np.all(distances < MAX_RELEASE_FACTOR * recorded):
                continue
            at_rest = " at rest" if pairs else ""
            place = f"{states[k]} = {height:g} {state_unit(states[k])}".removesuffix(" 1")
            options[f"a release from {place}{at_rest}"] = replace(first, initial_state=start)
    unseen = [v for k, v in pairs.items() if not np.isfinite(first.sigma[v])]
    if unseen and bounded:
        # with the noise of displacements, relative to the motion
        size, sigma = motion.std(axis=0), first.sigma.copy()
        for k, v in pairs.items():
            sigma[v] = min(sigma[v], size[v] * sigma[k] / size[k])
        options[f"{again}, with velocities beside displacements"] = replace(first, sigma=sigma)
    return options
