"""Where displacements that no channel measures count from: the position of rest.

Moved along a displacement, a polynomial model is another one that follows velocities and
accelerations as well. That which rests at zero, without constants, is meant; how far the middle of
the motion lies from there is tried.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from galloping.identification.likelihood.constants import OFF_REST
from galloping.identification.likelihood.integrals import undisplaced
from galloping.identification.likelihood.problem import Problem
from galloping.identification.likelihood.weak_gls import Start, weak_fit


def from_rest(problem: Problem, start: Start) -> Iterator[tuple[Problem, Start]]:
    """The problem without constants, with starts whose displacements are moved by some OFF_REST.

    As they are, and alone, unless each unknown equation is of the velocity of a displacement that
    no recording measures: the curves of such have lost their means.
    """
    missing = [undisplaced(recording).items() for recording in start.recordings]
    pairs = set.intersection(*map(set, missing))
    if not set(problem.unknown) <= {velocity for _, velocity in pairs}:
        yield problem, start
        return
    moving = np.any(problem.terms, axis=1)
    terms = tuple(term for term in problem.terms if any(term))
    without = replace(problem, terms=terms, known=problem.known[:, moving])
    units = np.eye(len(problem.states))[sorted(state for state, _ in pairs)]
    for offset in (0.0 * units[0], *OFF_REST * units, *-OFF_REST * units):
        curves = [
            replace(one, states=one.states + offset * one.states.std(axis=0))
            for one in start.smoothed
        ]
        fit = weak_fit(without, curves, start.penalty)
        yield without, replace(start, smoothed=curves, fit=fit)
