"""Channels and recordings that differ in rate, offset, length or inputs count as what they are."""

import numpy as np
import pytest
from scipy.signal import lfilter

from galloping import (
    Input,
    PolynomialModel,
    Recording,
    maximum_likelihood,
    measure,
    polynomial_library,
    simulate,
)
from galloping.identification.findings import Code
from galloping.identification.free_motion.rest import moving_recordings
from galloping.identification.preparation.screening import smooth_without_outliers
from galloping.identification.prior_knowledge import Coefficient

LINEAR, CUBIC = polynomial_library(2, 1), polynomial_library(2, 3)
STATES = ("x", "dx")


def of_displacements(time: np.ndarray, x: np.ndarray) -> Recording:
    return Recording(time, STATES, np.column_stack([x, np.full(len(x), np.nan)]))


def decay(time: np.ndarray, frequency: float) -> np.ndarray:
    motion = np.exp(-0.05 * time) * np.cos(2.0 * np.pi * frequency * time)
    return motion + 0.01 * np.random.default_rng(3).standard_normal(len(time))


@pytest.mark.parametrize("frequency", [1.0, 2.0])
def test_a_channel_that_is_slower_than_its_rows_has_no_mirror_image(frequency: float) -> None:
    time, slow = np.arange(3000) * 0.02, slice(None, None, 5)
    x = np.full(len(time), np.nan)
    x[slow] = decay(time[slow], frequency)
    found = maximum_likelihood(of_displacements(time, x), LINEAR)
    stiffness = -found.model.coefficients[1, LINEAR.index((1, 0))]
    assert found.status == "ok"
    assert stiffness == pytest.approx((2.0 * np.pi * frequency) ** 2, rel=1e-3)


def test_free_motion_is_not_linear_where_the_library_says_so() -> None:
    time = np.arange(1200) * 0.05
    x = np.exp(-0.02 * time) * np.cos(3.0 * time)
    exact = np.column_stack([x, np.gradient(x, time)])
    values = exact + 0.005 * np.random.default_rng(0).standard_normal(exact.shape)
    spring = [Coefficient("dx", (3, 0), -5.0, 0.0)]
    found = maximum_likelihood(Recording(time, STATES, values), CUBIC, coefficients=spring)
    assert found.status != "ok"
    around = Recording(time, STATES, np.add(values, [10.0, 0.0]))
    assert maximum_likelihood(around, CUBIC[1:]).status != "ok"  # without a constant
    assert CUBIC[0] == (0, 0)


def test_powers_of_an_input_that_moves_between_its_samples_differ() -> None:
    time = np.arange(1200) * 0.05
    force = Input([0.0, 30.0, 60.0], [0.0, 2.0, 0.0], "linear")
    fine = np.linspace(0.0, time[-1], 50 * len(time) - 49)
    x, step = [1.0], fine[1]
    for now in np.interp(fine, force.time, force.values)[:-1]:
        x.append(x[-1] + step * (now**2 - x[-1]))
    values = np.array(x)[::50, None] + 0.005 * np.random.default_rng(0).normal(size=(1200, 1))
    found = maximum_likelihood(
        Recording(time, ("x",), values, inputs={"F": force}), polynomial_library(2, 2)
    )
    assert found.status == "ok"
    assert found.model.equations()[0].split(" = ")[1].endswith("F^2")


def test_short_recordings_count_also_with_an_input_that_no_term_has() -> None:
    rng = np.random.default_rng(0)
    time, parts = np.arange(80) * 0.1, []
    for k in range(6):
        values = np.exp(-0.2 * time)[:, None] + 0.005 * rng.standard_normal((80, 1))
        unused = {"G": Input(time, np.sin(time))} if k else {}
        parts.append(Recording(time, ("x",), values, inputs=unused))
    found = maximum_likelihood(parts, polynomial_library(1, 1))
    assert len(found.initial_states) == 6


def test_outliers_are_the_same_wherever_zero_is() -> None:
    rng, time = np.random.default_rng(1), np.arange(3000) * 0.02
    x = 0.2 * np.sin(3.0 * time) + 0.002 * rng.standard_normal(len(time))
    x[::60] += 0.1
    left = []
    for offset in (0.0, 200.0):
        recording = of_displacements(time, x + offset)
        left.append(np.isfinite(smooth_without_outliers(recording, 2.0)[0].values[:, 0]).sum())
    assert np.abs(np.array(left) - (len(time) - 50)).max() <= 3


def test_a_coefficient_that_only_the_prior_tells_has_the_error_of_the_prior() -> None:
    time, rng = np.arange(2000) * 0.02, np.random.default_rng(0)
    x = 1e-3 * np.exp(-0.1 * time)[:, None]
    slow = lfilter([1e-5], [1.0, -0.95], rng.standard_normal(len(time)))
    recording = Recording(time, ("x",), x, rates=-0.1 * x + slow[:, None], exact=True)
    prior = [Coefficient("x", (3,), 2.0, 0.5)]
    found = maximum_likelihood(recording, ((0,), (1,), (3,)), coefficients=prior)
    assert found.model.coefficients[0, 2] == pytest.approx(2.0, rel=1e-3)
    assert found.standard_errors[0, 2] == pytest.approx(0.5, rel=1e-3)


def test_a_recording_of_few_samples_moves() -> None:
    time = np.arange(400) * 0.05
    few = np.full(400, np.nan)
    few[[10, 90, 170, 250, 330, 399]] = decay(time, 1.0)[[10, 90, 170, 250, 330, 399]]
    own = [of_displacements(time, decay(time, 1.0)), of_displacements(time, few)]
    assert len(moving_recordings(own).recordings) == 2


@pytest.mark.parametrize("resolution", [0.0, 0.01])
def test_a_recording_at_rest_changes_nothing_beside_a_motion(resolution: float) -> None:
    time = np.arange(1500) * 0.04
    model = PolynomialModel(STATES, ((1, 0), (0, 1), (0, 3)), [[0, 1, 0], [-4, -0.05, -0.05]])
    moves = measure(model, simulate(model, [1.5, 0.0], time), level=0.03, seed=5)
    noise = 0.3 * resolution * np.random.default_rng(6).standard_normal(moves.values.shape)
    steps = np.round(noise / resolution) * resolution if resolution else noise
    alone, beside = (
        maximum_likelihood(own, CUBIC) for own in ([moves], [moves, Recording(time, STATES, steps)])
    )
    assert alone.status == beside.status == "ok"
    np.testing.assert_allclose(beside.model.coefficients, alone.model.coefficients, atol=1e-3)
    codes = {(finding.code, finding.recording) for finding in beside.findings}
    assert ((Code.CAME_TO_REST, 1) in codes) == (resolution == 0.0)
