"""Which further recording of a line would help identification most."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from galloping.bounds.cell import free_terms
from galloping.bounds.identifiable import IDENTIFIABLE
from galloping.bounds.information import Experiment, ranked_experiments
from galloping.measurement.measuring import Motion
from galloping.physics.equations import EQUATIONS
from galloping.polynomial import PolynomialModel, term_name
from galloping.simulation import Simulator


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
                options.append(_experiment(first.time, motion.states, level))
    done = [_experiment(first.time, first.states, level)]
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


def _experiment(time: np.ndarray, states: np.ndarray, level: float) -> Experiment:
    return Experiment(states[0], time, level * states.std(axis=0))
