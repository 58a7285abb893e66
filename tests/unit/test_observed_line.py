"""A continuous line as the truth of a case: its motion as sensors see it, and how it is judged."""

import numpy as np
import pytest

from galloping.configuration.load import load, plain
from galloping.evaluation.score import Truth, evaluate
from galloping.identification.model import IdentifiedModel
from galloping.physics.continuous import observed as motion
from galloping.physics.galerkin import STATES, coefficients, model

TIME = np.arange(3001) / 100
REST = dict.fromkeys(STATES, 0.0)


def settings(**truth):
    return load({"cases": {"line": {"truth": {"model": "continuous", **truth}}}})


def observed(**truth):
    case = plain(settings(**truth))["cases"]["line"]
    start = {**REST, "q_v": 0.5, "q_w": 0.5, "dq_w": 0.2}
    return motion(case, case["truth"], start, TIME, np.random.default_rng(1))


def test_first_modes_of_the_line_as_three_sensors_see_them():
    seen = observed(modes=3, antisymmetric=0.3)
    assert seen.status == "ok" and seen.names == STATES
    # the sagging line swings vertically in more than half a sine
    assert seen.states[0] == pytest.approx([0.42, 0.5, 0.0, 0.2], abs=0.01)
    assert np.array_equal(seen.states[:, 2:], seen.derivatives[:, :2])
    slope = np.gradient(seen.states, TIME[1], axis=0)[1:-1]
    assert seen.derivatives[1:-1] == pytest.approx(slope, abs=2e-3 * np.abs(slope).max())
    # one sensor at a quarter of the span cannot tell the antisymmetric mode from the first
    blind = observed(modes=3, antisymmetric=0.3, sensors=[0.25])
    assert np.abs(blind.states - seen.states)[:, 0].max() > 0.2


def test_gusts_are_drawn_and_count():
    steady, gusty = observed(modes=1), observed(modes=1, gusts={"intensity": 0.05})
    assert np.abs(gusty.states - steady.states)[-1].max() > 1e-3


def test_no_coefficient_is_true_but_the_motion_is_judged(cases):
    line = model(coefficients(cases["internal_resonance"]))
    seen = observed(modes=3)
    truth = Truth(line, TIME, seen.states, (20.0, 30.0), is_own_model=False)
    unbounded = np.full((1, *line.coefficients.shape), np.nan)
    (row,), _ = evaluate(truth, {"any": [IdentifiedModel(line, "ok")]}, unbounded)
    assert np.isnan([row["e2"], row["missing"], row["mean_error_linear_percent"]]).all()
    assert row["motion"] == "ok" and row["r2_q_v"] > 0.9
    assert np.isfinite(row["amplitude_error_q_w_percent"])
