import numpy as np
import pytest
from identification_cases import (
    LINE_STATES,
    NON_RESONANT,
    RELEASE,
    TIME,
    line,
    solution,
    unknown_support,
)

from galloping.bounds.information import (
    Experiment,
    derivative_bound,
    ranked_experiments,
    state_bound,
)
from galloping.polynomial import PolynomialModel, term_name


def experiment(true: PolynomialModel, start: np.ndarray, level: float = 0.05) -> Experiment:
    return Experiment(start, TIME, level * solution(true, start, TIME).std(axis=0))


def test_the_default_line_has_the_bounds_of_the_design() -> None:
    true = line()
    free = np.argwhere(unknown_support(true))
    bound = state_bound(true, free, [experiment(true, RELEASE)])
    weakest = bound.free[np.argmin(bound.t)]
    assert bound.t.min() == pytest.approx(36.8, abs=0.05)
    assert term_name(true.terms[weakest[1]], LINE_STATES) == "dq_v^2"
    relative = np.sqrt(2.0 / np.pi) / bound.t * 100.0
    degree = np.array([sum(true.terms[j]) for _, j in free])
    means = [relative[degree == d].mean() for d in (1, 2, 3)]
    assert means == pytest.approx([0.10, 0.64, 0.76], abs=0.005)


def test_displacements_alone_tell_less() -> None:
    true = line()
    known = experiment(true, RELEASE)
    sigma = np.where([True, True, False, False], known.sigma, np.inf)
    only = Experiment(RELEASE, TIME, sigma)
    bound = state_bound(true, np.argwhere(unknown_support(true)), [only])
    assert bound.t.min() == pytest.approx(18.5, abs=0.05)


def test_a_subset_tells_its_share() -> None:
    true = line()
    whole = experiment(true, RELEASE)
    chosen = np.sort(np.random.default_rng(0).choice(len(TIME), 5000, replace=False))
    start = solution(true, RELEASE, TIME[: chosen[0] + 2])[chosen[0]]
    subset = Experiment(start, TIME[chosen], whole.sigma)
    bound = state_bound(true, np.argwhere(unknown_support(true)), [subset])
    assert bound.t.min() == pytest.approx(15.0, abs=0.6)


def test_derivative_bound_is_that_of_linear_regression() -> None:
    true = line()
    x = solution(true, RELEASE, TIME)
    bound = derivative_bound(true, np.argwhere(unknown_support(true)), x, np.full(4, 0.15))
    assert bound.t.min() == pytest.approx(7.7, abs=0.05)


def test_the_recording_that_helps_the_non_resonant_line_is_found() -> None:
    true = line(NON_RESONANT)
    free = np.argwhere(unknown_support(true))
    done = experiment(true, RELEASE)
    assert state_bound(true, free, [done]).t.min() == pytest.approx(2.1, abs=0.05)
    options = [experiment(true, np.array([0.1, start, 0.0, 0.0])) for start in (0.1, 0.5, 3.0)]
    ranked = ranked_experiments(true, free, [done], options)
    assert ranked[0][0] == 2
    assert ranked[0][1].t.min() == pytest.approx(82.0, abs=0.5)


def test_what_the_data_do_not_show_has_an_infinite_bound() -> None:
    true = line()
    free = np.argwhere(true.support)[:1]
    still = Experiment(np.zeros(4), TIME[:100], np.ones(4))
    assert np.isinf(state_bound(true, free, [still]).std).all()
