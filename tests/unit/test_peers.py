"""pysindy tuned from the data: its own filters, held-out errors, and the oracle beside it."""

from functools import partial

import numpy as np
import pandas as pd
import pysindy as ps
import pytest
from lines import moved, recorded

from galloping.evaluation.oracle import alternatives, oracles
from galloping.figures.errors import beaten_at
from galloping.identification.sparse import stlsq
from galloping.identification.sparse.evidence import Regressions, reduce, reduce_by_splines
from galloping.identification.sparse.regression import (
    FOLDS,
    HeldOutErrors,
    ReducedRegression,
    judge_path,
)
from galloping.identification.sparse.supports import forward_models, threshold_path
from galloping.identification.sparse.tuning import Convolution, savitzky_golay, weak_form
from galloping.line.galerkin import EQUATIONS
from galloping.model.polynomial import PolynomialModel, polynomial_library
from galloping.tables.scores import CHOSEN_SETTING, ORACLE_SETTING, peers

STEP = 0.02
TERMS = polynomial_library(4, 3)


TIME = STEP * np.arange(400)
NOISY = np.column_stack([np.sin(3 * TIME), np.cos(2 * TIME)])
NOISY += np.random.default_rng(11).normal(0, 0.1, NOISY.shape)


@pytest.mark.parametrize(("window", "order"), [(31, 3), (51, 5)])
def test_smoothing_is_that_of_pysindy(window, order):
    half, rows = window // 2, np.arange(60, 340)
    state, slope = (
        Convolution(NOISY, window)(kernel, rows) for kernel in savitzky_golay(window, order, STEP)
    )
    smoother = ps.SmoothedFiniteDifference(
        smoother_kws={"window_length": window, "polyorder": order}
    )
    smoother(NOISY, t=STEP)
    assert state == pytest.approx(np.asarray(smoother.smoothed_x_)[rows], abs=1e-10)
    sindy = ps.SINDyDerivative(
        kind="savitzky_golay", left=half, right=half, order=order, iwindow=True
    )
    assert slope == pytest.approx(np.asarray(sindy(NOISY, t=STEP))[rows], rel=1e-3, abs=1e-3)


@pytest.mark.filterwarnings("ignore:.*axes labeled")  # pysindy's, of what it does itself
@pytest.mark.parametrize(("half", "order"), [(10, 2), (40, 8)])
def test_test_functions_are_those_of_pysindy(half, order):
    np.random.seed(3)
    weak = ps.WeakPDELibrary(
        function_library=ps.PolynomialLibrary(degree=1, include_bias=False),
        spatiotemporal_grid=TIME, K=20, H_xt=STEP * (half + 0.25), p=order,
    )  # fmt: skip
    cells = [np.asarray(cell[0]) for cell in weak.inds_k]
    same = np.array([len(cell) == 2 * half + 1 for cell in cells])
    assert same.any()
    centres = np.array([cell[half] for cell in cells if len(cell) == 2 * half + 1])
    states, slopes = (
        Convolution(NOISY, 2 * half + 1)(kernel, centres) for kernel in weak_form(half, order, STEP)
    )
    weak.fit([NOISY])
    assert states == pytest.approx(np.asarray(weak.transform([NOISY])[0])[same], abs=1e-12)
    assert slopes == pytest.approx(weak.convert_u_dot_integral(NOISY)[same], abs=1e-12)


def test_errors_are_those_of_rows_that_were_not_fitted():
    """Of y = 2 x_0 - x_3 on six columns, with other rows held out."""
    rng = np.random.default_rng(5)
    rows = rng.standard_normal((2, 10, 7, 6))
    targets = rows @ np.array([2, 0, 0, -1, 0, 0]) + 0.3 * rng.standard_normal((2, 10, 7))
    seen, held_out = (np.dstack([x, y]) for x, y in zip(rows, targets, strict=True))
    reduced = ReducedRegression(
        rows[0].reshape(-1, 6), targets[0].reshape(-1, 1), np.array([70]), ("x",), (),
        held_out.transpose(0, 2, 1) @ held_out,
    )  # fmt: skip
    path = partial(forward_models, steps=3)
    judged = judge_path(reduced.products, reduced.held_out, 1, path)
    assert judged.supports[0, 2].tolist() == [True, False, False, True, False, False]
    fold = np.arange(10) % FOLDS
    for f in range(FOLDS):
        train = np.concatenate(seen[fold != f])[:, [0, 3, 6]]
        test = np.concatenate(held_out[fold == f])[:, [0, 3, 6]]
        c = np.linalg.lstsq(train[:, :2], train[:, 2], rcond=None)[0]
        expected = np.sum((test[:, 2] - test[:, :2] @ c) ** 2)
        assert judged.errors[f, 0, 2] == pytest.approx(expected)


def test_forward_models_take_the_best_next_term():
    rng = np.random.default_rng(8)
    x = rng.standard_normal((40, 6)) + rng.standard_normal((40, 1))
    y = rng.standard_normal(40)
    models = forward_models((x.T @ x)[np.newaxis], (x.T @ y)[np.newaxis, np.newaxis], 4)[0, 0]
    taken = []
    for step in range(1, 5):
        rss = {
            j: np.linalg.lstsq(x[:, [*taken, j]], y, rcond=None)[1][0]
            for j in range(6)
            if j not in taken
        }
        taken.append(min(rss, key=rss.get))
        assert np.flatnonzero(models[step]).tolist() == sorted(taken)
        expected = np.linalg.lstsq(x[:, taken], y, rcond=None)[0]
        assert models[step, taken] == pytest.approx(expected)


@pytest.mark.parametrize(("spread", "chosen"), [(1.0, 1), (0.1, 2)])
def test_the_sparsest_within_one_standard_error_is_chosen(spread, chosen):
    supports = np.tri(4, 3, -1, dtype=bool)[np.newaxis]  # 0 to 3 terms
    folds = np.array([-1.0, 1, -1, 1, 0])[:, np.newaxis, np.newaxis]
    errors = np.array([90.0, 10.4, 10, 10]) + folds * np.array([0, spread, 0.1, 0])
    assert HeldOutErrors(supports, errors).choose_sparsest().tolist() == [chosen]


def error(true, coefficients):
    present = true.support & np.isin(np.arange(len(true.states)), list(EQUATIONS))[:, None]
    right = true.coefficients[present]
    return np.mean(np.abs(coefficients[present] - right) / np.abs(right))


def test_tuned_smoothing_is_better_than_a_spline_and_worse_than_the_oracle(resonant):
    (recording,) = recorded(moved(*resonant), seed=71)
    true, evidence = resonant[0].on_library(TERMS), reduce([recording], TERMS)
    tuned, plain = (
        stlsq.fit_normalised(each, threshold=None, path_length=30).model.coefficients
        for each in (evidence, Regressions(reduce_by_splines([recording], TERMS)))
    )
    assert error(true, tuned) < 0.6 * error(true, plain)
    models = alternatives(evidence, partial(stlsq.models_along, threshold_path(30)))
    assert error(true, oracles(true, models)[0]) < error(true, tuned)


def test_an_oracle_knows_the_truth():
    true = PolynomialModel(
        ("q_v", "q_w", "dq_v", "dq_w"), ((1, 0, 0, 0), (2, 0, 0, 0)),
        np.array([[1.0, 0], [1, 0], [2, 4], [0, 1]]),
    )  # fmt: skip
    one = [np.array([[1.0, 0]])] * 2
    vertical = np.array([[2.0, 3.9], [2.5, 4.0], [0, 4.0]])
    horizontal = np.array([[0.1, 1.0], [0, 1.1]])
    least, right = oracles(true, [*one, vertical, horizontal])
    assert least[2:].tolist() == [[2.0, 3.9], [0.1, 1.0]]
    assert right[2:].tolist() == [[2.0, 3.9], [0, 1.1]]


def scored(method, replicate, error, spurious, r2, **more):
    return {
        "case": "line", "protocol": "state", "level": 0.05, "kind": "noise", "method": method,
        "replicate": replicate, "mean_error_linear_percent": error,
        "mean_error_cubic_percent": error + 2, "missing": 0, "spurious": spurious,
        "r2_q_v": r2, "r2_q_w": r2, **more,
    }  # fmt: skip


def test_the_oracle_is_never_worse_than_what_was_chosen():
    scores = pd.DataFrame(
        scored(method, k, 10 + k, 1, 0.5) for method in ("stlsq", "ours") for k in range(4)
    )
    least = [scored("stlsq", k, 3 + k, 5, -np.inf, choice="least error") for k in range(3)]
    right = [scored("stlsq", k, 20, 0, 0.4, choice="right terms") for k in range(3)]
    best = pd.DataFrame(least + right)
    table = peers(scores, {"a cell": best}).set_index(["method", "setting"])
    numbers = ["mean_error_percent", "share_exact_support", "r2_q_v", "r2_q_w", "replicates"]
    assert table.loc[("stlsq", CHOSEN_SETTING), numbers].tolist() == [12.5, 0, 0.5, 0.5, 4]
    assert table.loc[("stlsq", ORACLE_SETTING), numbers].tolist() == [5, 1, 0.5, 0.5, 3]
    assert ("ours", ORACLE_SETTING) not in table.index


def test_the_figure_says_where_the_oracle_is_better():
    table = pd.DataFrame(
        [("oracle", 0.05, 2.0), ("oracle", 0.1, 3.0), ("maximum_likelihood", 0.05, 1.0),
         ("maximum_likelihood", 0.1, 4.0)],
        columns=["method", "level", "median"],
    )  # fmt: skip
    assert beaten_at(table) == "0.1"
    assert beaten_at(table[table["method"] == "oracle"]) == ""
