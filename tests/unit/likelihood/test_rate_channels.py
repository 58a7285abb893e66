"""Accelerometers beside displacements: samples of the solution's rate in the likelihood."""

from dataclasses import replace

import numpy as np
import pytest

from galloping import Recording, derive, maximum_likelihood, polynomial_library, simulate
from galloping.identification.likelihood.problem import posed
from galloping.identification.likelihood.rate_channels import scaled, scales_told
from galloping.identification.likelihood.weak_gls import begin

TERMS = polynomial_library(4, 3)
TIME = np.arange(0, 120, 0.04)
LINE = derive()


def recording(rng, accelerations=True, offset=0.0, scale=1.0):
    """Noisy displacements, and accelerations with an offset that drifts."""
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


def deviations(identified):
    """Errors of the present terms in standard errors."""
    error = identified.model.coefficients - LINE.on_library(TERMS).coefficients
    return (error / identified.standard_errors)[identified.support]


def test_accelerations_with_offset_and_drift_sharpen_the_model():
    rng = np.random.default_rng(4)
    both = maximum_likelihood(recording(rng, offset=0.3), TERMS)
    alone = maximum_likelihood(recording(np.random.default_rng(4), accelerations=False), TERMS)
    assert both.status != "refused", both.reason
    assert np.abs(deviations(both)).max() < 5
    assert both.diagnostics["noise_ddq_v"] == pytest.approx(0.05, rel=0.1)
    shared = both.support & alone.support
    ratio = both.standard_errors[shared] / alone.standard_errors[shared]
    assert np.median(ratio) < 0.9


def test_a_camera_of_unknown_scale_is_calibrated_by_the_accelerometer():
    measured = recording(np.random.default_rng(5), scale=1.15)
    start = begin(posed(LINE.states, TERMS), [measured])
    (calibrated,) = scaled([measured], start.period)
    scale = measured.values[:, :2] / calibrated.values[:, :2]
    np.testing.assert_allclose(scale, 1.15, rtol=4e-3)
    told = scales_told([measured], [calibrated])
    assert told == {k: pytest.approx(1.15, rel=4e-3) for k in ("scale_q_v", "scale_q_w")}
    alone = maximum_likelihood(replace(measured, rates=None), TERMS)
    assert alone.status == "refused" and "the scale of q_v cannot be told" in alone.reason
