"""What a model says of its line, from Python: values with intervals, beside the truth."""

import pickle
from dataclasses import replace

import numpy as np
import pytest
from statuses import finding_for

import galloping
from galloping.behaviour.dynamics import Surroundings, Value, dynamics
from galloping.summary.numbers import compute_numbers, keeps_any_amplitude
from galloping.summary.wording import _beyond_recorded

pytestmark = pytest.mark.xdist_group("summary")

START = [0.3, 0.2, 0, 0]


@pytest.fixture(scope="module")
def line():
    return galloping.derive(wind={"speed": 14})


@pytest.fixture(scope="module")
def recorded(line):
    motion = galloping.simulate(line, START, np.arange(7501) / 25)
    return galloping.measure(line, motion, level=0.02, seed=3)


@pytest.fixture(scope="module")
def summary(recorded):
    found = galloping.maximum_likelihood(recorded, galloping.polynomial_library(4, 3))
    return galloping.summarise(found, recorded)


def test_the_values_hold_the_truth(line, summary):
    eigenvalues = np.linalg.eigvals(line.jacobian(np.zeros((1, 4)))[0])
    modes = sorted(eigenvalues, key=lambda e: -e.imag)[:2]
    motion = galloping.simulate(line, START, np.arange(50000) / 25).states[-5000:]
    of = summary.dynamics
    for k, (state, mode) in enumerate(zip(("q_v", "q_w"), modes, strict=True)):
        for value, truth in (
            (of.frequencies[state], abs(mode) / (2 * np.pi)),
            (of.damping[state], -mode.real / abs(mode)),
            (of.half_range[state], np.ptp(motion[:, k]) / 2),
        ):
            assert value.low <= value.value <= value.high
            assert abs(value.value - truth) < value.high - value.low
    assert np.all(summary.held_out.skill > 0.9) and np.all(summary.held_out.held > 0.75)


def test_the_parts_of_a_summary_are_had_alone(summary, recorded):
    found = summary.found
    assert galloping.dynamics(found, recorded) == summary.dynamics
    alone = galloping.forecast(found, recorded)
    assert alone == summary.forecast != galloping.forecast(found, recorded, seed=1)
    assert pickle.loads(pickle.dumps(summary)) == summary
    assert repr(alone).startswith("Forecast of q_v, q_w, dq_v, dq_w from 300.04 to")
    assert alone.time[0] > recorded.time[-1]


def test_a_summary_is_text_and_figures(summary):
    text = str(summary)
    assert text.startswith("# Summary\n\n## What was found\n\n**As recorded, the line gallops.**")
    for said in ("| vertical: natural frequency | 0.4", "### The line", "7501 samples"):
        assert said in text
    assert repr(summary).splitlines()[0] == "Summary of IdentifiedModel of q_v, q_w, dq_v, dq_w"
    assert len(summary.draw_fit().axes) == 4 * len(summary.motions)
    assert len(summary.draw_forecast().axes) == 4 * 2


def test_a_refused_model_says_so_and_no_more(recorded):
    refused = galloping.IdentifiedModel.refused(recorded.states, ((1, 0, 0, 0),), [])
    summary = galloping.summarise(refused, recorded)
    assert "**refused: No model was found.**" in str(summary) and "### The line" not in str(summary)
    assert summary.dynamics is summary.held_out is summary.forecast is summary.advice is None


def test_a_sensor_that_only_a_later_recording_has_is_told():
    time = np.arange(500) / 25
    values, rates = np.full((2, 500, 4), np.nan)
    values[:, 0], rates[:, 3] = np.sin(2.6 * time), np.cos(1.3 * time)
    first = galloping.Recording(time, ("q_v", "q_w", "dq_v", "dq_w"), values)
    refused = galloping.IdentifiedModel.refused(first.states, ((1, 0, 0, 0),), [])
    text = str(galloping.Summary(refused, (first, replace(first, rates=rates))))
    assert "| vertical displacement, recorded | -1.00 to 1.00 m |" in text
    assert "| horizontal acceleration, recorded | -1.00 to 1.00 m/s^2 |" in text


DIES, GROWS, UNSURE = (0.01, 0.008, 0.012), (-0.01, -0.012, -0.008), (0.001, -0.002, 0.004)
NONE = (0.0, -0.003, 0.003)


@pytest.mark.parametrize(
    ("damping", "kind", "said"),
    [
        ((GROWS, DIES), "cycle", "**As recorded, the line gallops.** Small motions grow: vertical"),
        ((UNSURE, DIES), "cycle", "**Whether small vertical motions grow or die out is not"),
        ((DIES, DIES), "cycle", "small motions of the line die out, and larger ones go on**"),
        ((DIES, DIES), "rest", "**As recorded, the line does not gallop.** Small motions die out."),
        ((NONE, NONE), "repeats", "small motions of the line neither grow nor die out**: "),
        ((NONE, NONE), "rest", "The motion dies out, by friction or by terms of higher degree"),
        ((NONE, DIES), "cycle", "**Whether small vertical motions grow or die out is not known**"),
        ((GROWS, UNSURE), "cycle", "**As recorded, the line gallops.** Small motions grow: vert"),
        ((GROWS, GROWS), "diverged", "How far the motion grows is unknown: in simulation it"),
    ],
)  # fmt: skip
def test_whether_a_line_gallops_is_one_line_of_a_summary(summary, damping, kind, said):
    values = {state: Value(*each) for state, each in zip(("q_v", "q_w"), damping, strict=True)}
    known = replace(summary.dynamics, damping=values, kind=kind)
    if kind == "repeats":  # on no limit cycle
        known = replace(known, kind="cycle", period=None)
    outcome = str(replace(summary, dynamics=known)).splitlines()[4]
    assert said in outcome and "  " not in outcome


def test_the_result_is_stated_at_the_means_of_the_inputs(summary):
    """Growth and onset are those of the model at these means, not at each recorded moment."""
    values = {state: Value(*DIES) for state in ("q_v", "q_w")}
    for means, said in (
        ({}, "**As recorded, the line"),
        ({"U": 9.2}, "**At U = 9.2, its mean, the line"),
        ({"U": 9.2, "F": 0.5}, "**At U = 9.2 and F = 0.5, their means, the line"),
    ):
        known = replace(summary.dynamics, damping=values, kind="rest", at=means)
        text = str(replace(summary, dynamics=known))
        assert f"{said} does not gallop.**" in text


def test_growth_of_a_further_mode_is_told_by_its_name(summary):
    values = {state: Value(*GROWS) for state in ("q_v", "q_w", "the mode at 0.31 Hz")}
    frequencies = summary.dynamics.frequencies | {"the mode at 0.31 Hz": Value(0.31, 0.30, 0.32)}
    known = replace(summary.dynamics, damping=values, frequencies=frequencies)
    text = str(replace(summary, dynamics=known))
    assert "vertical ones double in" in text and "those of the mode at 0.31 Hz double in" in text


def test_a_motion_that_keeps_its_size_may_be_galloping(summary):
    values = {state: Value(*NONE) for state in ("q_v", "q_w")}
    known = replace(summary.dynamics, damping=values, period=None)
    found = replace(summary.found, findings=(finding_for("not identifiable"),))
    text = str(replace(summary, dynamics=known, found=found))
    assert "the amplitude is constant, as far as the samples show" in text
    assert "net damping |" not in text
    assert "| vertical displacement, dominant frequency | 0.39 Hz" in text


def test_a_mode_that_keeps_any_amplitude_is_on_no_limit_cycle(summary):
    values = {"q_v": Value(*NONE), "q_w": Value(*DIES)}
    known = replace(summary.dynamics, damping=values)
    assert "settles on a limit cycle" in str(replace(summary, dynamics=known))
    known = replace(known, period=None)
    assert "amplitude of the limit cycle" not in str(replace(summary, dynamics=known))
    assert not keeps_any_amplitude(replace(known, damping={}))  # as of states without rates
    assert keeps_any_amplitude(replace(known, damping={"q_v": Value(np.nan), "q_w": Value(*NONE)}))
    growing = replace(known, damping={"q_v": Value(*GROWS), "q_w": Value(*NONE)})
    assert "amplitude of the limit cycle" in str(replace(summary, dynamics=growing))


def test_a_limit_cycle_that_the_motion_leaves_is_noted(summary):
    """A motion reaches it, since a period-doubling grows by 0.7 % a period."""
    model = galloping.parse_model(
        "q_v = dq_v; q_w = dq_w; "
        "dq_v = -5.70071 q_v + 0.013845 dq_v + 0.6086 q_v^2 - 0.3516 q_v^3 - 0.00318 dq_v^3; "
        "dq_w = -1.741057 q_w + 0.007498 dq_v - 0.045816 dq_w + 0.5054 q_v q_w"
    )
    found = galloping.IdentifiedModel(model, initial_states=np.array([[0.1, 0, 0, 0]]))
    around = Surroundings(np.zeros(4), np.full(4, -0.5), np.full(4, 0.5))
    known = dynamics(found, around, np.random.default_rng(0))
    assert known.kind == "cycle" and not known.is_stable and summary.dynamics.is_stable
    text = str(replace(summary, dynamics=replace(summary.dynamics, is_stable=False)))
    assert "approaches a limit cycle" in text and "the motion slowly leaves it." in text


def test_a_limit_cycle_beyond_the_recorded_motion_is_noted_for_any_sensor(summary):
    omega = {n: 2 * np.pi * f.value for n, f in summary.dynamics.frequencies.items()}
    half = {name: Value(0.5) for name in omega}
    numbers = compute_numbers(replace(summary, dynamics=replace(summary.dynamics, half_range=half)))
    for order, prefix in enumerate(("", "d", "dd")):
        size = 0.25 * omega["q_v"] ** order
        recorded = replace(numbers.recorded[0], name=f"{prefix}q_v", low=-size, high=size)
        (note,) = _beyond_recorded(replace(numbers, recorded=(recorded,)))
        assert note == "2 times the recorded vertical amplitude"


def test_an_interval_of_draws_holds_its_value():
    beyond, unknown = Value.of(1.0, (1.1, 1.2)), Value.of(1.0, (np.nan, np.nan))
    assert (beyond.low, beyond.high) == (1.0, 1.2)
    assert np.isnan([unknown.low, unknown.high]).all()


def test_the_time_of_doubling_is_a_plain_number(summary):
    slowly = {"q_v": Value(-0.0026, -0.0036, 0.0), "q_w": Value(*DIES)}
    known = replace(summary.dynamics, damping=slowly)
    assert "double in 100 s (at least 73 s)" in str(replace(summary, dynamics=known))


def test_outliers_spoil_no_forecast_and_no_recorded_size(summary, recorded):
    values = recorded.values.copy()
    values[7470, 0], values[7400, 1] = 20.0, -20.0
    spoilt = replace(recorded, values=values)
    ahead = galloping.forecast(summary.found, spoilt)
    assert np.abs(ahead.median - summary.forecast.median).max() < 0.02
    row = str(summary).partition("| vertical displacement, recorded |")[2].split("\n")[0]
    assert row in str(replace(summary, recordings=(spoilt,)))


def test_damping_that_was_not_found_is_within_what_would_have_shown(summary):
    found, around = summary.found, Surroundings.of(summary.recordings)
    damped = found.model.terms.index((0, 0, 1, 0))
    without = found.model.coefficients.copy()
    without[2] = 0.0
    without[2, found.model.terms.index((1, 0, 0, 0))] = -7.0
    limits = found.detection_limits.copy()
    limits[2, damped] = 0.02  # 1/s
    bare = replace(
        found, model=replace(found.model, coefficients=without),
        detection_limits=limits, covariance=np.empty((0, 0)), extrapolation_shift=np.empty(0),
        extrapolation_covariance=np.empty((0, 0)),
    )  # fmt: skip
    damping = dynamics(bare, around, np.random.default_rng(1)).damping["q_v"]
    assert damping.value == 0.0
    assert damping.high == -damping.low == pytest.approx(0.01 / np.sqrt(7.0), rel=0.2)
