"""From recordings to models: as the study does, from long ones, with known noise, with advice."""

import os
import subprocess
from dataclasses import replace

import numpy as np
import pytest
from field_files import COMMAND, STATES, read, write
from lines import simulate
from statuses import finding_for

from galloping import Recording, Simulator, maximum_likelihood
from galloping import polynomial_library as library
from galloping.identification.findings import Code, Finding
from galloping.identification.preparation.smoothing import shortest_period
from galloping.inspection.excerpts import MAX_STRETCHES, PERIODS_PER_STRETCH, excerpts
from galloping.line.galerkin import coefficients, make_model
from galloping.streams import make_generator
from galloping.summary.further_recording import advise
from galloping.summary.summarise import hold_out, longest_period
from galloping.trials.recorded_lines import draw_line

TERMS = library(4, 3)


def recorded(path, time, states):
    """A file of noisy displacements."""
    q = states[:, :2]
    noise = np.random.default_rng(4).standard_normal(q.shape)
    return write(path, time, q + 0.05 * q.std(axis=0) * noise)


def tried(field):
    """The end of a field's recording, forecast from the rest."""
    given, rng = list(field.recordings), np.random.default_rng(0)
    return hold_out(given, longest_period(given), lambda r: maximum_likelihood(r, TERMS), rng)


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    """A file of the resonant line, with two samples in a window."""
    _, motion = simulate("internal_resonance")
    path = tmp_path_factory.mktemp("field") / "a.csv"
    return recorded(path, motion.time[::20], motion.states[::20])


@pytest.fixture(scope="module")
def field(path):
    return read(path)


@pytest.fixture(scope="module")
def identified(field):
    return maximum_likelihood(list(field.recordings), TERMS)


def test_a_known_noise_replaces_the_estimate_and_a_wrong_one_is_named(path, identified):
    _, motion = simulate("internal_resonance")
    v, w = 0.05 * motion.states[::20, :2].std(axis=0)

    def told(*noises):
        channels = [{"column": q, "measures": q, "noise": noise}
                    for q, noise in zip(STATES[:2], noises, strict=True)]  # fmt: skip
        return maximum_likelihood(list(read(path, channels=channels).recordings), TERMS)

    known, wrong = told(f"{1e3 * v} mm", w), told(v / 5, w / 5)
    assert np.isnan(identified.chi2) and known.chi2 == pytest.approx(1.0, abs=0.1)
    assert known.sigma[0, :2] == pytest.approx([v, w])
    assert wrong.status == "approximate" and wrong.has_finding(Code.NOISE_EXCEEDS_KNOWN)


def test_long_recordings_are_identified_from_their_liveliest_and_largest_stretches(field):
    recording = field.recordings[0]
    assert excerpts([recording]) == [recording]
    time = np.arange(0.0, 6000.0, 0.2)
    size = 0.2 + 0.8 / (1.0 + np.exp((time % 1000.0 - 300.0) / -30.0))  # grows again and again
    values = np.full((len(time), 4), np.nan)
    values[:, 0] = size * np.sin(2.5 * time)
    long = replace(recording, time=time, values=values)
    stretches = excerpts([long])
    period = shortest_period([long])
    assert len(stretches) == MAX_STRETCHES
    assert all(
        np.ptp(one.time) == pytest.approx(PERIODS_PER_STRETCH * period, rel=0.02)
        for one in stretches
    )
    changing, large = stretches[::2], stretches[1::2]
    for one in changing:
        sizes = [np.std(part) for part in np.array_split(one.values[:, 0], 8)]
        assert max(sizes) > 3 * min(sizes)
    assert all(np.nanstd(one.values[:, 0]) > 0.65 for one in large)
    assert len(excerpts([long] * 20)) == 20


def test_advice_ranks_recordings_by_what_they_tell_of_the_weakest_term(field, identified):
    told = advise(identified, field.recordings[0], longest_period(field.recordings))
    errors = list(told.options.values())
    assert errors == sorted(errors) and max(errors) < told.standard_error
    assert not any("release" in name for name in told.options)  # of a live span
    again = told.options["another event like this one"]
    assert told.standard_error / again == pytest.approx(np.sqrt(2.0), rel=0.2)
    for finding in (finding_for("approximate"), Finding.of(Code.MOTION_REPEATS)):
        assert advise(identified.with_findings(finding), field.recordings[0], 5.0) is None


def test_the_band_of_a_forecast_holds_what_is_held_out(tmp_path):
    held = []
    for number in (0, 1, 2):  # motions of the first one part within seconds
        case, (start, _) = draw_line(make_generator(771203, "random line", number))
        line = make_model(coefficients(case)).on_library(TERMS)
        time = np.arange(7501) / 25.0
        states = Simulator(STATES, TERMS)(line, start, time).states
        path = recorded(tmp_path / "a.csv", time, states)
        held.append(tried(read(path)).held[:2])
    assert np.min(held) > 0.8 and 0.85 < np.mean(held) < 0.95


def test_accelerations_alone_are_forecast_with_the_displacements(tmp_path):
    line, motion = simulate("internal_resonance")
    time, states = motion.time[:15001:4], motion.states[:15001:4]
    rates = line(states)[:, 2:]
    noise = 0.05 * rates.std(axis=0) * np.random.default_rng(9).standard_normal(rates.shape)
    header, measured = "t [s],ddq_v,ddq_w", (rates + noise) / 9.80665 + 0.02
    channels = [{"column": q, "measures": q, "unit": "g_n"} for q in ("ddq_v", "ddq_w")]
    trial = tried(read(write(tmp_path / "a.csv", time, measured, header), channels=channels))
    ahead = trial.forecast
    assert ahead.names == (*STATES, "ddq_v", "ddq_w")
    assert np.isnan(trial.skill[:4]).all() and np.min(trial.skill[4:]) > 0.9
    assert np.min(trial.held[4:]) > 0.8
    for k in range(2):  # from rest, which the accelerations hardly tell
        displaced = np.interp(ahead.time, time, states[:, k])
        assert np.std(displaced - ahead.median[:, k]) < 0.1 * np.std(displaced)


@pytest.mark.slow
def test_a_million_rows_need_no_two_gigabytes(tmp_path):
    line, _ = simulate("internal_resonance")
    time = np.arange(1_000_000) / 25.0
    states = Simulator(line.states, line.terms)(line, np.array([0.2, 0.1, 0, 0]), time).states
    path = recorded(tmp_path / "a.csv", time, states)
    process = subprocess.Popen(
        [*COMMAND, "identify", path, "--time", "t", "--states", ",".join(STATES), "--unit", "m",
         "--unit", "t=s", "--measure", "q_v=q_v", "--measure", "q_w=q_w",
         "--output", tmp_path / "out"],
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    _, status, used = os.wait4(process.pid, 0)
    assert status == 0
    assert used.ru_maxrss < 2 * 1024**2  # KiB
    assert "stretches" in (tmp_path / "out" / "summary.md").read_text(encoding="utf-8")


def test_an_end_in_which_nothing_moves_tests_no_forecast():
    time = np.arange(2000) / 25.0
    values = np.where(time < 60.0, np.exp(-0.1 * time) * np.cos(3.0 * time), 0.01)
    recording = Recording(time, ("q", "dq"), np.column_stack([values, np.full(2000, np.nan)]))
    with pytest.raises(ValueError, match="no motion in the last"):
        hold_out([recording], 2.0, maximum_likelihood, np.random.default_rng(0))
