import numpy as np
import pytest
from identification_cases import RELEASE, TIME, line, model, solution

from galloping.bounds import Experiment, information, sensitivities
from galloping.polynomial import PolynomialModel


def test_solution_of_the_line_matches_the_design_figures() -> None:
    x = solution(line(), RELEASE, TIME)
    expected = [0.35202677, 1.81831793, -1.84807987, -0.88856756]
    assert x[-1] == pytest.approx(expected, abs=2e-4)  # coefficients are given to seven digits


def test_sensitivities_match_finite_differences_at_irregular_times() -> None:
    true = line()
    time = np.sort(np.random.default_rng(0).uniform(0.0, 40.0, 60))
    free = np.argwhere(true.support)
    _, s = sensitivities(true, free, RELEASE, time)
    for k, (i, j) in enumerate(free):
        shift = 1e-5 * abs(true.coefficients[i, j])
        sides = []
        for sign in (1.0, -1.0):
            coefficients = true.coefficients.copy()
            coefficients[i, j] += sign * shift
            moved = PolynomialModel(true.states, true.terms, coefficients)
            sides.append(solution(moved, RELEASE, time))
        numeric = (sides[0] - sides[1]) / (2.0 * shift)
        assert s[:, :, k] == pytest.approx(numeric, rel=1e-5, abs=1e-6 * np.abs(numeric).max())
    for k in range(4):
        shift = np.eye(4)[k] * 1e-5
        ahead, behind = (solution(true, RELEASE + sign * shift, time) for sign in (1.0, -1.0))
        numeric = (ahead - behind) / 2e-5
        assert s[:, :, len(free) + k] == pytest.approx(numeric, rel=1e-5, abs=1e-6)


def test_a_term_that_is_absent_has_a_sensitivity() -> None:
    true = model(("x",), 2, {"x": -1.0})
    time = np.linspace(0.0, 2.0, 9)
    _, s = sensitivities(true, np.array([[0, 2]]), np.array([1.0]), time)
    assert s[:, 0, 0] == pytest.approx(np.exp(-time) * (1.0 - np.exp(-time)), abs=1e-9)


def test_divergence_is_an_error() -> None:
    explosive = model(("x",), 2, {"x^2": 1.0})
    with pytest.raises(ValueError, match="diverges"):
        sensitivities(explosive, np.zeros((0, 2), int), np.array([1.0]), np.array([0.0, 2.0]))


def test_information_beyond_the_range_of_numbers_is_an_error() -> None:
    growing = model(("x",), 1, {"x": 1.0})
    long = Experiment(np.zeros(1), np.array([0.0, 200.0, 400.0]), np.ones(1))
    with pytest.raises(ValueError, match="by more than numbers hold"):
        information(growing, np.argwhere(growing.support), long)
