"""The likelihood and its weak form: how near the bound they come, on lines and other systems."""

import numpy as np
import pytest
from identification_cases import (
    LINE,
    RELEASE,
    SUPPORT,
    TIME,
    X,
    assert_found,
    deviations,
    line,
    model,
    noisy,
    solution,
    unknown_support,
)

from galloping import Prior, Recording, maximum_likelihood, weak_gls
from galloping import polynomial_library as library
from galloping.evaluation.bounds import Experiment, state_bound
from galloping.identification.findings import Code
from galloping.identification.preparation.weak_form import make_start, whitened_weak_form
from galloping.identification.problem import make_problem
from galloping.identification.selection import solve_support


def line_bound(level: float) -> np.ndarray:
    experiment = Experiment(RELEASE, TIME, level * X.std(axis=0))
    return state_bound(LINE, np.argwhere(SUPPORT), [experiment]).std


@pytest.mark.parametrize("level", [0.01, 0.05, 0.15])
def test_the_line_is_found_at_the_bound_and_near_it_by_the_weak_form_alone(level: float) -> None:
    std, errors, weak_errors = line_bound(level), [], []
    for seed in range(3):
        recording = noisy(LINE, X, TIME, level, seed)
        weak = weak_gls(recording, LINE.terms)
        assert np.array_equal(weak.support, SUPPORT)
        weak_errors.append(deviations(weak, LINE, std))
        found = maximum_likelihood(recording, LINE.terms)
        assert_found(found, LINE)
        assert np.sqrt(np.diag(found.covariance)) == pytest.approx(std, rel=0.03)
        assert np.array_equal(np.sqrt(np.diag(found.covariance)), found.standard_errors[SUPPORT])
        assert found.diagnostics["residual_band"] < found.diagnostics["residual_band_allowed"]
        assert found.sigma[0] == pytest.approx(level * X.std(axis=0), rel=0.03)
        assert found.initial_states[0] == pytest.approx(RELEASE, abs=level)
        errors.append(deviations(found, LINE, std))
    assert np.sqrt(np.mean(np.square(errors))) < 1.3  # 42 values, of unit variance at the bound
    assert np.sqrt(np.mean(np.square(weak_errors))) < 1.5


def test_a_random_subset_is_enough_and_few_points_leave_more_to_hide() -> None:
    recording, limits = noisy(LINE, X, TIME, 0.05, 2), {}
    for points in (10_000, 5_000, 1_000):
        chosen = np.sort(np.random.default_rng(2).choice(len(TIME), points, replace=False))
        subset = Recording(TIME[chosen], LINE.states, recording.values[chosen])
        found = maximum_likelihood([subset], LINE.terms)
        limits[points] = found.detection_limits
        if points > 1_000:
            assert np.array_equal(found.support, SUPPORT)
            std = line_bound(0.05) * np.sqrt(len(TIME) / points)
            assert np.sqrt(np.mean(deviations(found, LINE, std) ** 2)) < 1.8
    ratio = np.nanmedian(limits[1_000] / limits[10_000])
    assert 2.0 < ratio < 6.0  # about the square root of 10


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_three_samples_a_second_are_followed(seed: int) -> None:
    """Of displacements alone: a start of the thirty terms that they seem to hold diverges."""
    true = line("non_resonant")
    x = solution(true, RELEASE, TIME)
    recording = noisy(true, x, TIME, 0.05, seed)
    chosen = np.sort(np.random.default_rng(seed).choice(len(TIME), 1_000, replace=False))
    values = recording.values[chosen]
    values[:, 2:] = np.nan
    found = maximum_likelihood([Recording(TIME[chosen], true.states, values)], true.terms)
    assert found.status == "not identifiable", found.reason
    error = solution(found.model, found.initial_states[0], TIME[chosen]) - x[chosen]
    assert np.all(np.std(error, axis=0) < 0.1 * np.std(x, axis=0))


def test_exact_states_with_noisy_derivatives() -> None:
    noise = 0.15 * np.random.default_rng(0).normal(size=X.shape)
    recording = Recording(TIME, LINE.states, X, LINE(X) + noise, exact=True)
    found = maximum_likelihood([recording], LINE.terms)
    assert np.array_equal(found.support, SUPPORT)
    assert found.sigma[0, 2:] == pytest.approx(0.15, rel=0.02)
    assert np.sqrt(np.mean(deviations(found, LINE) ** 2)) < 1.6
    simple = maximum_likelihood([recording], LINE.terms, prior=Prior(nonlinear=1e-300))
    assert np.all(SUPPORT | ~simple.support) and simple.support.sum() < SUPPORT.sum()
    few = Recording(TIME[:20], LINE.states, X[:20], (LINE(X) - noise)[:20], exact=True)
    with_few = maximum_likelihood([recording, few], LINE.terms)
    assert np.array_equal(with_few.model.coefficients, found.model.coefficients)


def test_the_non_resonant_line_needs_a_second_recording() -> None:
    true = line("non_resonant")
    starts = (RELEASE, np.array([0.1, 3.0, 0.0, 0.0]))
    recordings = [
        noisy(true, solution(true, start, TIME), TIME, 0.05, seed)
        for seed, start in enumerate(starts)
    ]
    alone = maximum_likelihood(recordings[:1], true.terms)
    missing = unknown_support(true) & ~alone.support
    assert missing.any()  # one of t = 2.1
    assert np.all(np.abs(true.coefficients[missing]) < alone.detection_limits[missing])
    assert alone.findings
    both = maximum_likelihood(recordings, true.terms)
    assert_found(both, true)
    assert both.initial_states[1] == pytest.approx(starts[1], abs=0.05)


# states and degree; equations; start; duration
OTHERS = {
    "van_der_pol": ("xy", 3, {"y": 1}, {"x": -1, "y": 1, "x^2 y": -1}, (0.5, 0), 50),
    "stiff_van_der_pol": ("xy", 3, {"y": 1}, {"x": -1, "y": 3, "x^2 y": -3}, (0.5, 0), 50),
    "duffing": (("x", "dx"), 3, {"dx": 1}, {"x": -1, "dx": -0.1, "x^3": -1}, (2, 0), 40),
    "lotka_volterra": ("ab", 2, {"a": 1, "a b": -0.5}, {"b": -1, "a b": 0.25}, (6, 3), 40),
    "linear_oscillator": ("xy", 3, {"x": -0.1, "y": 2}, {"x": -2, "y": -0.1}, (2, 0), 25),
    # its first swings are far quicker than most of the record
    "cubic_oscillator": ("xy", 3, {"x^3": -0.1, "y^3": 2}, {"x^3": -2, "y^3": -0.1}, (2, 0), 25),
}


@pytest.mark.parametrize("name", OTHERS)
def test_other_systems_at_ten_percent_noise(name: str) -> None:
    states, degree, *rows, start, duration = OTHERS[name]
    true = model(tuple(states), degree, *rows)
    time = np.linspace(0.0, duration, 100 * duration + 1)
    x, support = solution(true, start, time), unknown_support(true)
    experiment = Experiment(x[0], time, 0.1 * x.std(axis=0))
    bound, squares = state_bound(true, np.argwhere(support), [experiment]), []
    for seed in range(100, 105):
        found = maximum_likelihood([noisy(true, x, time, 0.1, seed)], true.terms)
        assert found.status != "refused", found.reason
        assert np.array_equal(found.support, support)
        squares.append(np.sum((found.model.coefficients - true.coefficients)[support] ** 2))
    assert np.sqrt(np.mean(squares)) < 1.5 * np.linalg.norm(bound.std)


def test_known_equations_are_kept() -> None:
    true, time = model(("x", "y"), *OTHERS["van_der_pol"][1:4]), np.linspace(0.0, 50.0, 5001)
    recording = noisy(true, solution(true, (0.5, 0.0), time), time, 0.05, 0)
    found = maximum_likelihood([recording], true.terms, true, ("x",))
    assert np.array_equal(found.model.coefficients[0], true.coefficients[0])
    assert not found.support[0].any()
    assert np.array_equal(found.support[1], true.support[1])


def test_segments_may_all_end_where_a_state_is_zero():
    """Their mismatch, rounding alone, is in units of the motion, not of what it is there."""
    time = np.linspace(0.0, 33 * 2.0 * np.pi, 2000)
    exact = Recording(time, ("x", "dx"), np.column_stack([np.cos(time), -np.sin(time)]))
    found = maximum_likelihood(exact, library(2, 1))
    assert found.status == "not identifiable" and found.has_finding(Code.MOTION_REPEATS)
    assert found.support.tolist() == [[False] * 3, [False, True, False]]


def test_the_weak_form_is_weighed_until_its_coefficients_move_by_less_than_their_errors():
    true = model(("x", "dx"), 3, {"dx": 1.0}, {"x": -1.0, "dx": 0.3, "x^2 dx": -0.3})
    time = np.linspace(0.0, 60.0, 1201)
    recording = noisy(true, solution(true, (0.5, 0.0), time), time, 0.1, 202611275)
    begun = make_start(make_problem(true.states, true.terms), [recording])
    weighed = begun.problem.coefficients(begun.fit.free)
    rows, rates = whitened_weak_form(begun.problem, begun.smoothed[0], weighed)
    again, covariance = solve_support(rows.T @ rows, rows.T @ rates, begun.fit.support)
    moved = (again - begun.fit.free)[begun.fit.support] / np.sqrt(np.diag(covariance))
    assert np.max(np.abs(moved)) < 0.1
