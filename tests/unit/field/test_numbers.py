"""No number that sounds sure and is wrong: what files of known truth are answered."""

import json
from dataclasses import replace

import field_files as files
import numpy as np
import pytest
from statuses import finding_for

from galloping import IdentifiedModel, Recording
from galloping.behaviour.dynamics import Surroundings, dynamics
from galloping.behaviour.forecast import check_followed, forecast, score_forecast, with_factors
from galloping.behaviour.objections import (
    find_difference,
    recording_outlasts_model,
    unaccelerated_coordinates,
    with_objections,
)
from galloping.identification.findings import Code, Finding
from galloping.identification.likelihood.repetition import FollowedRecording, is_periodic
from galloping.identification.random_forces.start import amplitude_fluctuates
from galloping.model.polynomial import PolynomialModel, design_matrix, polynomial_library
from galloping.readers import FileError
from galloping.readers.recordings import split_recording
from galloping.summary.summarise import Summary, hold_out, longest_period

TERMS = polynomial_library(4, 3)


def sure(model, share=1e-3, status="ok", **more):
    """An identified model as sure of its coefficients as `share`."""
    present = model.coefficients[2:][model.coefficients[2:] != 0]
    covariance = np.diag((share * present) ** 2)
    sigma = np.array([[files.NOISE, files.NOISE, np.nan, np.nan]])
    start = np.array([files.RELEASE])
    given = {"covariance": covariance, "known": (0, 1), "sigma": sigma, "initial_states": start}
    return IdentifiedModel(model, (finding_for(status),), is_judged=True, **given, **more)


def recorded(wind=12.0, seed=1):
    time, states = files.motion(wind)
    values = np.full(states.shape, np.nan)
    values[:, :2] = files.seen(states, seed)
    return Recording(time, files.STATES, values)


def linear(stiffness, damping=(0.0, 0.0)):
    """Two oscillators, the stiffness and the damping of each."""
    rows = np.block([[np.zeros((2, 2)), np.eye(2)], [-np.diag(stiffness), -np.diag(damping)]])
    return PolynomialModel(files.STATES, polynomial_library(4, 1)[1:], rows)


def ahead_of(recording, identified, time):
    return forecast(identified, recording, time, 25.0, np.random.default_rng(0))


@pytest.mark.parametrize("by", [0.0, 6.0])
def test_small_motions_are_those_about_the_position_of_rest(by):
    """Where the zero of a state is lower; the same system exactly, as it is polynomial."""
    shift, line = np.array([by, -by / 2, 0.0, 0.0]), files.line().on_library(TERMS)
    x = np.random.default_rng(0).normal(size=(200, 4))
    values = np.linalg.lstsq(design_matrix(x + shift, TERMS), line(x), rcond=None)[0].T
    model = replace(line, coefficients=np.where(abs(values) > 1e-9, values, 0))
    exact = IdentifiedModel(model, initial_states=np.array([files.RELEASE]) + shift)
    recording = recorded()
    around = Surroundings.of([replace(recording, values=recording.values + shift)])
    found = dynamics(exact, around, np.random.default_rng(0))
    values, _ = np.linalg.eig(files.line().jacobian(np.zeros((1, 4)))[0])
    values = sorted(values[values.imag > 0], key=lambda value: -abs(value))
    for state, value in zip(("q_v", "q_w"), values, strict=True):
        assert found.frequencies[state].value == pytest.approx(abs(value) / 2 / np.pi, rel=1e-4)
        assert found.damping[state].value == pytest.approx(-value.real / abs(value), abs=1e-5)
    assert found.rest["q_v"].value == pytest.approx(by, abs=1e-6)
    assert found.rest["q_w"].value == pytest.approx(-by / 2, abs=1e-6)
    assert found.half_range["q_v"].value == pytest.approx(1.305, abs=0.005)


def test_a_model_without_rest_inside_the_motion_has_no_natural_frequencies():
    model = PolynomialModel(("x", "dx"), ((0, 0), (0, 1)), np.array([[0, 1.0], [1.0, 0]]))
    exact = IdentifiedModel(model, initial_states=np.zeros((1, 2)))
    around = Surroundings(np.zeros(2), -np.ones(2), np.ones(2))
    found = dynamics(exact, around, np.random.default_rng(0))
    assert not found.rest and np.isnan(found.frequencies["x"].value)
    own = Recording(np.arange(64.0), ("x", "dx"), np.random.default_rng(0).normal(size=(64, 2)))
    said = str(Summary(exact, (own,), found))
    assert "no equilibrium inside the recorded motion" in said


@pytest.mark.parametrize("jump", [20.0, 150.0, 3600.0, 1e8])
def test_a_clock_that_jumps_parts_a_recording(tmp_path, jump):
    field = files.read(files.two_events(tmp_path / "a.csv", jump, each=60.0))
    assert len(field.recordings) == 2
    assert [np.ptp(one.time) for one in field.recordings] == pytest.approx([60.0, 60.0])
    (report,) = field.reports
    assert report["channels"]["q_v"]["dominant_frequencies_hz"][0] == pytest.approx(0.42, abs=0.03)
    assert longest_period(field.recordings) < 10.0
    assert not any(
        problem["code"] in ("few_periods", "sampled_coarsely") for problem in report["problems"][:1]
    )
    assert "divided at gaps" in report["notes"][-1]


def test_the_end_that_is_held_out_is_long_enough_to_tell():
    time, states = files.motion(duration=120.0)
    values = np.where(np.arange(4) < 2, states, np.nan)
    long, short = (Recording(time[:n], files.STATES, values[:n]) for n in (3001, 251))
    sound = sure(files.line().on_library(TERMS))

    def identify(given):
        starts = np.array([one.values[0] for one in given])
        starts[:, 2:] = 0.0
        return replace(sound, initial_states=starts, sigma=np.repeat(sound.sigma, len(given), 0))

    for parts, index in (((long, short), -2), ((short, long), -1)):
        trial = hold_out(parts, 2.4, identify, np.random.default_rng(0))
        assert trial.index == index and trial.forecast.time[-1] == pytest.approx(120.0)


def test_a_sensor_that_dies_leaves_the_recording_up_to_then(tmp_path):
    time, states = files.motion(duration=120.0)
    values = files.seen(states, 1)
    values[time > 70.0, 1] = np.nan
    field = files.read(files.write(tmp_path / "a.csv", time, values))
    assert [np.ptp(one.time) for one in field.recordings] == pytest.approx([70.0])
    assert "than 6 periods of one sensor alone" in field.reports[0]["notes"][-1]
    rates = np.full(states.shape, np.nan)
    rates[:, 3] = np.where(time > 70.0, np.nan, states[:, 3])  # an accelerometer
    alone = np.where(np.arange(4) == 0, states, np.nan)
    (whole,) = split_recording(Recording(time, files.STATES, alone, rates=rates), 2.4)
    assert np.ptp(whole.time) == pytest.approx(70.0)


def test_a_clock_that_starts_again_parts_a_recording_and_rows_out_of_order_do_not(tmp_path):
    field = files.read(files.two_events(tmp_path / "a.csv", -150.0))
    assert [np.ptp(one.time) for one in field.recordings] == pytest.approx([150.0, 150.0])
    assert "the clock starts again in row 3753" in field.reports[0]["notes"][0]
    head, *rows = (tmp_path / "a.csv").read_text(encoding="utf-8").splitlines()[:3752]
    swapped = [head, *rows[2000:], *rows[:2000]]
    (tmp_path / "b.csv").write_text("\n".join(swapped), encoding="utf-8")
    packets = [head, *rows[:1000], rows[1001], rows[1000], *rows[1002:]]
    (tmp_path / "c.csv").write_text("\n".join(packets), encoding="utf-8")
    for name in ("b.csv", "c.csv"):
        (whole,) = files.read(tmp_path / name).recordings
        np.testing.assert_array_equal(whole.values, field.recordings[0].values)


def test_samples_count_once(tmp_path):
    path = files.cameras(tmp_path / "a.csv")
    head, *rows = path.read_text(encoding="utf-8").splitlines()
    (tmp_path / "end.csv").write_text("\n".join([head, *rows[3000:]]), encoding="utf-8")
    for second in (path, tmp_path / "end.csv"):
        with pytest.raises(FileError, match=r"a\.csv"):
            files.read(path, second)
    assert len(files.read(path, files.cameras(tmp_path / "b.csv", seed=9)).recordings) == 2


@pytest.mark.parametrize("status", ["ok", "approximate"])
def test_the_band_at_an_instant_is_one_band(status):
    recording = recorded()
    identified = sure(files.line().on_library(TERMS), status=status, chi2=1.0)
    time = recording.time[-1] + np.arange(1, 400) / files.RATE
    short, long = (ahead_of(recording, identified, time[:count]) for count in (100, 399))
    for name in ("low", "median", "high"):
        np.testing.assert_allclose(getattr(short, name), getattr(long, name)[:100], rtol=1e-9)


def test_a_model_that_does_not_follow_a_file_is_refused():
    identified = sure(files.line().on_library(TERMS))
    check_followed(identified, recorded(seed=5), 25.0)
    for wind, status, chi2 in ((8.0, "ok", np.nan), (14.0, "approximate", 3.0)):
        other = replace(identified, findings=(finding_for(status),), chi2=chi2)
        check_followed(other, recorded(seed=5), 25.0)
        with pytest.raises(ValueError, match="over 25 s"):
            check_followed(other, recorded(wind), 25.0)


def test_a_band_that_did_not_hold_is_widened_to_what_was_seen_or_gives_no_forecast():
    recording, identified = recorded(), sure(files.line().on_library(TERMS), 1e-5)
    seen, cut = recording.values[:, :2], 6500
    ahead = ahead_of(recording[:cut], identified, recording.time[cut:])
    samples = np.column_stack([seen, np.full((len(seen), 2), np.nan)])
    size, noise = samples.std(axis=0), identified.sigma[-1]
    right = score_forecast(ahead, samples[cut:], size, noise)
    assert right.factors == pytest.approx(1.0) and right.held[:2] == pytest.approx(0.9, abs=0.04)
    narrow = score_forecast(ahead.widened(np.full(4, 0.4)), samples[cut:], size, noise)
    wide = narrow.forecast.widened(narrow.factors)
    again = score_forecast(wide, samples[cut:], size, noise)
    assert narrow.held[0] < 0.6 and again.held[:2] == pytest.approx(0.9, abs=0.01)
    told = with_factors(identified, narrow)
    later = recording.time[-1] + np.arange(1, 50) / files.RATE
    plain, widened = (ahead_of(recording, each, later) for each in (identified, told))
    ratio = (widened.high - widened.low) / (plain.high - plain.low)
    assert ratio[:, 0] == pytest.approx(narrow.factors[0])
    ends = {end: getattr(ahead, end) - 6.0 * ahead.median for end in ("low", "median", "high")}
    lost = score_forecast(replace(ahead, **ends), samples[cut:], size, noise)
    assert not lost.useful
    with pytest.raises(ValueError, match="gives no forecast"):
        ahead_of(recording, with_factors(identified, lost), later)


def missing(status, share):
    """The model of one recording or of several, and the share of q_v that its forecasts miss."""
    told = {"error_share_all_q_v": share, "forecast_r2": 0.95} if status == "approximate" else {}
    if status == "refused":
        return IdentifiedModel.refused(files.STATES, TERMS, [])
    missed = Finding.of(Code.FORECASTS_MISS, "q_v", share=share, span_s=10.0)
    finding = missed if status == "approximate" else finding_for(status)
    line = files.line().on_library(TERMS)
    return IdentifiedModel(line, (finding,), is_judged=True, diagnostics=told)


@pytest.mark.parametrize(
    ("together", "alone", "differs"),
    [
        (("approximate", 0.09), (("ok", 0.0), ("ok", 0.0)), True),
        (("approximate", 0.09), (("approximate", 0.02), ("approximate", 0.02)), True),
        (("approximate", 0.09), (("approximate", 0.07), ("approximate", 0.08)), False),
        (("approximate", 0.01), (("ok", 0.0), ("ok", 0.0)), False),
        (("refused", 0.0), (("ok", 0.0), ("not identifiable", 0.0)), True),
        (("approximate", 0.09), (("ok", 0.0), ("refused", 0.0)), False),
        (("ok", 0.0), (("ok", 0.0), ("ok", 0.0)), False),
    ],
)
def test_recordings_differ_where_models_of_each_miss_much_less(together, alone, differs):
    models = iter([missing(*each) for each in alone])
    parts = [recorded(seed=1), recorded(seed=2)]
    result = find_difference(missing(*together), parts, lambda _: next(models))
    assert (result is not None) == differs


def test_parts_of_one_recording_qualify_their_model_and_two_recordings_refuse_it():
    parts, alone = [recorded()[:3000], recorded()[4000:]], missing("approximate", 0.01)
    for are_one, status in ((True, "approximate"), (False, "refused")):
        names = ["a from 0 s", "a from 160 s"]
        model, identify = missing("approximate", 0.2), lambda _: alone
        said = with_objections(model, parts, names, 2.4, identify, are_one=are_one)
        assert said.status == status
        (different,) = (f for f in said.findings if "differ" in f.code)
        assert (different.subject, different.data["missed"]) == ("q_v", 0.2)


def test_a_motion_that_lasts_on_a_stable_line_is_forced(tmp_path):
    (recording,) = files.read(files.ambient(tmp_path / "a.csv")).recordings
    omega, ratio = 2 * np.pi * np.array([0.38, 0.21]), np.array([0.01, 0.02])
    stable, start = linear(omega**2, 2 * ratio * omega), np.array([[0.3, 0.3, 0.0, 0.0]])
    found = IdentifiedModel(stable, (finding_for("approximate"),), True, initial_states=start)
    assert recording_outlasts_model(found, [recording]) and amplitude_fluctuates([recording], 4.0)
    motion = found.simulate(start[0], recording.time).states
    decay = replace(recording, values=np.where(np.isfinite(recording.values), motion, np.nan))
    assert not recording_outlasts_model(found, [decay])
    galloping = sure(files.line().on_library(TERMS))
    assert not recording_outlasts_model(galloping, [recorded()]) and not unaccelerated_coordinates(
        galloping
    )
    assert not amplitude_fluctuates([recorded()], 4.0) and not amplitude_fluctuates([decay], 4.0)
    still = linear([0.0, omega[1] ** 2])
    assert unaccelerated_coordinates(IdentifiedModel(still)) == ["q_v"]


def test_a_motion_that_only_repeats_is_told_from_one_that_settles_or_beats():
    exact, recording = files.line().on_library(TERMS), recorded()
    _, states = files.motion(12.0, 1500.0)
    duration = np.ptp(recording.time)

    def repeats(model, start, duration=duration, period=2.4):
        return is_periodic(
            model, [FollowedRecording(np.zeros(1), np.array([start]), duration)], period
        )

    assert repeats(exact, states[-1])
    assert not repeats(exact, files.RELEASE)
    circle = [1.0, 0.0, 0.0, 0.0]  # which comes back to itself exactly
    assert repeats(linear([1.0, 1.0]), circle, 33 * 2.0 * np.pi, 2.0 * np.pi)
    assert not repeats(linear([6.0, 2.1]), [0.3, 0.3, 0.0, 0.0])


def test_a_motion_on_an_unstable_orbit_repeats():
    """A circle that all motions near it leave by e in a second: no free run stays on it for long.

    In polar coordinates dr/dt = (r^3 - r) / 2, and one turn takes 2 pi s.
    """
    terms = polynomial_library(2, 3)
    coefficients = np.zeros((2, len(terms)))
    for state, turned, sign in ((0, (0, 1), -1.0), (1, (1, 0), 1.0)):
        own = np.eye(2, dtype=int)[state]
        entries = {turned: sign, tuple(own): -0.5, tuple(3 * own): 0.5,
                   tuple(own + 2 * own[::-1]): 0.5}  # fmt: skip
        for term, value in entries.items():
            coefficients[state, terms.index(term)] = value
    model = PolynomialModel(("x", "y"), terms, coefficients)
    times = np.arange(0.0, 60.0, 6.0)
    on_it = np.column_stack([np.cos(times), np.sin(times)])
    assert is_periodic(model, [FollowedRecording(times, on_it, 60.0)], 2.0 * np.pi)
    assert not is_periodic(
        model, [FollowedRecording(times[:1], 0.99 * on_it[:1], 60.0)], 2.0 * np.pi
    )


def test_a_known_fault_is_the_first_reason_where_there_is_no_model(tmp_path):
    field = files.read(files.cameras(tmp_path / "a.csv", harm=files.clipped))
    refused = IdentifiedModel.refused(files.STATES, TERMS, [Finding.of(Code.ITERATION_DIVERGES)])
    period = longest_period(field.recordings)
    given = (field.recordings, field.names, period, lambda parts: refused, field.faults)
    first, *_, last = with_objections(refused, *given).findings
    assert (first.code, first.subject) == (Code.CLIPPED, "q_v of a.csv")
    assert first.data["at"] == pytest.approx(-0.3) and last.code == Code.ITERATION_DIVERGES
    wind = IdentifiedModel.refused(files.STATES, ((1, 0, 0, 0, 1),), refused.findings, ("U",))
    again = with_objections(wind, field.recordings, field.names, 5.0, lambda parts: wind)
    assert again.codes == "iteration_diverges" and again.model.inputs == ("U",)


LIMIT_CYCLE = {"q_v": 1.305, "q_w": 2.133}  # m, of the line in 12 m/s, simulated over 4000 s
ABOUT_REST = {"q_v": (0.4205, -0.640), "q_w": (0.2140, 0.499)}  # Hz, % of critical
SOUND = ("ok", "not identifiable")
# Files, by what makes them: status, codes of what weighs, faults of the samples, and whether small
# motions and the limit cycle are those of the line.
FILES = {
    "release": (
        lambda name: files.cameras(name, 1, harm=files.shifted),
        "not identifiable", {Code.RIVAL_TERMS}, set(), True),
    "accelerations": (files.accelerations, "ok", set(), set(), True),
    # three samples a period
    "seldom": (
        lambda name: files.cameras(name, 13, rows=slice(None, None, 20)),
        "not identifiable", {Code.RIVAL_TERMS}, {Code.SAMPLED_COARSELY}, True),
    "clipped": (
        lambda name: files.cameras(name, 7, harm=files.clipped),
        "ok", set(), {Code.CLIPPED}, True),
    # the limit cycle alone, reached long before
    "settled": (
        lambda name: files.cameras(name, 11, duration=1500.0, rows=slice(-7501, None)),
        "not identifiable", {Code.MOTION_REPEATS, Code.RIVAL_TERMS, Code.UNSETTLED}, set(), False),
    "short": (
        lambda name: files.cameras(name, 12, duration=20.0),  # eight periods
        "not identifiable", {Code.RIVAL_TERMS}, {Code.FEW_PERIODS}, False),
    "below_onset": (
        lambda name: files.cameras(name, 10, wind=5.0, noise=0.005),
        "not identifiable", {Code.RIVAL_TERMS}, set(), False),
    "three_winds": (
        lambda name: [files.cameras(name.with_stem(f"wind_{wind:g}"), 2 + k, wind=wind)
                      for k, wind in enumerate((10.0, 12.0, 14.0))],
        "refused", {Code.RECORDINGS_DIFFER}, set(), False),
    "changing_wind": (
        lambda name: files.of_changing_wind(name, 11.0, 13.0),
        "approximate", {Code.PARTS_DIFFER, Code.FORCES, Code.FORECASTS_MISS}, set(), False),
    "ambient": (files.ambient, "ok", {Code.RANDOM_FORCES}, set(), False),
    "noisy": (  # more than the line moves
        lambda name: files.cameras(name, 14, noise=1.5),
        "not identifiable", {Code.RIVAL_TERMS, Code.UNSETTLED}, {Code.MOSTLY_NOISE}, False),
    "an hour apart": (lambda name: files.two_events(name, 3600.0), "", set(), set(), True),
    "a cut off last cell": (
        lambda name: files.cameras(name, 2, duration=120.0, noise=0.002, harm=files.cut_off),
        "", set(), set(), True),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("name", FILES)
def test_a_file_is_answered_right_or_refused_for_its_fault(tmp_path, name):
    make, status, codes, faults, is_told = FILES[name]
    made, out = make(tmp_path / f"{name}.csv"), tmp_path / "out"
    paths = made if isinstance(made, list) else [made]
    files.run("identify", *paths, "--output", out, code=3 if status == "refused" else 0)
    numbers, reports = (
        json.loads((out / f"{each}.json").read_text(encoding="utf-8"))
        for each in ("summary", "quality")
    )
    assert numbers["status"] in ([status] if status else SOUND)
    assert codes <= {each["code"] for each in numbers["findings"]}
    problems = {each["code"] for report in reports for each in report["problems"]}
    assert faults <= problems
    if not is_told:
        return
    told, forecast = numbers["system"], numbers["forecast"]
    assert not forecast or all(one["band_factor"] <= 1.0 for one in forecast["channels"])
    small = {one["name"]: one for one in told["small_motions"]}
    for state, (frequency, damping) in ABOUT_REST.items():
        own, size = small[state], told["limit_cycle"][state]
        assert own["natural_frequency"]["value"] == pytest.approx(frequency, rel=1e-3)
        assert own["net_damping"]["value"] == pytest.approx(damping, abs=0.02)
        assert size["value"] == pytest.approx(LIMIT_CYCLE[state], rel=0.01)
        assert size["low"] - 0.01 < LIMIT_CYCLE[state] < size["high"] + 0.01
