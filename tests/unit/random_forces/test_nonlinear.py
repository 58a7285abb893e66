"""Random forces that move a nonlinear system, made without the code under test."""

import numpy as np
import pytest
from ambient import displacements

from galloping import maximum_likelihood
from galloping.intervals import decay_interval
from galloping.polynomial import library

STIFFNESS, DAMPING = np.array([7.0, 1.8]), np.array([0.02, 0.03])
TERMS = library(4, 3)


@pytest.fixture(scope="module")
def moved():
    """A span whose coordinates pull at each other, moved so far that it shows; steps of 0.01 s."""
    rng, step, every, count = np.random.default_rng(3), 0.01, 12, 2500
    q, velocity = np.zeros(2), np.zeros(2)
    states = np.empty((count, 4))
    for k in range(count * every):
        if k % every == 0:
            states[k // every] = [*q, *velocity]
        pulled = np.array([2.0 * q[0] ** 2 + 0.6 * q[1] ** 2, 1.2 * q[0] * q[1]])
        pushed = np.array([0.12, 0.1]) * rng.standard_normal(2) / np.sqrt(step)
        velocity += step * (-STIFFNESS * q - DAMPING * velocity + pulled + pushed)
        q += step * velocity
    noisy = states + 0.03 * states.std(axis=0) * rng.standard_normal(states.shape)
    return displacements(np.arange(count) * every * step, *noisy[:, :2].T)


@pytest.fixture(scope="module")
def found(moved):
    return maximum_likelihood(moved, TERMS)


def test_finds_what_couples_the_coordinates(found):
    assert found.is_forced and found.status == "ok"
    nonlinear = np.array(TERMS).sum(axis=1) > 1
    chosen = {(i, TERMS[j]) for i, j in np.argwhere(found.support & nonlinear)}
    cubes = {(2, (0, 0, 3, 0)), (3, (0, 0, 0, 3)), (2, (3, 0, 0, 0)), (3, (0, 3, 0, 0))}
    pulls = {(2, (2, 0, 0, 0)): 2.0, (2, (0, 2, 0, 0)): 0.6, (3, (1, 1, 0, 0)): 1.2}
    assert chosen - cubes == pulls.keys()
    for (i, term), true in pulls.items():
        place = i, TERMS.index(term)
        assert abs(found.model.coefficients[place] - true) < 3.0 * found.standard_errors[place]


def test_net_damping_at_rest_is_held(found, moved):
    for i, own in ((2, (0, 0, 1, 0)), (3, (0, 0, 0, 1))):
        j = TERMS.index(own)
        decay, error = -found.model.coefficients[i, j] / 2, found.standard_errors[i, j] / 2
        low, high = decay_interval(decay, error, float(np.ptp(moved.time)))
        assert low <= DAMPING[i - 2] / 2 <= high
