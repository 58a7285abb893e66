"""What was once answered wrongly: a kind of fault each, with the right answer."""

import json
import re
from dataclasses import replace

import field_files as files
import motions
import numpy as np
import pytest
from ambient import displacements, swing
from statuses import finding_for

from galloping import IdentifiedModel, Recording, assess, maximum_likelihood, polynomial_library
from galloping.behaviour.forecast import check_followed
from galloping.behaviour.objections import outlives_recording, with_objections
from galloping.identification.findings import Code
from galloping.model.polynomial import PolynomialModel
from galloping.summary.numbers import Estimate, compute_numbers
from galloping.summary.summarise import dynamics, summarise
from galloping.summary.wording import in_words

TERMS = polynomial_library(2, 3)


def identified(recording):
    return maximum_likelihood(recording, TERMS)


@pytest.fixture(scope="module")
def growing():
    """A recording of a growing motion, and the model found from it."""
    recording = motions.growing()
    return recording, identified(recording)


def test_a_limit_cycle_is_found(growing):
    """At any size and frequency, as test_units_of_motion says of all numbers."""
    recording, found = growing
    known = dynamics(found, recording)
    assert known.kind == "cycle"
    assert known.half_range["q"].value == pytest.approx(2.0, rel=2e-3)
    assert known.period.value == pytest.approx(6.3, rel=1e-2)
    assert known.damping["q"].value == pytest.approx(-0.1, abs=0.005)
    (condition,) = assess(found).conditions
    (cycle,) = condition.cycles
    assert cycle.stable and cycle.half_range["q"].value == pytest.approx(2.0, rel=2e-3)


def test_of_a_motion_that_has_died_out_nothing_but_noise_is_left_to_forecast(growing):
    """1 Hz, 3 % of critical: after 30 s a 300th of the release is left, a tenth of the noise."""
    time = np.arange(2000) / 50
    states = motions.moved(lambda t, x: [x[1], -39.5 * x[0] - 0.38 * x[1]], (0.05, 0.0), time)
    recording = motions.of_displacement(time, states, 0.0014)
    trial = summarise(identified(recording), recording).held_out
    assert trial.is_noise[0] and trial.missed[0] < 0.2
    live, found = growing
    assert not summarise(found, live).held_out.is_noise[0]


def test_random_forces_are_not_missed_but_held_in_a_band():
    time = np.arange(1200) / 10
    recording = displacements(time, swing(time, 0.5, 0.012, seed=1), noise=0.05, seed=1)
    found = maximum_likelihood(recording, polynomial_library(2, 1), forced=())
    told = compute_numbers(summarise(found, recording, forced=())).forecast.channels
    assert found.is_forced and told and all(np.isnan(one.missed_percent) for one in told)


@pytest.fixture(scope="module")
def pendulum():
    """A recording, its model and their summary: q'' = -100 sin q - 0.04 q', from 60 to 41 degrees,
    with noise of half a degree.
    """
    time = np.arange(2000) / 100
    states = motions.moved(
        lambda t, x: [x[1], -100 * np.sin(x[0]) - 0.04 * x[1]], (np.pi / 3, 0.0), time
    )
    recording = motions.of_displacement(time, states, np.radians(0.5))
    found = identified(recording)
    return recording, found, summarise(found, recording)


def test_small_motions_that_were_not_recorded_are_told_with_what_further_terms_would_change(
    pendulum,
):
    """The cubic is that of the recorded angles."""
    recording, found, summary = pendulum
    assert found.status == "ok"
    true, small = 10.0 / (2.0 * np.pi), summary.dynamics.frequencies["q"]
    alone = dynamics(replace(found, extrapolation_shift=np.zeros(3),
                             extrapolation_covariance=np.zeros((3, 3))), recording)  # fmt: skip
    trusting = alone.frequencies["q"]
    assert not trusting.low <= true <= trusting.high
    assert small.low <= true <= small.high
    assert small.high - small.low < 0.01 * true
    damping = summary.dynamics.damping["q"]
    assert damping.low <= 0.002 <= damping.high
    (rest,) = [rest for rest in assess(summary.found).conditions[0].equilibria if rest.stable]
    assert rest.modes[0].frequency.low <= true <= rest.modes[0].frequency.high


def test_of_a_motion_that_was_small_as_well_further_terms_change_little():
    time = np.arange(6000) / 50
    states = motions.moved(
        lambda t, x: [x[1], -40 * x[0] - 0.4 * x[1] - 8 * x[0] ** 3], (1.0, 0.0), time
    )
    recording = motions.of_displacement(time, states, 0.003)
    summary = summarise(identified(recording), recording)
    errors = np.sqrt(np.diag(summary.found.covariance))
    linear = [*map(tuple, np.argwhere(summary.found.support))].index((1, TERMS.index((1, 0))))
    further = np.sqrt(np.diag(summary.found.extrapolation_covariance))
    assert further[linear] < 2.0 * errors[linear]


def test_what_terms_of_the_next_degree_change_is_stored_with_the_model(pendulum, tmp_path):
    found = pendulum[2].found
    found.save(tmp_path / "model.json")
    assert IdentifiedModel.load(tmp_path / "model.json") == found
    assert found.recorded("q") == pytest.approx((-1.06, 1.06), abs=0.03)
    beyond = [rest.is_extrapolated for rest in assess(found).conditions[0].equilibria]
    assert beyond.count(False) == 1  # where a sine has its further zeros the cubic has others


def lasting(damping):
    """A linear oscillator of 1 Hz as an approximate model."""
    model = PolynomialModel(("q", "dq"), ((1, 0), (0, 1)), [[0, 1], [-39.5, -damping]])
    start = np.array([[0.05, 0.0]])
    return IdentifiedModel(model, (finding_for("approximate"),), True, initial_states=start)


def test_a_model_whose_motion_lasts_where_the_recorded_one_dies_out_is_refused():
    time = np.arange(1000) / 50
    states = motions.moved(lambda t, x: [x[1], -39.5 * x[0] - 0.8 * x[1]], (0.05, 0.0), time)
    recording = motions.of_displacement(time, states, 2e-4)
    assert outlives_recording(lasting(0.0), [recording])
    assert outlives_recording(lasting(-40.0), [recording])  # which runs away
    assert not outlives_recording(lasting(0.7), [recording])
    steady = motions.on_its_limit_cycle()
    assert not outlives_recording(lasting(0.0), [steady])
    said = with_objections(lasting(0.0), [recording], ["a"], 1.0, lambda parts: lasting(0.0))
    assert said.status == "refused" and said.has_finding(Code.OUTLIVED)


@pytest.mark.parametrize(
    ("estimate", "said"),
    [
        (Estimate(0.42048034, 0.420452, 0.420498, "Hz"), "0.4205 Hz (narrower than 0.0001 Hz)"),
        (Estimate(2.00017, 1.99899, 2.00168), "2.000 (1.999 to 2.002)"),
        (Estimate(2.0001e-6, 1.9990e-6, 2.0017e-6, "m"), "2.000e-06 m (1.999e-06 to 2.002e-06)"),
        (Estimate(2000173.0, 1998999.0, 2001678.0), "2.000e+06 (1.999e+06 to 2.002e+06)"),
        (Estimate(1.5894001, 1.5894000, 1.5894002, "Hz"), "1.589 Hz (narrower than 0.001 Hz)"),
        (Estimate(1.5894, 1.5888, 1.5932, "Hz"), "1.589 Hz (1.589 to 1.593)"),
        (Estimate(1.5894, 1.5838, 1.5982, "Hz"), "1.589 Hz (1.584 to 1.598)"),
        (Estimate(16.0, 12.0, 20.0, "s"), "16 s (12 to 20)"),
        (Estimate(0.0, -3e-4, 3e-4, "m"), "0 m (-3.0e-04 to 3.0e-04)"),
        (Estimate(1.0, np.nan, np.nan), "1 (interval unknown)"),
        (Estimate(1.0, 0.5, np.inf), "1 (0.5 to beyond the range)"),
    ],
)
def test_a_number_has_the_digits_that_its_interval_tells(estimate, said):
    assert in_words(estimate) == said


def test_no_window_that_is_told_is_longer_than_its_recording():
    time = np.arange(500) / 50
    states = motions.moved(lambda t, x: [x[1], -1.6 * x[0] - 0.1 * x[1]], (1.0, 0.0), time)
    recording = motions.of_displacement(time, states, 0.02)
    other = replace(recording, values=np.roll(recording.values, 250, axis=0))
    found = identified(recording)
    with pytest.raises(ValueError, match=r"over (9\.98|10) s"):
        check_followed(found, other, 30.0)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """What `identify` writes of a camera at a quarter of a span, and prints as JSON."""
    folder = tmp_path_factory.mktemp("numbers")
    time, states = files.motion(12.0, 120.0)
    seen = files.seen(np.sin(np.pi / 4) * states, 1)
    files.write(folder / "a.csv", time, 1e3 * seen, "t [s],cam v [mm],cam w [mm]")
    printed = files.run(
        "identify", folder / "a.csv", "--measure", "q_v=cam v@50", "--measure", "q_w=cam w@50",
        "--span", 200, "--output", folder / "out", "--json",
    )  # fmt: skip
    return folder / "out", json.loads(printed), seen


def test_a_column_is_told_with_its_own_extremes(folder):
    out, _, seen = folder
    text = (out / "summary.md").read_text(encoding="utf-8")
    low, high = seen[:, 0].min(), seen[:, 0].max()
    assert re.search(rf"cam v of a\.csv, .*\| {low:.2f}\d* to {high:.2f}\d* m \|", text)
    told = re.search(
        r"\| vertical displacement of the first mode, recorded \| (\S+) to (\S+) m", text
    )
    assert float(told[2]) == pytest.approx(np.sqrt(2.0) * high, rel=0.02)


def test_all_numbers_of_a_summary_are_there_for_programs(folder):
    out, printed, _ = folder
    numbers = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    text = (out / "summary.md").read_text(encoding="utf-8")
    assert printed["summary"] == numbers
    assert printed["files"]["summary.json"] == str(out / "summary.json")
    system, trial = numbers["system"], numbers["forecast"]
    shown = [one[key] for one in system["small_motions"]
             for key in ("natural_frequency", "net_damping")]  # fmt: skip
    shown += [*system["limit_cycle"].values(), system["period"]]
    for each in shown:
        assert each["low"] <= each["value"] <= each["high"]
        own, _, interval = in_words(Estimate(**each)).partition(" (")
        assert own in text and interval.rstrip(")") in text
    for one in trial["channels"]:
        assert f"{one['missed_percent']:.3g} %" in text and f"R2 {one['r2']:.3f}" in text
    for one in numbers["absent_terms"]:
        assert one["term"] in text and f"{one['limit']:.3g}" in text


def test_of_a_refused_recording_the_samples_are_told(tmp_path):
    values = np.random.default_rng(0).standard_normal((500, 2))
    recording = Recording(np.arange(500) / 25, motions.STATES, values)
    refused = IdentifiedModel.refused(motions.STATES, TERMS, [])
    summary = summarise(refused, recording)
    assert "| q, recorded |" in str(summary)
