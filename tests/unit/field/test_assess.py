"""What a model says of its system, beside what is known in closed form."""

import json
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from field_files import run as command

from galloping import IdentifiedModel, PolynomialModel, assess, derive
from galloping.behaviour.assess import list_extrapolations
from galloping.model.terms import parse_library
from galloping.summary.driving import parse_input_values

A, B = 0.02, 0.05  # net damping 0.1 - A U, cubic damping B: onset at U = 5, A^2 = 4 (A U - 0.1)/3 B
ERROR = 0.001  # of A


def oscillator(frequency=1.0, damping=0.1, error=ERROR):
    """q'' = -w^2 q + (A U - damping) w q' - B q'^3 / w, at w = 2 pi frequency."""
    w = 2 * np.pi * frequency
    terms, _ = parse_library("q + dq + U*dq + dq^3", ("q", "dq"), ("U",))
    coefficients = np.zeros((2, len(terms)))
    coefficients[0, 1] = 1.0
    coefficients[1] = -(w**2), -damping * w, A * w, -B / w
    model = PolynomialModel(("q", "dq"), terms, coefficients, ("U",))
    covariance = np.zeros((5, 5))
    covariance[3, 3] = (error * w) ** 2
    return IdentifiedModel(model, is_judged=True, covariance=covariance,
                           initial_states=np.array([[0.5, 0.0]]))  # fmt: skip


def amplitude(wind):
    return np.sqrt(4 * (A * wind - 0.1) / (3 * B))


@pytest.mark.parametrize("frequency", [0.4, 70.0, 0.001])
def test_rest_and_limit_cycle_at_a_wind_of_slow_and_fast_systems(frequency):
    (condition,) = assess(oscillator(frequency), {"U": 10.0}).conditions
    (rest,) = condition.equilibria
    (mode,) = rest.modes
    assert not rest.stable and rest.place["q"].value == 0.0
    assert mode.frequency.value == pytest.approx(frequency, rel=1e-6)
    assert mode.damping.value == pytest.approx(-0.05, rel=1e-9)
    deviation = ERROR * 10.0 / 2
    assert mode.damping.low == pytest.approx(-0.05 - 2 * deviation, abs=deviation)
    assert mode.damping.high == pytest.approx(-0.05 + 2 * deviation, abs=deviation)
    (cycle,) = condition.cycles
    half = cycle.half_range["q"]
    assert cycle.stable and cycle.found == 1.0
    assert half.value == pytest.approx(amplitude(10.0), rel=2e-3)
    assert half.low < amplitude(9.5) and half.high > amplitude(10.5)
    assert cycle.period.value == pytest.approx(1 / frequency, rel=1e-2)


def test_the_onset_lies_where_the_damping_vanishes():
    found = assess(oscillator(), {"U": np.arange(3.0, 9.0)})
    (onset,) = found.onsets
    assert onset.is_growing_above and onset.value.value == pytest.approx(5.0, abs=1e-8)
    assert onset.frequency == pytest.approx(1.0)
    assert onset.value.low == pytest.approx(5.0 - 0.5, abs=0.25)
    assert onset.value.high == pytest.approx(5.0 + 0.5, abs=0.25)
    for condition in found.conditions:
        wind = condition.at["U"]
        assert condition.equilibria[0].stable == (wind < 5.0)
        assert len(condition.cycles) == (wind > 5.0)
        for cycle in condition.cycles:
            assert cycle.half_range["q"].value == pytest.approx(amplitude(wind), rel=1e-2)
    unsure = assess(oscillator(error=10 * ERROR), {"U": np.arange(3.0, 9.0)}).onsets[0].value
    assert unsure.high == np.inf and unsure.low <= 4.0


def two_oscillators(damping_of_x):
    """Model of q, which grows above U = 5, and x, which the wind does not change."""
    terms, _ = parse_library("q + dq + U*dq + dq^3 + x + dx + dx^3", ("q", "dq", "x", "dx"), ("U",))
    coefficients = np.zeros((4, len(terms)))
    coefficients[0, 1] = coefficients[2, 5] = 1.0
    coefficients[1, :4] = -9.0, -0.3, 0.06, -0.05
    coefficients[3, 4:] = -40.0, -damping_of_x, -0.05
    model = PolynomialModel(("q", "dq", "x", "dx"), terms, coefficients, ("U",))
    return IdentifiedModel(model, is_judged=True, initial_states=np.array([[0.5, 0.0, 0.5, 0.0]]))


def test_a_second_motion_that_begins_to_grow_is_no_end_of_growth():
    (onset,) = assess(two_oscillators(-0.1), {"U": np.array([3.0, 9.0])}).onsets
    assert onset.is_growing_above and onset.value.value == pytest.approx(5.0, abs=1e-6)


def test_rounding_of_a_motion_without_damping_is_no_onset():
    answer = assess(two_oscillators(0.0), {"U": np.array([3.0, 9.0])})
    assert not answer.onsets
    assert len(answer.notes) == 1  # instead of one for each crossing that is not followed


def test_a_line_has_the_onset_of_its_closed_form_and_both_its_limit_cycles():
    """The 2:1 resonance makes the vertical cycle unstable, beside the stable one of both modes."""
    line = IdentifiedModel(derive(), initial_states=np.array([[0.1, 0.1, 0, 0]]))
    (condition,) = assess(line).conditions
    assert [cycle.stable for cycle in condition.cycles] == [True]
    (rest,) = condition.equilibria
    assert {mode.state for mode in rest.modes} == {"q_v", "q_w"}
    assert np.isnan(condition.cycles[0].period.low)  # no method stated a covariance


def test_systems_that_are_no_oscillators():
    pitchfork = PolynomialModel(("x",), ((1,), (3,)), [[1.0, -1.0]])
    found = IdentifiedModel(pitchfork, initial_states=np.array([[0.5]]))
    (condition,) = assess(found).conditions
    places = sorted(rest.place["x"].value for rest in condition.equilibria)
    assert places == pytest.approx([0.0, 1.0]) or places == pytest.approx([-1.0, 0.0, 1.0])
    for rest in condition.equilibria:
        decay = 2.0 if rest.place["x"].value else -1.0
        assert rest.modes[0].frequency.value == 0.0
        assert rest.modes[0].damping.value == pytest.approx(decay)
    assert not condition.cycles


@pytest.mark.filterwarnings("error")
def test_each_mode_has_a_state_of_its_own_and_rounding_is_no_growth():
    terms = tuple(map(tuple, np.eye(4, dtype=int)))
    stiffness = np.array([[4.0, -0.5], [-0.5, 1.0]])
    rates = np.block([[np.zeros((2, 2)), np.eye(2)], [-stiffness, np.zeros((2, 2))]])
    model = PolynomialModel(("x", "y", "dx", "dy"), terms, rates)
    free = np.argwhere(model.support)
    found = IdentifiedModel(
        model, is_judged=True, covariance=np.diag(np.where(free[:, 0] < 2, 0.0, 1.0)),
        initial_states=np.array([[0.01, 10.0, 0.0, 0.0]]),
    )  # fmt: skip
    (rest,) = assess(found).conditions[0].equilibria
    assert [mode.state for mode in rest.modes] == ["y", "x"]
    assert all(mode.damping.value == 0.0 for mode in rest.modes)
    assert all(mode.damping.low <= 0.0 <= mode.damping.high for mode in rest.modes)


def test_a_damping_of_zero_has_the_limit_of_its_detection_at_any_value_of_an_input():
    terms, _ = parse_library("q + dq + U*dq + U", ("q", "dq"), ("U",))
    model = PolynomialModel(("q", "dq"), terms, [[0, 1, 0, 0], [-1, 0, 0, 1]], ("U",))
    limits = np.full((2, 4), np.nan)
    limits[1, 1:3] = 0.03, 0.02
    found = IdentifiedModel(
        model, is_judged=True, detection_limits=limits, initial_states=np.array([[1.0, 0.0]])
    )
    (rest,) = assess(found, {"U": 2.0}).conditions[0].equilibria
    damping = rest.modes[0].damping
    assert damping.value == 0.0
    assert damping.high == -damping.low == pytest.approx(np.hypot(0.03, 0.04) / 2)


def test_equilibria_that_most_drawn_models_lack_have_no_interval():
    terms = ((0, 0), (2, 0), (0, 2))
    model = PolynomialModel(("x", "y"), terms, [[-1.0, 1.0, 0.0], [-1.0, 0.0, 1.0]])
    found = IdentifiedModel(
        model, is_judged=True, covariance=np.diag([100.0, 0.0, 100.0, 0.0]),
        initial_states=np.array([[-1.0, -0.9]]),
    )  # fmt: skip
    for rest in assess(found).conditions[0].equilibria:
        assert abs(rest.place["x"].value) == pytest.approx(1.0) and np.isnan(rest.place["x"].low)


def test_a_force_may_be_below_zero_and_a_little_outside_of_what_was_recorded():
    for low, high, value, count in ((-3.0, 3.0, -9.0, 1), (0.5, 3.0, -1.0, 1), (-3.0, 3.0, 1.0, 0)):
        found = replace(oscillator(), diagnostics={"U_low": low, "U_high": high})
        assert len(list_extrapolations(found, {"U": value})) == count
    below = replace(oscillator(), diagnostics={"U_low": -3.0, "U_high": -1.0})
    assert len(list_extrapolations(below, {"U": 4.0})) == 1
    of_span = replace(below, model=replace(below.model, states=("q_v", "dq_v")))
    with pytest.raises(ValueError, match=r"U = 4: .*-3 and -1; must be 0"):
        assess(of_span, {"U": 4.0})
    for given, told in (
        ({"X": 3.0}, "X is no input of the model; must be one of U"),
        ({"U": []}, "U has no value"),
        ({"U": [1.0, np.nan]}, "U: .*; must be finite"),
        ({"U": "strong"}, "U: text; must be real numbers"),
    ):
        with pytest.raises(ValueError, match=told):
            assess(below, given)


def test_a_range_ends_where_it_is_said_to():
    for text, values in (("U=8:16:3", [8.0, 11.0, 14.0]), ("U=0:0.3:0.1", [0.0, 0.1, 0.2, 0.3])):
        assert parse_input_values([text], ["U"])["U"] == pytest.approx(values)


def test_the_command_says_the_same_in_words_and_rows(tmp_path):
    path = tmp_path / "model.json"
    found = replace(oscillator(), diagnostics={"U_low": 5.0, "U_high": 9.0})
    found.save(path, units={"U": "m/s"})
    run = partial(command, "assess", path)
    onset, extrapolated, _, *conditions = run("--at", "U=4:10:3").splitlines()
    assert "U = 5.0" in onset and "U = 4 to 10" in extrapolated and "5 and 9" in extrapolated
    (of_ten,) = (line for line in conditions if "U = 10 m/s" in line)
    assert "q ±1.6" in of_ten and "q ± 1.6" in run("--at", "U=4:10:3", "--verbose")
    rows = json.loads(run("--at", "U=10", "--json"))
    half = next(row for row in rows if row["quantity"] == "half range of q")
    assert half["U"] == 10.0 and half["value"] == pytest.approx(amplitude(10.0), rel=1e-2)
    assert run("--at", "U=10", "--csv").splitlines()[0].startswith("U,what,number,stable,quantity")
    for options, said in (
        ((), "--at U=VALUE"),
        (("--at", "V=3"), "inputs U"),
        (("--at", "U=9:8"), "U=12"),
        (("--at", "U=x"), "U=12"),
        (("--at", "U=1:2:1e-9"), "2 to 200"),
        (("--at", "U=8:16:20"), "2 to 200"),
        (("--at", "U=8", "--figure", tmp_path / "a.png"), "range of an input"),
        (("--at", "U=4:10:3", "--figure", "/dev/full"), "must end in .svg or .png"),
    ):
        printed = run(*options, code=1)
        assert said in printed and printed.count("\n") == 1
