"""Random forces beside a wind that was measured, and on a span that is not linear, in motion made
without the code under test.
"""

import numpy as np
import pytest
from ambient import displacements, stepped

import galloping
from galloping import IdentifiedModel, Input, Recording, forecast, maximum_likelihood
from galloping.line.gusts import wind_speed
from galloping.model.intervals import decay_interval

STATES, RATE, EVERY = ("y", "dy"), 5.0, 20
TERMS, ALLOWED = galloping.library(("wind(U)",), STATES, ("U",))
STIFFNESS, DAMPING, GROWTH, PUSH, STRENGTH = 6.0, 0.12, 0.008, 0.004, 0.03
TRUE = {(1, 0, 0): -STIFFNESS, (0, 1, 0): -DAMPING, (0, 1, 1): GROWTH, (0, 0, 2): PUSH}


@pytest.fixture(scope="module")
def gusty():
    """A mode in gusts about 8 m/s and in white forces; steps of 0.01 s."""
    rng, time = np.random.default_rng(21), np.arange(0.0, 600.0, 1.0 / RATE)
    speed = wind_speed(
        time, mean=8.0, intensity=0.25, length_scale=50.0, spectrum="kaimal", rng=rng
    )
    wind = Input(time, speed)
    step = 1.0 / RATE / EVERY
    now = wind(np.minimum(np.arange(len(time) * EVERY) * step, time[-1]))
    pushed = PUSH * now**2 + STRENGTH * rng.standard_normal(len(now)) / np.sqrt(step)
    forces = np.stack([pushed, DAMPING - GROWTH * now], axis=1).reshape(len(time), EVERY, 2)
    y, _ = stepped(lambda y, velocity, now: now[0] - STIFFNESS * y - now[1] * velocity,
                   forces, step, PUSH * 64 / STIFFNESS)  # fmt: skip
    values = np.full((len(time), 2), np.nan)
    values[:, 0] = y + 0.05 * y.std() * rng.standard_normal(len(time))
    return Recording(time, STATES, values, inputs={"U": wind})


@pytest.fixture(scope="module")
def found(gusty):
    return maximum_likelihood(gusty, TERMS, allowed=ALLOWED)


def coefficient(found, term):
    j = found.model.terms.index(term)
    return found.model.coefficients[1, j], found.standard_errors[1, j]


def test_forces_are_told_from_the_wind(found):
    assert found.is_forced and found.status == "ok"
    assert {found.model.terms[j] for _, j in np.argwhere(found.support)} == set(TRUE)
    for term, true in TRUE.items():
        value, error = coefficient(found, term)
        assert abs(value - true) < 3.0 * error
    assert np.sqrt(found.forces[1, 1]) == pytest.approx(STRENGTH, rel=0.1)
    assert found.recorded("U")[0] < 8.0 < found.recorded("U")[1]


def test_what_is_known_of_coefficients_is_kept(gusty, found):
    known = [
        galloping.Coefficient("dy", (0, 1, 0), -DAMPING),
        galloping.Coefficient("dy", (0, 0, 2), PUSH, 1e-5),
    ]
    told = maximum_likelihood(gusty, TERMS, allowed=ALLOWED, forced=("y",), coefficients=known)
    assert coefficient(told, (0, 1, 0)) == (-DAMPING, 0.0)
    value, error = coefficient(told, (0, 0, 2))
    assert error <= 1e-5 < coefficient(found, (0, 0, 2))[1]
    assert abs(value - PUSH) < 3.0 * error
    value, error = coefficient(told, (0, 1, 1))
    assert error < coefficient(found, (0, 1, 1))[1] / 3.0
    assert abs(value - GROWTH) < 3.0 * error
    assert told.covariance.shape == (told.support.sum(), told.support.sum())


def test_a_saved_model_holds_in_other_winds(gusty, found, tmp_path):
    found.save(tmp_path / "model.json")
    loaded = IdentifiedModel.load(tmp_path / "model.json")
    assert loaded == found
    for speed in (6.0, 8.0, 10.0):
        (condition,) = galloping.assess(loaded, {"U": speed}).conditions
        (mode,) = condition.equilibria[0].modes
        true = (DAMPING - GROWTH * speed) / 2.0 / np.sqrt(STIFFNESS)
        assert mode.damping.low < true < mode.damping.high
    shown, hidden = gusty[:2850], gusty[2850:]
    ahead = forecast(loaded, shown, hidden.time)
    inside = (hidden.values[:, 0] > ahead.low[:, 0]) & (hidden.values[:, 0] < ahead.high[:, 0])
    assert inside.mean() > 0.75
    calm = forecast(loaded, shown, hidden.time, inputs={"U": 2.0})
    assert np.mean(calm.median[-50:, 0]) < np.mean(ahead.median[-50:, 0]) - 0.01


def test_the_summary_says_at_which_wind(gusty, found):
    told = galloping.summarise(found, gusty, allowed=ALLOWED).dynamics
    assert told.kind == "forced" and told.at["U"] == pytest.approx(8.0, abs=0.5)


STIFF, DAMPED = np.array([7.0, 1.8]), np.array([0.02, 0.03])
CUBIC = galloping.polynomial_library(4, 3)


@pytest.fixture(scope="module")
def coupled():
    """A span whose coordinates pull at each other, moved so far that it shows; steps of 0.01 s."""
    rng, step, every, count = np.random.default_rng(3), 0.01, 12, 2500

    def acceleration(q, velocity, push):
        pull = np.array([2.0 * q[0] ** 2 + 0.6 * q[1] ** 2, 1.2 * q[0] * q[1]])
        return -STIFF * q - DAMPED * velocity + pull + push

    pushes = np.array([0.12, 0.1]) * rng.standard_normal((count, every, 2)) / np.sqrt(step)
    states = np.hstack(stepped(acceleration, pushes, step, np.zeros(2)))
    noisy = states + 0.03 * states.std(axis=0) * rng.standard_normal(states.shape)
    recording = displacements(np.arange(count) * every * step, *noisy[:, :2].T)
    return recording, maximum_likelihood(recording, CUBIC)


def test_finds_what_couples_the_coordinates(coupled):
    _, found = coupled
    assert found.is_forced and found.status == "ok"
    nonlinear = np.array(CUBIC).sum(axis=1) > 1
    chosen = {(i, CUBIC[j]) for i, j in np.argwhere(found.support & nonlinear)}
    cubes = {(2, (0, 0, 3, 0)), (3, (0, 0, 0, 3)), (2, (3, 0, 0, 0)), (3, (0, 3, 0, 0))}
    pulls = {(2, (2, 0, 0, 0)): 2.0, (2, (0, 2, 0, 0)): 0.6, (3, (1, 1, 0, 0)): 1.2}
    assert chosen - cubes == pulls.keys()
    for (i, term), true in pulls.items():
        place = i, CUBIC.index(term)
        assert abs(found.model.coefficients[place] - true) < 3.0 * found.standard_errors[place]


def test_net_damping_at_rest_is_held(coupled):
    moved, found = coupled
    for i, own in ((2, (0, 0, 1, 0)), (3, (0, 0, 0, 1))):
        j = CUBIC.index(own)
        decay, error = -found.model.coefficients[i, j] / 2, found.standard_errors[i, j] / 2
        low, high = decay_interval(decay, error, float(np.ptp(moved.time)))
        assert low <= DAMPED[i - 2] / 2 <= high
