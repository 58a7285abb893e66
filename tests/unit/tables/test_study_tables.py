"""Tables over replicates, of parameters and of coefficients, on scores whose summary is known."""

from dataclasses import replace
from itertools import product

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lines import CASES, RESONANT

from galloping.identification.identified_model import IdentifiedModel
from galloping.line.galerkin import Derived, coefficients, make_model
from galloping.model.intervals import median_and_interval
from galloping.model.polynomial import polynomial_library
from galloping.tables.scores import all_scores, data_amount, noise_coefficients, noise_r2
from galloping.tables.table3 import equations, table3

INF = float("inf")


def test_interval_is_median_and_percentiles_that_occurred_failures_as_the_worst():
    for values, told in (
        (range(21), (10.0, 1.0, 19.0)), ([3.0], (3.0, 3.0, 3.0)),
        ([1.0, INF, INF], (INF, 1.0, INF)), ([-INF, 0.5, 0.6], (0.5, -INF, 0.6)),
    ):  # fmt: skip
        assert median_and_interval(values) == told


@given(st.lists(st.floats(allow_nan=False), min_size=1, max_size=30))
@pytest.mark.filterwarnings("ignore")  # the middle of two huge numbers
def test_intervals_do_not_depend_on_order(values):
    low, high = median_and_interval(values)[1:]
    assert median_and_interval(sorted(values))[1:] == (low, high)
    assert low <= high and {low, high} <= set(values)


def study_scores(replicates=4):
    """Scores of a small study with numbers that differ from row to row, and some failures."""
    cells = [("noise", 0.0, 30001), ("noise", 0.05, 30001), ("points", 0.05, 1000),
             ("joint", 0.05, 30001)]  # fmt: skip
    rng, rows = np.random.default_rng(4), []
    for case, method, (kind, level, points), replicate in product(
        CASES, ["stlsq", "weak"], cells, range(replicates)
    ):
        if (method, kind) == ("weak", "points"):
            continue
        failed = (replicate, level) == (2, 0.05)
        error, r2 = rng.uniform(1, 30, 5), rng.uniform(0.5, 1, 2)
        rows.append({
            "case": case, "protocol": "state", "cell": f"{kind}_{level}", "kind": kind,
            "level": level, "points": points, "method": method, "replicate": replicate,
            "motion": "diverged: far away" if failed else "ok",
            **{f"mean_error_{order}_percent": error[k] for k, order in
               enumerate(("linear", "quadratic", "cubic"))},
            **{f"r2_q_{d}": -INF if failed else r2[k] for k, d in enumerate("vw")},
            **{f"amplitude_error_q_{d}_percent": INF if failed else error[3 + k]
               for k, d in enumerate("vw")},
        })  # fmt: skip
    return pd.DataFrame(rows)


def test_noise_tables_hold_whole_records_with_failures_counted():
    scores = study_scores()
    errors, r2 = noise_coefficients(scores), noise_r2(scores)
    assert set(errors["order"]) == {"linear", "quadratic", "cubic"}
    assert set(errors["level"]) == set(r2["level"]) == {0.0, 0.05}
    assert len(r2) == 2 * 2 * 2 * 2 and len(errors) == 2 * 2 * 2 * 3
    assert set(r2["replicates"]) == {4}
    noisy = r2["level"] == 0.05
    assert (r2["failures"] == noisy).all()
    assert (r2.loc[noisy, "r2_low"] == -INF).all()
    of_one = "case == 'non_resonant' and method == 'weak' and level == 0"
    (row,) = r2.query(f"{of_one} and state == 'q_w'").to_dict("records")
    values = scores.query(of_one)["r2_q_w"]
    told = (row["r2_median"], row["r2_low"], row["r2_high"])
    assert told == (values.median(), values.min(), values.max())


def test_data_amount_holds_subsets():
    table = data_amount(study_scores())
    assert set(table["points"]) == {1000} and set(table["method"]) == {"stlsq"}
    assert len(table) == 2 * 2
    assert set(table["failures"]) == {1}
    assert (table["amplitude_error_percent_high"] == INF).all()
    assert (table["r2_low"] == -INF).all()
    assert np.isfinite(table[["amplitude_error_percent", "r2"]]).all(axis=None)
    scores = study_scores()
    none = data_amount(scores[scores["kind"] != "points"])
    assert none.empty and list(none) == list(table)


def test_scores_of_cells_stand_in_one_order():
    scores = study_scores()
    cells = {str(k): cell for k, (_, cell) in enumerate(scores.groupby(["case", "method", "cell"]))}
    forward = all_scores(cells)
    pd.testing.assert_frame_equal(forward, all_scores(dict(reversed(cells.items()))))
    assert len(forward) == len(scores)


def test_table_3_shows_true_and_spurious_terms():
    true, terms = coefficients(RESONANT), polynomial_library(4, 3)
    line = make_model(true).on_library(terms)
    off = line.coefficients.copy()
    off[2, terms.index((1, 0, 0, 0))] *= 1.1  # gamma_2
    off[3, terms.index((0, 0, 0, 1))] = 0.0  # kappa_1 missed
    off[3, terms.index((1, 0, 0, 0))] = -0.5  # kappa_8 spurious
    off[2, terms.index((0, 0, 0, 3))] = 0.2  # spurious, without a symbol
    found = IdentifiedModel(replace(line, coefficients=off))
    about = {"cases": ["a"], "protocol": "state", "method": "stlsq", "level": 0.0, "degree": 3}
    made = {"a": Derived(make_model(true), true, {})}, {"a": {"stlsq": [found] * 3}}
    table = table3(*made, about | {"continuous": []})
    by_symbol = table.set_index("symbol")
    assert list(table["equation"].unique()) == ["vertical", "horizontal"]
    present = [symbol for symbol, value in true.items() if value]
    assert set(present) | {"kappa_8", "dq_w^3"} == set(by_symbol.index)
    assert list(by_symbol.index[:9]) == [f"gamma_{i}" for i in range(1, 9)] + ["dq_w^3"]
    errors = by_symbol["relative_error_percent"]
    wrong = {"gamma_2": pytest.approx(10), "kappa_1": 100, "kappa_8": INF, "dq_w^3": INF}
    assert errors[errors != 0].to_dict() == wrong
    assert by_symbol.loc["gamma_2", "identified"] == pytest.approx(1.1 * true["gamma_2"])
    assert by_symbol.loc["kappa_8", "identified"] == 0.5
    assert by_symbol.loc["kappa_3", "term"] == "q_v q_w"
    unknown = table3(*made, about | {"continuous": ["a"]})
    assert unknown[["true", "relative_error_percent"]].isna().all(axis=None)


def test_equations_are_those_of_single_recordings_with_their_errors():
    true, terms = coefficients(RESONANT), polynomial_library(4, 3)
    line = Derived(make_model(true), true, {})
    on_library = line.model.on_library(terms)
    off = on_library.coefficients.copy()
    off[3, terms.index((0, 0, 0, 1))] = 0.0  # kappa_1 missed
    off[3, terms.index((1, 0, 0, 0))] = -0.5  # a false term
    stated = np.where(on_library.support, 0.01, np.nan)
    first = IdentifiedModel(on_library, is_judged=True, standard_errors=stated)
    other = IdentifiedModel(replace(on_library, coefficients=off))
    fits = {cell: {"protocol": "state", "method": cell, "level": 0.1} for cell in ("ours", "paper")}
    settings = {"case": "a", "is_continuous": False, "degree": 3, "fits": fits}
    identified = {"ours": {"ours": [first, other]}, "paper": {"paper": [other, first]}}
    table = equations(line, identified, settings)
    ours, paper = (rows.set_index("symbol") for _, rows in table.groupby("method"))
    assert (ours["identified"] == ours["true"]).all() and (ours["standard_error"] == 0.01).all()
    assert np.isnan(paper.loc["kappa_1", "identified"]) and paper["standard_error"].isna().all()
    assert tuple(paper.loc["kappa_8", ["true", "identified"]]) == (0.0, 0.5)
    unknown = equations(line, identified, settings | {"is_continuous": True})
    assert unknown["true"].isna().all()
