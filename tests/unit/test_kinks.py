"""Motions under elementary functions of states: series, kinks, and what sticks to a kink."""

import numpy as np
import pytest
from integrators import moved_with_derivatives

from galloping import Input, PolynomialModel, parse_model, simulate
from galloping.evaluation.bounds import sensitivities

FRICTION = "q = dq; dq = -4 q - 0.9 sign(dq)"
SMOOTH = {
    "pendulum": ("q = dq; dq = -9.81 sin(q) - 0.1 dq", (2.5, 0.1)),
    "cosine of two states": ("q = dq; dq = -q + 0.3 cos(2 q - dq) dq", (1.0, 0.5)),
    "exponential": ("q = dq; dq = -4 q - 0.3 exp(-q) dq", (1.5, 0.0)),
    "quotients": ("x = x - 0.5 x y + 0.1/x; y = -y + x y/(2 y + 2)^2", (1.5, 1.0)),
    "powers": ("q = dq; dq = -9.81 sin(q)^3 - 0.2 sin(q) cos(q) dq^2", (1.2, 0.0)),
}
KINKED = {
    "drag": ("q = dq; dq = -4 q - 0.3 |dq| dq", (2.5, 0.3)),
    "two slopes": ("q = dq; dq = -4 q - 1.5 |q| - 0.1 dq", (2.5, 0.3)),
    "dry friction": (FRICTION, (2.5, 0.3)),
    "force of the position": ("q = dq; dq = -4 q - 0.9 sign(dq) - 0.4 q^2 sign(dq)", (2.5, 0.3)),
    "belt": ("q = dq; dq = -4 q - 0.9 sign(dq - 0.5) + 0.3 dq^2 - 0.1 dq", (0.5, 0.3)),
    "friction between two": (
        "a = da; b = db; da = -4 a + 2 b - 0.5 sign(da) - 0.3 sign(da - db); "
        "db = 2 a - 4 b - 0.4 sign(db) + 0.3 sign(da - db)",
        (2.5, -1.0, 0.3, 0.2),
    ),
}
TIME = np.linspace(0.0, 10.0, 201)


def differences(model, free, start, time, inputs=None):
    """(n, n_states, n_free + n_states) of solutions, by central differences."""
    none, found = np.empty((0, 2), int), []
    for place in free:
        size = 1e-6 * abs(model.coefficients[tuple(place)])
        moved = []
        for sign in (1.0, -1.0):
            coefficients = model.coefficients.copy()
            coefficients[tuple(place)] += sign * size
            other = PolynomialModel(model.states, model.terms, coefficients, model.inputs)
            moved.append(sensitivities(other, none, start, time, inputs)[0])
        found.append((moved[0] - moved[1]) / (2.0 * size))
    for unit in 1e-6 * np.eye(len(start)):
        moved = [sensitivities(model, none, start + s * unit, time, inputs)[0] for s in (1, -1)]
        found.append((moved[0] - moved[1]) / 2e-6)
    return np.stack(found, axis=2)


@pytest.mark.parametrize("name", SMOOTH)
def test_smooth_functions_agree_with_another_integrator(name):
    text, start = SMOOTH[name]
    model = parse_model(text)
    free = np.argwhere(model.support)
    states, moved = sensitivities(model, free, start, TIME)
    others = moved_with_derivatives(model, free, start, TIME, rtol=1e-12, atol=1e-14)
    assert states == pytest.approx(others[0], abs=1e-9)
    assert moved == pytest.approx(others[1], abs=1e-9 * np.abs(others[1]).max())


@pytest.mark.parametrize("name", KINKED)
def test_derivatives_cross_kinks_and_hold_what_sticks(name):
    text, start = KINKED[name]
    model = parse_model(text)
    free = np.argwhere(model.support)
    _, moved = sensitivities(model, free, np.array(start), TIME)
    other = differences(model, free, np.array(start), TIME)
    assert moved == pytest.approx(other, abs=1e-6 * np.abs(other).max())


def test_dry_friction_takes_a_piece_of_each_half_swing_and_stops_the_motion():
    motion = simulate(parse_model(FRICTION), [2.5, 0.0], TIME).states
    half, shift, at, swings = np.pi / 2.0, 0.225, 2.5, 0
    while abs(at) > shift:
        own, side = np.floor(TIME / half) == swings, np.sign(at) * shift
        swing = (at - side) * np.cos(2.0 * (TIME[own] - swings * half))
        assert motion[own, 0] == pytest.approx(side + swing, abs=1e-12)
        at, swings = 2.0 * side - at, swings + 1
    rests = motion[np.floor(TIME / half) >= swings]
    assert rests[:, 0] == pytest.approx(at, abs=1e-12) and swings == 6
    assert np.abs(rests[:, 1]).max() < 1e-14


@pytest.mark.parametrize("sensitive", [False, True])
def test_what_sticks_is_held_until_a_force_exceeds_the_friction(sensitive):
    model = parse_model("q = dq; dq = -4 q - 0.9 sign(dq) + F", ["F"])
    force = Input(np.linspace(-1.0, 12.0, 131), 0.2 * np.linspace(-1.0, 12.0, 131))
    if sensitive:
        free = np.argwhere(model.support)
        start, inputs = np.array([0.1, 0.0]), {"F": force}
        states, moved = sensitivities(model, free, start, TIME, inputs)
        other = differences(model, free, start, TIME, inputs)
        assert moved[1:] == pytest.approx(other[1:], abs=1e-4)  # at first none has slid yet
    else:
        states = simulate(model, [0.1, 0.0], TIME, {"F": force}).states
    slips = (0.9 + 0.4) / 0.2  # where the force overcomes friction and spring
    after = np.maximum(TIME - slips, 0.0)
    ahead = 0.05 * after - 0.025 * np.sin(2.0 * after)  # of a spring that is pulled steadily
    assert states[:, 0] == pytest.approx(0.1 + ahead, abs=1e-10)


def test_units_change_nothing_beside_kinks():
    motions = []
    for unit in (2.0**-30, 1.0, 2.0**30):
        model = parse_model(f"q = dq; dq = -4 q - {0.9 * unit} sign(dq) - {0.3 / unit} |dq| dq")
        motions.append(simulate(model, [2.5 * unit, 0.3 * unit], TIME[:100]).states / unit)
    assert motions[0] == pytest.approx(motions[1], abs=1e-13)
    assert motions[2] == pytest.approx(motions[1], abs=1e-13)


def test_a_quotient_ends_where_its_divisor_vanishes():
    motion = simulate(parse_model("x = -1/x"), [1.0], np.linspace(0.0, 1.0, 101))
    assert motion.status != "ok" and "0.5" in motion.status
    assert motion.states[:50, 0] == pytest.approx(np.sqrt(1.0 - 2.0 * np.linspace(0, 0.49, 50)))
