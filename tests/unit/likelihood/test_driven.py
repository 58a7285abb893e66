"""Identification of what measured inputs drive: a Duffing oscillator, a line in gusts."""

from dataclasses import replace

import numpy as np
import pytest
from identification_cases import assert_found, deviations, unknown_support

import galloping
from galloping import Coefficient, Input
from galloping.identification.findings import Code
from galloping.identification.preparation.weak_form import delayed_inputs, make_start
from galloping.identification.problem import make_problem

TIME = np.arange(1601) / 20.0
DUFFING_TERMS = ((1, 0, 0), (0, 1, 0), (3, 0, 0), (0, 0, 1))
DUFFING = galloping.PolynomialModel(
    ("y", "dy"), DUFFING_TERMS, [[0, 1, 0, 0], [-9.0, -0.3, -0.7, 1.0]], ("F",)
)
CUBIC = (*((*term, 0) for term in galloping.polynomial_library(2, 3)), (0, 0, 1))

LINE_TERMS = ((1, 0, 0), (0, 1, 0), (0, 1, 1), (0, 2, 0), (0, 3, -1), (3, 0, 0))
LINE = galloping.PolynomialModel(
    ("q", "dq"), LINE_TERMS, [[0, 1, 0, 0, 0, 0], [-4.0, -0.5, 0.06, 0.0, -1.2, -0.3]], ("U",)
)
WIND_LIBRARY = (*LINE_TERMS, (2, 0, 0), (0, 0, 0), (0, 0, 2))


def multisine(time, seed=0, lowest=0.1, highest=0.9, size=1.0):
    rng = np.random.default_rng(seed)
    tones = rng.uniform(lowest, highest, 15)[:, None] * 2.0 * np.pi
    return size * np.cos(tones * time + rng.uniform(0.0, 6.3, (15, 1))).sum(axis=0)


FORCE = Input(TIME, multisine(TIME))
GUSTS = Input(TIME, 12.0 + multisine(TIME, 1, 0.01, 0.4, 0.3))


def recorded(model, inputs, time=TIME, **measured):
    motion = galloping.simulate(model, (0.1, 0.0), time, inputs)
    about = {"level": 0.05, "seed": 3, "inputs": inputs} | measured
    return galloping.measure(model, motion, **about)


@pytest.fixture(scope="module")
def in_gusts():
    """A recording of the line in gusts, and the model found from it."""
    recording = recorded(LINE, {"U": GUSTS})
    return recording, galloping.maximum_likelihood(recording, WIND_LIBRARY)


@pytest.mark.parametrize("protocol", ["state", "displacement"])
def test_a_driven_oscillator_is_found_at_the_bound(protocol):
    true, errors = DUFFING.on_library(CUBIC), []
    support = unknown_support(true)
    motion = galloping.simulate(DUFFING, [0.1, 0.0], TIME, {"F": FORCE})
    sigma = 0.05 * motion.states.std(axis=0)
    if protocol == "displacement":
        sigma[1] = np.inf
    bound = galloping.cramer_rao_bound(true, [0.1, 0.0], TIME, sigma, inputs={"F": FORCE})
    for seed in range(8):
        recording = recorded(DUFFING, {"F": FORCE}, protocol=protocol, seed=seed)
        found = galloping.maximum_likelihood(recording, CUBIC)
        assert_found(found, true)
        assert found.standard_errors[support] == pytest.approx(bound[support], rel=0.1)
        errors.append((found.model.coefficients - true.coefficients)[support] / bound[support])
    assert np.sqrt(np.mean(np.square(errors))) < 1.3


def test_a_line_in_gusts_holds_at_other_winds(in_gusts):
    _, found = in_gusts
    assert_found(found, LINE)
    assert found.recorded("U") == pytest.approx(np.quantile(GUSTS.values, (0.05, 0.95)))
    for speed in (10.0, 12.0, 14.0):
        held, true = found.at({"U": speed}), LINE.at({"U": speed})
        assert np.max(np.abs(deviations(held, true))) < 3.0
        amplitude, right = (
            np.ptp(galloping.simulate(model, [0.5, 0.0], TIME).states[TIME > 60.0, 0])
            for model in (held.model, true)
        )
        assert amplitude == pytest.approx(right, rel=0.05)


def test_a_structural_damping_tells_the_onset_from_one_steady_wind():
    recording = recorded(LINE, {"U": Input(TIME, np.full(len(TIME), 12.0))})
    known = Coefficient("dq", (0, 1, 0), mean=-0.5, deviation=0.02)
    found = galloping.maximum_likelihood(recording, WIND_LIBRARY, coefficients=[known])
    assert found.status == "ok"
    assessed = galloping.assess(found, at={"U": np.linspace(6.0, 14.0, 9)})
    (onset,) = assessed.onsets
    assert onset.value.low < 0.5 / 0.06 < onset.value.high < 9.5


def test_functions_of_states_are_found_beside_an_input():
    truth = galloping.parse_model("y = dy; dy = -9 sin(y) - 0.2 |dy| dy + F", ["F"])
    terms, _ = galloping.library("y + dy + sin(y) + |dy| dy + F", ["y", "dy"], ["F"])
    found = galloping.maximum_likelihood(recorded(truth, {"F": FORCE}), terms)
    assert found.status == "ok"
    assert found.support[1].tolist() == [False, False, True, True, True]


def test_inputs_that_no_term_names_change_nothing(in_gusts):
    recording, _ = in_gusts
    terms = galloping.polynomial_library(2, 3)
    alone = galloping.maximum_likelihood(replace(recording, inputs={}), terms)
    assert galloping.maximum_likelihood(recording, terms) == alone


def test_stretches_without_the_input_do_not_count():
    values = np.array(FORCE.values)
    values[600:700] = np.nan
    recording = recorded(DUFFING, {"F": FORCE})
    given = replace(recording, inputs={"F": Input(TIME, values)})
    found, of_parts = (
        galloping.maximum_likelihood(each, CUBIC)
        for each in (given, [recording[:600], recording[700:]])
    )
    assert found.status == "ok"
    assert found.model.coefficients == pytest.approx(of_parts.model.coefficients, rel=1e-3)
    assert found.initial_states.shape == (2, 2)
    assert found.diagnostics["without_inputs_share"] == pytest.approx(100 / 1601)


def test_a_model_is_summarised_where_its_input_was_recorded():
    force = Input(TIME[20:-8], np.where((TIME > 15.0) & (TIME < 21.0), np.nan, FORCE.values)[20:-8])
    whole = recorded(DUFFING, {"F": FORCE})
    recording = replace(whole, inputs={"F": force})
    found = galloping.maximum_likelihood(recording, CUBIC)
    summary = galloping.summarise(found, recording)
    assert summary.found.status == "ok" and summary.held_out
    assert [part.time[0] for part in summary.recordings] == pytest.approx([1.0, 21.0])


def test_drag_is_not_imitated_under_ok():
    drag = galloping.parse_model("y = dy; dy = -y - 0.2 |dy| dy + 0.5 F", ["F"])
    cubic = galloping.parse_model("y = dy; dy = -y - 0.1 dy - 0.1 dy^3 + 0.5 F", ["F"])
    time = np.arange(2000) / 10.0
    force = np.sin(np.outer(time, [0.9, 0.37, 1.7])) @ [1.0, 1.0, 0.5]
    told = []
    for model in (drag, cubic):
        recording = recorded(model, {"F": Input(time, force)}, time, protocol="displacement")
        told.append(galloping.maximum_likelihood(recording, CUBIC))
    assert [one.code for one in told[0].findings] == [Code.DRAG_IMITATED]
    assert [one.status for one in told] == ["not identifiable", "ok"]


def test_no_stretch_with_the_input_is_refused():
    values = np.where(np.arange(1601) % 80 < 60, FORCE.values, np.nan)
    recording = replace(recorded(DUFFING, {"F": FORCE}), inputs={"F": Input(TIME, values)})
    found = galloping.maximum_likelihood(recording, CUBIC)
    assert (found.status, found.codes) == ("refused", "inputs_missing")


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_what_no_model_follows_is_followed_best_when_it_runs_freely(seed):
    """Of a library that lacks a term in F^2 the model errs least over the whole recording, whether
    its segments could be joined or not, and says less of it than if what it misses were white.
    """
    rows = np.hstack([DUFFING.coefficients, [[0.0], [0.03]]])
    odd = replace(DUFFING, terms=(*DUFFING_TERMS, (0, 0, 2)), coefficients=rows)
    recording = recorded(odd, {"F": Input(TIME, multisine(TIME, seed))}, level=0.002)
    found = galloping.maximum_likelihood(recording, DUFFING_TERMS)
    assert found.status == "approximate"
    assert found.has_finding(Code.FREE_RUN_MISSES)
    assert not found.has_finding(Code.FORCES)  # which were measured

    def error(coefficients):
        model = replace(DUFFING, coefficients=coefficients)
        motion = galloping.simulate(model, found.initial_states[0], TIME, recording.inputs)
        return np.mean(((motion.states - recording.values) / found.sigma[0]) ** 2)

    least = error(found.model.coefficients)
    for place in map(tuple, np.argwhere(found.support)):
        for sign in (-1.0, 1.0):
            moved = np.zeros((2, 4))
            moved[place] = sign * found.standard_errors[place]
            assert error(found.model.coefficients + moved) > 0.999 * least
    white = galloping.cramer_rao_bound(
        found.model, found.initial_states[0], TIME, found.sigma[0], inputs=recording.inputs
    )
    assert np.all(found.standard_errors[found.support] > 1.3 * white[found.support])


@pytest.mark.parametrize("protocol", ["state", "derivative"])
def test_single_coefficients_are_fixed_or_bounded(protocol):
    recording = recorded(DUFFING, {"F": FORCE}, protocol=protocol, level=0.1, seed=2)
    stiffness, cubic, odd = (CUBIC.index(term) for term in ((1, 0, 0), (3, 0, 0), (1, 1, 0)))

    def told(*coefficients):
        return galloping.maximum_likelihood(recording, CUBIC, coefficients=coefficients)

    free, fixed = told(), told(Coefficient("dy", (3, 0, 0), -0.7))
    assert fixed.model.coefficients[1, cubic] == -0.7
    assert fixed.standard_errors[1, cubic] == 0.0
    assert fixed.standard_errors[1, stiffness] < 0.7 * free.standard_errors[1, stiffness]
    assert fixed.covariance.shape == (fixed.support.sum(),) * 2
    row = np.flatnonzero(np.argwhere(fixed.support)[:, 1] == cubic)
    assert not fixed.covariance[row].any()

    deviation = free.standard_errors[1, cubic]
    bounded = told(Coefficient("dy", (3, 0, 0), -0.7, deviation))
    middle = (free.model.coefficients[1, cubic] - 0.7) / 2.0  # two statements as sure
    assert bounded.model.coefficients[1, cubic] == pytest.approx(middle, abs=0.05 * deviation)
    assert bounded.standard_errors[1, cubic] == pytest.approx(deviation / np.sqrt(2.0), rel=0.05)

    # what the data contradict is named, where it is surely so
    cubed, far = free.model.coefficients[1, cubic], 20.0 * deviation
    wrong = told(Coefficient("dy", (3, 0, 0), cubed + far, deviation))
    assert wrong.status != "ok" and wrong.findings[0].code == Code.PRIOR_CONTRADICTED
    assert wrong.findings[0].data["term"] == "y^3 in d(dy)/dt"
    assert told(Coefficient("dy", (3, 0, 0), cubed + 0.1 * far, deviation)).status == "ok"

    # not told by the data, yet not left out
    small = told(Coefficient("dy", (1, 1, 0), 0.0, 1e-4))
    assert small.support[1, odd] and small.support.sum() == free.support.sum() + 1
    assert small.standard_errors[1, odd] == pytest.approx(1e-4, rel=0.05)


def test_terms_are_sought_where_they_are_allowed():
    allowed = np.ones((2, len(CUBIC)), bool)
    allowed[1] = [term in DUFFING_TERMS for term in CUBIC]
    recording = recorded(DUFFING, {"F": FORCE})
    found = galloping.maximum_likelihood(recording, CUBIC, allowed=allowed)
    assert found.status == "ok"
    assert not found.support[~allowed].any()
    assert np.isnan(found.detection_limits[1, ~allowed[1]]).all()


def test_the_error_of_an_input_is_in_the_intervals(in_gusts):
    """A factor on the wind is one on each coefficient, to the power of the wind in its term."""
    recording, sure = in_gusts
    given = {"U": replace(GUSTS, error=0.02)}
    unsure = galloping.maximum_likelihood(replace(recording, inputs=given), WIND_LIBRARY)
    assert unsure.model == sure.model
    powers = {(1, 0, 0): 0, (0, 1, 0): 0, (0, 1, 1): 1, (0, 3, -1): -1}
    for term, power in powers.items():
        place = 1, WIND_LIBRARY.index(term)
        added = 0.02 * power * sure.model.coefficients[place]
        whole = np.hypot(sure.standard_errors[place], added)
        assert unsure.standard_errors[place] == pytest.approx(whole, rel=1e-9)


def test_an_input_that_comes_late_is_named():
    """As of an anemometer that stands aside."""
    recording = recorded(LINE, {"U": GUSTS}, time=TIME[10:-10], level=0.01)
    assert galloping.maximum_likelihood(recording, WIND_LIBRARY).status == "ok"
    for delay in (-0.3, 0.3, 2.0):
        aside = {"U": Input(TIME + delay, GUSTS.values)}
        found = galloping.maximum_likelihood(replace(recording, inputs=aside), WIND_LIBRARY)
        assert found.status == "approximate"
        (late,) = (each for each in found.findings if each.subject == "U" and "delay" in each.code)
        assert late.code == Code.INPUT_DELAYED_BY
        assert late.data["delay_s"] == pytest.approx(delay, abs=0.1)


def test_recordings_share_their_inputs_by_name():
    first, second = (recorded(DUFFING, {"F": FORCE}, seed=seed) for seed in (1, 2))
    twice = replace(second, inputs={"G": GUSTS, "F": FORCE})
    found = galloping.maximum_likelihood([first, twice], CUBIC)
    assert found.status == "ok"
    assert found.model.inputs == ("F",)


def test_a_rest_shorter_than_a_test_function_says_nothing_of_delays():
    """Beside the motion: as where an input is there for a moment only."""
    rng = np.random.default_rng(5)
    moving = np.column_stack([np.sin(TIME), np.cos(TIME)]) + 0.01 * rng.normal(size=(len(TIME), 2))
    short, rest = np.linspace(0.0, 0.5, 120), 0.01 * rng.normal(size=(120, 2))
    problem = make_problem(("y", "dy"), DUFFING_TERMS, inputs=("F",))

    def late(*recorded):
        recordings = [
            galloping.Recording(time, ("y", "dy"), values, inputs={"F": FORCE})
            for time, values in recorded
        ]
        return delayed_inputs(make_start(problem, recordings))

    assert late((TIME, moving), (short, rest)) == late((TIME, moving))
