"""Modes beside those of the coordinates: what a model in random forces tells of them."""

import numpy as np
import pytest
from scipy.signal import lfilter

from galloping import (
    IdentifiedModel,
    PolynomialModel,
    Recording,
    forecast,
    maximum_likelihood,
    polynomial_library,
    summarise,
)
from galloping.identification.model import Resonance
from galloping.identification.random_forces.tracking import spectra

TIME = np.arange(9_000) / 10
STATES = ("q_v", "dq_v")
TERMS = polynomial_library(2, degree=1)
MODES = {0.4: 0.006, 0.5: 0.01}  # Hz: damping ratio


def swing(frequency: float, damping: float, seed: int) -> np.ndarray:
    """A mode in white forces, of deviation one."""
    omega, step = 2 * np.pi * frequency, TIME[1]
    turn = omega * np.sqrt(1 - damping**2) * step
    poles = [1.0, -2 * np.exp(-damping * omega * step) * np.cos(turn)]
    poles.append(np.exp(-2 * damping * omega * step))
    force = np.random.default_rng(seed).standard_normal(len(TIME) + 20_000)
    motion = lfilter([1.0], poles, force)[-len(TIME) :]
    return motion / motion.std()


@pytest.fixture(scope="module")
def recording() -> Recording:
    motion = sum(swing(f, ratio, k) for k, (f, ratio) in enumerate(MODES.items(), 4))
    noise = 0.05 * np.random.default_rng(9).standard_normal(len(TIME))
    values = np.column_stack([motion + noise, np.full(len(TIME), np.nan)])
    return Recording(TIME, STATES, values)


@pytest.fixture(scope="module")
def found(recording):
    return maximum_likelihood(recording, TERMS)


def test_both_modes_of_one_sensor_are_told(found, recording):
    assert found.status == "ok" and len(found.resonances) == 1
    assert "beside those of the coordinates" in found.reason
    summary = summarise(found, recording)
    told = summary.dynamics
    assert len(told.frequencies) == len(MODES)
    for name, frequency in told.frequencies.items():
        true = min(MODES, key=lambda f: abs(f - frequency.value))
        assert frequency.low < true < frequency.high
        assert told.damping[name].low < MODES[true] < told.damping[name].high
    (other,) = found.resonances
    assert f"| {other.name}: net damping |" in str(summary)
    assert "more modes than there are directions" in str(summary)


def test_such_a_model_is_saved_and_forecasts(found, recording, tmp_path):
    found.save(tmp_path / "model.json")
    loaded = IdentifiedModel.load(tmp_path / "model.json")
    assert loaded.resonances == found.resonances
    time = TIME[-1] + np.arange(1, 30) / 10
    ahead = forecast(loaded, recording, time)
    same = forecast(found, recording, time)
    np.testing.assert_array_equal(ahead.median, same.median)
    assert np.all(ahead.low < ahead.high)


def test_the_spectrum_is_that_of_two_oscillators_in_white_forces():
    """r moves q; the white forces on both are correlated: by hand, in complex numbers."""
    own, other = (2.5, 0.02), (3.1, 0.01)
    white = np.array([[0.4, -0.1], [-0.1, 0.3]])
    coefficients = np.array([[0.0, 0.0, 1.0], [0.0, -(own[0] ** 2), -2 * own[1] * own[0]]])
    terms = ((0, 0), (1, 0), (0, 1))
    resonance = Resonance(*other, (0.0, 0.0), (0.0, 1.0), (0.0, white[0, 1], white[1, 1]))
    forces = np.diag([0.0, white[0, 0]])
    model = PolynomialModel(STATES, terms, coefficients)
    known = IdentifiedModel(
        model, "ok", forces=forces, resonances=(resonance,), sigma=np.array([[1e-9, np.nan]])
    )
    still = Recording(TIME, STATES, np.column_stack([np.sin(TIME), np.full(len(TIME), np.nan)]))
    frequency, power = spectra(known, still, np.random.default_rng(0))
    omega = 2 * np.pi * frequency
    by_force, by_other = (
        1 / (w**2 - omega**2 + 2j * ratio * w * omega) for w, ratio in (own, other)
    )
    onto = np.stack([by_force, by_force * by_other])
    exact = 2 * np.einsum("if,ij,jf->f", onto, white, onto.conj()).real
    np.testing.assert_allclose(power[:, 0], exact, rtol=1e-6)
