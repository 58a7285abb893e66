"""The trial of motion in random forces: what is drawn, and how decays follow the coefficients."""

import numpy as np
import pytest

from galloping.streams import generator
from galloping.trials.ambient import DAMPING, FREQUENCIES, RandomMotion, decays


def test_recordings_are_drawn_by_number_within_the_ranges():
    motion = RandomMotion.drawn(generator(1, "ambient", 3))
    again = RandomMotion.drawn(generator(1, "ambient", 3))
    np.testing.assert_array_equal(motion.recording.values, again.recording.values)
    values, _ = decays(motion.system, ())
    assert np.all(np.abs(values) / (2 * np.pi) >= FREQUENCIES[0] - 1e-9)
    assert np.all(np.abs(values) / (2 * np.pi) <= FREQUENCIES[1] + 1e-9)
    ratio = -values.real / np.abs(values)
    assert DAMPING[0] - 1e-9 <= ratio.min() <= ratio.max() <= DAMPING[1] + 1e-9
    np.testing.assert_allclose(np.nanstd(motion.recording.values[:, :2], axis=0), 1.0, rtol=0.4)


def test_slopes_of_decays_are_differences():
    system = RandomMotion.drawn(generator(1, "ambient", 4)).system
    places = [(i, np.array([j])) for i in (2, 3) for j in range(4)] + [(2, np.array([], int))]
    _, slopes = decays(system, places)
    assert np.all(slopes[:, -1] == 0.0)
    for k, (i, j) in enumerate(places[:-1]):
        moved = system.copy()
        moved[i, j] += 1e-6
        change = (decays(system, ())[0] - decays(moved, ())[0]).real / 1e-6
        np.testing.assert_allclose(slopes[:, k], change, rtol=1e-3, atol=1e-6)


def test_slower_mode_comes_first():
    system = RandomMotion.drawn(generator(1, "ambient", 5)).system
    values, _ = decays(system, ())
    assert values[0].imag < values[1].imag == pytest.approx(np.max(np.linalg.eigvals(system).imag))


def test_the_bound_of_a_decay_is_little_above_that_of_its_envelope_alone():
    motion = RandomMotion.drawn(generator(1, "ambient", 6))
    values, _ = decays(motion.system, ())
    alone = np.sqrt(-values.real / motion.recording.time[-1])  # an Ornstein-Uhlenbeck process
    assert np.all(motion.least_errors() > alone)
    np.testing.assert_allclose(motion.least_errors(), alone, rtol=0.06)
