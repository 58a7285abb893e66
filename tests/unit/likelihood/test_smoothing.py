import numpy as np
import pytest

from galloping.identification.likelihood.smoothing import shortest_period, smooth
from galloping.recording import Recording

TIME = np.linspace(0.0, 60.0, 6001)
OMEGA = 3.0


def swing(level: float, seed: int = 0) -> tuple[np.ndarray, Recording]:
    x = np.column_stack([np.sin(OMEGA * TIME), OMEGA * np.cos(OMEGA * TIME)])
    noise = level * x.std(axis=0) * np.random.default_rng(seed).normal(size=x.shape)
    return x, Recording(TIME, ("q", "dq"), x + noise)


@pytest.mark.parametrize("level", [1e-4, 0.1])
def test_the_shortest_period_is_that_of_the_motion(level: float) -> None:
    assert shortest_period([swing(level)[1]]) == pytest.approx(2.0 * np.pi / OMEGA, rel=0.05)


def test_noise_is_measured_and_mostly_removed() -> None:
    x, recording = swing(0.1)
    curve = smooth(recording, 2.1)
    assert curve.noise == pytest.approx(0.1 * x.std(axis=0), rel=0.03)
    truth = np.column_stack([np.interp(curve.time, TIME, channel) for channel in x.T])
    left = (curve.states - truth).std(axis=0) / x.std(axis=0)
    assert np.all(left < 0.03)
    assert curve.derived.tolist() == [-1, -1]
