"""Recordings without displacements: of accelerometers, or of velocities, alone."""

import numpy as np
import pytest

from galloping import Recording, derive, maximum_likelihood, polynomial_library, simulate

TERMS = polynomial_library(4, 3)
LINE = derive()
# duration and step, s; release, m; noise, of the deviation
MOTIONS = {
    "velocities": (120, 0.08, (0.6, 0.9), 0.005),
    "velocities for long": (300, 0.04, (0.1, 0.1), 0.02),
    "velocities nearly exact": (90, 0.08, (0.6, 0.9), 0.002),
    "accelerations": (300, 0.04, (0.1, 0.1), 0.05),
}


def recording(name, seed=8):
    """Of the line's velocities, or its accelerations with a drifting offset, and nothing else."""
    duration, step, release, noise = MOTIONS[name]
    time = np.arange(0, duration, step)
    motion = simulate(LINE, [*release, 0, 0], time).states
    noise = noise * np.random.default_rng(seed).standard_normal((len(time), 2))
    values, rates = np.full((2, *motion.shape), np.nan)
    if name != "accelerations":
        values[:, 2:] = motion[:, 2:] + noise * motion[:, 2:].std(axis=0)
        return Recording(time, LINE.states, values)
    exact = LINE(motion)[:, 2:]
    drift = 0.3 + 0.2 * time[:, None] / time[-1]
    rates[:, 2:] = exact + noise * exact.std(axis=0) + drift
    unknown = np.array([False, False, True, True])
    return Recording(time, LINE.states, values, rates=rates, unknown_offsets=unknown)


SLOW = [
    pytest.param(name, marks=pytest.mark.slow)
    for name in ("velocities for long", "velocities nearly exact")
]


@pytest.mark.parametrize("name", ["velocities", *SLOW, "accelerations"])
def test_the_line_is_found_without_its_displacements(name):
    identified = maximum_likelihood(recording(name), TERMS)
    assert identified.status == "ok", identified.reason
    assert identified.model.terms == TERMS
    true = LINE.on_library(TERMS).coefficients
    assert np.array_equal(identified.model.coefficients != 0, true != 0)
    wrong = (identified.model.coefficients - true) / identified.standard_errors
    assert np.nanmax(np.abs(wrong)) < 4.5
    assert np.isnan(identified.sigma[:, :2]).all()
