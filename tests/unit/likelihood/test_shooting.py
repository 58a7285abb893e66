import numpy as np
import pytest
from identification_cases import model, noisy, solution

from galloping.bounds.information import Experiment, state_bound
from galloping.identification.likelihood.condense import condense
from galloping.identification.likelihood.problem import posed
from galloping.identification.likelihood.selection import solve_support
from galloping.identification.likelihood.shooting import cut, eliminate, linearise

OSCILLATOR = model(("x", "dx"), 3, {"dx": 1.0}, {"x": -4.0, "dx": 0.4, "x^2 dx": -0.5})
TIME = np.linspace(0.0, 20.0, 1001)
X = solution(OSCILLATOR, np.array([0.5, 0.0]), TIME)


def setting(windows: int, chained: bool):
    recording = noisy(OSCILLATOR, X, TIME, 0.05, 0)
    condensed = condense([TIME], [recording.values], np.array([0, 1]), 0.2)
    segments = cut(condensed, windows, np.ones(100, bool), chained)
    starts = X[np.round(segments.first[:-1] * 10).astype(int)]
    sigma = 0.05 * X.std(axis=0)[None]
    asked = posed(OSCILLATOR.states, OSCILLATOR.terms)
    free = OSCILLATOR.coefficients[tuple(asked.candidates.T)]
    linear = linearise(asked, condensed, sigma, segments, free, starts)
    return asked, free, eliminate(linear, segments, starts)


def test_matched_segments_carry_the_information_of_the_whole_recording() -> None:
    asked, free, quadratic = setting(20, chained=True)
    support = free != 0.0
    bound = state_bound(
        OSCILLATOR,
        asked.candidates[support],
        [Experiment(X[0], TIME, 0.05 * X.std(axis=0))],
    )
    _, covariance = solve_support(quadratic.information, quadratic.right, support)
    assert np.sqrt(np.diag(covariance)) == pytest.approx(bound.std, rel=1e-3)
    assert quadratic.gap < 1e-6


def test_matched_segments_step_as_one_segment_does() -> None:
    _, _, many = setting(20, chained=True)
    _, _, one = setting(1000, chained=True)
    scale = np.sqrt(np.outer(np.diag(one.information), np.diag(one.information)))
    assert many.information / scale == pytest.approx(one.information / scale, abs=1e-6)
    assert many.right / np.sqrt(np.diag(scale)) == pytest.approx(
        one.right / np.sqrt(np.diag(scale)), abs=1e-4
    )
    assert many.states[0] == pytest.approx(one.states[0], rel=1e-4, abs=1e-6)


def test_free_segments_tell_less_than_matched_ones() -> None:
    _, free, apart = setting(20, chained=False)
    _, _, matched = setting(20, chained=True)
    support = free != 0.0
    wide, narrow = (
        np.diag(solve_support(one.information, one.right, support)[1]) for one in (apart, matched)
    )
    assert np.all(wide > narrow)


def test_divergence_is_an_error() -> None:
    asked = posed(OSCILLATOR.states, OSCILLATOR.terms)
    condensed = condense([TIME], [X], np.array([0, 1]), 0.2)
    segments = cut(condensed, 50, np.ones(100, bool), chained=False)
    free = np.zeros(len(asked.candidates))
    free[asked.candidates[:, 1] == asked.terms.index((3, 0))] = 50.0
    with pytest.raises(FloatingPointError, match="diverges"):
        linearise(asked, condensed, np.ones((1, 2)), segments, free, np.ones((2, 2)))
