"""Answers to recordings are told apart by name, summed up by stratum, and compared in pairs."""

import json

import numpy as np
import pandas as pd
import pytest

from galloping.tables.exam import (
    collect_answers,
    compare_measures,
    find_changes,
    is_worse,
    restore_types,
    sum_up_strata,
)

TRUE = {"dq": {"q": [-4.0, 0.01], "dq": [0.2, 0.02]}}


def fits(n=10, **columns):
    """Rows of a trial, all exact, as `trials.attempts` has them."""
    rows = {
        "case": "all", "replicate": np.arange(n), "method": "maximum_likelihood", "status": "ok",
        "exact_support": True, "ok_and_wrong": False, "fault_diagnosed": np.nan, "terms": 2,
        "covered_unconditional": 2, "coefficients": json.dumps(TRUE), "findings": np.nan,
        "path": "a", "work": 1.0, "seconds": 2.0,
    }  # fmt: skip
    return pd.DataFrame(rows | columns)


def of(stratum="lines", **columns):
    return collect_answers({f"{stratum}/all": fits(**columns)})


def test_recordings_have_names_of_their_own_within_a_stratum():
    parts = {
        "lines/all_0_to_9": fits(level=0.05),
        "files/rest": fits(case="rest", terms=np.nan, coverage=0.5),
        "files/release": fits(case="release", coverage=1.0),
    }
    found = collect_answers(parts)
    assert not found.duplicated(["stratum", "recording"]).any()
    assert list(found["stratum"].unique()) == ["lines", "files"]
    assert found["recording"][3] == "all, level 0.05, replicate 3"
    assert found.groupby("stratum")["coverage"].mean().to_dict() == {
        "lines": 1.0, "files": 0.75,
    }  # fmt: skip


def test_a_recording_of_unknown_truth_is_not_judged():
    rows = fits().drop(
        columns=["exact_support", "ok_and_wrong", "fault_diagnosed", "covered_unconditional"]
    )
    row = sum_up_strata(collect_answers({"files/span": rows})).iloc[0]
    assert row["ok"] == 10 and row[["exact_support", "ok_and_wrong", "coverage"]].isna().all()


def test_intervals_count_for_models_that_state_which_terms_exist():
    found = of(status=["ok", "approximate"] * 5, covered_unconditional=1)
    assert found["coverage"].tolist()[:2] == [0.5, pytest.approx(np.nan, nan_ok=True)]


def test_a_stratum_is_summed_up_and_so_are_all():
    status = ["ok"] * 6 + ["refused"] * 3 + ["approximate"]
    found = sum_up_strata(of(status=status, exact_support=[True] * 5 + [False] * 5)).set_index(
        "stratum"
    )
    assert list(found.index) == ["lines", "all"]
    row = found.loc["lines"]
    assert (row["fits"], row["exact_support"], row["ok"], row["refused"]) == (10, 5, 6, 3)
    assert (row["coverage"], row["work"], row["seconds"]) == (1.0, 10.0, 20.0)
    assert np.isnan(row["fault_diagnosed"])


@pytest.mark.parametrize(
    ("lost", "gained", "is_significant"), [(4, 0, False), (5, 0, True), (7, 1, True), (6, 3, False)]
)
def test_differences_are_judged_in_pairs(lost, gained, is_significant):
    """As in McNemar's test: (gained - lost) / sqrt(gained + lost)."""
    before, now = np.ones(20, bool), np.ones(20, bool)
    now[:lost], before[20 - gained :] = False, False
    found = compare_measures(of(n=20, exact_support=before), of(n=20, exact_support=now))
    row = found.set_index(["stratum", "measure"]).loc[("lines", "exact_support")]
    assert row["pairs"] == 20 and row["difference"] == gained - lost
    assert row["standard_error"] == pytest.approx(np.sqrt(gained + lost))
    assert row["is_significant"] == is_significant
    worse = found[found.apply(is_worse, axis=1)]
    assert set(worse["stratum"]) == ({"lines", "all"} if is_significant else set())
    better = compare_measures(of(n=20, exact_support=now), of(n=20, exact_support=before))
    assert not better.apply(is_worse, axis=1).any()


def test_more_work_stands_out_and_is_not_worse():
    found = compare_measures(of(), of(work=1.1)).set_index(["stratum", "measure"])
    row = found.loc[("lines", "work")]
    assert row["difference"] == pytest.approx(1.0) and row["is_significant"]
    assert not found.reset_index().apply(is_worse, axis=1).any()


def test_only_recordings_that_both_have_are_compared():
    found = compare_measures(of(n=4), of(n=10)).set_index(["stratum", "measure"])
    assert found.loc[("lines", "ok"), "pairs"] == 4
    found = find_changes(of(n=4), of(n=10))
    assert len(found) == 6 and set(found["change"]) == {"new"}
    assert set(find_changes(of(n=10), of(n=4))["change"]) == {"left out"}
    empty = of(n=10).iloc[:0]
    assert compare_measures(empty, of()).empty and len(find_changes(empty, of())) == 10


def changed(**columns):
    found = find_changes(of(n=1), of(n=1, **columns))
    return "" if found.empty else found["change"].item()


def model(**terms):
    return json.dumps({"dq": TRUE["dq"] | terms})


def test_an_answer_that_is_another_one_is_told():
    assert changed() == "" and changed(work=3.0, seconds=9.0, path="b") == ""
    refused = changed(status="refused", coefficients="{}").split("; ")
    assert refused == ["ok -> refused", "coverage 1 -> nan", "-dq in d(dq), -q in d(dq)"]
    assert changed(exact_support=False) == "exact support 1 -> 0"
    assert changed(coefficients=model(q2=[1.0, 0.1])) == "+q2 in d(dq)"
    assert "3 standard errors" in changed(coefficients=model(q=[-4.03, 0.01]))
    assert changed(coefficients=model(q=[-4.00009, 0.01])) == ""
    assert "0.5 of them" in changed(coefficients=model(q=[-4.0, 0.015]))
    assert "inf" in changed(coefficients=model(q=[-4.0, None]))
    assert changed(findings="knocked released") == "+knocked, +released"


def test_answers_survive_a_file(tmp_path):
    of().to_csv(tmp_path / "answers.csv", index=False)
    read = restore_types(pd.read_csv(tmp_path / "answers.csv"))
    assert find_changes(read, of()).empty
    assert (compare_measures(read, of())["difference"] == 0.0).all()
