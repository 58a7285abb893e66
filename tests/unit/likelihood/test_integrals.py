"""Recordings without displacements: of accelerometers, or of velocities, alone."""

import numpy as np
import pytest

from galloping import Recording, derive, maximum_likelihood, polynomial_library, simulate

TERMS = polynomial_library(4, 3)
LINE = derive()
TIME = np.arange(0, 300, 0.04)
MOTION = simulate(LINE, [0.1, 0.1, 0, 0], TIME).states
NOISE = {"velocities": 0.02, "accelerations": 0.05}  # of the deviation


def recording(quantity, seed=8):
    """Of the line's velocities, or its accelerations with a drifting offset, and nothing else."""
    noise = NOISE[quantity] * np.random.default_rng(seed).standard_normal((len(TIME), 2))
    values, rates = np.full((2, *MOTION.shape), np.nan)
    if quantity == "velocities":
        values[:, 2:] = MOTION[:, 2:] + noise * MOTION[:, 2:].std(axis=0)
        return Recording(TIME, LINE.states, values)
    exact = LINE(MOTION)[:, 2:]
    drift = 0.3 + 0.2 * TIME[:, None] / TIME[-1]
    rates[:, 2:] = exact + noise * exact.std(axis=0) + drift
    unknown = np.array([False, False, True, True])
    return Recording(TIME, LINE.states, values, rates=rates, unknown_offsets=unknown)


@pytest.mark.parametrize("quantity", ["velocities", "accelerations"])
def test_the_line_is_found_without_its_displacements(quantity):
    identified = maximum_likelihood(recording(quantity), TERMS)
    assert identified.status == "ok", identified.reason
    assert identified.model.terms == TERMS
    true = LINE.on_library(TERMS).coefficients
    assert np.array_equal(identified.model.coefficients != 0, true != 0)
    wrong = (identified.model.coefficients - true) / identified.standard_errors
    assert np.nanmax(np.abs(wrong)) < 4.5
    assert np.isnan(identified.sigma[:, :2]).all()
