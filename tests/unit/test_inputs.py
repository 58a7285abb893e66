"""Inputs, models with them, and their simulation."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import galloping
from galloping.identification.drawn_models import draw_models_and_rivals
from galloping.identification.identified_model import IdentifiedModel
from galloping.recording.samples import Input, fit_windows
from galloping.trajectory.simulation import solve_driven

TIME = np.arange(401) / 20.0


def wave(time):
    return 10.0 + np.sin(1.3 * time) + 0.5 * np.cos(2.9 * time)


WIND = Input(TIME, wave(TIME))
TERMS = ((1, 0, 0), (0, 1, 0), (0, 1, 1), (0, 3, -1), (0, 0, 2))
LINE = galloping.PolynomialModel(
    ("q", "dq"), TERMS, [[0, 1, 0, 0, 0], [-4.0, -0.4, 0.05, -0.9, 0.002]], ("U",)
)


@pytest.mark.parametrize(("between", "error"), [("zero", 0.2), ("linear", 2e-3), ("cubic", 2e-6)])
def test_an_input_is_near_what_was_sampled(between, error):
    given = Input(TIME, wave(TIME), between)
    inside = np.linspace(1.0, 19.0, 977)
    assert np.abs(given(inside) - wave(inside)).max() < error
    assert given(TIME) == pytest.approx(wave(TIME), rel=1e-14)


def test_times_without_samples_are_not_covered():
    values = wave(TIME)
    values[100:120], values[200] = np.nan, np.nan
    given = Input(TIME, values)
    assert given.stretches == ((0.0, TIME[99]), (TIME[120], TIME[-1]))
    assert given([-0.1, 5.5, 20.1]) == pytest.approx([np.nan] * 3, nan_ok=True)
    assert given(TIME[200]) == pytest.approx(wave(TIME[200]), abs=1e-4)
    held = Input(TIME, values, "zero")
    assert not held.covered([TIME[200]])[0]


def test_an_input_in_every_other_row_is_held_over_the_rows_between():
    values = np.where(np.arange(401) % 2, np.nan, TIME)
    values[200:203] = np.nan
    held = Input(TIME, values, "zero")
    assert held.stretches == ((0.0, TIME[198]), (TIME[204], TIME[-1]))
    assert held(TIME[11]) == TIME[10]
    recording = galloping.Recording(TIME, ("q",), np.zeros((401, 1)), inputs={"U": held})
    assert [len(one.time) for one in recording.driven(["U"])] == [199, 197]


def test_an_input_reaches_times_that_are_outside_by_rounding():
    tenths = np.arange(13) / 10
    given = Input(tenths, wave(tenths))
    beyond = np.array([-1e-12, 0.5, np.nextafter(1.2, 2.0)])
    assert given(beyond) == pytest.approx(wave(beyond))
    assert given.covered(beyond).all() and not given.covered([1.2 + 1e-3])[0]
    recording = galloping.Recording(beyond, ("q",), np.zeros((3, 1)), inputs={"U": given})
    assert recording.driven(["U"]) == [recording]


def test_windows_keep_the_moments_of_an_input():
    """The polynomial over a window has the integrals of the factor times 1, t, .., t^degree."""
    factors, degree, step = ((1,), (2,), (-1,)), 3, 0.7
    found = fit_windows([WIND], factors, 0.5, step, 20, degree)
    place = (np.arange(4000) + 0.5) / 4000
    powers = place[:, None] ** np.arange(degree + 1)
    for window in (0, 7, 19):
        u = WIND(0.5 + step * (window + place))
        for k, (power,) in enumerate(factors):
            away = powers @ found[window, :, k] - u**power
            assert powers.T @ away / len(place) == pytest.approx(np.zeros(4), abs=1e-5)


def test_a_recording_carries_inputs_of_a_frame():
    frame = {"t": TIME, "q": np.sin(TIME), "U": wave(TIME)}
    recording = galloping.Recording.from_frame(frame, inputs=["U"], between="linear")
    assert recording.states == ("q",) and "inputs: U" in repr(recording)
    assert recording.inputs == {"U": Input(TIME, wave(TIME), "linear")}


def test_a_model_at_constant_inputs():
    held = LINE.at({"U": 12.0})
    assert held.terms == ((1, 0), (0, 1), (0, 3), (0, 0))
    assert held.coefficients[1] == pytest.approx([-4.0, 0.2, -0.075, 0.288])
    x, u = np.array([[0.3, -0.7], [0.1, 0.2]]), np.full((2, 1), 12.0)
    assert LINE(x, u) == pytest.approx(held(x))
    assert LINE.jacobian(x, u) == pytest.approx(held.jacobian(x))
    assert "0.05 dq U + -0.9 dq^3/U + 0.002 U^2" in LINE.equations()[1]


def test_the_covariance_follows_to_constant_inputs(tmp_path):
    """As draws of the coefficients do."""
    support = LINE.support & [[False], [True]]
    rng = np.random.default_rng(5)
    root = rng.normal(size=(5, 5)) * [1e-2, 1e-3, 1e-3, 1e-2, 1e-4]
    covariance = root.T @ root
    errors = np.full(support.shape, np.nan)
    errors[support] = np.sqrt(np.diag(covariance))
    rivals = LINE.coefficients * [[[1.0], [1.1]], [[1.0], [0.0]]]
    found = IdentifiedModel(
        LINE, standard_errors=errors, covariance=covariance, known=(0,), rivals=rivals,
        rival_share=0.25,
    )  # fmt: skip
    held = found.at({"U": 11.0})
    drawn = rng.multivariate_normal(LINE.coefficients[1], covariance, 40_000)
    merged = drawn @ [[1, 0, 0, 0], [0, 1, 0, 0], [0, 11, 0, 0], [0, 0, 1 / 11, 0], [0, 0, 0, 121]]
    assert held.standard_errors[1] == pytest.approx(merged.std(axis=0), rel=0.02)
    assert held.covariance[0, 1] == pytest.approx(np.cov(merged.T)[0, 1], rel=0.05)
    assert held.rivals[0] == pytest.approx(1.1 * held.model.coefficients * [[1 / 1.1], [1.0]])
    draws = draw_models_and_rivals(held, rng, 4_000)
    share = np.mean([not np.any(each.coefficients[1]) for each in draws])
    assert share == pytest.approx(0.125, abs=0.02)
    found.save(tmp_path / "model.json")
    assert IdentifiedModel.load(tmp_path / "model.json") == found
    assert r"\dot q^{3} \, U^{-1}" in found.latex()


@pytest.mark.filterwarnings("error")
def test_a_term_without_a_detection_limit_has_none_at_constant_inputs():
    coefficients = LINE.coefficients * (np.arange(LINE.coefficients.shape[1]) > 0)
    limits = np.full(coefficients.shape, np.nan)
    limits[1, 0] = np.inf
    found = IdentifiedModel(replace(LINE, coefficients=coefficients), detection_limits=limits)
    assert found.at({"U": 11.0}).detection_limits[1, 0] == np.inf


@pytest.mark.parametrize("between", ["zero", "linear", "cubic"])
def test_motion_with_an_input_is_that_of_another_integrator(between):
    wind = Input(TIME, wave(TIME), between)
    motion = galloping.simulate(LINE, [0.1, 0.0], TIME, {"U": wind})
    states = [np.array([0.1, 0.0])]
    for a, b in pairwise(TIME):  # smooth from knot to knot

        def rates(t, x, last=b):
            u = wind(np.array([min(t, last - 1e-12)]))
            return LINE(x[None], u[:, None])[0]

        step = solve_ivp(rates, (a, b), states[-1], method="DOP853", rtol=1e-11, atol=1e-12)
        states.append(step.y[:, -1])
    assert motion.status == "ok"
    assert motion.states == pytest.approx(np.array(states), abs=2e-5 if between == "zero" else 1e-7)


def test_constant_inputs_may_be_numbers():
    motion = galloping.simulate(LINE, [0.1, 0.0], TIME, {"U": np.float32(12.0)})
    alone = galloping.simulate(LINE.at({"U": 12.0}), [0.1, 0.0], TIME)
    assert motion.states == pytest.approx(alone.states, abs=1e-12)


def test_motion_that_runs_away_says_when():
    away = galloping.PolynomialModel(("x",), ((2, 0), (0, 1)), [[1.0, 1.0]], ("F",))
    motion = galloping.simulate(away, [0.0], TIME, {"F": Input(TIME, np.ones(401))})
    assert motion.status.startswith("diverged: |x| exceeded 1e+12 at t = 1.6")  # tan(t)
    assert np.isfinite(motion.states[:31]).all()
    assert motion.states[30, 0] == pytest.approx(np.tan(1.5), rel=1e-6)


def test_a_solution_that_diverges_is_not_sought_in_ever_shorter_steps():
    """dx/dt = u x^2 from x = 1 is infinite after 1 s, whatever the steps."""
    time = np.linspace(0.0, 1000.0, 100_001)
    drive = Input(np.arange(1002.0), np.ones(1002))
    model = galloping.PolynomialModel(("x",), ((2, 1),), np.ones((1, 1)), ("u",))
    states, _, _ = solve_driven(model, [drive], np.ones(1), time, 2.0, most=10**9)
    np.testing.assert_allclose(states[:90, 0], 1.0 / (1.0 - time[:90]), rtol=1e-6)
    assert not np.all(np.abs(states[120:]) < 1e4)
