import numpy as np
import pytest
from identification_cases import RELEASE, TIME, line, model, noisy, solution, unknown_support

from galloping.bounds import Experiment, state_bound
from galloping.identification.likelihood.problem import posed
from galloping.identification.likelihood.weak_gls import begin, rough_fit, weak_gls
from galloping.polynomial import library
from galloping.recording import Recording

LINE = line()
X = solution(LINE, RELEASE, TIME)


@pytest.mark.parametrize("level", [0.01, 0.05, 0.15])
def test_the_weak_form_alone_is_near_the_bound(level: float) -> None:
    support = unknown_support(LINE)
    experiment = Experiment(RELEASE, TIME, level * X.std(axis=0))
    bound = state_bound(LINE, np.argwhere(support), [experiment])
    errors = []
    for seed in range(3):
        found = weak_gls([noisy(LINE, X, TIME, level, seed)], LINE.terms)
        assert np.array_equal(found.support, support)
        errors.append((found.model.coefficients - LINE.coefficients)[support] / bound.std)
    assert np.sqrt(np.mean(np.square(errors))) < 1.5


@pytest.mark.parametrize("order", [1, -1])
def test_a_long_recording_starts_from_where_its_motion_grows(order: int) -> None:
    true = model(("x", "dx"), 3, {"dx": 1.0}, {"x": -1.0, "dx": 0.1, "x^2 dx": -0.1})
    problem = posed(true.states, true.terms)
    time = np.arange(0.0, 7000.0, 0.5)
    settled, growing = (
        noisy(true, solution(true, np.array([x, 0.0]), time), time, 0.05, seed)
        for seed, x in enumerate((2.0, 0.01))
    )
    values = np.vstack([one.values for one in (settled, growing)[::order]])
    start = begin(problem, [Recording(0.5 * np.arange(len(values)), true.states, values)])
    alone, misled = (begin(problem, [one]).fit.free for one in (growing, settled))
    assert np.allclose(rough_fit(start).free, alone, atol=0.02)
    assert not np.allclose(misled, alone, atol=0.2)


def test_a_library_without_the_cubic_terms_is_refused() -> None:
    found = weak_gls([noisy(LINE, X, TIME, 0.05, 0)], library(4, 2))
    assert found.status == "refused"
    assert "misfit" in found.reason
