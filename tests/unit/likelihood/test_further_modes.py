"""Oscillations that a recording holds besides its model."""

import numpy as np
import pytest

from galloping.identification.likelihood.condense import condense_recordings
from galloping.identification.likelihood.further_modes import find_further_modes
from galloping.identification.preparation.channels import Channels

TIME = np.arange(0.0, 300.0, 0.02)
STATES = ("q", "dq")
MOTION = np.column_stack([np.cos(1.3 * TIME), -1.3 * np.sin(1.3 * TIME)])


def found(besides, observed=(0, 1), kept=slice(None)):
    """Further modes of a motion with `besides` (n, 2), noise included, where the model is exact."""
    channels, unknown = Channels(STATES, observed, ()), np.full((1, len(observed)), np.nan)

    def condensed(values):
        sampled = [values[kept][:, list(observed)]]
        return condense_recordings([TIME[kept]], sampled, channels, 0.2, unknown)

    return find_further_modes(condensed(MOTION + besides), condensed(besides).targets)


def noise(seed):
    return 0.05 * np.random.default_rng(seed).standard_normal(MOTION.shape)


@pytest.mark.parametrize("kept", [slice(None), np.r_[0:6000, 7500:15000]])
def test_growing_and_decaying_oscillations_are_found(kept):
    growing = 0.005 * np.exp(0.01 * TIME) * np.cos(6.7 * TIME + 0.3)
    decaying = 0.08 * np.exp(-0.02 * TIME) * np.sin(4.1 * TIME)
    besides = noise(1) + np.outer(growing + decaying, [1.0, 0.0])
    modes = sorted(found(besides, kept=kept), key=lambda mode: mode.frequency)
    assert [mode.state for mode in modes] == ["q", "q"]  # not in its rate, which is left out
    assert [mode.frequency for mode in modes] == pytest.approx([4.1, 6.7], abs=2e-3)
    assert [mode.growth for mode in modes] == pytest.approx([-0.02, 0.01], abs=2e-3)
    assert modes[0](TIME) == pytest.approx(decaying, abs=0.01)
    assert modes[1](TIME) == pytest.approx(growing, abs=0.01)


def test_noise_and_what_is_no_higher_than_the_motion_are_no_modes():
    slow = np.outer(0.1 * np.cos(1.6 * TIME), [1.0, 0.0])
    for seed in range(10):
        assert found(noise(seed)) == ()
        assert found(noise(seed) + slow) == ()
    assert found(np.zeros_like(MOTION)) == ()


def test_a_velocity_alone_shows_them_too():
    (mode,) = found(noise(2) + 0.1 * np.cos(5.0 * TIME)[:, None], observed=(1,))
    assert (mode.state, mode.recording) == ("dq", 0)
    assert mode.frequency == pytest.approx(5.0, abs=1e-3)
