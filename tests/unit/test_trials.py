"""Trials: lines are drawn by number, and a row says what a model claims and whether it holds."""

from dataclasses import replace

import numpy as np
import pytest

from galloping.identification.model import IdentifiedModel
from galloping.physics.equations import STATES, model
from galloping.physics.galerkin import coefficients
from galloping.polynomial import library
from galloping.trials.random_lines import draw, trial
from galloping.trials.scores import claims, trust

TERMS = library(4, 3)


def test_a_line_is_drawn_by_its_number_and_gallops():
    case, starts = draw(1, 3)
    again, _ = draw(1, 3)
    assert case == again != draw(1, 4)[0]
    assert starts.shape == (2, 4)
    for number in range(20):
        case = draw(1, number)[0]
        assert coefficients(case)["gamma_1"] < 0
        assert 150 < case["line"]["span"] < 500


@pytest.fixture
def result():
    true = model(coefficients(draw(1, 3)[0])).on_library(TERMS)
    present = np.where(true.support, np.abs(true.coefficients) / 100, np.nan)
    errors = np.where(true.support, present, 1e-3)
    sure = IdentifiedModel(
        true, "ok", standard_errors=present, unconditional_errors=2 * errors,
        detection_limits=np.where(true.support, np.nan, 0.01), known=(0, 1),
    )  # fmt: skip
    return true, sure


def test_claims_that_hold(result):
    true, sure = result
    row = claims(true, sure)
    assert row["exact"] and not row["ok_and_wrong"]
    assert row["terms"] == row["holding_unconditional"] == row["holding_given_terms"]
    assert row["terms"] == np.sum(true.support[2:]) and row["width_ratio"] == 2.0


@pytest.mark.parametrize("fault", ["false_terms", "above_limit", "off"])
def test_claims_that_do_not_hold(result, fault):
    true, sure = result
    values = true.coefficients.copy()
    if fault == "false_terms":
        values[2, 0] = 0.5
    elif fault == "above_limit":
        values[2, TERMS.index((1, 0, 0, 0))] = 0.0
    else:
        values[2, TERMS.index((1, 0, 0, 0))] *= 1.09
    wrong = replace(sure, model=replace(true, coefficients=values))
    if fault != "off":  # the limits and errors of the terms that the method then has
        wrong = replace(wrong, detection_limits=np.full((4, 35), 0.01))
    row = claims(true, wrong)
    assert row[fault] == 1 and row["ok_and_wrong"]
    assert not claims(true, replace(wrong, status="not identifiable"))["ok_and_wrong"]


def test_a_refusal_claims_nothing(result):
    true, _ = result
    row = claims(true, IdentifiedModel.refused(STATES, TERMS, "no luck"))
    assert (row["status"], row["terms"], row["ok_and_wrong"]) == ("refused", 0, False)


def test_a_short_trial_and_its_table():
    rows = list(trial(5, [0], duration=60.0))
    assert [row["release"] for row in rows] == [0, 1]
    table = trust(rows)
    assert len(table) == 1
    (line,) = table.to_dict("records")
    assert (line["group"], line["fits"], line["level"]) == ("random lines", 2, 0.05)
    answers = ("ok", "not_identifiable", "approximate", "refused")
    assert sum(line[name] for name in answers) == 2
