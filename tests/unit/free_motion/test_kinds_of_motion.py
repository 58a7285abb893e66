"""What kind of motion it is, and the models of free motion."""

import numpy as np
import pytest
from ambient import two_modes
from integrators import moved
from scipy.signal import lfilter
from swings import noisy, sensed, small_motions, swing

from galloping import (
    Coefficient,
    IdentifiedModel,
    Recording,
    maximum_likelihood,
    polynomial_library,
    summarise,
)
from galloping.identification.findings import Code
from galloping.identification.free_motion.kinds_of_motion import classify_motion

LIBRARY = polynomial_library(2, degree=3)
HERTZ, DAMPING = 6.8, 0.0014
TIME = np.arange(5000) / 200.0


def identified(samples, derivative=0, time=TIME):
    return maximum_likelihood(sensed(time, samples, derivative), LIBRARY)


def codes(found):
    return [finding.code for finding in found.findings]


def assert_decays(found, hertz=HERTZ, damping=DAMPING, within=0.02):
    own, ratio = small_motions(found)
    assert own == pytest.approx(hertz, rel=1e-4) and ratio == pytest.approx(damping, rel=within)
    assert not found.is_forced


@pytest.mark.parametrize("derivative", [0, 2])
@pytest.mark.parametrize("share", [0.002, 0.05])
def test_a_further_mode_is_told_beside_the_model(derivative, share):
    modes = swing(TIME, HERTZ, DAMPING, 1.0, derivative), swing(TIME, 13.7, 0.002, 1.0, derivative)
    first, second = (each / np.abs(each).max() for each in modes)
    found = identified(noisy(first + share * second, 1, 0.002), derivative)
    assert found.status == "ok"
    assert_decays(found, within=0.005)
    (mode,) = found.further_modes
    assert mode.frequency / (2.0 * np.pi) == pytest.approx(13.7, abs=0.02)
    assert str(found).splitlines()[-2:] == ["not in the equations: the mode at 13.7 Hz", "ok"]
    assert abs(mode.growth + 0.002 * mode.frequency) < 4.0 * mode.growth_error


def test_a_summary_tells_further_modes_and_releases():
    time = np.arange(2000) / 50.0
    motion = swing(time - 5.0, 1.0, 0.01) + swing(time - 5.0, 2.37, 0.005, 0.05)
    recording = sensed(time, noisy(motion, 2, 0.005))
    found = maximum_likelihood(recording, LIBRARY)
    summary = summarise(found, recording)
    names = list(summary.dynamics.damping)
    assert names[0] == "q" and names[1] == "the mode at 2.37 Hz"
    low, high = summary.dynamics.damping["q"].low, summary.dynamics.damping["q"].high
    assert low < 0.01 < high and high - low < 5e-4
    value = summary.dynamics.damping["the mode at 2.37 Hz"]
    assert value.low < 0.005 < value.high
    assert codes(found) == [Code.RELEASED]
    assert found.findings[0].data["time_s"] == pytest.approx(5.0, abs=0.1)


@pytest.mark.parametrize("derivative", [0, 2])
def test_a_knock_is_told_with_its_time(derivative):
    struck = swing(TIME - 12.5, HERTZ, DAMPING, 0.03 * np.exp(1.1j), derivative)
    motion = swing(TIME, HERTZ, DAMPING, 1.0, derivative) + struck
    found = identified(noisy(motion, 3, 0.004), derivative)
    assert found.status == "ok" and codes(found) == [Code.KNOCKED]
    assert found.findings[0].data["time_s"] == pytest.approx(12.5, abs=0.1)
    assert found.findings[0].data["share"] == pytest.approx(0.06, abs=0.01)
    assert len(found.initial_states) == 2
    assert_decays(found)


def test_a_step_of_a_force_is_told_with_its_time_and_what_it_moved():
    elapsed = np.maximum(TIME - 10.0, 0.0)
    step = 0.1 * np.where(TIME >= 10.0, 1.0 - swing(elapsed, HERTZ, DAMPING), 0.0)
    recording = sensed(TIME, noisy(swing(TIME, HERTZ, DAMPING) + step, 4, 0.004))
    found = maximum_likelihood(recording, LIBRARY)
    assert found.status == "ok" and codes(found) == [Code.FORCE_STEPPED]
    assert found.findings[0].data["change"] == pytest.approx(0.1, abs=0.002)
    assert_decays(found)
    assert summarise(found, recording).found.status == "ok"


@pytest.mark.parametrize("forcing", [0.9, 1.0, 1.05])
def test_a_steady_force_is_told_apart_from_the_motion_that_it_sets_off(forcing):
    time = np.arange(2000) / 20.0
    omega, of_force = 2.0 * np.pi, 2.0 * np.pi * forcing
    answer = 1.0 / complex(omega**2 - of_force**2, 2.0 * 0.02 * omega * of_force)
    steady = answer * np.exp(1j * of_force * time)
    set_off = swing(time, 1.0, 0.02, -answer)  # from near rest
    found = identified(noisy(steady.real + set_off, 5, 0.005), time=time)
    assert found.status == "ok" and codes(found) == [Code.FORCED_STEADILY]
    assert found.findings[0].data["frequency_hz"] == pytest.approx(forcing, abs=1e-4)
    assert_decays(found, 1.0, 0.02, within=0.1)
    assert all(mode.is_steady for mode in found.further_modes)


def test_a_steady_force_is_found_beside_a_recording_too_short_for_the_fit():
    samples = noisy(swing(TIME, HERTZ, DAMPING) + 0.2 * np.cos(60.0 * TIME), 6, 0.002)
    recording = sensed(TIME, samples)
    found = maximum_likelihood([recording[:9], recording], LIBRARY)
    assert found.status == "ok" and codes(found) == [Code.FORCED_STEADILY]
    assert found.findings[0].data["amplitude"] == pytest.approx(0.2, rel=0.01)


def test_damping_that_no_model_follows_is_told_by_its_envelope():
    time = np.arange(4000) / 100.0
    size = np.sqrt(1.0 - time / 60.0)  # of a force that no polynomial of the library is
    found = identified(noisy(size * np.cos(2.0 * np.pi * time), 6, 0.003), time=time)
    assert found.status == "approximate" and codes(found)[-1] == Code.NOT_EXPONENTIAL
    for part in found.envelope:
        expected = 1.0 / (120.0 * (1.0 - part.time / 60.0))
        assert -part.growth == pytest.approx(
            expected, abs=4.0 * part.growth_error + 0.05 * expected
        )
    summary = summarise(found, sensed(time, noisy(size * np.cos(2.0 * np.pi * time), 6, 0.003)))
    damping = summary.dynamics.damping["q"]
    assert 0.0 < damping.low < damping.high


@pytest.mark.parametrize("linear", [0.0, 0.05])
def test_a_decay_by_drag_into_the_noise_is_no_motion_in_random_forces(linear):
    time, rng = np.arange(2000) / 10.0, np.random.default_rng(2)
    motion = moved(lambda _, x: [x[1], -x[0] - (linear + 0.2 * abs(x[1])) * x[1]], (2, 0), time)
    noise = 0.06 * motion[:, 0].std() * rng.standard_normal(len(time))
    found = identified(motion[:, 0] + noise, time=time)
    assert found.status == "approximate" and found.envelope
    (missing,) = (one for one in found.findings if one.code == Code.TERM_MISSING)
    assert "|dq| dq" in missing.data["term"]


@pytest.mark.parametrize("noise", ["correlated", "proportional"])
def test_noise_that_is_not_white_hides_no_term_of_a_decay(noise):
    time, rng = np.arange(700) / 10.0, np.random.default_rng(7)
    motion = moved(
        lambda _, x: [x[1], -4.0 * x[0] - 0.04 * x[1] - 0.8 * x[0] ** 3], (1.2, 0.0), time
    )[:, 0]
    white = rng.standard_normal(len(time))
    size = 0.03 * motion.std() if noise == "correlated" else 0.05 * motion
    samples = motion + size * (lfilter([0.8], [1, -0.6], white) if np.isscalar(size) else white)
    found = identified(samples, time=time)
    assert found.status == "approximate" and not found.envelope
    cubic = found.model.terms.index((3, 0))
    error = found.standard_errors[1, cubic]
    assert 0.0 < error < 0.3
    assert found.model.coefficients[1, cubic] == pytest.approx(-0.8, abs=3.0 * error)


def test_parts_of_a_decay_that_agree_by_chance_have_their_own_errors():
    time = np.arange(1200) / 20.0
    states = moved(
        lambda t, x: [x[1], -x[0] - 0.1 * x[1] - 0.5 * x[0] ** 3 + 0.4 * np.sin(1.7 * t)],
        (1.0, 0.0), time,
    )  # fmt: skip
    noise = np.random.default_rng(5).standard_normal(states.shape)
    recording = Recording(time, ("q", "dq"), states + 0.05 * states.std(axis=0) * noise)
    found = maximum_likelihood(recording, LIBRARY)
    damping = found.model.terms.index((0, 1))
    assert codes(found) == [Code.NOT_EXPONENTIAL] and len(found.envelope) == 2
    alone = [2.0 * part.growth_error for part in found.envelope]
    assert found.standard_errors[1, damping] > 0.8 * min(alone)
    (used,) = summarise(found, recording).recordings
    assert np.isfinite(used.values).all()


def test_the_term_that_a_library_lacks_is_named_beside_the_envelope():
    time, stiffness = np.arange(4000) / 100.0, 4.0 * np.pi**2
    states = moved(
        lambda _, x: [x[1], -stiffness * x[0] - 0.05 * abs(x[1]) * x[1]], (1.0, 0.0), time
    )
    found = identified(noisy(states[:, 0], 1, 0.003), time=time)
    assert codes(found) == [Code.TERM_MISSING, Code.NOT_EXPONENTIAL]
    assert found.findings[0].data["term"].startswith("|dq| dq")
    rates = [-part.growth for part in found.envelope]
    sizes = [part.amplitude for part in found.envelope]
    slope = 0.05 * 2.0 * np.pi * 4.0 / (3.0 * np.pi)  # by averaging over a period
    np.testing.assert_allclose(rates, slope * np.array(sizes), rtol=0.05)


def test_a_linear_model_is_within_the_bounds_of_its_coefficients():
    recording = sensed(TIME, noisy(swing(TIME, HERTZ, 0.01), 12, 0.004))
    damping = LIBRARY.index((0, 1))
    free = maximum_likelihood(recording, LIBRARY).model.coefficients[1, damping]
    for bound, is_allowed in ((0.9 * free, True), (1.1 * free, False)):
        known = [Coefficient("dq", (0, 1), upper=bound)]
        found = maximum_likelihood(recording, LIBRARY, coefficients=known)
        assert (found.status == "ok") == is_allowed
        if is_allowed:
            assert found.model.coefficients[1, damping] == free


def test_a_nonlinear_decay_keeps_its_terms_beside_a_further_mode():
    time, stiffness = np.arange(2000) / 50.0, 4.0 * np.pi**2
    states = moved(
        lambda _, x: [x[1], -stiffness * (x[0] + 0.2 * x[0] ** 3) - 0.1 * x[1]], (1.0, 0.0), time
    )
    found = identified(noisy(states[:, 0] + swing(time, 2.37, 0.005, 0.03), 7, 0.003), time=time)
    terms = {found.model.terms[j] for i, j in np.argwhere(found.support)}
    assert found.status == "ok" and terms == {(1, 0), (0, 1), (3, 0)}
    (mode,) = found.further_modes
    assert mode.frequency / (2.0 * np.pi) == pytest.approx(2.37, abs=1e-3)


def test_motion_is_free_unless_something_may_sustain_it():
    time = np.arange(2000) / 50.0
    decay, growth = swing(time, 1.0, 0.01), 0.01 * swing(time, 1.0, -0.01)
    assert classify_motion([sensed(time, noisy(decay, 8))]).decays
    assert not classify_motion([sensed(time, noisy(growth, 8))]).decays
    steady = swing(time, 1.0, 0.0)
    assert classify_motion([sensed(time, noisy(steady, 8))]) is None
    slow = np.arange(16400) * np.pi / 4.0  # of a limit cycle, with a harmonic, and its approach
    cycle = 2.0 * np.cos(slow) - 0.09 * np.sin(3.0 * slow) - 1.5 * np.exp(-0.15 * slow)
    assert classify_motion([sensed(slow, noisy(cycle, 8, 0.03))]) is None
    for seed in range(3):
        assert classify_motion([two_modes(seed)[0]]) is None


@pytest.mark.parametrize("begin", [0.3, 2.0, 2.6])
@pytest.mark.parametrize("seed", range(5))
def test_the_approach_of_a_limit_cycle_is_no_force_and_its_transient(begin, seed):
    time = np.arange(2000) * 0.06
    states = moved(
        lambda _, x: [x[1], -4.0 * x[0] + 0.5 * np.tanh(0.8 * x[1]) - 0.22 * x[1]],
        (begin, 0.0), time,
    )  # fmt: skip
    motion = classify_motion([sensed(time, noisy(states[:, 0], seed, 0.02))])
    assert motion is None or not (motion.is_linear or motion.steady_modes)


@pytest.mark.parametrize("seed", range(3))
def test_growth_to_a_limit_cycle_in_correlated_noise_is_no_pair_of_growing_modes(seed):
    time = np.arange(2000) / 20.0
    states = moved(lambda _, x: [x[1], -4.0 * x[0] + 0.06 * x[1] - 0.1 * x[1] ** 3], (0.1, 0), time)
    noise = lfilter([0.6], [1.0, -0.8], np.random.default_rng(seed).standard_normal(len(time)))
    found = identified(states[:, 0] + 0.05 * states[:, 0].std() * noise, time=time)
    assert found.status == "approximate"
    growth = found.model.coefficients[1, found.model.term_names.index("dq")]
    assert growth == pytest.approx(0.06, abs=0.015)


@pytest.mark.parametrize("begin", [0.05, 0.15])
def test_truncated_samples_of_growth_to_a_limit_cycle_are_no_growing_modes(begin):
    time = np.arange(1000) * 0.1
    states = moved(
        lambda _, x: [x[1], -4.0 * x[0] + 0.1 * x[1] - 0.1 * x[1] ** 3], (begin, 0.0), time
    )
    unit = 0.2 * states[:, 0].std()
    found = identified(unit * np.trunc(states[:, 0] / unit), time=time)
    terms = dict(zip(found.model.term_names, found.model.coefficients[1], strict=True))
    assert found.status != "ok" or terms["dq^3"] < 0.0


@pytest.mark.parametrize(("count", "begin", "seed"), [(700, 1.2, 5501), (500, 1.0, 5507)])
def test_damping_that_depends_on_the_amplitude_is_no_event(count, begin, seed):
    time, rng = 0.1 * np.arange(count), np.random.default_rng(seed)
    states = moved(
        lambda _, x: [x[1], -4.0 * x[0] + 0.1 * x[1] * (1.0 - x[0] ** 2)], (begin, 0.0), time
    )
    noise = 0.2 * states.std(axis=0) * rng.standard_normal(states.shape)
    found = maximum_likelihood(sensed(time, (states + noise)[:, 0]), LIBRARY)
    assert Code.KNOCKED not in codes(found) and Code.FORCE_STEPPED not in codes(found)


def test_two_coordinates_are_told_without_their_further_mode():
    time, states = np.arange(3000) / 50.0, ("a", "b", "da", "db")
    first, second = swing(time, 1.0, 0.01), swing(time, 1.4, 0.02)
    beside = swing(time, 3.3, 0.004, 0.05)
    values = np.full((len(time), 4), np.nan)
    values[:, 0] = noisy(first + 0.3 * second + beside, 9, 0.003)
    values[:, 1] = noisy(second - 0.4 * first - 0.7 * beside, 10, 0.003)
    found = maximum_likelihood(Recording(time, states, values), polynomial_library(4, degree=1))
    modes = found.model.small_motions(np.zeros(4)).oscillations()
    assert found.status in ("ok", "not identifiable") and not found.is_forced
    np.testing.assert_allclose(modes.omega / (2.0 * np.pi), [1.0, 1.4], rtol=1e-3)
    np.testing.assert_allclose(modes.damping, [0.01, 0.02], rtol=0.05)
    assert {round(mode.frequency / (2.0 * np.pi), 1) for mode in found.further_modes} == {3.3}
    assert {mode.state for mode in found.further_modes} == {"a", "b"}


@pytest.mark.parametrize("unit", [1e-3, 1e3])
def test_the_unit_of_a_coordinate_chooses_no_stretch(unit):
    time, states = np.arange(1500) / 50.0, ("a", "b", "da", "db")
    scale = np.array([1.0, unit, 1.0, unit])
    plain, scaled = [], []
    for k, (a, b) in enumerate(((1.0, 0.2), (0.2, 1.0))):  # each stretch has one strong mode
        first, second = swing(time, 1.0, 0.01, a, 2), swing(time, 1.4, 0.02, b, 2)
        values, rates = np.full((2, len(time), 4), np.nan)
        rates[:, 2] = noisy(first + 0.3 * second, 2 * k, 0.003)
        rates[:, 3] = noisy(second - 0.4 * first, 2 * k + 1, 0.003)
        plain.append(Recording(time, states, values, rates=rates))
        scaled.append(Recording(time, states, values, rates=rates * scale))
    library = polynomial_library(4, degree=1)
    one, other = (maximum_likelihood(each, library).model for each in (plain, scaled))
    matrices = one.jacobian(np.zeros((1, 4)))[0], other.jacobian(np.zeros((1, 4)))[0]
    back = matrices[1] / scale[:, np.newaxis] * scale
    np.testing.assert_allclose(back, matrices[0], rtol=1e-5, atol=1e-7)


def test_what_is_noticed_is_saved(tmp_path):
    found = identified(noisy(swing(TIME - 2.0, HERTZ, 0.005), 11, 0.004))
    found.save(tmp_path / "model.json")
    loaded = IdentifiedModel.load(tmp_path / "model.json")
    assert loaded.findings == found.findings != () and loaded == found
