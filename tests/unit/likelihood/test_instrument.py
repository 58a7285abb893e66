"""Faults of sensors are named; sound, exact, chaotic and long recordings are not accused."""

import numpy as np
import pytest
from identification_cases import RELEASE, TIME, line, model, noisy, solution

from galloping.identification.likelihood.maximum_likelihood import maximum_likelihood
from galloping.polynomial import PolynomialModel
from galloping.recording import Recording

LINE = line()
X = solution(LINE, RELEASE, np.append(TIME, 300.01 + 0.01 * np.arange(20)))


def late(values: np.ndarray) -> np.ndarray:
    values[10:, [1, 3]] += X[: len(TIME) - 10, [1, 3]] - X[10 : len(TIME), [1, 3]]
    return values


def scaled(values: np.ndarray) -> np.ndarray:
    values[:, 2] *= 1.005
    return values


def multiplied(values: np.ndarray) -> np.ndarray:
    rng = np.random.default_rng(0)
    return X[: len(TIME)] * (1.0 + 0.01 * rng.standard_normal(values.shape))


@pytest.mark.parametrize(
    ("fault", "clock", "named"),
    [
        (late, 1.0, "delayed"),
        (scaled, 1.0, "dq_v is not the rate of q_v"),
        (np.asarray, 1.003, "clock"),
        (multiplied, 1.0, "noise grows with the signal"),
    ],
)
def test_a_fault_is_named(fault, clock: float, named: str) -> None:
    values = noisy(LINE, X[: len(TIME)], TIME, 0.05, 0).values.copy()
    result = maximum_likelihood([Recording(clock * TIME, LINE.states, fault(values))], LINE.terms)
    assert result.status != "ok"
    assert named in result.reason


def test_a_chaotic_recording_is_matched_in_chains() -> None:
    rows = {"x": -10.0, "y": 10.0}, {"x": 28.0, "y": -1.0, "x z": -1.0}, {"x y": 1.0, "z": -8 / 3}
    true = model(("x", "y", "z"), 2, *rows)
    time = np.linspace(0.0, 50.0, 5001)
    recording = noisy(true, solution(true, np.array([-8.0, 7.0, 27.0]), time), time, 0.02, 0)
    result = maximum_likelihood([recording], true.terms)
    assert result.status == "ok", result.reason
    assert np.array_equal(result.support, true.support)
    z = (result.model.coefficients - true.coefficients) / result.standard_errors
    assert np.nanmax(np.abs(z)) < 4.0


def test_a_slight_drift_is_looked_at_where_every_term_of_the_library_is_there() -> None:
    terms, time = ((1, 0), (0, 1), (2, 1)), np.linspace(0.0, 100.0, 2001)
    true = PolynomialModel(("x", "dx"), terms, np.array([[0.0, 1.0, 0.0], [-1.0, 0.3, -0.3]]))
    values = noisy(true, solution(true, np.array([0.5, 0.0]), time), time, 0.05, 0).values.copy()
    values[:, 0] += 0.035 * (time / time[-1] - 0.5)
    result = maximum_likelihood(Recording(time, true.states, values), terms)
    assert result.status == "ok", result.reason
    assert np.array_equal(result.support[1], [True, True, True])
