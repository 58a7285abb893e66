"""Modes beside those of the coordinates, and what makes a model in random forces no sound one."""

from functools import partial

import numpy as np
import pytest
from ambient import displacements, stepped, swing
from scipy.ndimage import gaussian_filter1d
from scipy.signal import butter, sosfilt

import galloping
from galloping import Recording, maximum_likelihood, polynomial_library
from galloping.behaviour.objections import with_objections
from galloping.identification.findings import Code, Finding
from galloping.identification.identified_model import IdentifiedModel
from galloping.identification.oscillations import Resonance
from galloping.identification.random_forces.forced_motion import model_spectra
from galloping.inspection.excerpts import identify_excerpts

TIME = np.arange(9_000) / 10
STATES = ("q_v", "dq_v")
TERMS = polynomial_library(2, degree=1)
MODES = {0.4: 0.006, 0.5: 0.01}  # Hz: damping ratio


@pytest.fixture(scope="module")
def recording() -> Recording:
    motion = sum(swing(TIME, f, ratio, k) for k, (f, ratio) in enumerate(MODES.items(), 4))
    return displacements(TIME, motion, noise=0.05, seed=9)


@pytest.fixture(scope="module")
def found(recording):
    return maximum_likelihood(recording, TERMS)


def test_both_modes_of_one_sensor_are_told(found, recording):
    assert found.status == "ok" and len(found.resonances) == 1
    assert found.has_finding(Code.MODE_BESIDE)
    summary = galloping.summarise(found, recording)
    told = summary.dynamics
    assert len(told.frequencies) == len(MODES)
    for name, frequency in told.frequencies.items():
        true = min(MODES, key=lambda f: abs(f - frequency.value))
        assert frequency.low < true < frequency.high
        assert told.damping[name].low < MODES[true] < told.damping[name].high


def test_forces_in_some_equations_leave_no_room_for_further_modes():
    one, other, horizontal = (swing(TIME, f, 0.01, k) for k, f in enumerate((0.4, 0.5, 0.45)))
    recording = displacements(TIME, one + other, horizontal, noise=0.05, seed=1)
    found = maximum_likelihood(recording, polynomial_library(4, degree=1), forced=("q_v",))
    assert found.status != "ok" and not found.resonances


def test_such_a_model_is_saved_and_forecasts(found, recording, tmp_path):
    found.save(tmp_path / "model.json")
    loaded = IdentifiedModel.load(tmp_path / "model.json")
    assert loaded.resonances == found.resonances
    time = TIME[-1] + np.arange(1, 30) / 10
    ahead = galloping.forecast(loaded, recording, time)
    assert ahead == galloping.forecast(found, recording, time)
    assert np.all(ahead.low < ahead.high)


def test_the_spectrum_is_that_of_two_oscillators_in_white_forces():
    """r moves q; the white forces on both are correlated: by hand, in complex numbers."""
    own, other = (2.5, 0.02), (3.1, 0.01)
    white = np.array([[0.4, -0.1], [-0.1, 0.3]])
    coefficients = np.array([[0.0, 0.0, 1.0], [0.0, -(own[0] ** 2), -2 * own[1] * own[0]]])
    terms = ((0, 0), (1, 0), (0, 1))
    resonance = Resonance(*other, (0.0, 0.0), (0.0, 1.0), (0.0, white[0, 1], white[1, 1]))
    forces = np.diag([0.0, white[0, 0]])
    model = galloping.PolynomialModel(STATES, terms, coefficients)
    known = IdentifiedModel(
        model, forces=forces, resonances=(resonance,), sigma=np.array([[1e-9, np.nan]])
    )
    still = displacements(TIME, np.sin(TIME))
    frequency, power = model_spectra(known, still, np.random.default_rng(0))
    omega = 2 * np.pi * frequency
    by_force, by_other = (
        1 / (w**2 - omega**2 + 2j * ratio * w * omega) for w, ratio in (own, other)
    )
    onto = np.stack([by_force, by_force * by_other])
    exact = 2 * np.einsum("if,ij,jf->f", onto, white, onto.conj()).real
    np.testing.assert_allclose(power[:, 0], exact, rtol=1e-6)


def test_a_long_recording_is_answered_as_a_whole():
    """Its excerpts are too short to part the modes that a filter leaves out."""
    slow, fast = {0.4: 0.006, 0.3: 0.01}, {0.83: 0.006, 0.62: 0.008}
    pairs = zip(slow.items(), fast.items(), strict=True)
    moved = [swing(TIME, *a, k) + 0.4 * swing(TIME, *b, 5 + k) for k, (a, b) in enumerate(pairs)]
    recording = displacements(TIME, *moved, noise=0.05, seed=2)
    found = identify_excerpts(maximum_likelihood, [recording], polynomial_library(4, degree=1))
    assert found.status == "ok"
    told = sorted(mode.frequency / (2 * np.pi) for mode in found.resonances)
    np.testing.assert_allclose(told, sorted(fast), rtol=0.01)


def test_halves_of_unlike_frequency_make_no_sound_model():
    tuned = np.concatenate([swing(TIME, 0.42, 0.005, 1)[:4500], swing(TIME, 0.40, 0.005, 2)[:4500]])
    recording = displacements(TIME, tuned, noise=0.05, seed=3)
    identify = partial(maximum_likelihood, terms=TERMS, forced=())
    said = with_objections(identify(recording), [recording], ["a"], 1 / 0.4, identify)
    assert said.status == "approximate"
    assert said.has_finding(Code.FREQUENCY_CHANGES)


@pytest.mark.parametrize(("force", "status"), [(0.0, "ok"), (0.4, "approximate")])
def test_friction_is_no_random_force(force: float, status: str) -> None:
    """Driven by a known force; what the library lacks goes with the velocity."""
    step, rng = TIME[1], np.random.default_rng(4)
    u = gaussian_filter1d(rng.standard_normal(len(TIME)), 4.0)
    u /= u.std()
    forces = u[:, np.newaxis] + 0.15 / np.sqrt(step / 20) * rng.standard_normal((len(TIME), 20))
    motion, _ = stepped(lambda x, v, now: now - 6.0 * x - 0.2 * v - force * np.sign(v),
                        forces, step / 20)  # fmt: skip
    motion = motion[:4000] + 0.002 * rng.standard_normal(4000)
    values = np.column_stack([motion, np.full(4000, np.nan)])
    drive = {"u": galloping.Input(TIME, u, "zero")}
    recording = Recording(TIME[:4000], ("x", "dx"), values, inputs=drive)
    terms = ((1, 0, 0), (0, 1, 0), (0, 0, 1))
    found = maximum_likelihood(recording, terms, forced=())
    assert found.status == status
    assert (Finding.of(Code.FORCE_MISSING, "dx") in found.findings) == bool(force)


def test_friction_that_ends_a_swing_is_no_random_force() -> None:
    """Of many samples in a period each hardly shows it."""
    rate, steps = 500, 20
    motion, _ = stepped(lambda x, v, none: none - 65.6 * x - 0.05 * v - 0.17 * np.sign(v),
                        np.zeros((5 * rate, steps)), 1 / rate / steps, 0.066)  # fmt: skip
    read = 1.6e-4 * np.round(motion / 1.6e-4)  # an encoder
    recording = displacements(np.arange(len(read)) / rate, read)
    assert not maximum_likelihood(recording, polynomial_library(2, 3)).is_forced


def test_a_steady_tone_is_no_mode_that_may_gallop():
    motion = swing(TIME, 0.4, 0.01, 7) + 0.5 * np.sin(2 * np.pi * 0.47 * TIME)
    recording = displacements(TIME, motion, noise=0.05, seed=2)
    text = str(galloping.summarise(maximum_likelihood(recording, TERMS), recording))
    assert "the mode at 0.47 Hz has a nearly constant amplitude" in text
    assert "may" not in text.partition("|")[0]


def test_two_modes_that_overlap_are_no_broad_one():
    pair = {0.5: 0.015, 0.56: 0.015}
    first, second = (swing(TIME, f, ratio, int(1e3 * f)) for f, ratio in pair.items())
    motion = first + 0.5 * second
    recording = displacements(TIME, motion, noise=0.05 * motion.std())
    found = maximum_likelihood(recording, TERMS)
    told = galloping.dynamics(found, recording)
    assert found.status == "ok" and len(told.damping) == len(pair)
    for damping, true in zip(told.damping.values(), pair.values(), strict=True):
        assert damping.low < true < damping.high


@pytest.mark.slow
def test_forces_that_are_not_white_leave_an_approximate_model_with_the_slow_mode():
    faster = {1.0: 2, 1.07: 12, 1.15: 22, 1.3: 32}
    about = butter(4, (0.3, 0.36), "bandpass", fs=10, output="sos")
    forces = sosfilt(about, np.random.default_rng(5).standard_normal(len(TIME)))
    motion = swing(TIME, 0.4, 0.006, 1)
    motion += sum(0.5 * swing(TIME, f, 0.006, k) for f, k in faster.items())
    motion += 0.2 * forces / forces.std()
    recording = displacements(TIME, motion, noise=0.05 * motion.std(), seed=9)
    found = maximum_likelihood(recording, polynomial_library(2, degree=3))
    assert found.status == "approximate" and found.is_forced
    assert any(each.code == Code.RESIDUAL_MODE for each in found.findings)
    # as the mode of the coordinate, or of a further one beside it
    told = [each.value for each in galloping.dynamics(found, recording).frequencies.values()]
    told += [each.frequency / (2.0 * np.pi) for each in found.resonances]
    assert min(told) == pytest.approx(0.4, rel=0.02)
