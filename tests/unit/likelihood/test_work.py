"""A search for a model ends at its limit of work, and says so: counted, never timed."""

import numpy as np
import pytest
from identification_cases import line, model, noisy, solution

from galloping import Input, Recording, maximum_likelihood
from galloping import polynomial_library as library
from galloping.identification.findings import Code
from galloping.identification.preparation.screening import prepare_recordings
from galloping.identification.preparation.weak_form import weak_fit
from galloping.identification.problem import make_problem
from galloping.identification.selection import select_support
from galloping.identification.work import MAX_WORK, limit_work, work_limit
from galloping.trials.published import SYSTEMS

# its first swings are far quicker than most of the record: the first time scale gives no model
TRUE = model(("x", "y"), 3, {"x^3": -0.1, "y^3": 2.0}, {"x^3": -2.0, "y^3": -0.1})
TIME = np.linspace(0.0, 25.0, 2501)


@pytest.fixture(scope="module")
def recording():
    return noisy(TRUE, solution(TRUE, (2.0, 0.0), TIME), TIME, 0.1, 100)


def searched(recording, most):
    """The model, and the work that was counted."""
    with limit_work([recording], most) as work:
        found = maximum_likelihood(recording, TRUE.terms)
    return found, work.spent


@pytest.fixture(scope="module")
def whole(recording):
    return searched(recording, MAX_WORK)


def test_a_search_within_its_limit_is_that_without_one(recording, whole):
    found, used = whole
    assert found.status == "ok" and 0 < used < 0.1 * MAX_WORK
    again, counted = searched(recording, 2.0 * used)  # each start has a portion
    assert counted == used and again.findings == found.findings
    assert np.array_equal(again.model.coefficients, found.model.coefficients)
    assert np.array_equal(again.covariance, found.covariance)


@pytest.mark.parametrize("share", [0.05, 0.3])
def test_a_search_at_its_limit_ends_and_is_not_ok(recording, whole, share):
    most = share * whole[1]
    found, used = searched(recording, most)
    assert found.status != "ok" and found.codes.split().count(Code.LIMIT_OF_WORK) == 1
    assert used < whole[1]
    again, counted = searched(recording, most)
    assert counted == used and again.findings == found.findings


def test_a_search_may_count_in_proportion_more_of_a_longer_recording():
    short, usual, long = map(work_limit, (1000, 30_001, 60_002))
    assert short == usual == long / 2.0


def test_nothing_is_begun_where_no_work_is_left(recording):
    found, used = searched(recording, 0.0)
    assert (found.status, used) == ("refused", 0.0) and found.has_finding(Code.LIMIT_OF_WORK)


def hyperchaos(rng):
    system, time = SYSTEMS["hyperchaos"], np.linspace(0.0, 180.0, 2000)
    return noisy(system.model, solution(system.model, system.start, time), time, 0.05, 990101), 3


def accelerations(rng):
    true, time = line(), np.arange(3001) / 10
    rates = true(solution(true, (0.1, 0.1, 0.0, 0.0), time))
    rates += 0.5 * rates.std(axis=0) * rng.standard_normal(rates.shape)
    rates[:, :2] = np.nan
    return Recording(time, true.states, np.full(rates.shape, np.nan), rates=rates), 3


def driven(rng):
    time = np.arange(2001) / 20
    values = np.cumsum(rng.standard_normal((len(time), 2)), axis=0)
    return Recording(time, ("x", "y"), values, inputs={"u": Input(time, np.sin(time) ** 3)}), 5


@pytest.mark.parametrize("drawn", [hyperchaos, accelerations, driven])
def test_a_search_counts_little_more_than_its_limit(drawn):
    recording, degree = drawn(np.random.default_rng(990101))
    signals = len(recording.states) + len(recording.inputs)
    with limit_work([recording], 1.5) as work:
        maximum_likelihood(recording, library(signals, degree))
    assert 1.5 < work.spent < 3.0


def test_many_candidates_of_the_weak_form_are_not_counted_by_their_square():
    recording, _ = driven(np.random.default_rng(990101))
    _, curves, _ = prepare_recordings([recording])
    counted = []
    for degree in (1, 3):
        terms = library(3, degree)
        with limit_work([recording]) as work:
            weak_fit(make_problem(recording.states, terms, inputs=("u",)), curves, 10.0)
        counted.append(work.spent / len(terms))
    assert 0.0 < counted[1] < 1.5 * counted[0]


def test_the_choice_of_terms_ends_where_no_work_is_left(recording):
    rng = np.random.default_rng(990101)
    design = rng.standard_normal((300, 100))
    information, right = design.T @ design, design.T @ rng.standard_normal(300)
    with limit_work([recording]) as work:
        select_support(information, right, [np.ones(100, bool)], 1.0)
    with limit_work([recording], 0.2 * work.spent) as less:
        support = select_support(information, right, [np.ones(100, bool)], 1.0)
    assert less.is_cut_short and not work.is_cut_short
    assert less.spent < 0.5 * work.spent and support.any()
