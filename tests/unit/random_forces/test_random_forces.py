"""Models of motion that random forces keep up."""

from dataclasses import replace

import numpy as np
import pytest
from ambient import DAMPING, FREQUENCIES, STATES, displacements, swing, two_modes
from scipy.signal import lfilter

from galloping import maximum_likelihood, parse_model, simulate
from galloping.identification.random_forces.several_modes import find_unmodelled_modes
from galloping.identification.random_forces.start import MEAN_BINS, estimate_spectra
from galloping.model.intervals import decay_interval
from galloping.model.polynomial import PolynomialModel, polynomial_library
from galloping.recording.samples import Recording
from galloping.summary.summarise import dynamics, forecast

pytestmark = pytest.mark.xdist_group("ambient")

LINEAR = polynomial_library(4, 1)


@pytest.fixture(scope="module")
def ambient():
    recording, _, system = two_modes()
    return recording, maximum_likelihood(recording, polynomial_library(4, 3)), system


def held(found, recording):
    """Whether each 95 % interval holds, of frequencies and then of damping, by frequency."""
    of = dynamics(found, recording)
    order = sorted(of.frequencies, key=lambda state: of.frequencies[state].value)
    truths = zip((of.frequencies, of.damping), (FREQUENCIES, DAMPING), strict=True)
    return [
        values[state].low <= true <= values[state].high
        for values, trues in truths
        for state, true in zip(order, trues, strict=True)
    ]


def test_answers_without_being_told_of_forces(ambient):
    recording, found, system = ambient
    assert found.status == "ok"
    assert found.is_forced
    assert all(held(found, recording))
    exact = PolynomialModel(STATES, polynomial_library(4, 1)[1:], system).on_library(
        found.model.terms
    )
    error = (found.model.coefficients - exact.coefficients) / found.standard_errors
    assert np.all(np.abs(error[found.support]) < 3.5)
    np.testing.assert_allclose(np.sqrt(np.diag(found.forces)[2:]), 0.01, rtol=0.1)
    np.testing.assert_allclose(
        found.sigma[0, :2], 0.05 * np.nanstd(recording.values[:, :2], 0), rtol=0.1
    )


def test_errors_are_those_of_the_spectra(ambient):
    """The Cramér-Rao bound of what was found, by the likelihood of spectra (P. Whittle, 1953)."""
    recording, found, _ = ambient
    step, terms = recording.time[1], found.model.terms
    omega = 2 * np.pi * np.fft.rfftfreq(len(recording.time), step)[1:-1]
    for i, own in ((0, [(1, 0, 0, 0), (0, 0, 1, 0)]), (1, [(0, 1, 0, 0), (0, 0, 0, 1)])):
        places = [terms.index(term) for term in own]
        stiffness, damping = -found.model.coefficients[2 + i, places]
        off = stiffness - omega**2
        gain = 1 / (off**2 + (damping * omega) ** 2)
        force = found.forces[2 + i, 2 + i] * gain
        noise = np.full(len(omega), found.sigma[0, i] ** 2 * step)
        moved = [2 * off * gain * force, 2 * damping * omega**2 * gain * force, force, noise]
        slopes = np.array(moved) / (force + noise)
        bound = np.sqrt(np.diag(np.linalg.inv(slopes @ slopes.T)))[:2]
        np.testing.assert_allclose(found.standard_errors[2 + i, places], bound, rtol=0.03)


@pytest.mark.parametrize(
    ("seed", "shapes"), [(2, ((1, 0.4), (0.5, 1))), (12, ((0, 1), (0.1, 0.3)))]
)
def test_coupled_modes_keep_what_couples_them_and_forces_may_share_nearly_all(seed, shapes):
    recording, _, _ = two_modes(seed, shapes=shapes)
    found = maximum_likelihood(recording, LINEAR)
    assert found.is_forced and not found.slow_forces.any()
    assert found.support[2:, 1:].all() and found.forces[2, 3] != 0.0
    assert all(held(found, recording))


def test_units_change_nothing_but_units(ambient):
    recording, found, _ = ambient
    scaled = maximum_likelihood(
        replace(recording, values=1000 * recording.values), polynomial_library(4, 3)
    )
    linear = np.array(found.model.terms).sum(axis=1) == 1
    own, same = (model.model.coefficients[:, linear] for model in (found, scaled))
    np.testing.assert_allclose(same, own, rtol=1e-5, atol=1e-8)
    np.testing.assert_allclose(scaled.forces, 1e6 * found.forces, rtol=1e-5)


def damaged(recording, how):
    values, rng = recording.values.copy(), np.random.default_rng(5)
    if how == "offset and gaps":
        values += np.array([3.0, -1.0, 0, 0])
        values[rng.random(len(values)) < 0.2] = np.nan
        values[2000:2600] = np.nan
        values[4000:4300, 0] = np.nan
    elif how == "irregular and small":
        rows = np.sort(rng.permutation(len(values))[:4000])
        values[:, 0] *= 0.01
        return Recording(recording.time[rows], STATES, values[rows])
    elif how == "transient":
        omega = 2 * np.pi * FREQUENCIES[0]
        free = np.exp(-DAMPING[0] * omega * recording.time) * np.cos(omega * recording.time)
        values[:, 0] += 10 * np.nanstd(values[:, 0]) * free
    return replace(recording, values=values)


@pytest.mark.parametrize("how", ["offset and gaps", "irregular and small", "transient"])
def test_intervals_hold_of_recordings_as_they_are(ambient, how):
    recording = damaged(ambient[0], how)
    found = maximum_likelihood(recording, LINEAR)
    assert found.is_forced
    assert all(held(found, recording))


def test_noise_as_large_as_the_motion_hides_no_forces(ambient):
    recording, _, _ = ambient
    values, rng = recording.values.copy(), np.random.default_rng(8)
    values[:, :2] += values[:, :2].std(axis=0) * rng.standard_normal((len(values), 2))
    found = maximum_likelihood(replace(recording, values=values), polynomial_library(4, 3))
    assert found.is_forced
    assert all(held(found, recording))


@pytest.mark.parametrize("kind", ["velocities", "all", "mixed", "means"])
def test_any_mix_of_channels(kind):
    recording, states, system = two_modes(3)
    rng = np.random.default_rng(6)
    noisy = states + 0.05 * states.std(axis=0) * rng.standard_normal(states.shape)
    rates = np.full(noisy.shape, np.nan)
    if kind == "velocities":
        noisy[:, :2] = np.nan
    elif kind == "mixed":
        noisy[:, [1, 2, 3]] = np.nan
        accelerations = states @ system[3]
        rates[:, 3] = accelerations + 0.05 * accelerations.std() * rng.standard_normal(len(states))
    elif kind == "means":  # of accelerometers, which show the forces
        noisy[:] = np.nan
        rates[1:, 2:] = np.diff(states[:, 2:], axis=0) / np.diff(recording.time)[:, np.newaxis]
        rates += 0.01 * rng.standard_normal(states.shape)
    recording = Recording(recording.time, STATES, noisy, rates=rates)
    shown, hidden = recording[:5700], recording[5700:]
    found = maximum_likelihood(shown, LINEAR, forced=None if kind == "means" else ())
    assert found.is_forced
    assert all(held(found, shown))
    np.testing.assert_allclose(np.sqrt(np.diag(found.forces)[2:]), 0.01, rtol=0.1)
    if kind == "means":
        ahead = forecast(found, shown, hidden.time)
        inside = (hidden.rates > ahead.low[:, 2:]) & (hidden.rates < ahead.high[:, 2:])
        assert 0.8 < inside[:, 2:].mean() < 0.99
        width = (ahead.high - ahead.low)[0, 4:] / 3.3  # of the forces in a sample, and of its noise
        assert np.all(width > 0.8 * np.hypot(0.01 * np.sqrt(10.0), 0.01))


def test_several_recordings_tell_more(ambient):
    recording, found, _ = ambient
    other = two_modes(9)[0]
    both = maximum_likelihood([recording, other], LINEAR)
    assert np.sqrt(np.diag(both.covariance)).sum() < 0.85 * np.sqrt(np.diag(found.covariance)).sum()
    assert both.initial_states.shape == (2, 4)


@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_a_sensor_of_one_recording_counts_there_and_a_dead_one_nowhere():
    (recording, states, system), other = two_modes(), two_modes(9)[0]
    rates = np.full(states.shape, np.nan)
    noise = 0.1 * np.random.default_rng(3).standard_normal(len(states))
    rates[:, 3] = states @ system[3] + noise
    first = replace(recording, rates=rates)
    found = maximum_likelihood([first, other], LINEAR)
    assert (found.status, found.is_forced) == ("ok", True)
    assert found.diagnostics["noise_ddq_w"] == pytest.approx(0.1, rel=0.1)
    assert np.all(np.isfinite(forecast(found, first[:5000], recording.time[5000:5010]).low))
    dead = replace(recording, rates=np.where(np.isfinite(rates), 0.25, np.nan))
    assert maximum_likelihood(dead, LINEAR).status == "ok"


def test_functions_of_the_library_that_random_forces_leave_out_are_no_obstacle(ambient):
    recording, *_ = ambient
    model = parse_model("q_v = dq_v; q_w = dq_w; dq_v = sin(q_v) + q_v + dq_v; dq_w = q_w + dq_w")
    found = maximum_likelihood(recording, model.terms)
    assert (found.status, found.is_forced) == ("ok", True)
    assert np.all(np.isfinite(forecast(found, recording[:5000], recording.time[5000:5010]).low))


@pytest.mark.parametrize("bin_of_tone", range(9, 13))
def test_a_mean_of_bins_is_at_the_frequency_in_their_middle(bin_of_tone: int) -> None:
    tone = np.cos(2.0 * np.pi * bin_of_tone * np.arange(400) / 400)[:, np.newaxis]
    omega, power = estimate_spectra([tone], 1.0)
    found = 400 * omega[np.argmax(power)] / (2.0 * np.pi)
    assert abs(found - bin_of_tone) <= (MEAN_BINS - 1) / 2 + 1e-9


def test_first_states_are_those_of_the_motion_and_forecasts_hold(ambient):
    recording, found, _ = ambient
    _, states, _ = two_modes()
    off = found.initial_states[0] - states[0]
    assert np.all(np.abs(off) < 0.2 * states.std(axis=0))
    ahead = forecast(found, recording[:5000], recording.time[5000:5300])
    inside = (states[5000:5300] >= ahead.low) & (states[5000:5300] <= ahead.high)
    assert inside.mean() > 0.8
    wide = (ahead.high - ahead.low)[:, 0]
    assert wide[-50:].mean() > 2 * wide[:5].mean()  # forces make the future less sure


@pytest.mark.parametrize("channels", [[0], [0, 1]])
def test_channels_may_end_long_before_the_recording(ambient, channels):
    recording, found, _ = ambient
    values = recording.values.copy()
    values[3000:, channels] = np.nan
    ahead = forecast(found, replace(recording, values=values))
    np.testing.assert_allclose((ahead.high - ahead.low)[-1, channels], 0.03, rtol=0.5)


def test_forecast_of_another_line_is_refused(ambient):
    _, found, _ = ambient
    with pytest.raises(ValueError, match="follow"):
        forecast(found, replace(two_modes(7)[0], values=20 * two_modes(7)[0].values))


def test_noise_alone_is_never_ok():
    noise = displacements(np.arange(2000) / 10, *np.zeros((2, 2000)), noise=1.0, seed=8)
    found = maximum_likelihood(noise, LINEAR, forced=())
    assert found.status in ("refused", "approximate") and found.findings


def accelerated(recording, accelerations):
    """As it is of accelerations alone, of an unknown offset."""
    missing = np.full(recording.values.shape, np.nan)
    rates = np.column_stack([missing[:, 0], accelerations])
    return replace(recording, values=missing, rates=rates, unknown_offsets=[False, True])


@pytest.mark.parametrize("of", ["values", "accelerations"])
def test_a_swing_that_goes_on_by_itself_needs_no_random_force(of):
    time = np.arange(0.0, 40.0, 0.05)
    recording = displacements(time, np.sin(4.4 * time), noise=0.05, seed=9)
    if of == "accelerations":
        recording = accelerated(recording, recording.values[:, 0])
    assert not maximum_likelihood(recording, polynomial_library(2, 3)).is_forced
    told = maximum_likelihood(recording, polynomial_library(2, 1), forced=())
    assert told.status == "refused"
    assert told.codes == "no_force_needed"


def test_a_weak_mode_that_is_missing_is_told():
    recording, _, _ = two_modes(2, shapes=((1, 0.3), (0, 1)))
    alone = displacements(recording.time, recording.values[:, 0])
    found = maximum_likelihood(alone, polynomial_library(2, 1), forced=())
    (other,) = found.resonances
    assert found.status == "ok"
    assert other.frequency == pytest.approx(2.0 * np.pi * 0.8, rel=0.01)


def test_the_growth_of_a_motion_that_settles_is_not_its_mean():
    """A second mode of the same sensor dies out, which looks like a random force."""
    both = parse_model("x = dx; dx = 0.1 dx - x - 0.1 dx^3; y = dy; dy = -1.5 y - 0.1 dy")
    time, rng = np.arange(0.0, 80.0, 0.05), np.random.default_rng(202611303)
    motion = simulate(both, [0.05, 0.0, 0.1, 0.0], time).states
    x = motion[:, 0] + motion[:, 2]
    x = x + 0.05 * x.std() * rng.standard_normal(len(time))
    values = np.column_stack([x, np.full(len(time), np.nan)])
    recording = Recording(time, ("x", "dx"), values)
    found = maximum_likelihood(recording, polynomial_library(2, 3), forced=("x",))
    errors = found.unconditional_errors[1]
    for name, true in {"x": -1.0, "dx": 0.1, "dx^3": -0.1}.items():
        k = found.model.term_names.index(name)
        assert abs(found.model.coefficients[1, k] - true) < 3.0 * errors[k]


def test_intervals_of_decay_are_open_where_little_is_told():
    assert decay_interval(0.01, 0.006, 300.0)[0] < 0.0 < decay_interval(0.05, 0.007, 1000.0)[0]
    assert decay_interval(-0.1, 0.01, 300.0)[1] < 0.0
    assert decay_interval(1e-5, 0.003, 600.0)[1] < 0.03  # not wide beyond what an error explains


@pytest.mark.parametrize("swings", [2.0, 10.0, 60.0])
def test_intervals_of_decay_hold(swings):
    """On Ornstein-Uhlenbeck processes of a decay times duration, by their exact likelihood."""
    rng, count, steps = np.random.default_rng(11), 2000, 400
    kept = np.exp(-swings / steps)
    size = np.sqrt((1.0 - kept**2) / (2.0 * swings))
    z = rng.standard_normal((count, 2)) @ [1, 1j] / np.sqrt(2.0 * swings)
    moved, power = np.zeros(count, complex), np.zeros(count)
    for _ in range(steps):
        after = kept * z + size * (rng.standard_normal((count, 2)) @ [1, 1j])
        moved, power, z = moved + after * z.conj(), power + np.abs(z) ** 2, after
    decay = -steps * np.log(np.abs(moved / power))
    intervals = np.array([decay_interval(a, np.sqrt(max(a, 0.0)), 1.0) for a in decay])
    held = np.mean((intervals[:, 0] <= swings) & (swings <= intervals[:, 1]))
    assert 0.93 <= held <= 0.98


def sine(frequency, time):
    return np.sin(2 * np.pi * frequency * time)


def test_further_modes_that_gallop_are_named():
    time = np.arange(0.0, 100.0, 0.04)
    slow = displacements(time, sine(0.4, time), noise=0.01, seed=12)
    assert find_unmodelled_modes([slow]) == []
    moved = slow.values[:, 0] + 0.3 * sine(2.1, time) + 0.3 * sine(2.8, time)
    moved += time**2 / 1000  # its mean drifts
    said = find_unmodelled_modes([displacements(time, moved)])
    assert [each.subject for each in said] == ["q_v", "q_v"]
    assert [each.data["own_hz"] for each in said] == pytest.approx([0.38] * 2, abs=0.01)  # in bins
    assert [each.data["frequency_hz"] for each in said] == pytest.approx([2.1, 2.8], abs=0.05)
    alone = accelerated(slow, np.gradient(np.gradient(moved, time), time))
    assert find_unmodelled_modes([alone]) == said


@pytest.mark.parametrize("kept", [0.8, 0.95, 0.99])
def test_noise_of_a_slow_colour_is_no_further_mode(kept):
    noise = lfilter([1.0], [1.0, -kept], np.random.default_rng(14).standard_normal(7500))
    assert find_unmodelled_modes([displacements(np.arange(7500) / 25, noise)]) == []


def test_a_further_mode_that_is_damped_well_is_named():
    time = np.arange(15000) / 25
    moved = sine(0.4, time) + 0.2 * swing(time, 2.1, 0.05, 15)
    assert find_unmodelled_modes([displacements(time, moved)])


def test_gaps_are_no_further_modes():
    time, rng = np.arange(0.0, 400.0, 0.04), np.random.default_rng(13)
    known = np.ones(len(time))
    for first in rng.integers(0, len(time), 40):
        known[first : first + 100] = np.nan
    for further, said in ((0.0, []), (0.1, [2.1])):
        moved = known * (sine(0.2, time) + further * sine(2.1, time))
        told = find_unmodelled_modes([displacements(time, moved, noise=0.03, seed=13)])
        assert [round(each.data["frequency_hz"], 1) for each in told] == said
