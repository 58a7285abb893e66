"""Recordings of known systems, each of which takes one part of `maximum_likelihood`.

What is tested is the answer, by the truth of the recording, or, where a part decides between
answers, the path to it. A recording is named after the part of the method without which it is not
answered as well (docs/identification_parts.csv). Recordings of other parts are tested where their
subject is: derivatives in test_maximum_likelihood; accelerations alone in test_rate_channels;
fluctuating coefficients in test_model_error; coloured noise in test_robustness.
"""

import numpy as np
import pytest
from identification_cases import model, noisy

from galloping import Input, PolynomialModel, Recording, Simulator, maximum_likelihood, simulate
from galloping import polynomial_library as library
from galloping.identification.findings import Code
from galloping.identification.likelihood.instrument import FORCE_CODES
from galloping.identification.likelihood.starts import starts_of_terms
from galloping.identification.likelihood.trajectory_fit import fit_free_segments
from galloping.identification.preparation.weak_form import make_start
from galloping.identification.prior_knowledge import PRIOR
from galloping.identification.problem import make_problem
from galloping.line.galerkin import STATES
from galloping.streams import make_generator
from galloping.trajectory.simulation import time_grid
from galloping.trials.attempts import against_truth, simulate_recording
from galloping.trials.published import PUBLISHED_SETTINGS, RECORDED_PERIODS, SYSTEMS
from galloping.trials.recorded_lines import TERMS, draw_lines

OSCILLATOR = model(("x", "dx"), 3, {"dx": 1.0}, {"x": -1.0, "dx": 0.3, "x^2 dx": -0.3})
TIME = np.linspace(0.0, 100.0, 2001)
SEED = 2718281
Known = tuple[PolynomialModel, Recording]


def published(
    name: str, level: float, periods: float = RECORDED_PERIODS, seed: int = SEED
) -> Known:
    """Of a published system, 500 samples of thirty periods, as its trial makes it."""
    true, time = SYSTEMS[name].model, np.linspace(0.0, periods * SYSTEMS[name].period, 500)
    columns = {
        "system": name, "states": len(true.states), "samples": 500,
        "protocol": "state", "level": level, "seed": seed, "replicate": 0,
    }  # fmt: skip
    motion = simulate(true, SYSTEMS[name].start, time).states
    return true, simulate_recording(columns, true, time, motion).recording


def random_line(number: int, release: int, seed: int) -> Known:
    """100 s of a line that is drawn, at 5 % noise."""
    time = time_grid(100.0, 100.0)
    simulator = Simulator(STATES, TERMS)
    true, motions = next(draw_lines(make_generator(SEED, "random line", number), simulator, time))
    return true, noisy(true, motions[release], time, 0.05, seed)


def long_ago_settled() -> Known:
    """Of 2,050 periods, all but some ten on the limit cycle."""
    time = np.linspace(0.0, 2.0 * np.pi * 2050, 2050 * 8)
    motion = simulate(OSCILLATOR, (0.5, 0.0), time).states
    return OSCILLATOR, noisy(OSCILLATOR, motion, time, 0.05, 0)


def velocity_alone(rate: dict[str, float]) -> Known:
    """Of a motion whose middle is not its equilibrium: its spring is softer on one side."""
    true = model(("x", "dx"), 3, {"dx": 1.0}, rate)
    recording = noisy(true, simulate(true, (0.3, 0.0), TIME).states, TIME, 0.03, 0)
    velocity = np.where([False, True], recording.values, np.nan)
    return true, Recording(TIME, true.states, velocity)


FOUND = {
    "time scale 0.25": lambda: published("cubic_damped", 0.01),
    "time scale 0.5": lambda: published("cubic_damped", 0.05),
    "few terms": lambda: published("van_der_pol", 0.2),
    # of more periods the motion, which is chaotic, is another one for another rounding
    "second degree": lambda: published("lorenz", 0.2, periods=15),
    "slow pass": lambda: published("brusselator", 0.1, seed=1732051),
    "3 periods": lambda: published("rayleigh", 0.1),
    "0.75 periods": lambda: published("rayleigh", 0.2),
    "selected with the prior": lambda: random_line(18, 1, 2),
    "telling stretch": long_ago_settled,
    "rest": lambda: velocity_alone({"x": -1.0, "x^2": -0.5, "dx": 0.05, "x^2 dx": -0.1}),
}
OPEN = {
    "windows 1/4": lambda: published("three_competitors", 0.01),
    "near a surface": lambda: published("wake", 0.05),
    "no model": lambda: published("relaxation", 0.05),
}


@pytest.mark.parametrize("path", FOUND)
def test_terms_are_found_and_coefficients_within_their_intervals(path) -> None:
    true, recording = FOUND[path]()
    found = maximum_likelihood(recording, true.terms)
    row = against_truth(true, found)
    assert found.status in ("ok", "not identifiable"), found.reason
    assert row["exact_support"] and not row["beyond_4_standard_errors"]  # within four errors
    error = (found.model.coefficients - true.coefficients)[found.support]
    size = true.coefficients[found.support]
    assert np.linalg.norm(error) < 0.1 * np.linalg.norm(size)


def test_forces_that_change_slowly_show_between_four_segments() -> None:
    """Of a spring that hardly drifts: between single segments noise hides the drift."""
    time, knots = np.linspace(0.0, 800.0, 6401), np.arange(0.0, 1001.0, 200.0)
    drift = np.random.default_rng(202611277).normal(size=len(knots))
    terms = (*((*term, 0) for term in OSCILLATOR.terms), (1, 0, 1))
    rows = np.hstack([OSCILLATOR.coefficients, [[0.0], [7e-5]]])
    drifting = PolynomialModel(OSCILLATOR.states, terms, rows, ("F",))
    force = {"F": Input(time, np.interp(time, knots, drift))}
    motion = simulate(drifting, (0.5, 0.0), time, force).states
    recording = noisy(OSCILLATOR, motion, time, 0.05, 202611277)
    found = maximum_likelihood(recording, OSCILLATOR.terms)
    assert found.status == "approximate" and found.has_finding(*FORCE_CODES)


def test_segments_whose_initial_states_explain_all_samples_are_not_joined() -> None:
    true, recording = published("brusselator", 0.1)
    start = make_start(make_problem(true.states, true.terms, prior=PRIOR), [recording])
    (_, terms, _), *_ = starts_of_terms(start)
    assert fit_free_segments(start, terms) is None


@pytest.mark.parametrize("path", OPEN)
def test_what_is_hard_to_tell_is_never_sure_and_wrong(path) -> None:
    true, recording = OPEN[path]()
    found = maximum_likelihood(recording, true.terms)
    assert not against_truth(true, found)["ok_and_wrong"]
    assert found.status == "ok" or found.findings
    assert (found.status == "refused") == bool(np.isnan(found.model.coefficients).all())


@pytest.mark.parametrize(("level", "penalty"), [(0.005, 25), (0.03, 7)])
def test_a_term_that_the_library_lacks_leaves_a_model_that_forecasts(level, penalty):
    """Of little noise by the stronger, of more by the weaker penalty, by which a misfit that is
    taken for white noise leads to a worse one.
    """
    rate = {"x": -1.0, "dx": 0.3, "x^2 dx": -0.3, "x^5": -0.02}
    true = model(("x", "dx"), 5, {"dx": 1.0}, rate)
    recording = noisy(true, simulate(true, (0.5, 0.0), TIME).states, TIME, level, 0)
    found = maximum_likelihood(recording, library(2, 3))
    assert found.status == "approximate", found.reason
    assert f"penalty {penalty}" in found.diagnostics["path"]
    assert found.diagnostics["forecast_r2"] > 0.95


@pytest.mark.parametrize(
    ("level", "seed", "code"),
    [(0.03, 0, Code.TERM_MAY_BE_MISSING), (0.01, 3, Code.MIXTURE_MAY_HIDE)],
)
def test_terms_that_others_may_balance_are_no_ok(level, seed, code):
    """As where a motion stays near a surface: other terms have the same motion there."""
    true, time = SYSTEMS["wake"].model, np.linspace(0.0, 30.0 * SYSTEMS["wake"].period, 500)
    motion = simulate(true, SYSTEMS["wake"].start, time).states
    recording = noisy(true, motion, time, level, seed)
    found = maximum_likelihood(recording, true.terms)
    assert found.status == "not identifiable"
    assert found.has_finding(code)


@pytest.mark.parametrize(
    ("seed", "duration", "level", "draw"),
    [
        pytest.param(20262011, 10.0, 0.35, 8, id="chains that grow far tell a term at its end"),
        pytest.param(20262014, 6.0, 0.05, 26, id="noise that is skewed does not grow"),
    ],
)
def test_lorenz_is_exact(seed, duration, level, draw):
    """Where shorter chains, or a test that takes a skewed sum for Gaussian, lead to no model."""
    system, step = PUBLISHED_SETTINGS["lorenz"]
    true, time = system.model, step * np.arange(1000)
    motion = simulate(true, system.start, time).states
    rows = slice(round(duration / step))
    noise = make_generator(seed, "lor", duration, level, draw).standard_normal(motion[rows].shape)
    recording = Recording(time[rows], true.states, motion[rows] + level * motion.std() * noise)
    found = maximum_likelihood(recording, true.terms)
    assert np.array_equal(found.support, true.support), found.reason


@pytest.mark.slow
def test_a_term_is_not_imitated_because_its_chain_grows_far():
    """By 1e6 here: of each term the end of the chain tells most, and alike."""
    time, simulator = time_grid(300.0, 100.0), Simulator(STATES, TERMS)
    true, motions = next(draw_lines(make_generator(20262020, "random line", 8), simulator, time))
    noise = make_generator(20262020, "n", 8, 0).standard_normal(motions[0].shape)
    values = motions[0] + 0.05 * motions[0].std(0) * noise
    found = maximum_likelihood(Recording(time, STATES, values), true.terms)
    assert (found.status, found.codes) == ("ok", "")


@pytest.mark.slow
def test_a_sensitive_swing_loses_its_superfluous_terms():
    """A few in each pass: after 14 passes the model follows the recording with 25 terms of 16."""
    time, simulator = time_grid(300.0, 100.0), Simulator(STATES, TERMS)
    true, motions = next(draw_lines(make_generator(31337001, "random line", 74), simulator, time))
    columns = {
        "group": "random lines", "case": "all", "protocol": "state", "level": 0.05,
        "seed": 31337001, "replicate": 74, "release": 0,
    }  # fmt: skip
    recording = simulate_recording(columns, true, time, motions[0]).recording
    found = maximum_likelihood(recording, true.terms)
    assert found.status == "ok" and against_truth(true, found)["exact_support"], found.reason


def test_of_little_noise_a_constant_is_no_cheaper_than_other_terms():
    """Noise makes one up here, which improves chi^2 by more than a constant costs elsewhere."""
    true = SYSTEMS["lorenz"].model.on_library(library(3, 2))
    motion = simulate(true, (-8.0, 8.0, 27.0), 0.01 * np.arange(1000)).states
    noise = make_generator(20261742, "lor", 4.0, 0.025, 1).standard_normal((400, 3))
    values = motion[:400] + 0.025 * motion.std() * noise
    recording = Recording(0.01 * np.arange(400), true.states, values)
    found = maximum_likelihood(recording, true.terms)
    assert np.array_equal(found.support, true.support) and found.status == "ok"
