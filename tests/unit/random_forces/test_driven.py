"""Random forces beside a wind that was measured, in motion made without the code under test."""

import numpy as np
import pytest

from galloping import Input, maximum_likelihood, summarise
from galloping.field.assess import assess
from galloping.field.summary import forecast
from galloping.identification.model import IdentifiedModel
from galloping.identification.problem import Coefficient
from galloping.physics.gusts import wind_speed
from galloping.recording import Recording
from galloping.terms import parse

STATES, RATE, EVERY = ("y", "dy"), 5.0, 20
TERMS, ALLOWED = parse(("wind(U)",), STATES, ("U",))
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
    y, velocity, moved = PUSH * 64 / STIFFNESS, 0.0, np.empty(len(now))
    for k, damping in enumerate(DAMPING - GROWTH * now):
        moved[k] = y
        velocity += step * (pushed[k] - STIFFNESS * y - damping * velocity)
        y += step * velocity
    values = np.full((len(time), 2), np.nan)
    values[:, 0] = moved[::EVERY] + 0.05 * moved.std() * rng.standard_normal(len(time))
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
    known = [Coefficient("dy", (0, 1, 0), -DAMPING), Coefficient("dy", (0, 0, 2), PUSH, 1e-5)]
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
    for speed in (6.0, 8.0, 10.0):
        (condition,) = assess(loaded, {"U": speed}).conditions
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
    said = str(summarise(found, gusty, allowed=ALLOWED))
    assert "Random forces keep the motion up" in said
    assert "U, at the mean of which is what follows | 8" in said
