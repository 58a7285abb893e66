"""Metrics and tables on cases whose answer is known."""

from dataclasses import replace

import numpy as np
import pytest
from lines import RESONANT, edited, recorded

from galloping.evaluation import score as scores
from galloping.evaluation.motion import r_squared, steady_amplitude, steady_frequency
from galloping.evaluation.score import Truth, evaluate, gallops, reconstruct, reconstruction, score
from galloping.identification.findings import Code, Finding
from galloping.identification.identified_model import IdentifiedModel
from galloping.identification.no_model import IdentificationError
from galloping.identification.sparse.evidence import reduce
from galloping.line.galerkin import coefficients, make_model
from galloping.model.polynomial import PolynomialModel, extend_library, polynomial_library
from galloping.recording.measurement import Motion
from galloping.tables.table3 import identified_terms
from galloping.trajectory.simulation import Simulator, Trajectory

INF = float("inf")


def unjudged(true, coefficients):
    """What a method without a verdict returns."""
    return IdentifiedModel(replace(true, coefficients=coefficients))


def short_truth(line, on=None):
    """The first 20 s of a line, on the terms `on`."""
    time, start = np.arange(2001) / 100, np.array([0.1, 0.1, 0, 0])
    states = Simulator(line.states, line.terms)(line, start, time).states
    return Truth(line.on_library(on or line.terms), time, states, (10, 20))


@pytest.mark.parametrize("frequency", [0.2137, 0.4204, 1.0, 7.77])
def test_frequency_of_a_sinusoid(frequency):
    time = np.arange(10001) / 100
    states = np.column_stack([np.sin(2 * np.pi * frequency * time + phase) for phase in (0, 1)])
    # a fiftieth of the spectral resolution of 0.01 Hz
    assert steady_frequency(5 + states, 0.01) == pytest.approx([frequency] * 2, abs=2e-4)


def test_frequency_is_that_of_the_strongest_line_and_amplitude_half_peak_to_peak():
    time = np.arange(10001)[:, np.newaxis] / 100
    states = np.sin(2 * np.pi * 0.4 * time) + 0.5 * np.sin(2 * np.pi * 0.21 * time)
    assert steady_frequency(states, 0.01) == pytest.approx([0.4], rel=1e-3)
    assert steady_amplitude(np.array([[0.0, 1.0], [3.0, -1.0]])).tolist() == [1.5, 1.0]


def test_r_squared_is_the_coefficient_of_determination():
    true = np.array([[1.0], [2.0], [3.0], [6.0]])  # mean 3, sum of squares about it 14
    assert r_squared(true, true).tolist() == [1.0]
    assert r_squared(true, np.full((4, 1), 3.0)).tolist() == [0.0]
    assert r_squared(true, np.array([[2.0], [2.0], [3.0], [4.0]])) == pytest.approx([1 - 5 / 14])
    assert r_squared(true[:, [0, 0]], np.array([[1, 1], [2, 2], [3, 3], [np.nan, 6]])).tolist() == [
        -INF, 1.0,
    ]  # fmt: skip


TRUE = PolynomialModel(
    ("a", "b"),
    polynomial_library(2, 3),
    np.array([[0, 0, 1.0] + [0] * 7, [0, 2, 0, 0, 4, 0, 0, 0, 0, -5]]),
)


def found(changes):
    """The coefficients of TRUE with others at places (row, column)."""
    values = TRUE.coefficients.copy()
    for place, value in changes.items():
        values[place] = value
    return values


def test_errors_by_order_and_in_the_norm():
    values = found({(1, 1): 2.2, (1, 4): 3.0, (1, 9): 0.0})
    assert scores.mean_error_by_order(TRUE, values, (1,)) == pytest.approx(
        {"linear": 0.1, "quadratic": 0.25, "cubic": 1.0}
    )
    assert scores.mean_error_by_order(TRUE, values, (0, 1))["linear"] == pytest.approx(0.05)
    assert scores.mean_error_by_order(TRUE, values, (0,)) == {"linear": 0.0}
    assert scores.relative_norm_error(TRUE, found({(0, 0): 3.0})) == pytest.approx(3 / np.sqrt(46))


def test_support_scores():
    assert scores.support_scores(TRUE, found({(1, 9): 0.0, (0, 0): 1e-9, (0, 5): 7.0})) == {
        "missing": 1, "spurious": 2, "true_positive_ratio": 3 / 6,
    }  # fmt: skip


def test_efficiency_is_the_error_over_the_bound_where_there_is_one():
    bound = np.full((2, 10), 0.5)
    values = found({(1, 1): 2.5, (1, 4): 3.0, (1, 9): -5.0})
    assert scores.efficiency(TRUE, values, bound, (1,)) == pytest.approx(np.sqrt((1 + 4 + 0) / 3))
    assert scores.efficiency(TRUE, np.full((2, 10), np.nan), bound, (1,)) == INF
    for undefined in (INF, np.nan):
        bound[1, 9] = undefined
        assert np.isnan(scores.efficiency(TRUE, values, bound, (0, 1)))
        assert scores.efficiency(TRUE, values, bound, (0,)) == 0.0  # of the other equation alone


def test_coverage_counts_the_intervals_that_hold():
    errors = np.full((2, 10), np.nan)
    errors[1, [1, 4]] = 0.1
    values = found({(1, 1): 2.19, (1, 4): 4.2, (1, 9): 0.0})
    # held; off by two standard deviations; missed
    held = scores.coverage(TRUE, values, errors, (1,))
    assert held == {"intervals": 3.0, "intervals_covering": 1.0}


NO_BOUND = np.full((4, 35), np.nan)


@pytest.fixture
def truth(resonant):
    line, trajectory = resonant
    line = line.on_library(polynomial_library(4, 3))
    return Truth(line, trajectory.time, trajectory.states, (200.0, 300.0))


def test_the_true_model_scores_best(truth):
    models = {"stlsq": [unjudged(truth.model, truth.model.coefficients)]}
    (row,), shown = evaluate(truth, models, NO_BOUND[np.newaxis])
    assert (row["method"], row["replicate"]) == ("stlsq", 0)
    assert np.array_equal(shown["stlsq"].low, shown["stlsq"].high)
    assert row["motion"] == "ok"
    assert (row["missing"], row["spurious"], row["true_positive_ratio"]) == (0, 0, 1)
    errors = [value for name, value in row.items() if "error" in name or name == "e2"]
    assert len(errors) == 8 and max(errors) < 1e-6
    assert all(
        row[f"r2_{k}{s}"] == pytest.approx(1) for k in ("", "steady_") for s in ("q_v", "q_w")
    )


def test_the_steady_window_is_where_amplitudes_are_read(truth):
    assert np.array_equal(truth.time[truth.steady_rows], truth.time[20000:])
    states = truth.states.copy()
    states[20000:, 0] = 1.1 * states[20000:, 0]
    states[:20000, 1] = 0.0
    own = unjudged(truth.model, truth.model.coefficients)
    row = score(truth, own, Trajectory(truth.time, states, "ok"), NO_BOUND)
    assert row["amplitude_error_q_v_percent"] == pytest.approx(10)
    assert row["frequency_error_q_v_percent"] == pytest.approx(0, abs=1e-9)
    assert row["amplitude_error_q_w_percent"] == row["frequency_error_q_w_percent"] == 0
    assert row["r2_steady_q_w"] == 1 > row["r2_q_w"]


@pytest.mark.parametrize("failure", ["fit", "motion"])
def test_failures_are_rows_of_worst_values(truth, failure):
    if failure == "fit":
        result = IdentifiedModel.refused(truth.model.states, truth.model.terms, [])
    else:
        coefficients = truth.model.coefficients.copy()
        coefficients[2, 3] = 3.0  # strong negative damping
        coefficients[2, 31:] = 0.0
        result = unjudged(truth.model, coefficients)
    bound = np.full((4, 35), 0.1)
    (motion,) = reconstruct(truth, [result])
    row = score(truth, result, motion, bound)
    expected = "refused: No model" if failure == "fit" else "diverged: |x| exceeded 1000"
    assert row["motion"].startswith(expected)
    for state in ("q_v", "q_w"):
        assert row[f"r2_{state}"] == row[f"r2_steady_{state}"] == -INF
        assert row[f"amplitude_error_{state}_percent"] == INF
        assert row[f"frequency_error_{state}_percent"] == INF
    for of_coefficients in ("mean_error_linear_percent", "e2", "efficiency"):
        assert (row[of_coefficients] == INF) == (failure == "fit")
    left_out = {name for name, value in row.items() if value != value}
    assert left_out == {"intervals", "intervals_covering"}  # the method states none


def test_a_term_that_the_library_lacks_is_missing():
    line = make_model(coefficients(RESONANT))
    terms = polynomial_library(4, 2)
    union = extend_library(terms, line)
    assert union[: len(terms)] == terms
    truth = short_truth(line, union)
    lacking = 5  # gamma_6 to gamma_8, kappa_4, kappa_5
    assert truth.model.support[:, len(terms) :].sum() == lacking
    within = PolynomialModel(line.states, terms, truth.model.coefficients[:, : len(terms)])
    exact = IdentifiedModel(within)
    (motion,) = reconstruct(truth, [exact])
    assert motion.status == "ok"
    row = score(truth, exact, motion, np.full(truth.model.coefficients.shape, np.nan))
    assert (row["missing"], row["spurious"]) == (lacking, 0)
    assert row["mean_error_cubic_percent"] == 100
    assert np.isnan(row["efficiency"])
    rows = identified_terms(line, [exact], terms)
    assert rows.query("term == 'q_v^3'")["identified"].tolist() == [0.0]


def test_a_line_that_does_not_gallop_has_no_amplitude_to_miss():
    calm = edited(wind__speed=0.5)
    line = make_model(coefficients(calm))
    assert gallops(make_model(coefficients(RESONANT)))
    assert not gallops(line)
    truth, other = short_truth(line), unjudged(line, 1.01 * line.coefficients)
    (motion,) = reconstruct(truth, [other])
    row = score(truth, other, motion, np.ones((4, len(line.terms))))
    assert {name for name, value in row.items() if value != value} == {
        "intervals", "intervals_covering",
        "amplitude_error_q_v_percent", "amplitude_error_q_w_percent",
    }  # fmt: skip


def test_a_line_that_diverges_is_a_row_with_its_reason():
    line = make_model(coefficients(RESONANT))
    time, states = np.arange(2001) / 100, np.full((2001, 4), np.nan)
    truth = Truth(line, time, states, (10, 20), "diverged: |x| exceeded 1000 at t = 3 s")
    with np.errstate(invalid="raise"):
        motion = Motion(line.states, time, states, line(states), truth.status)
    with pytest.raises(IdentificationError):  # which makes a row of it
        reduce(recorded(motion), polynomial_library(4, 3))
    failed = IdentifiedModel.refused(line.states, line.terms, [Finding.of(Code.STATE_ZERO)])
    (motion,) = reconstruct(truth, [failed])
    row = score(truth, failed, motion, np.full(line.coefficients.shape, np.nan))
    assert row.pop("motion") == "the line itself diverged: |x| exceeded 1000 at t = 3 s"
    assert (row.pop("status"), row.pop("findings")) == ("refused", "state_zero")
    assert np.isnan(list(row.values())).all()


def test_representative_motion_is_the_median_one():
    time = np.arange(0, 10, 0.01)
    states = np.stack([np.full((1000, 4), float(k)) for k in range(5)])
    summary = reconstruction(time, states, np.array([0.9, -INF, 0.5, 0.7, 0.99]))
    assert np.diff(summary.time) == pytest.approx(np.full(199, 0.05))
    assert np.all(summary.representative == 3)
    assert summary.low[0] == pytest.approx(0.2) and summary.high[0] == pytest.approx(3.8)
