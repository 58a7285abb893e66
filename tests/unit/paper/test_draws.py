"""Draws of the paper's study are those of the study itself, recorded, identified and scored."""

import numpy as np
import pandas as pd
import pytest
from lines import RESONANT, recorded
from scipy.stats import ks_2samp

from galloping.evaluation.score import Truth, evaluate
from galloping.identification import cell, registry
from galloping.identification.sparse.evidence import reduce
from galloping.paper import draws
from galloping.polynomial import extended, library
from galloping.results import NOISE, PAPER_METHOD, SUBSET

CASE = {**RESONANT, "initial_state": {**RESONANT["initial_state"], "q_v": 0.7, "q_w": 1.0}}
AMOUNTS = draws.Amounts(levels=(0.0, 0.05), points=(1000,), duration=60, sampling_rate=50,
                        steady_window=(40, 60))  # fmt: skip
SETTING = {"threshold": 0.003, "columns": "raw"}


@pytest.fixture(scope="module")
def line():
    return draws.line_motion(CASE, AMOUNTS.duration, AMOUNTS.sampling_rate)


def items(line, **options):
    options |= {"protocol": "derivative", "relative": False, "name": ("test",)}
    return [(recording,) for recording in recorded(line[0], **options)]


def standard_scores(line, *, level, points, replicates):
    """Scores by the way that the study goes: recordings, the method, its evaluation."""
    motion, model = line
    terms = library(4, 3)
    recordings = items(line, level=level, samples=points, replicates=replicates)
    method = registry.BY_NAME[PAPER_METHOD]
    settings = method.settings({"degree": 3, "paper": {"threshold": 0.003, "path_length": 30}}, 0)
    models = cell.identify({PAPER_METHOD: settings}, recordings, terms, ("test",))
    true = model.on_library(extended(terms, model))
    truth = Truth(true, motion.time, motion.states, AMOUNTS.steady_window)
    return pd.DataFrame(evaluate(truth, models, np.full((1, 4, 35), np.nan))[0])


def test_one_recording_gives_one_model_by_either_way(line):
    ((recording,),) = items(line, samples=3001)
    ours = draws.identify(reduce([recording], library(4, 3)).plain, **SETTING)
    standard = cell.identify(
        {"paper": registry.BY_NAME["paper"].settings(
            {"degree": 3, "paper": {"threshold": 0.003, "path_length": 30}}, 0)},
        [(recording,)], library(4, 3), ("test",),
    )["paper"][0]  # fmt: skip
    np.testing.assert_allclose(ours.model.coefficients, standard.model.coefficients, rtol=1e-9)


@pytest.mark.parametrize("points", [3001, 3000, 1000])
def test_a_drawn_regression_is_that_of_its_samples(line, points):
    """With next to no noise: least squares on the same number of samples finds the line."""
    motion, model = line
    drawn = draws.DerivativeNoise(motion, library(4, 3), np.ones(4))
    products = drawn.draw(1e-9, points, np.random.default_rng(1))
    (reduced,) = products.regressions(motion.names, library(4, 3))
    found = np.linalg.lstsq(reduced.library, reduced.targets, rcond=None)[0].T
    np.testing.assert_allclose(found, model.on_library(library(4, 3)).coefficients, atol=1e-6)
    rows = reduced.library.T @ reduced.library
    assert rows[0, 0] == pytest.approx(points)  # the constant's column counts the samples


def test_draws_are_distributed_as_scores_of_recordings(line):
    number = 60
    every = draws.paper_draws(
        CASE, draws=number, seed=1, name=("test",), **SETTING, amounts=AMOUNTS
    )
    for kind, points in ((NOISE, 3001), (SUBSET, 1000)):
        standard = standard_scores(line, level=0.05, points=points, replicates=number)
        own = (every["kind"] == kind) & (every["level"] == 0.05) & (every["points"] == points)
        for column in ("mean_error_linear_percent", "mean_error_cubic_percent", "e2", "r2_q_v",
                       "amplitude_error_q_w_percent", "spurious", "missing"):  # fmt: skip
            assert ks_2samp(standard[column], every.loc[own, column]).pvalue > 0.01, (kind, column)


def test_without_noise_the_line_is_found_exactly_in_one_draw():
    drawn = draws.paper_draws(
        CASE, draws=5, seed=1, name=("test",), **SETTING,
        amounts=draws.Amounts(levels=(0.0,), points=(), duration=60, steady_window=(40, 60)),
    )  # fmt: skip
    assert len(drawn) == 1
    assert drawn["true_positive_ratio"][0] == 1
    assert drawn["e2"][0] < 1e-9


def test_a_draw_depends_on_its_own_cell_and_number_alone():
    def few(**changes):
        return draws.paper_draws(
            CASE, seed=1, name=("test",), **SETTING, amounts=draws.Amounts(**changes), draws=2
        )

    window = {"duration": 30, "steady_window": (20, 30)}
    one = few(levels=(0.05,), points=(), **window)
    more = few(levels=(0.01, 0.05), points=(1000,), **window)
    pd.testing.assert_frame_equal(one, more[more["kind"] == NOISE].query("level == 0.05")
                                  .reset_index(drop=True))  # fmt: skip


@pytest.mark.parametrize("protocol", list(draws.PROTOCOLS))
def test_known_kinematic_equations_are_not_identified(protocol):
    drawn = {
        kinematics: draws.paper_draws(
            CASE, draws=2, seed=1, name=("test",), threshold=None, protocol=protocol,
            kinematics=kinematics, columns="normalised",
            amounts=draws.Amounts(levels=(0.05,), points=(), duration=30, steady_window=(20, 30)),
        )
        for kinematics in (draws.KNOWN, draws.IDENTIFIED)
    }  # fmt: skip
    known, identified = (drawn[name] for name in (draws.KNOWN, draws.IDENTIFIED))
    assert (known["spurious"] <= identified["spurious"]).all()
    assert (known["mean_error_cubic_percent"] == identified["mean_error_cubic_percent"]).all()
