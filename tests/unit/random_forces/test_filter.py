"""The filter of linear systems in white forces, beside independent computations."""

import numpy as np
import pytest
from ambient import STATES, two_modes
from scipy.linalg import expm
from scipy.stats import multivariate_normal

from galloping.identification.findings import Code
from galloping.identification.no_model import IdentificationError
from galloping.identification.preparation.channels import Channels
from galloping.identification.random_forces.kalman import kalman_filter
from galloping.identification.random_forces.steps import Steps, discretise
from galloping.identification.random_forces.tracking import Forces, SampledChannels, StateSpaceModel
from galloping.identification.random_forces.whiteness import assess_whiteness
from galloping.model.polynomial import PolynomialModel, polynomial_library

SYSTEM = np.array([[0, 0, 1, 0], [0, 0, 0, 1], [-9.0, 0.7, -0.1, 0.02], [0.3, -20.0, 0.01, -0.2]])
FORCES = np.diag([0.0, 0.0, 0.3, 0.1])
FORCES[2, 3] = FORCES[3, 2] = 0.05


def by_block_exponential(length):
    """C. F. Van Loan, IEEE Trans. Autom. Control 23, 1978."""
    n = len(SYSTEM)
    block = np.block([[-SYSTEM, FORCES], [np.zeros((n, n)), SYSTEM.T]])
    whole = expm(block * length)
    transition = whole[n:, n:].T
    return transition, transition @ whole[:n, n:]


@pytest.mark.parametrize("length", [1e-3, 0.04, 0.7, 30.0])
def test_steps_are_those_of_the_block_exponential(length):
    transitions, covariances = discretise(SYSTEM, FORCES, np.array([length]))
    transition, covariance = by_block_exponential(length)
    np.testing.assert_allclose(transitions[0], transition, atol=1e-11)
    np.testing.assert_allclose(covariances[0], covariance, atol=1e-11, rtol=1e-8)


def test_undamped_motion_gathers_force_without_bound():
    system = np.array([[0.0, 1.0], [-4.0, 0.0]])
    _, covariance = discretise(system, np.diag([0.0, 1.0]), np.array([1000.0]))
    # energy grows by half the force's covariance a second
    assert covariance[0, 1, 1] / 2 + 4.0 * covariance[0, 0, 0] / 2 == pytest.approx(500.0)


def test_critical_damping_cannot_be_told_apart():
    with pytest.raises(IdentificationError) as error:
        discretise(np.array([[0.0, 1.0], [-1.0, -2.0]]), np.eye(2), np.array([1.0]))
    assert error.value.findings[0].code == Code.MODES_ALIKE


@pytest.mark.parametrize("missing", [0.0, 0.3])
@pytest.mark.parametrize("regular", [True, False])
def test_likelihood_is_that_of_all_samples_together(missing, regular):
    rng = np.random.default_rng(3)
    time = np.arange(40) * 0.1 if regular else np.sort(rng.uniform(0.0, 4.0, 40))
    sensing, noise = np.vstack([np.eye(2, 4), SYSTEM[2]]), np.array([0.1, 0.2, 0.5])
    first = np.diag([1.0, 2.0, 3.0, 4.0])
    samples = rng.standard_normal((40, 3))
    samples[rng.random((40, 3)) < missing] = np.nan
    steps = Steps.from_times(time)
    transitions, covariances = discretise(SYSTEM, FORCES, steps.lengths)
    innovations, variances, _ = kalman_filter(
        samples, steps.index, transitions, covariances, sensing, noise, np.zeros(4), first.copy()
    )
    terms = np.log(2.0 * np.pi * variances) + innovations**2 / variances
    known = np.isfinite(samples)
    np.testing.assert_array_equal(np.isfinite(innovations), known)

    blocks = np.zeros((40, 4, 40, 4))
    covariance = first
    for k in range(40):
        if k:
            f = transitions[steps.index[k]]
            covariance = f @ covariance @ f.T + covariances[steps.index[k]]
        reached = covariance
        for j in range(k, 40):
            if j > k:
                reached = transitions[steps.index[j]] @ reached
            blocks[j, :, k], blocks[k, :, j] = reached, reached.T
    joint = np.einsum("ca,jakb,db->jckd", sensing, blocks, sensing).reshape(120, 120)
    joint += np.diag(np.tile(noise, 40))
    own = known.ravel()
    exact = multivariate_normal(cov=joint[np.ix_(own, own)]).logpdf(samples.ravel()[own])
    assert -0.5 * np.nansum(terms) == pytest.approx(exact, rel=1e-6)


def test_settled_gains_change_nothing():
    rng = np.random.default_rng(4)
    samples = rng.standard_normal((3000, 1))
    steps = Steps.from_times(np.arange(3000) * 0.1)
    discrete = discretise(SYSTEM, FORCES, steps.lengths)
    sensing, noise = np.array([[1.0, 0.5, 0, 0]]), np.array([0.1])
    whole = kalman_filter(samples, steps.index, *discrete, sensing, noise, np.zeros(4), np.eye(4))
    # never settles
    twice = np.concatenate([steps.index[:1], steps.index[1:] + np.arange(2999) % 2])
    doubled = [np.concatenate([each, each]) for each in discrete]
    again = kalman_filter(samples, twice, *doubled, sensing, noise, np.zeros(4), np.eye(4))
    for one, other in zip(whole, again, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-11)


def linear(system):
    return PolynomialModel(STATES, polynomial_library(4, 1), np.hstack([np.zeros((4, 1)), system]))


def tracker(model, recording, slow=(0.0, 0.0), **means):
    white = np.diag([0.0, 0.0, 1e-4, 1e-4])
    forces = Forces(white, np.diag([0.0, 0.0, *slow]), np.full(4, 0.3))
    size = np.tile(recording.values[:, :2].std(axis=0), 2) * np.array([1, 1, 4, 4])
    return StateSpaceModel(
        model, forces, Channels.from_recordings([recording]), 0.05 * size[:2], size, means
    )


def test_extended_filter_of_a_linear_system_is_that_of_kalman():
    recording, _, system = two_modes(4, duration=60.0)
    follow = tracker(linear(system), recording, slow=(1e-4, 2e-4))
    data = SampledChannels(recording.values[:, :2], Steps.from_times(recording.time))
    exact, other = follow.filter(data), follow.filter_extended(data, np.zeros((0, 2), np.int64))[0]
    atol = 1e-3 * np.std(data.samples[:, 0])
    np.testing.assert_allclose(other.innovations, exact.innovations, atol=atol)
    np.testing.assert_allclose(other.variances[9:], exact.variances[9:], rtol=1e-4)


def test_line_far_from_the_modes_counts_only_where_it_stands_out():
    """At the level of chance over all frequencies near the modes, above twice that elsewhere."""
    count, step, modes = 16000, 0.1, np.array([0.5, 0.8])
    frequency = np.fft.rfftfreq(count, step)
    noise = np.fft.rfft(np.random.default_rng(12).standard_normal((count, 1)), axis=0)
    alone = assess_whiteness([np.fft.irfft(noise, axis=0)], step, modes)
    assert alone.is_white
    for middle, times, named in ((0.7, 4.0, True), (4.2, 4.0, False), (4.2, 8.0, True)):
        louder = np.abs(frequency - middle) < 0.01
        moved = noise * np.where(louder, np.sqrt(times), 1.0)[:, np.newaxis]
        left = assess_whiteness([np.fft.irfft(moved, axis=0)], step, modes)
        assert left.shows_line == left.is_relevant == named
        assert left.frequency == pytest.approx(middle, abs=0.01)


def test_a_jump_is_no_random_force():
    """Of normal innovations none is ten deviations; one is said with its time and its channel."""
    noise = np.random.default_rng(21).standard_normal((2000, 2))
    assert assess_whiteness([noise], 0.1, np.array([0.5])).is_white
    noise[700, 1] = -14.0
    left = assess_whiteness([noise[:300], noise], 0.1, np.array([0.5]))
    assert left.is_relevant and not left.is_white
    jump = left.to_finding(["q_v", "q_w"])
    assert (jump.code, jump.subject) == (Code.INNOVATION_JUMPS, "q_w")
    assert jump.data == {"after_s": pytest.approx(70.0), "size": pytest.approx(14.0, abs=0.5)}


def test_modes_slower_than_a_recording_are_no_mistake():
    noise = np.random.default_rng(2).standard_normal((600, 1))
    parts = [noise[:100], noise[100:]]
    alone, among = (assess_whiteness(own, 0.1, np.array([2e-3])) for own in (parts[1:], parts))
    assert alone.is_white and among.is_white
    assert assess_whiteness(parts, 0.1, np.array([1e-6])).is_white
