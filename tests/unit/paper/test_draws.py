"""Draws of the paper's study are those of the study itself, recorded, identified and scored."""

import numpy as np
import pandas as pd
import pytest
from lines import RESONANT, recorded
from scipy.stats import ks_2samp

from galloping.configuration.load import load, plain
from galloping.configuration.yaml_file import read
from galloping.evaluation.score import Truth, evaluate
from galloping.identification import cell, registry
from galloping.identification.sparse.evidence import reduce_by_splines
from galloping.identification.sparse.stlsq import fit, fit_raw
from galloping.model.polynomial import design_matrix, extend_library, polynomial_library
from galloping.paper import draws
from galloping.paper.quick import QuickStudy
from galloping.paper.unknowns import MethodReading
from galloping.results import IDENTIFIED, KNOWN, NOISE, PAPER_METHOD, SUBSET

CASE = {**RESONANT, "initial_state": {**RESONANT["initial_state"], "q_v": 0.7, "q_w": 1.0}}
MINUTE = {"duration": 60, "sampling_rate": 50, "steady_window": (40, 60)}
AMOUNTS = draws.Amounts(levels=(0.0, 0.05), points=(1000,), **MINUTE)
SETTING = {"threshold": 0.003, "path_length": 30}
PLAN = {"kinematics": IDENTIFIED, "degree": 3}
TERMS = polynomial_library(4, 3)
PYSINDY_RIDGE = 0.05  # `alpha` of its STLSQ, where none is given


@pytest.fixture(scope="module")
def line():
    return draws.line_motion(CASE, AMOUNTS.duration, AMOUNTS.sampling_rate)


def short(levels, duration=30, points=()):
    window = (duration - duration // 3, duration)
    return draws.Amounts(levels=levels, points=points, duration=duration, steady_window=window)


def drawn(number, amounts, **setting):
    return draws.paper_draws(
        CASE, draws=number, seed=1, name=("test",), amounts=amounts, **PLAN | setting
    )


def items(line, **options):
    options |= {"protocol": "derivative", "relative": False, "name": ("test",)}
    return [(recording,) for recording in recorded(line[0], **options)]


def identified(recordings):
    """Models by the way that the study goes, by method."""
    options = {PAPER_METHOD: {"threshold": 0.003, "path_length": 30}}
    settings = registry.BY_NAME[PAPER_METHOD].settings(options, 0)
    return cell.identify({PAPER_METHOD: settings}, recordings, TERMS, ("test",))


def test_one_recording_gives_one_model_by_either_way(line):
    ((recording,),) = items(line, samples=3001)
    ours = fit_raw(reduce_by_splines([recording], TERMS), **SETTING)
    (standard,) = identified([(recording,)])[PAPER_METHOD]
    np.testing.assert_allclose(ours.model.coefficients, standard.model.coefficients, rtol=1e-9)


@pytest.mark.parametrize("points", [3001, 3000, 1000])
def test_a_drawn_regression_is_that_of_its_samples(line, points):
    """With next to no noise: least squares on the same number of samples finds the line."""
    motion, model = line
    drawn = draws.DerivativeNoise(motion, TERMS, np.ones(4))
    products = drawn.draw(1e-9, points, np.random.default_rng(1))
    (reduced,) = products.regressions(motion.names, TERMS)
    found = np.linalg.lstsq(reduced.library, reduced.targets, rcond=None)[0].T
    np.testing.assert_allclose(found, model.on_library(TERMS).coefficients, atol=1e-6)
    rows = reduced.library.T @ reduced.library
    assert rows[0, 0] == pytest.approx(points)  # the constant's column counts the samples


def test_draws_are_distributed_as_scores_of_recordings(line):
    motion, model = line
    true = model.on_library(extend_library(TERMS, model))
    truth = Truth(true, motion.time, motion.states, AMOUNTS.steady_window)
    every = drawn(60, AMOUNTS, **SETTING)
    for kind, points in ((NOISE, 3001), (SUBSET, 1000)):
        models = identified(items(line, level=0.05, samples=points, replicates=60))
        standard = pd.DataFrame(evaluate(truth, models, np.full((1, 4, 35), np.nan))[0])
        own = (every["kind"] == kind) & (every["level"] == 0.05) & (every["points"] == points)
        for column in ("mean_error_linear_percent", "mean_error_cubic_percent", "e2", "r2_q_v",
                       "amplitude_error_q_w_percent", "spurious", "missing"):  # fmt: skip
            assert ks_2samp(standard[column], every.loc[own, column]).pvalue > 0.01, (kind, column)


def test_without_noise_the_line_is_found_exactly_in_one_draw():
    (row,) = drawn(5, short((0.0,), 60), **SETTING).to_dict("records")
    assert row["true_positive_ratio"] == 1 and row["e2"] < 1e-9


def test_a_draw_depends_on_its_own_cell_and_number_alone():
    one = drawn(2, short((0.05,)), **SETTING)
    more = drawn(2, short((0.01, 0.05), points=(1000,)), **SETTING)
    same = more[(more["kind"] == NOISE) & (more["level"] == 0.05)]
    pd.testing.assert_frame_equal(one, same.reset_index(drop=True))


@pytest.mark.parametrize("protocol", list(draws.NOISES_BY_READING))
def test_known_kinematic_equations_are_not_identified(protocol):
    study = QuickStudy(*draws.line_motion(CASE, 30, 100), short((0.05,)))
    known, identified = (
        study.draw_scores(
            MethodReading(None, "normalised", kinematics, protocol), 2, np.random.default_rng(1)
        )
        for kinematics in (KNOWN, IDENTIFIED)
    )
    assert (known["spurious"] <= identified["spurious"]).all()
    assert (known["mean_error_cubic_percent"] == identified["mean_error_cubic_percent"]).all()


def test_the_default_ridge_of_pysindy_finds_false_terms_without_noise(root):
    """What `readings.csv` says of it, at the study's own setting."""
    study = plain(load(read(root / "config" / "config.yaml")))
    motion, line = draws.line_motion(study["cases"]["internal_resonance"], 300, 100)
    columns, true = design_matrix(motion.states, TERMS), line.on_library(TERMS).coefficients != 0
    thresholds = np.full(len(true), study["identification"]["paper"]["threshold"])
    without, with_ridge = (
        fit(columns, motion.rates, thresholds, ridge) != 0 for ridge in (0, PYSINDY_RIDGE)
    )
    np.testing.assert_array_equal(without, true)
    assert (with_ridge & ~true).any()


def test_the_length_of_the_path_of_thresholds_counts():
    amounts = draws.Amounts(levels=(0.05,), points=(), **MINUTE)
    short_path, long_path = (
        drawn(2, amounts, threshold=None, path_length=count)["e2"].to_list() for count in (3, 30)
    )
    assert short_path != long_path


def test_draws_with_too_few_samples_are_refused():
    amounts = draws.Amounts(levels=(), points=(100,), **MINUTE)
    table = drawn(2, amounts, **SETTING | {"degree": 5})
    assert table["status"].to_list() == ["refused"] * 2
