"""Where displacements that no channel measures count from: the position of rest.

Moved along a displacement, a polynomial model is another one that follows velocities and
accelerations as well. That which rests at zero, without constants, is meant; how far the middle of
the motion lies from there is tried.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from galloping.identification.likelihood.integrals import undisplaced
from galloping.identification.likelihood.problem import Problem
from galloping.identification.likelihood.result import by
from galloping.identification.likelihood.weak_gls import Start, weak_fit
from galloping.identification.model import BY_TERM, NO_MODEL, IdentifiedModel
from galloping.polynomial import Exponents, PolynomialModel

# How far the middle of a motion may lie from rest, in deviations of the displacement. Measured on
# accelerations of the study's line, whose is 0.15: starts 0.0 to 0.1 off lead to the model always.
OFF_REST = 0.2

ALONE = "displacements are not measured, and one alone of several starts leads to a model"


def from_rest(
    problem: Problem, start: Start, identify: Callable[[Problem, Start], IdentifiedModel]
) -> IdentifiedModel:
    """What `identify` makes of the problem and the start.

    Where each unknown equation is of the velocity of a displacement that no recording measures, the
    curves of which have lost their means: of the problem without constants, and starts moved by
    some OFF_REST, the best model; not `ok` where they lead to no other that follows the data, for
    a better one may then have been missed. Raises what `identify` raises, where no start
    gives a model.
    """
    missing = [undisplaced(recording).items() for recording in start.recordings]
    pairs = set.intersection(*map(set, missing))
    if not set(problem.unknown) <= {velocity for _, velocity in pairs}:
        return identify(problem, start)
    moving = np.any(problem.terms, axis=1)
    terms = tuple(term for term in problem.terms if any(term))
    without = replace(problem, terms=terms, known=problem.known[:, moving])
    units = np.eye(len(problem.states))[sorted(state for state, _ in pairs)]
    made, objections = [], []
    offsets = [*OFF_REST * units, *-OFF_REST * units, 0.0 * units[0]]
    for k, offset in enumerate(offsets, 1):
        try:
            found = identify(without, _moved(without, start, offset))
            made.append(by([f"rest {k} of {len(offsets)}"], found))
        except NO_MODEL as objection:
            objections.append(objection)
    if not made:
        raise objections[0]
    best = _on_library(min(made, key=_merit), problem.terms, moving)
    if best.status == "ok" and sum(map(_follows, made)) < 2:
        return replace(best, status="not identifiable", reason=ALONE)
    return best


def _moved(problem: Problem, start: Start, offset: np.ndarray) -> Start:
    """The start with its curves moved by `offset` (n_states,) deviations."""
    curves = [
        replace(one, states=one.states + offset * one.states.std(axis=0)) for one in start.smoothed
    ]
    return replace(start, smoothed=curves, fit=weak_fit(problem, curves, start.penalty))


def _follows(identified: IdentifiedModel) -> bool:
    return identified.status in ("ok", "not identifiable")


def _on_library(
    identified: IdentifiedModel, terms: tuple[Exponents, ...], own: np.ndarray
) -> IdentifiedModel:
    """What was identified on the terms `own` (n_terms,) boolean, on all `terms`."""

    def spread(values: np.ndarray, elsewhere: float) -> np.ndarray:
        whole = np.full((len(values), len(terms)), elsewhere)
        whole[:, own] = values
        return whole

    coefficients = spread(identified.model.coefficients, 0.0)
    model = PolynomialModel(identified.model.states, terms, coefficients, identified.model.inputs)
    errors = {name: spread(getattr(identified, name), np.nan) for name in BY_TERM}
    return replace(identified, model=model, **errors)


def _merit(identified: IdentifiedModel) -> tuple[int, float]:
    """The least is best: of the fewest terms that follow the data, else of the best forecasts."""
    if _follows(identified):
        return 0, float(identified.support.sum())
    if identified.status == "approximate":
        return 1, -identified.diagnostics["forecast_r2"]
    return 2, 0.0
