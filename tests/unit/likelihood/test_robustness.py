"""Where it hurts: a good answer, or a refusal with its reason; of faults see test_trials too."""

import numpy as np
import pytest
from identification_cases import LINE, SUPPORT, TIME, X, assert_found, noisy, solution
from scipy.integrate import solve_ivp
from scipy.signal import lfilter

from galloping import (
    IdentifiedModel,
    PolynomialModel,
    Recording,
    maximum_likelihood,
    parse_model,
    simulate,
    weak_gls,
)
from galloping import polynomial_library as library
from galloping.identification.findings import Code, Finding
from galloping.identification.preparation.screening import smooth_without_outliers
from galloping.progress_reports import progress

LEVEL = 0.05


def identify(values: np.ndarray, time: np.ndarray = TIME) -> IdentifiedModel:
    return maximum_likelihood([Recording(time, LINE.states, values)], LINE.terms)


def measured(seed: int = 0) -> np.ndarray:
    return noisy(LINE, X, TIME, LEVEL, seed).values.copy()


def assert_good(found: IdentifiedModel) -> None:
    assert_found(found, LINE, spread=1.8)


def coloured(correlation: float) -> np.ndarray:
    white = np.random.default_rng(0).normal(size=(len(TIME) + 1000, 4))
    noise = lfilter([np.sqrt(1.0 - correlation**2)], [1.0, -correlation], white, axis=0)[1000:]
    return X + LEVEL * X.std(axis=0) * noise


def test_noise_correlated_over_a_few_samples_widens_the_intervals() -> None:
    """By 2.4, as the power of the noise at the frequencies of the motion says."""
    white, found = identify(measured()), identify(coloured(0.7))
    assert_good(found)
    assert found.chi2 > 2.0
    assert np.all(found.standard_errors[SUPPORT] > 2.1 * white.standard_errors[SUPPORT])


@pytest.mark.parametrize("correlation", [pytest.param(0.98, marks=pytest.mark.slow), 0.999])
def test_noise_correlated_over_a_period_is_never_exact(correlation: float) -> None:
    found = identify(coloured(correlation)[::4], TIME[::4])
    assert found.status in ("approximate", "refused")
    assert found.has_finding(Code.NOISE_CORRELATED)


@pytest.mark.parametrize("size", [5.0, 50.0])
def test_one_percent_of_outliers_is_removed(size: float) -> None:
    rng = np.random.default_rng(5)
    values = measured()
    hit = rng.random(values.shape) < 0.01
    values[hit] += (size * LEVEL * X.std(axis=0) * rng.normal(size=X.shape))[hit]
    found = identify(values)
    assert_good(found)
    assert 0.001 < found.diagnostics["removed_share"] < 0.012


def test_noise_that_bursts_is_no_outlier() -> None:
    """Up to ten times as large, twice: by the noise of the whole channel many samples are far."""
    time, noise = np.arange(6000) / 20, np.random.default_rng(202611273).normal(size=(6000, 2))
    noise *= 1.0 + 9.0 * np.sin(np.pi * time[:, None] / 150.0) ** 8
    exact = np.column_stack([np.sin(time), np.cos(time)])
    recording = Recording(time, ("x", "dx"), exact + 0.02 * noise)
    cleaned, _ = smooth_without_outliers(recording, 2.0 * np.pi)
    assert cleaned.samples > 0.999 * recording.samples


def test_the_noise_of_counts_is_no_outlier() -> None:
    """An epidemic is a single swell, shorter than four of its periods."""
    days = np.arange(150.0)
    epidemic = solve_ivp(
        lambda _, x: [-0.35 * x[0] * x[1], (0.35 * x[0] - 0.1) * x[1]], (0.0, 150.0), [0.99, 0.01],
        t_eval=days, rtol=1e-9,
    ).y.T  # fmt: skip
    counts = np.random.default_rng(202611301).poisson(1e4 * epidemic) / 1e4
    found = maximum_likelihood(Recording(days, ("S", "I"), counts), library(2, 2))
    assert not found.has_finding(Code.OUTLIERS)
    assert found.has_finding(Code.NOISE_GROWS)


@pytest.mark.parametrize("hum", [3.0, 7.3])
def test_a_hum_has_its_own_frequency_and_not_that_to_which_windows_fold_it(hum: float) -> None:
    rng, time = np.random.default_rng(202611302), np.arange(0.0, 80.0, 0.05)
    van_der_pol = parse_model("x = dx; dx = 0.3 dx - 0.3 x^2 dx - x - 0.1 x^3")
    x = simulate(van_der_pol, [0.05, 0.0], time).states[:, 0]
    x = x + 0.1 * np.sin(2.0 * np.pi * hum * time) + 0.03 * rng.standard_normal(len(time))
    values = np.column_stack([x, np.full(len(time), np.nan)])
    found = maximum_likelihood(Recording(time, ("x", "dx"), values), library(2, 3))
    (line,) = (each for each in found.findings if each.code is Code.RESIDUAL_LINE)
    assert line.data["frequency_hz"] == pytest.approx(hum, abs=0.02)


@pytest.mark.parametrize("share", [0.98, 0.7])
def test_a_saturated_sensor(share: float) -> None:
    values = measured()
    limit = np.quantile(np.abs(X[:, 1]), share)
    values[:, 1] = np.clip(values[:, 1], -limit, limit)
    assert_good(identify(values))


def test_a_stuck_velocity_is_done_without_and_a_stuck_displacement_refused() -> None:
    without, refused = measured(), measured()
    without[:, 2] = refused[:, 0] = 1.0
    found = identify(without)
    assert_good(found)
    assert np.isnan(found.sigma[0, 2])
    found = identify(refused)
    assert found.status == "refused" and Finding.of(Code.NOT_MEASURED, "q_v") in found.findings


@pytest.mark.parametrize("method", [maximum_likelihood, weak_gls])
def test_constant_channels_are_refused(method) -> None:
    found = method([Recording(TIME, LINE.states, np.ones_like(X))], LINE.terms)
    assert (found.status, found.codes) == ("refused", "no_motion")


def test_a_mistake_in_the_code_is_not_taken_for_a_recording_without_a_model() -> None:
    def listen(*_: object) -> None:
        raise ValueError("shapes differ")

    with progress(listen), pytest.raises(ValueError, match="shapes differ"):
        maximum_likelihood(Recording(TIME, LINE.states, X), LINE.terms)


def test_a_sensor_that_drifts_is_named_and_the_rest_answered() -> None:
    values = measured()
    values[:, 0] += 0.2 * values[:, 0].std() * (TIME / TIME[-1])
    found = identify(values)
    assert found.status == "approximate"
    assert Finding.of(Code.DRIFTS, "q_v") in found.findings
    assert not found.has_finding(Code.RESIDUAL_LINE)
    assert found.diagnostics["forecast_r2"] > 0.9


def test_gaps() -> None:
    values = measured()
    values[8000:14000] = np.nan  # a minute
    values[17000:17500, 1] = np.nan
    values[np.random.default_rng(0).random(values.shape) < 0.3] = np.nan
    assert_good(identify(values))
    # displacements alone, each gone for 40 % of the time, in stretches of some periods
    values = measured()
    values[:, 2:] = np.nan
    for channel, cycle in ((0, 2000), (1, 2300)):
        values[np.arange(len(TIME)) % cycle > 0.6 * cycle, channel] = np.nan
    assert_good(identify(values))


@pytest.mark.parametrize("bits", [5, 7])
def test_a_coarse_resolution_is_no_saturation(bits: int) -> None:
    values = measured()
    step = np.ptp(values, axis=0) / 2**bits
    found = identify(step * np.round(values / step))
    assert found.status == "ok", found.reason
    assert found.diagnostics["removed_share"] < 0.01


@pytest.mark.parametrize("seconds", [4, 20])  # of some two periods and more
def test_a_few_periods_are_answered_in_words(seconds: int) -> None:
    few = round(seconds / TIME[1])
    found = identify(measured()[:few], TIME[:few])
    assert found.status == "not identifiable"
    assert found.has_finding(Code.RIVAL_TERMS, Code.TERM_MAY_BE_MISSING, Code.MIXTURE_MAY_HIDE)


def test_a_library_without_the_cubic_terms_is_never_right() -> None:
    recording = Recording(TIME[::2], LINE.states, measured()[::2])
    found = maximum_likelihood([recording], library(4, 2))
    assert found.status in ("approximate", "refused")
    assert found.has_finding(
        Code.NOT_FOLLOWED, Code.ITERATION_DIVERGES, Code.RESIDUAL_LINE, Code.RESIDUAL_POWER
    )
    found = weak_gls([Recording(TIME, LINE.states, measured())], library(4, 2))
    assert (found.status, found.codes) == ("refused", "weak_misfit")


def test_a_slight_drift_is_looked_at_where_every_term_of_the_library_is_there() -> None:
    terms, time = ((1, 0), (0, 1), (2, 1)), np.linspace(0.0, 100.0, 2001)
    true = PolynomialModel(("x", "dx"), terms, np.array([[0.0, 1.0, 0.0], [-1.0, 0.3, -0.3]]))
    values = noisy(true, solution(true, np.array([0.5, 0.0]), time), time, 0.05, 0).values.copy()
    values[:, 0] += 0.035 * (time / time[-1] - 0.5)
    found = maximum_likelihood(Recording(time, true.states, values), terms)
    assert found.status == "ok", found.reason
    assert found.support[1].all()


def test_growth_that_settles_early_in_a_recording_is_identified() -> None:
    """Its transient is a fortieth of the recording, where the window of a spectrum is small."""
    time = np.arange(4000) / 10
    p = 50.0 / (1.0 + 49.0 * np.exp(-0.8 * time))
    p += 0.03 * p.std() * np.random.default_rng(2).standard_normal(p.shape)
    found = maximum_likelihood(Recording(time, ("p",), p[:, np.newaxis]), library(1, 2))
    assert found.support.tolist() == [[False, True, True]], found.reason
    error = np.abs(found.model.coefficients - [0.0, 0.8, -0.016])[found.support]
    assert np.all(error < 3.0 * found.standard_errors[found.support])


def test_an_oscillation_of_a_single_state_is_refused_with_the_state_that_it_lacks() -> None:
    time, rng = np.arange(1200) / 20, np.random.default_rng(1)
    noise = rng.normal(size=(1200, 1))
    swing = np.exp(-0.05 * time) * np.cos(time)
    growth = 1.0 / (1.0 + 9.0 * np.exp(-time / 5.0))
    moves = {"swing": swing, "growth": growth, "step": (time > 15.0).astype(float)}
    moves = {name: each[:, None] + 0.01 * noise for name, each in moves.items()}
    found = {
        name: maximum_likelihood(Recording(time, ["x"], values), library(1, 3))
        for name, values in {**moves, "noise": noise}.items()
    }
    lacking = [
        name
        for name, one in found.items()
        if [each.code for each in one.findings] == [Code.SECOND_STATE_MISSING]
    ]
    assert lacking == ["swing"] and found["swing"].status == "refused"
