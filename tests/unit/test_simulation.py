"""The compiled integrator: printed states, another integrator, models that end early."""

import numpy as np
import pytest
from integrators import moved_with_derivatives
from lines import CASES, RESONANT, START, edited

from galloping.evaluation.bounds import sensitivities
from galloping.evaluation.motion import steady_amplitude
from galloping.line.galerkin import coefficients, make_model
from galloping.model.polynomial import PolynomialModel
from galloping.trajectory.simulation import Simulator, time_grid
from galloping.trajectory.taylor import Ending, solve

TIME = time_grid(300, 100)
VARIANTS = {**CASES, "sine": edited(line__mode_shape="sine")}
PRINTED = {
    "internal_resonance": ((0.35202677, 1.81831793, -1.84807987, -0.88856756), (1.106, 1.873)),
    "sine": ((0.17784683, 0.53246272, -1.04591588, -2.64306990), (1.054, 2.132)),
    "non_resonant": ((-0.28807116, -0.63631260, 3.90279507, -0.43758123), (1.770, 0.672)),
}


@pytest.mark.parametrize("name", PRINTED)
def test_printed_motion_on_any_grid(name):
    end, amplitudes = PRINTED[name]
    line = make_model(coefficients(VARIANTS[name]))
    simulator = Simulator(line.states, line.terms)
    trajectory = simulator(line, START, TIME)
    assert trajectory.status == "ok"
    assert trajectory.states[-1] == pytest.approx(end, rel=0, abs=1e-7)
    steady = trajectory.states[20000:]
    assert steady_amplitude(steady)[:2] == pytest.approx(amplitudes, rel=0, abs=5.1e-4)
    thinned = simulator(line, START, TIME[::100])
    assert thinned.states == pytest.approx(trajectory.states[::100], rel=0, abs=1e-12)


@pytest.mark.parametrize("name", PRINTED)
def test_states_and_derivatives_of_another_integrator(name):
    line = make_model(coefficients(VARIANTS[name]))
    free, time = np.argwhere(line.support)[:6], time_grid(20, 10)
    states, moved = sensitivities(line, free, START, time)
    others = moved_with_derivatives(line, free, START, time, rtol=3e-14, atol=1e-16)
    assert states == pytest.approx(others[0], rel=0, abs=1e-11)
    assert np.abs((moved - others[1]) / np.abs(others[1]).max(axis=0)).max() < 1e-11


def test_units_change_nothing():
    terms, time = ((1, 0), (0, 1), (1, 1)), time_grid(5, 40)
    motions = []
    for unit in (2.0**-30, 1.0, 2.0**30):
        coupled = np.array([[0.0, 1.0, 0.0], [-4.0, -0.1, -0.5 / unit]])
        small = PolynomialModel(("y", "dy"), terms, coupled)
        motions.append(solve(small, np.array([unit, 0.0]), time, 1000).states / unit)
    assert np.array_equal(motions[0], motions[1])
    assert np.array_equal(motions[2], motions[1])


def test_motions_that_are_known_exactly():
    square = PolynomialModel(("x",), ((2,),), [[1.0]])
    ended = solve(square, np.array([1.0]), time_grid(2, 1000), 10_000, limit=1000.0)
    assert ended.ending is Ending.BEYOND_LIMIT
    assert ended.end == pytest.approx(0.999, abs=1e-12)
    assert len(ended.states) == 1000
    exact = 1 / (1 - time_grid(0.9, 1000))
    assert ended.states[:901, 0] == pytest.approx(exact, rel=1e-12)
    rest = solve(square, np.zeros(1), time_grid(300, 10), 100)
    assert rest.ending is Ending.COMPLETE and not rest.states.any()
    there = solve(square, np.ones(1), np.array([7.0]), 1, np.array([[0, 0]]))
    assert there.ending is Ending.COMPLETE and there.states.tolist() == [[1.0]]
    assert there.derivatives.tolist() == [[[0.0, 1.0]]]


@pytest.mark.parametrize("inputs", [(), ("u",)])
def test_motions_in_small_units_do_not_count_as_diverged(inputs):
    terms = tuple(powers + (0,) * len(inputs) for powers in ((1, 0), (0, 1)))
    oscillator = PolynomialModel(("y", "dy"), terms, [[0.0, 1.0], [-200_000.0, -20.0]], inputs)
    simulator = Simulator(oscillator.states, terms, inputs=inputs)
    moved = simulator(oscillator, [45.0, 17_000.0], time_grid(0.1, 600), dict.fromkeys(inputs, 0.0))
    assert moved.status == "ok"
    assert np.abs(moved.states).max() > 10_000


@pytest.mark.parametrize(
    ("values", "reason"),
    [({"gamma_6": 0.0, "gamma_1": -3.0}, "diverged: |x| exceeded 1000 at t = "),
     ({"gamma_2": np.nan}, "diverged: not finite"),
     ({"gamma_1": 1e8}, "stopped: more than 125538 integration steps")],
)  # fmt: skip
@pytest.mark.filterwarnings("ignore")
def test_a_model_that_diverges_ends_early_and_leaves_the_simulator_usable(resonant, values, reason):
    line, trajectory = resonant
    simulator = Simulator(line.states, line.terms)
    ended = simulator(make_model(coefficients(RESONANT) | values), START, TIME)
    assert ended.status.startswith(reason)
    first = np.argmax(np.isnan(ended.states).any(axis=1))
    assert np.isnan(ended.states[first:]).all()
    if reason.endswith("at t = "):
        assert first > 0 and np.abs(ended.states[:first]).max() <= 1000
        assert float(ended.status.split()[-2]) == pytest.approx(TIME[first], abs=0.02)
    assert simulator(line, START, TIME) == trajectory


def test_time_grid():
    assert time_grid(0.3, 10).tolist() == [0.0, 0.1, 0.2, 0.3]
