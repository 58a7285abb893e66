"""Damped sinusoids by maximum likelihood."""

import numpy as np
import pytest
from swings import noisy, pole

from galloping.identification.free_motion.damped_modes import Stretch, fit_poles
from galloping.identification.free_motion.envelope import fit_envelope
from galloping.identification.free_motion.mode_search import fit_modes, strongest_mode


def stretch(time, samples, degree=0):
    return Stretch(time, np.column_stack([samples]), (degree,))


def sum_of(time, *modes):
    """modes: natural frequency, Hz, damping ratio, amplitude of each."""
    return sum((a * np.exp(pole(f, z) * time)).real for f, z, a in modes)


@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("second", [1e-5, 1.0, 1e5])
def test_a_weak_second_mode_is_told_in_any_units(unit, second):
    time = np.arange(3600) / 100.0
    samples = noisy(sum_of(time, (3.4, 0.0014, 1.0), (6.85, 0.002, 0.01)), 1, 0.004)
    found, is_noise = fit_modes([stretch(second * time, unit * samples)])
    assert is_noise and len(found.poles) == 2
    expected = np.array([pole(3.4, 0.0014), pole(6.85, 0.002)]) / second
    off = found.poles - expected
    assert np.all(np.abs(off.real) < 4.0 * found.growth_errors)
    assert np.all(np.abs(off.imag) < 4.0 * found.frequency_errors)
    assert found.growth_errors[1] < 0.1 * -expected[1].real


def test_intervals_hold():
    time = np.arange(600) / 20.0
    held = []
    for seed in range(300):
        samples = noisy(sum_of(time, (1.0, 0.01, 1.0), (2.3, 0.02, 0.05)), seed, 0.02)
        found, _ = fit_modes([stretch(time, samples)])
        off = found.poles[0] - pole(1.0, 0.01)
        held += [abs(off.real) < 1.96 * found.growth_errors[0]]
        held += [abs(off.imag) < 1.96 * found.frequency_errors[0]]
    assert 0.93 < np.mean(held) < 0.97  # 600 of which chance makes 0.932 to 0.967


def test_stretches_share_their_poles_and_gaps_do_no_harm():
    time = np.arange(1500) / 50.0
    first = noisy(sum_of(time, (1.0, 0.015, 1.0)), 3)
    first[400:500] = np.nan
    kept = np.sort(np.random.default_rng(4).choice(1500, 700, replace=False))
    second = stretch(time[kept] - time[kept[0]], noisy(sum_of(time, (1.0, 0.015, 0.4)), 5)[kept])
    found, is_noise = fit_modes([stretch(time, first), second])
    assert is_noise and len(found.poles) == 1 and len(found.amplitudes) == 2
    assert abs(found.poles[0].real - pole(1.0, 0.015).real) < 4.0 * found.growth_errors[0]
    assert found.growth_errors[0] < 2e-4


def test_a_stretch_of_longer_steps_may_fold_the_frequency_of_another():
    fine, coarse = np.arange(1500) / 50.0, np.sort(np.random.default_rng(4).uniform(0.0, 30.0, 24))
    parts = [noisy(sum_of(time, (1.0, 0.015, 1.0)), 3) for time in (fine, coarse)]
    found, is_noise = fit_modes([stretch(fine, parts[0]), stretch(coarse - coarse[0], parts[1])])
    assert is_noise and len(found.poles) == 1


def test_noise_and_drifts_hold_no_mode():
    time, rng = np.arange(4000) / 100.0, np.random.default_rng(6)
    for _ in range(20):
        white = rng.standard_normal((4000, 1))
        assert strongest_mode([stretch(time, white[:, 0])], [white], np.empty(0)) is None
    drift = np.cumsum(0.003 * rng.standard_normal(4000))
    found, _ = fit_modes([stretch(time, sum_of(time, (3.0, 0.01, 1.0)) + drift, degree=3)])
    hertz = np.abs(found.poles) / (2.0 * np.pi)
    assert hertz[0] == pytest.approx(3.0, rel=1e-3) and np.all(hertz[1:] < 1.0)


def test_noiseless_decays_are_told_to_rounding():
    time = np.arange(500) / 20.0
    found, is_noise = fit_modes([stretch(time, sum_of(time, (1.0, 0.02, 1.0), (2.2, 0.01, 0.1)))])
    assert is_noise
    np.testing.assert_allclose(found.poles, [pole(1.0, 0.02), pole(2.2, 0.01)], rtol=1e-8)


def test_an_envelope_tells_damping_against_amplitude():
    time = np.arange(4000) / 50.0
    # damping of 0.5 % with small and 1 % more with unit amplitude: da/dt = -w a (0.005 + 0.01 a)
    omega = 2.0 * np.pi
    shrunk = np.exp(-0.005 * omega * time)
    size = shrunk / (1.0 + 2.0 * (1.0 - shrunk))
    samples = noisy(size * np.cos(omega * time), 7, 0.002)
    whole = stretch(time, samples)
    modes = fit_poles([whole], np.array([pole(1.0, 0.01)]))
    parts = fit_envelope(whole, modes, 0, 0, ["q"], 0.0)
    assert len(parts) > 4
    for part in parts:
        omega = np.hypot(part.frequency, part.growth)
        error, damping = part.growth_error / omega, -part.growth / omega
        expected = 0.005 + 0.01 * np.interp(part.time, time, size)
        assert damping == pytest.approx(expected, abs=3.0 * error + 0.02 * expected)
        assert part.amplitude == pytest.approx(np.interp(part.time, time, size), rel=0.02)


def test_poles_of_a_stretch_shorter_than_the_means_of_an_oscillation():
    time = np.arange(400) / 100.0
    short = stretch(time, noisy(np.exp(-0.1 * time) * np.cos(0.1 * time), 3, 0.001))
    # the first guess of a period is 50 times as long as the recording
    modes = fit_poles([short], np.array([pole(0.005, 0.0)]))
    assert np.isfinite(modes.poles).all()
