"""A search for a model ends at its limit of work, and says so: counted, never timed."""

import numpy as np
import pytest
from identification_cases import model, noisy, solution

from galloping.identification.likelihood.maximum_likelihood import maximum_likelihood
from galloping.identification.work import ENDED, MOST, limited

# its first swings are far quicker than most of the record: the first time scale gives no model
TRUE = model(("x", "y"), 3, {"x^3": -0.1, "y^3": 2.0}, {"x^3": -2.0, "y^3": -0.1})
TIME = np.linspace(0.0, 25.0, 2501)


@pytest.fixture(scope="module")
def recording():
    return noisy(TRUE, solution(TRUE, (2.0, 0.0), TIME), TIME, 0.1, 100)


def searched(recording, most):
    """The model, and the work that was counted."""
    with limited([recording], most) as work:
        found = maximum_likelihood(recording, TRUE.terms)
    return found, most - work.left


@pytest.fixture(scope="module")
def whole(recording):
    return searched(recording, MOST)


def test_a_search_within_its_limit_is_that_without_one(recording, whole):
    found, used = whole
    assert found.status == "ok" and 0 < used < 0.1 * MOST
    again, counted = searched(recording, 1.01 * used)
    assert counted == used and again.reason == found.reason
    assert np.array_equal(again.model.coefficients, found.model.coefficients)
    assert np.array_equal(again.covariance, found.covariance)


@pytest.mark.parametrize("share", [0.05, 0.3])
def test_a_search_at_its_limit_ends_and_is_not_ok(recording, whole, share):
    most = share * whole[1]
    found, used = searched(recording, most)
    assert found.status != "ok" and found.reason.split("; ").count(ENDED) == 1
    assert used < whole[1]
    again, counted = searched(recording, most)
    assert counted == used and again.reason == found.reason


def test_nothing_is_begun_where_no_work_is_left(recording):
    found, used = searched(recording, 0.0)
    assert (found.status, found.reason, used) == ("refused", ENDED, 0.0)
