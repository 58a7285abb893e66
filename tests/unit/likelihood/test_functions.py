"""Terms that are no polynomials, and bounds of coefficients, in identification."""

import json

import numpy as np
import pytest
from identification_cases import noisy
from oscillators import LIBRARIES, recorded

from galloping import (
    Coefficient,
    IdentifiedModel,
    Recording,
    library,
    maximum_likelihood,
    parse_model,
    polynomial_library,
    simulate,
)
from galloping.identification.findings import Code
from galloping.identification.problem import make_problem
from galloping.summary.sample_files import trial

DESIGN, REPORTING = 20261128, 20261129  # only the former was looked at while the method was made
STATES = ("q", "dq")


def errors(found, true, free, std):
    """Of the terms to be found, in standard deviations of the bound."""
    at = tuple(free.T)
    return (found.model.coefficients[at] - true.coefficients[at]) / std


@pytest.mark.parametrize("kind", LIBRARIES)
def test_an_oscillator_is_found_with_the_right_library(kind, tmp_path):
    true, recording, free, std = recorded(kind, DESIGN, 0)
    found = maximum_likelihood(recording, true.terms)
    assert np.array_equal(np.argwhere(found.support), free)
    assert np.abs(errors(found, true, free, std)).max() < 4.0
    found.save(tmp_path / "model.json")
    assert IdentifiedModel.load(tmp_path / "model.json") == found
    ahead = simulate(found.model, recording.values[0], recording.time)
    left = recording.values - ahead.states
    assert ahead.status == "ok" and np.all(left.std(axis=0) < 0.1 * recording.values.std(axis=0))


def test_a_model_that_sticks_a_swing_late_gets_no_further_term_for_it():
    true, recording, free, std = recorded("dry friction", DESIGN, 8)
    found = maximum_likelihood(recording, true.terms)
    assert np.array_equal(np.argwhere(found.support), free)
    assert np.abs(errors(found, true, free, std)).max() < 4.0


def test_what_only_the_motion_before_its_end_tells_has_an_error_nevertheless():
    rows = trial(DESIGN, "dry friction, its term asked for", range(3), {"maximum_likelihood": {}})
    for row in rows:
        terms = json.loads(row["coefficients"])["dq"].values()
        assert row["status"] == "approximate" and row["exact_support"]
        assert all(error > 0.0 for _, error in terms) and row["coverage"] == 1.0


@pytest.mark.slow
@pytest.mark.parametrize("kind", LIBRARIES)
def test_oscillators_are_found_with_errors_near_the_bound(kind):
    squares, ok = [], 0
    for replicate in range(20):
        true, recording, free, std = recorded(kind, REPORTING, replicate)
        found = maximum_likelihood(recording, true.terms)
        if np.array_equal(np.argwhere(found.support), free):
            squares.append(np.mean(errors(found, true, free, std) ** 2))
            ok += found.status == "ok"
    assert len(squares) >= 18
    assert np.sqrt(np.mean(squares)) <= 1.3
    assert ok >= 14


@pytest.mark.parametrize(("kind", "named"), [("pendulum", "sin(q)"), ("drag", "|dq| dq"),
                                             ("dry friction", "sign(dq)")])  # fmt: skip
def test_the_kind_of_term_that_a_polynomial_library_lacks_is_named(kind, named):
    found = maximum_likelihood(recorded(kind, REPORTING, 0)[1], CUBIC)
    (missing,) = (each for each in found.findings if each.code == Code.TERM_MISSING)
    assert named in missing.data["term"]


def test_a_quotient_of_what_crosses_zero_is_refused_with_the_divisor():
    true = parse_model("q = dq; dq = -4 q - 0.05 dq")
    time = np.linspace(0.0, 20.0, 401)
    recording = noisy(true, simulate(true, (1.0, 0.0), time).states, time, 0.02, 1)
    terms, _ = library("q + dq + 1/(q - 0.5)", STATES)
    found = maximum_likelihood(recording, terms)
    assert found.status == "refused" and found.findings[0].subject == "1/(q - 0.5)"
    terms, _ = library("q + dq + 1/(q - 5)", STATES)
    assert maximum_likelihood(recording, terms).support.sum() == 2


# --- bounds ---


TRUE = parse_model("q = dq; dq = -4 q - 0.05 dq - 0.5 q^3")
TIME = np.linspace(0.0, 20.0, 401)
CUBIC, BOUNDED = polynomial_library(2, 3), {"q": (1, 0), "dq": (0, 1)}


def bounded(**bounds):
    """What is identified with bounds of q or dq in the equation of dq."""
    recording = noisy(TRUE, simulate(TRUE, (1.0, 0.0), TIME).states, TIME, 0.05, 1)
    known = [
        Coefficient("dq", BOUNDED[name], lower=low, upper=high)
        for name, (low, high) in bounds.items()
    ]
    return maximum_likelihood(recording, CUBIC, coefficients=known)


def test_bounds_that_hold_change_nothing_and_are_kept_with_the_model(tmp_path):
    free, found = bounded(), bounded(dq=(-1.0, 0.0), q=(-10.0, 0.0))
    assert found.model == free.model and found.status == free.status
    found.save(tmp_path / "model.json")
    loaded = IdentifiedModel.load(tmp_path / "model.json")
    assert loaded == found and loaded.bounds == ((1, (0, 1), -1.0, 0.0), (1, (1, 0), -10.0, 0.0))


def test_a_coefficient_stays_within_its_bounds():
    found = bounded(q=(-3.95, 0.0))
    column = CUBIC.index((1, 0))
    assert found.model.coefficients[1, column] >= -3.95
    assert not found.has_finding(Code.BOUNDS_CONTRADICTED)
    wrong = bounded(dq=(0.0, np.inf))  # it gains energy, says who sets the bound
    assert not wrong.support[1, CUBIC.index((0, 1))] and wrong.status != "ok"


def test_bounds_are_checked():
    for wrong in ({}, {"lower": 1.0, "upper": 1.0}, {"lower": np.nan}):
        with pytest.raises(ValueError, match="coefficient: "):
            Coefficient("dq", (0, 1), **wrong)
    recording = Recording(TIME, STATES, np.zeros((len(TIME), 2)))
    for pair in (
        [Coefficient("dq", (0, 1), 0.1, upper=0.0)],
        [Coefficient("dq", (0, 1), 0.1, 0.01), Coefficient("dq", (0, 1), upper=0.0)],
    ):
        with pytest.raises(ValueError, match=r"out of its bounds"):
            maximum_likelihood(recording, CUBIC, coefficients=pair)


def test_a_known_constant_sets_an_equilibrium_that_is_not_measured():
    true = parse_model("q = dq; dq = 2 - 4 q - 0.1 dq - 0.5 q^3")
    recording = noisy(true, simulate(true, (1.5, 0.0), TIME).states, TIME, 0.005, 1)
    recording = Recording(TIME, STATES, recording.values * [np.nan, 1.0])
    for deviation, statuses in ((0.1, ("ok",)), (0.0, ("ok", "refused"))):
        known = Coefficient("dq", (0, 0), 2.0, deviation)
        found = maximum_likelihood(recording, CUBIC, coefficients=[known])
        assert found.status in statuses
        assert found.status == "refused" or abs(found.model.coefficients[1, 0] - 2.0) < 0.1


def test_a_coefficient_has_one_mean_and_one_pair_of_bounds():
    mean, fixed = Coefficient("dq", (0, 1), -0.1, 0.01), Coefficient("dq", (0, 1), -0.1)
    bounds = Coefficient("dq", (0, 1), upper=0.0)
    for pair in ((mean, mean), (fixed, mean), (bounds, bounds)):
        with pytest.raises(ValueError, match="said twice"):
            make_problem(STATES, CUBIC, coefficients=pair)
    for pair in ((fixed, bounds), (bounds, fixed)):
        problem = make_problem(STATES, CUBIC, coefficients=pair)
        assert problem.known[1, CUBIC.index((0, 1))] == -0.1 and len(problem.bounds) == 1
