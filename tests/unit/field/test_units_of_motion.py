"""Any oscillator: the same motion in other units of length and time is answered alike."""

from functools import cache

import motions
import numpy as np
import pytest

from galloping import assess, maximum_likelihood, polynomial_library, summarise
from galloping.recording.samples import mean_inputs

UNITS = ((1e-6, 1e-6), (1e6, 1e5), (3.3, 1e-3))  # what lengths and times are multiplied by
FAST = (motions.growing, motions.decaying)


@cache
def identified(kind, length=1.0, time=1.0):
    """A recording of a kind in other units, and the model found from it."""
    recording = motions.in_other_units(kind(), length, time)
    count = len(recording.states) + len(recording.inputs)
    return recording, maximum_likelihood(recording, polynomial_library(count, 3))


def coefficients(found, length, time):
    """Coefficients, errors and limits in the units of the first recording."""
    own = motions.units(found.model.states, length, time)
    powers = np.array(found.model.terms)[:, : len(own)]
    factors = np.prod(own**powers, axis=1) / own[:, np.newaxis] * time
    each = (found.model.coefficients, found.standard_errors, found.detection_limits)
    return np.array([factors * values for values in each])


def numbers(summary, assessment, length, time):
    """All numbers of a summary and an assessment in the units of the first recording."""
    states, found = summary.found.model.states, {}
    own = dict(zip(states, motions.units(states, length, time), strict=True))
    own |= {f"d{state}": unit / time for state, unit in own.items() if f"d{state}" not in own}

    def put(name, value, unit):
        found[name] = np.array([value.value, value.low, value.high]) / unit

    known, trial = summary.dynamics, summary.held_out
    for values, unit in ((known.rest, length), (known.frequencies, 1 / time), (known.damping, 1),
                         (known.half_range, length)):  # fmt: skip
        for name, value in values.items():
            put(f"{name} {len(found)}", value, unit)
    if known.period:
        put("period", known.period, time)
    for name in ("skill", "missed", "held", "factors"):
        found[name] = getattr(trial, name)
    for ahead in filter(None, (trial.forecast, summary.forecast)):  # of what inputs drive, none
        for name in ("median", "low", "high"):
            factors = [own[channel] for channel in ahead.names]
            found[f"{name} {len(found)}"] = getattr(ahead, name) / factors
    for condition in assessment.conditions:
        for cycle in condition.cycles:
            put(f"period {len(found)}", cycle.period, time)
            for value in cycle.half_range.values():
                put(f"half range {len(found)}", value, length)
        for rest in condition.equilibria:
            for mode in rest.modes:
                drifts = mode.frequency.value == 0.0
                put(f"frequency {len(found)}", mode.frequency, 1 / time)
                put(f"damping {len(found)}", mode.damping, 1 / time if drifts else 1)
    return found


@cache
def answers(kind, length=1.0, time=1.0):
    """Numbers and codes of what a recording is answered, in the units of the first one."""
    own, found = identified(kind, length, time)
    summary = summarise(found, own)
    assessment = assess(summary.found, mean_inputs(found.model.inputs, [own]))
    return numbers(summary, assessment, length, time), (found.status, found.codes)


def of(kind, *values, more="", marks=()):
    """Parameters of a test, in the process that keeps what a kind is answered."""
    group = pytest.mark.xdist_group(kind.__name__)
    return pytest.param(kind, *values, id=kind.__name__ + more, marks=[group, *marks])


@pytest.mark.parametrize("kind", [of(kind) for kind in motions.QUICK])
def test_a_model_is_the_same_in_all_units(kind):
    _, first = identified(kind)
    expected = coefficients(first, 1.0, 1.0)
    for length, time in UNITS:
        _, other = identified(kind, length, time)
        assert other.status == first.status and other.codes == first.codes
        found = coefficients(other, length, time)
        np.testing.assert_allclose(found, expected, rtol=1e-6, equal_nan=True)
        assert other.rival_share == pytest.approx(first.rival_share, rel=1e-6)


@pytest.mark.parametrize(
    ("kind", "units"),
    [of(kind, UNITS[:1]) for kind in FAST]
    + [
        of(kind, units, more=" in more", marks=[pytest.mark.slow])
        for kinds, units in ((motions.QUICK, UNITS), (motions.SLOW, UNITS[:1]))
        for kind in kinds
    ],
)
def test_what_a_recording_is_answered_is_the_same_in_all_units(kind, units):
    expected, told = answers(kind)
    for length, time in units:
        found, other = answers(kind, length, time)
        assert other == told
        assert found.keys() == expected.keys()
        for name, value in expected.items():
            scale = np.nanmax(np.abs(value[np.isfinite(value)]), initial=0.0)
            np.testing.assert_allclose(
                found[name], value, rtol=1e-4, atol=1e-5 * scale, equal_nan=True, err_msg=name
            )
