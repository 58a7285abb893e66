"""Where motion begins out of rest, and where it has come to rest."""

import numpy as np
import pytest
from ambient import two_modes
from swings import noisy, sensed, swing

from galloping import library
from galloping.identification.findings import Code
from galloping.identification.free_motion.rest import moving_parts, moving_recordings

TIME = np.arange(2000) / 50.0


def parts(samples, time=TIME):
    found = moving_parts(time, np.column_stack([samples]))
    return [(part.rows.start, part.rows.stop) for part in found]


@pytest.mark.parametrize("level", [0.0, 0.001, 0.03])
@pytest.mark.parametrize("begin", [0.4, 5.0, 20.0])
@pytest.mark.parametrize("held", [False, True])
def test_a_release_is_found(level, begin, held):
    motion = swing(TIME - begin, 1.0, 0.003)
    if held:
        motion[begin > TIME] = 1.0
    ((first, last),) = parts(noisy(motion, 1, level))
    released = np.searchsorted(TIME, begin)
    assert released <= first <= released + 25 and last == len(TIME)


def test_a_blow_is_left_out_with_its_own_acceleration():
    motion = swing(TIME - 3.0, 1.0, 0.01) + 4.0 * np.exp(-(((TIME - 3.0) / 0.03) ** 2))
    ((first, _),) = parts(noisy(motion, 2, 0.002))
    assert 3.05 < TIME[first] < 4.0


@pytest.mark.parametrize("scale", [1e-6, 1e5])
def test_units_change_nothing(scale):
    motion = noisy(swing(TIME - 5.0, 1.0, 0.05), 3, 0.005)
    assert parts(scale * motion, TIME) == parts(motion, TIME) == parts(motion, scale * TIME)


def test_what_has_died_out_is_at_rest():
    motion = swing(TIME, 1.0, 0.05)
    ((first, last),) = parts(noisy(motion, 4, 0.01))
    assert first == 0 and 8.0 < TIME[last] < 20.0  # the noise is reached after 15 s
    ((_, last),) = parts(0.02 * np.round(motion / 0.02))  # a sensor of coarse steps
    assert 7.0 < TIME[last] < 15.0


def test_each_release_is_a_motion_of_its_own():
    motion = noisy(swing(TIME - 2.0, 1.0, 0.08) + swing(TIME - 20.0, 1.0, 0.08), 5, 0.005)
    found = moving_recordings([sensed(TIME, motion)])
    begins = [recording.time[0] for recording in found.recordings]
    assert begins == pytest.approx([2.0, 20.0], abs=0.5) and found.origins == [0, 0]
    codes = [finding.code for finding in found.findings]
    assert codes == [Code.RELEASED, Code.CAME_TO_REST] * 2
    again = moving_recordings(found.recordings)
    assert [len(a.time) for a in again.recordings] == [len(a.time) for a in found.recordings]


def test_the_rest_after_a_motion_that_may_stick_is_kept():
    recording = sensed(TIME, noisy(swing(TIME, 1.0, 0.05), 4, 0.01))
    terms, _ = library("poly(q, dq; 1) + sign(dq)", recording.states)
    found = moving_recordings([recording], terms)
    assert found.recordings == [recording] and not found.findings
    without = moving_recordings([recording])
    assert len(found.until_rest[0].time) == len(without.recordings[0].time) < len(TIME)


def test_growth_beats_and_random_motion_are_no_rest():
    assert parts(noisy(0.01 * swing(TIME, 1.0, -0.02), 6, 0.01)) == [(0, 2000)]
    beats = swing(TIME, 1.0, 0.0) + swing(TIME, 1.1, 0.0)
    assert parts(noisy(beats, 7, 0.01)) == [(0, 2000)]
    assert parts(np.ones(2000)) == [(0, 2000)]
    for seed in range(5):
        recording, _, _ = two_modes(seed)
        assert len(moving_recordings([recording]).findings) == 0
