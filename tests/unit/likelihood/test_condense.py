import numpy as np
import pytest

from galloping.identification.likelihood.condense import ROWS, condense
from galloping.taylor import ORDER


def test_projections_keep_the_distance_of_samples_to_a_slow_curve() -> None:
    rng = np.random.default_rng(0)
    time = np.sort(rng.uniform(0.0, 3.0, 400))
    values = rng.normal(size=(400, 2))
    values[rng.random(values.shape) < 0.2] = np.nan
    condensed = condense([time], [values], np.array([0, 1]), 0.5)
    coefficients = rng.normal(size=(6, 2, ROWS))  # a parabola in every window and channel
    padded = np.zeros((6, 2, ORDER + 1))
    padded[:, :, :ROWS] = coefficients
    predicted = np.einsum("wok,work->wor", padded, condensed.functionals)
    inside = ((condensed.targets - predicted) ** 2).sum(axis=(0, 2)) + condensed.remainder[0]
    scaled = (time - time[0]) / 0.5
    window = np.minimum(scaled.astype(int), 5)
    powers = (scaled - window)[:, None] ** np.arange(ROWS)
    curve = np.einsum("iok,ik->io", coefficients[window], powers)
    direct = np.nansum((values - curve) ** 2, axis=0)
    assert inside == pytest.approx(direct, rel=1e-10)


def test_windows_with_few_samples_have_as_many_rows() -> None:
    time = np.array([0.0, 0.1, 2.05, 2.5])
    values = np.ones((4, 1))
    condensed = condense([time], [values], np.array([0]), 1.0)
    filled = np.any(condensed.functionals != 0.0, axis=3)[:, 0].sum(axis=1)
    assert filled.tolist() == [2, 0, 2]
    assert condensed.counts[0, 0] == condensed.rows[0, 0] == 4
    assert condensed.remainder[0, 0] == pytest.approx(0.0, abs=1e-12)


def test_recordings_keep_their_own_windows() -> None:
    times = [np.linspace(0.0, 1.0, 11), np.linspace(5.0, 7.0, 21)]
    values = [np.zeros((11, 1)), np.ones((21, 1))]
    condensed = condense(times, values, np.array([0]), 0.5)
    assert condensed.first.tolist() == [0, 2, 6]
    assert np.all(condensed.targets[:2] == 0.0)
    assert condensed.counts[:, 0].tolist() == [11, 21]
