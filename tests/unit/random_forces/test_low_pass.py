"""Ambient motion of more modes than coordinates: what is filtered out, and what is told then."""

from itertools import pairwise

import numpy as np
import pytest
from ambient import swing

from galloping import Recording, forecast, maximum_likelihood, polynomial_library, summarise
from galloping.identification.findings import Code
from galloping.identification.no_model import IdentificationError
from galloping.identification.random_forces.low_pass import FILTER_HALF_LENGTH, low_pass_recording
from galloping.identification.random_forces.several_modes import SeveralModes

TIME = np.arange(12_000) / 20
SLOW, FAST = {0.4: 0.01, 0.46: 0.012}, {1.2: 0.008, 2.0: 0.006}  # Hz: damping ratio


def recorded(*channels: np.ndarray) -> Recording:
    """Displacements of as many coordinates, with 5 % noise."""
    rng, states = np.random.default_rng(3), tuple(f"q{k}" for k in range(len(channels)))
    values = np.full((len(TIME), 2 * len(channels)), np.nan)
    for k, channel in enumerate(channels):
        values[:, k] = channel + 0.05 * channel.std() * rng.standard_normal(len(TIME))
    return Recording(TIME, (*states, *(f"d{state}" for state in states)), values)


@pytest.fixture(scope="module")
def ambient() -> Recording:
    q, w = (swing(TIME, f, ratio, k) for k, (f, ratio) in enumerate(SLOW.items()))
    fast = [swing(TIME, f, ratio, 7 + k) for k, (f, ratio) in enumerate(FAST.items())]
    return recorded(q + 0.5 * fast[0] + 0.3 * fast[1], w + 0.1 * q + 0.4 * fast[1])


def test_what_is_slow_stays_and_what_is_fast_goes():
    for frequency, share in ((0.1, 1.0), (0.4, 1.0), (0.7, 1.0), (1.2, 0.0), (3.0, 0.0)):
        whole = Recording(TIME, ("q",), np.sin(2 * np.pi * frequency * TIME)[:, None])
        left = low_pass_recording(whole, 1.0)
        kept = share * np.sin(2 * np.pi * frequency * left.time)
        np.testing.assert_allclose(left.values[:, 0], kept, atol=0.02)


def test_white_noise_stays_white_and_its_size_is_told():
    rng, known = np.random.default_rng(5), np.array([[1.0], [np.nan]])
    power, variance = np.zeros(400), []
    for _ in range(50):
        noise = Recording(TIME, ("q",), rng.standard_normal((len(TIME), 1)), known_noise=known)
        left = low_pass_recording(noise, 1.0)
        power += np.abs(np.fft.rfft(left.values[:, 0], 800)[1:]) ** 2
        variance.append(left.values.var())
    groups = power.reshape(10, -1).mean(axis=1)
    np.testing.assert_allclose(groups / groups.mean(), 1.0, atol=0.05)
    assert np.mean(variance) == pytest.approx(left.known_noise[0, 0] ** 2, rel=0.03)


def test_there_is_nothing_about_gaps_but_short_ones():
    values = np.sin(2 * np.pi * 0.4 * TIME)[:, None]
    values[2000:2004], values[6000:6100] = np.nan, np.nan
    left = low_pass_recording(Recording(TIME, ("q",), values), 1.0)
    steps, silent = np.diff(left.time), TIME[6100] - TIME[5999]
    about = silent + 2 * FILTER_HALF_LENGTH * np.median(steps)
    assert about < steps.max() < about + 2 * np.median(steps)
    assert np.sum(steps > 1.1 * np.median(steps)) == 1
    with pytest.raises(IdentificationError) as error:
        low_pass_recording(Recording(TIME, ("q",), values)[:600], 0.05)
    assert error.value.findings[0].code == Code.NOTHING_LEFT
    assert error.value.findings[0].data["duration_s"] == pytest.approx(29.95)


def test_the_slowest_modes_are_told_where_faster_ones_move_the_sensors_too(ambient):
    found = maximum_likelihood(ambient, polynomial_library(4, degree=3))
    assert found.status == "ok" and 0.6 < found.diagnostics["below"] < 1.1
    (left_out,) = (f for f in found.findings if f.code == Code.FASTER_MODES_LEFT_OUT)
    assert left_out.data["modes"] == "1.2, 2"
    summary = summarise(found, ambient)
    for k, (frequency, damping) in enumerate(SLOW.items()):
        told = summary.dynamics.frequencies[f"q{k}"]
        assert told.value == pytest.approx(frequency, rel=0.02)
        told = summary.dynamics.damping[f"q{k}"]
        assert told.low < damping < told.high
    words = (" line", "span", "gallop", "modal mass", "m/s")
    assert not any(word in str(summary) for word in words)
    ahead = forecast(found, ambient, TIME[-1] + np.arange(1, 40) / 20)
    assert np.all(ahead.low < ahead.high)


def test_harmonics_of_a_limit_cycle_are_no_modes():
    phase = 2 * np.pi * 0.4 * TIME
    for slow, has_modes in ((swing(TIME, 0.4, 0.01, 1), True), (np.sin(phase), False)):
        motion = recorded(slow + 0.3 * np.sin(3 * phase))
        assert bool(list(SeveralModes([motion], 2.5).slowest())) == has_modes


def test_more_close_modes_than_are_modelled_leave_no_sound_model():
    frequencies = 0.4 * 1.13 ** np.arange(6)
    motion = recorded(sum(swing(TIME, f, 0.008, k) for k, f in enumerate(frequencies)))
    found = maximum_likelihood(motion, polynomial_library(2, degree=1), forced=())
    assert found.status != "ok"


def test_parts_between_gaps_have_no_modes_of_their_own():
    whole, begins = recorded(swing(TIME, 0.51, 0.005, 1), swing(TIME, 0.44, 0.012, 2)), [0]
    while begins[-1] < len(TIME):
        begins.append(begins[-1] + 500 + 487 * len(begins) % 2500)
    parts = [whole[a:b] for a, b in pairwise(begins) if b < len(TIME)]
    parts.append(whole[-60:])
    found = maximum_likelihood(parts, polynomial_library(4, degree=1))
    assert found.status == "ok" and "below" not in found.diagnostics
    summary = summarise(found, parts)
    assert summary.dynamics.frequencies["q0"].value == pytest.approx(0.51, rel=0.01)
