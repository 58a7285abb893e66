"""Samples of the solution's rate: of accelerometers beside displacements, of accelerometers or
velocities alone, and derivatives of exact states.
"""

from dataclasses import replace

import numpy as np
import pytest
from identification_cases import RELEASE, assert_found, deviations, solution

from galloping import (
    Recording,
    derive,
    maximum_likelihood,
    parse_model,
    polynomial_library,
    simulate,
    summarise,
)
from galloping.identification.findings import Code

TERMS = polynomial_library(4, 3)
TIME = np.arange(0, 120, 0.04)
LINE = derive()


def recording(seed, accelerations=True, offset=0.0, scale=1.0):
    """Noisy displacements, and accelerations with an offset that drifts."""
    rng = np.random.default_rng(seed)
    motion = simulate(LINE, [0.6, 0.9, 0, 0], TIME).states
    values = np.full(motion.shape, np.nan)
    values[:, :2] = scale * motion[:, :2] + 0.02 * rng.standard_normal((len(TIME), 2))
    rates = np.full(motion.shape, np.nan)
    drift = offset * (1.0 + TIME / TIME[-1])[:, None]
    noise = 0.05 * rng.standard_normal((len(TIME), 2))
    rates[:, 2:] = LINE(motion)[:, 2:] + drift + noise
    states = LINE.states
    return Recording(
        TIME, states, values, rates=rates if accelerations else None,
        unknown_offsets=np.array([False, False, True, True]) if offset else None,
        unknown_scales=np.array([True, True, False, False]) if scale != 1 else None,
    )  # fmt: skip


def test_accelerations_with_offset_and_drift_sharpen_the_model():
    both = maximum_likelihood(recording(4, offset=0.3), TERMS)
    alone = maximum_likelihood(recording(4, accelerations=False), TERMS)
    assert both.status != "refused", both.reason
    assert np.nanmax(np.abs(deviations(both, LINE))) < 5
    assert both.diagnostics["noise_ddq_v"] == pytest.approx(0.05, rel=0.1)
    shared = both.support & alone.support
    ratio = both.standard_errors[shared] / alone.standard_errors[shared]
    assert np.median(ratio) < 0.9


@pytest.mark.parametrize(
    ("equation", "start"),
    [("-4 q - 0.15 dq - 2 q^3", 0.5), ("-4 q + 0.15 dq - 0.3 dq^3 - 0.5 q^3", 0.1)],
    ids=["decay", "growth"],
)
def test_an_unknown_offset_changes_no_model_of_an_accelerometer_alone(equation, start):
    true, time = parse_model(f"q = dq; dq = {equation}"), np.arange(0.0, 40.0, 0.03)
    motion = simulate(true, (start, 0.0), time).states
    rate = true(motion)[:, 1]
    rate += 0.05 * rate.std() * np.random.default_rng(9400).standard_normal(len(time))
    coefficients = []
    for offset in (0.0, 0.3):
        rates = np.column_stack([np.full(len(time), np.nan), rate + offset])
        missing = np.full_like(rates, np.nan)
        recording = Recording(
            time, true.states, missing, rates=rates, unknown_offsets=[False, True]
        )
        found = maximum_likelihood(recording, polynomial_library(2, 3))
        assert found.status == "ok", found.reason
        assert np.array_equal(found.support[1], true.on_library(found.model.terms).support[1])
        coefficients.append(found.model.coefficients)
    np.testing.assert_allclose(*coefficients, rtol=1e-6)


def test_a_camera_of_unknown_scale_is_calibrated_by_the_accelerometer():
    measured = recording(5, scale=1.15)
    both, alone = (maximum_likelihood(r, TERMS) for r in (measured, replace(measured, rates=None)))
    told = [both.diagnostics[f"scale_{state}"] for state in ("q_v", "q_w")]
    assert told == pytest.approx([1.15, 1.15], rel=4e-3)
    assert np.nanmax(np.abs(deviations(both, LINE))) < 5
    assert (alone.status, alone.codes) == ("refused", "scale_undetermined")
    gaps = measured.values.copy()
    gaps[TIME % 9.0 < 0.5] = np.nan
    rates = np.where(TIME[:, None] % 9.0 < 0.5, np.nan, measured.rates)
    broken = maximum_likelihood(replace(measured, values=gaps, rates=rates), TERMS)
    told = [broken.diagnostics[f"scale_{state}"] for state in ("q_v", "q_w")]
    assert told == pytest.approx([1.15, 1.15], rel=1e-2)
    assert alone.findings[0].subject == "q_v"


def test_noise_of_the_accelerometer_shifts_no_scale_and_its_error_is_in_the_coefficients():
    time, errors = np.arange(1500) / 25.0, []
    duffing = parse_model("x = dx; dx = -4 x - 0.1 dx - 2 x^3")
    motion = simulate(duffing, [1.2, 0.0], time).states
    force = duffing(motion)[:, 1]
    for seed in range(12):
        rng, rates = np.random.default_rng(seed), np.full((len(time), 2), np.nan)
        values = rates.copy()
        values[:, 0] = 7.3 * (motion[:, 0] + 0.02 * rng.standard_normal(len(time)))
        rates[:, 1] = force + 0.3 * force.std() * rng.standard_normal(len(time))
        scaled = Recording(time, ("x", "dx"), values, rates=rates, unknown_scales=[True, False])
        found = maximum_likelihood(scaled, polynomial_library(2, 3))
        place = 1, found.model.term_names.index("x^3")
        errors.append((found.model.coefficients[place] + 2.0) / found.standard_errors[place])
    assert np.sqrt(np.mean(np.square(errors))) < 1.5 and abs(np.mean(errors)) < 0.9
    summary = summarise(found, scaled)
    assert summary.dynamics.kind == "rest"
    assert np.nanmax(np.abs(summary.recordings[0].values)) == pytest.approx(1.2, rel=0.1)


@pytest.mark.parametrize("times", [1000.0, -1.0, 0.3])
@pytest.mark.parametrize("sensor", ["velocity", "accelerometer"])
def test_a_rate_in_another_unit_or_of_the_wrong_sign_is_named_at_once(sensor, times):
    measured = recording(6)
    if sensor == "velocity":
        speed = simulate(LINE, [0.6, 0.9, 0, 0], TIME).states[:, 2]
        values = measured.values.copy()
        values[:, 2] = times * (speed + 0.05 * np.random.default_rng(7).standard_normal(len(TIME)))
        measured = replace(measured, values=values)
        expected = ("dq_v", "q_v")
    else:
        measured = replace(measured, rates=measured.rates * [1, 1, 1, times])
        expected = ("ddq_w", "dq_w")
    found = maximum_likelihood(measured, TERMS)
    assert (found.status, found.codes) == ("refused", "rate_scaled")
    (finding,) = found.findings
    assert (finding.subject, finding.data["coordinate"]) == expected
    assert finding.data["times"] == pytest.approx(times, rel=0.03)


# duration and step, s; release, m; noise, of the deviation
MOTIONS = [
    ("velocities", 120, 0.08, (0.6, 0.9), 0.005),
    pytest.param("velocities", 300, 0.04, (0.1, 0.1), 0.02, marks=pytest.mark.slow),
    pytest.param("velocities", 90, 0.08, (0.6, 0.9), 0.002, marks=pytest.mark.slow),
    pytest.param("accelerations", 300, 0.04, (0.1, 0.1), 0.05, marks=pytest.mark.slow),
]


@pytest.mark.parametrize(("measured", "duration", "step", "release", "noise"), MOTIONS)
def test_the_line_is_found_without_its_displacements(measured, duration, step, release, noise):
    """Of its velocities, or of its accelerations with a drifting offset, and nothing else."""
    time = np.arange(0, duration, step)
    motion = simulate(LINE, [*release, 0, 0], time).states
    noise = noise * np.random.default_rng(8).standard_normal((len(time), 2))
    exact = (motion if measured == "velocities" else LINE(motion))[:, 2:]
    samples, missing = np.full((2, *motion.shape), np.nan)
    samples[:, 2:] = exact + noise * exact.std(axis=0)
    recording = Recording(time, LINE.states, samples)
    if measured == "accelerations":
        rates = samples + (0.3 + 0.2 * time[:, None] / time[-1])
        unknown = [False, False, True, True]
        recording = Recording(time, LINE.states, missing, rates=rates, unknown_offsets=unknown)
    found = maximum_likelihood(recording, TERMS)
    assert_found(found, LINE, within=4.5)
    assert np.isnan(found.sigma[:, :2]).all()


@pytest.mark.parametrize(("lacking", "status"), [(0.0, "ok"), (0.005, "approximate")])
def test_what_the_library_lacks_is_no_noise_of_derivatives(lacking: float, status: str) -> None:
    true, time = LINE.on_library(TERMS), np.linspace(0.0, 100.0, 2501)
    x = solution(true, RELEASE, time)
    rates = true(x)
    rates[:, 2] += lacking * rates[:, 2].std() * (x[:, 2] / x[:, 2].std()) ** 5
    noise = 0.001 * rates.std(axis=0) * np.random.default_rng(1).standard_normal(rates.shape)
    recording = Recording(time, LINE.states, x, rates + noise, exact=True)
    found = maximum_likelihood(recording, TERMS)
    assert found.status == status, found.reason
    assert found.has_finding(Code.DERIVATIVES_CORRELATED) == bool(lacking)
    assert np.all(np.isfinite(found.standard_errors[found.support]))
