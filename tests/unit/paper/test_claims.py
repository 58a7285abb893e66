"""The paper's claims: what it prints, how draws are judged, and what is not."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from lines import CASES, RESONANT
from pictures import drawn

from galloping.configuration.load import load, plain
from galloping.figures.against_paper import draw_printed
from galloping.paper import claims as paper_claims
from galloping.paper.draws import Amounts, paper_draws
from galloping.recording.measurement import Motion
from galloping.report import printed_numbers as report
from galloping.tables.judged_claims import claims_table, paper_table, variation_rows
from galloping.tables.line_parameters import conductor
from galloping.tables.table3 import as_printed

ROOT = Path(__file__).parents[3]
CASE, PAIR = "internal_resonance", ("derivative", "paper")
INF = np.inf
POINTS = (1000, 5000, 10000, 30000)
LEVELS = (0.0, 0.01, 0.03, 0.05, 0.1, 0.15)


def scores(draws=20, **columns):
    """Draws that are like the paper's in every cell, or have other values in `columns`."""
    cells = [("noise", level, 30001) for level in LEVELS]
    cells += [("points", 0.05, points) for points in POINTS]
    rows = []
    for kind, level, points in cells:
        for draw in range(draws if level else 1):
            row = {
                "kind": kind, "level": level, "points": points, "replicate": draw, "motion": "ok",
                "missing": 0, "spurious": round(100 * level), "true_positive_ratio": 1.0,
                "e2": level, "mean_error_linear_percent": 200 * level + 0.01 * draw,
                "mean_error_cubic_percent": 450 * level + 0.01 * draw,
                "r2_q_v": 0.995, "r2_q_w": 0.997,
            }  # fmt: skip
            for k, state in enumerate(("q_v", "q_w")):
                row[f"amplitude_error_{state}_percent"] = 1e4 / points * (0.5 + 0.1 * draw + k)
            rows.append(row | columns)
    return pd.DataFrame(rows)


def judge_values(kind, values):
    """What is said of a claim of this kind about 10, of draws with these values."""
    claim = paper_claims.Claim(
        "a claim", "", kind, column="error", level=0.05, printed=10.0, case=CASE
    )
    cell = {"kind": "noise", "level": 0.05, "missing": 0, "spurious": 0, "motion": "ok"}
    return paper_claims.judge(
        claim, pd.DataFrame({"error": np.asarray(values, float)}).assign(**cell)
    )


@pytest.mark.parametrize(
    ("values", "verdict"),
    [(np.linspace(5, 15, 21), "reproduced"), ([10.0] * 20, "reproduced"), ([9.99] * 20, "better"),
     ([10.01] * 20, "worse"), ([12.0] * 11 + [INF] * 9, "worse"), ([INF] * 20, "undecided"),
     ([np.nan] * 20, "undecided")],
)  # fmt: skip
def test_a_printed_number_is_judged_on_both_sides(values, verdict):
    found = judge_values("value", values)
    assert found["verdict"] == verdict and found["reason"]
    if verdict != "undecided":
        assert found["ratio"] == pytest.approx(found["median"] / 10)


@pytest.mark.parametrize(("kind", "sign"), [("at_least", 1), ("at_most", -1)])
@pytest.mark.parametrize(
    ("met", "verdict"),
    [(200, "met"), (115, "met"), (105, "undecided"), (100, "undecided"), (95, "undecided"),
     (85, "seldom met"), (10, "seldom met"), (1, "seldom met"), (0, "not met")],
)  # fmt: skip
@pytest.mark.parametrize("bad", [0.1, INF])
def test_a_bound_is_judged_by_the_interval_of_the_share_of_draws(kind, sign, met, verdict, bad):
    values = 10.0 + sign * np.where(np.arange(200) < met, 0.1, -bad)
    found = judge_values(kind, values)
    assert (found["verdict"], found["share_met"]) == (verdict, met / 200)
    assert found["share_met_low"] <= met / 200 <= found["share_met_high"]
    assert judge_values(kind, np.full(20, np.nan))["verdict"] == "undecided"


def test_the_interval_of_a_share_is_wilson_s_and_a_single_draw_has_none():
    found = paper_claims.share_with_interval(np.arange(200) < 100)
    assert (found["share_met_low"], found["share_met_high"]) == pytest.approx(
        (0.4313, 0.5687), abs=1e-3
    )
    one = paper_claims.share_with_interval(np.array([True]), is_exact=True)
    assert one["share_met_low"] == 1.0


@pytest.mark.parametrize(("kind", "value"), [("value", 3.0), ("at_least", 11), ("at_most", 11)])
def test_one_realisation_of_noise_is_not_enough(kind, value):
    found = judge_values(kind, [value])
    assert found["verdict"] == "undecided" and found["replicates"] == 1


def test_with_one_realisation_only_what_has_no_noise_is_judged():
    table = tables(scores(draws=1))
    judged = table[table["role"].isin(("counted", "joint"))].set_index("claim")["verdict"]
    held = judged[judged.isin(paper_claims.HELD_VERDICTS)]
    assert list(held.index) == ["exact structure without noise", "exact parameters without noise"]
    assert {"undecided"} == set(judged.drop(held.index))
    (noiseless,) = report.build_table(table)["exact structure without noise"]
    (noisy,) = report.build_table(table)["all terms found at noise 0.05"]
    assert (noiseless.ours, noisy.ours) == ("yes", "in 100 % of the realisations")


def settings(cases=(CASE,), pairs=(PAIR,)):
    winds = dict.fromkeys(cases, 10.0)
    return {"cases": list(cases), "pairs": list(pairs), "steady_window": (200.0, 300.0),
            "winds": winds}  # fmt: skip


def tables(drawn_):
    claims = claims_table(drawn_, settings(), {CASE: drawn_})
    return paper_table(claims, {CASE: drawn_}, {"departures": {CASE: ""}})


def test_paper_csv_has_a_row_for_each_sentence_and_the_joint_shares():
    table = tables(scores())
    of_line = ("steady", "attack")  # are of the motion
    about = [
        c.name
        for c in paper_claims.CLAIMS
        if c.case in ("", CASE) and not c.column.startswith(of_line)
    ]
    assert table["claim"].to_list()[: len(about)] == about
    joint = table[table["role"] == "joint"]
    assert len(joint) == 2 and set(joint["share_met"]) <= {0.0, 1.0}
    beyond = table[table["role"] == "beyond"]
    assert len(beyond) == len(paper_claims.UNJUDGED_CLAIMS) > 5
    assert beyond["reason"].str.len().min() > 10
    table = table.set_index("claim")
    row = table.loc["mean error of linear terms at noise 0.05"]
    assert (row["printed"], row["noise_level"]) == (9.56, 0.05)
    assert row["median"] == pytest.approx(10.095) and row["verdict"] == "worse"
    grown = table.loc["linear error grows from noise 0.03 to 0.05"]  # within a draw
    assert grown["median"] == pytest.approx(4.0) and grown["verdict"] == "met"
    assert pd.isna(grown["noise_level"])
    assert table.loc["more false terms at noise 0.05 than at 0.03", "median"] == 2
    few = table.loc["few false terms at noise 0.01"]
    assert (few["median"], few["verdict"]) == (1, "met")


def test_bounds_hold_together_in_the_draws_that_keep_each():
    drawn_ = scores()
    drawn_.loc[drawn_["replicate"] == 3, "r2_q_v"] = 0.5
    drawn_.loc[drawn_["replicate"] == 4, "missing"] = 1
    bounds = [c for c in paper_claims.CLAIMS if not c.is_number and c.column in drawn_]
    bounds = [c for c in bounds if c.name != "exact parameters without noise"]
    kept = paper_claims.find_joint_draws(bounds, drawn_)
    assert len(kept) == 20 and np.flatnonzero(~kept).tolist() == [3, 4]
    assert paper_claims.find_joint_draws(bounds, drawn_[drawn_["level"] != 0.1]) is None


def test_failures_keep_no_bound():
    worst = {c: INF for c in scores() if c.startswith(("mean_error", "amplitude", "e2"))}
    worst |= {"r2_q_v": -INF, "r2_q_w": -INF, "missing": 16, "true_positive_ratio": 0.0}
    table = tables(scores(**worst, spurious=0, motion="diverged"))
    judged = table[table["role"] != "beyond"]
    assert set(judged["verdict"]) == {"undecided", "not met", "met"}
    assert set(judged.loc[judged["verdict"] == "met", "claim"]) == {"few false terms at noise 0.01"}


def test_what_the_study_lacks_is_not_run_and_what_differs_is_not_judged():
    few = scores()
    table = tables(few[few["level"] != 0.1]).set_index("claim")
    assert set(table.loc[table.index.str.contains("noise 0.1$"), "verdict"]) == {"not run"}
    reason = "line.span is 320, where the paper has 300"
    replicates = few[few["replicate"] < 4].assign(case=CASE, protocol="state", method="stlsq")
    told = claims_table(replicates, settings(pairs=[("state", "stlsq"), ("state", "weak")]))
    assert set(told["method"]) == {"stlsq"} and set(told["replicates"]) == {1, 4}
    other = paper_table(claims_table(few, settings(cases=[])), {}, {"departures": {CASE: reason}})
    other = other[other["role"] != "beyond"]
    assert set(other["verdict"]) == {"not judged"} and other["reason"].nunique() == 1
    assert other["printed"].notna().all() and reason in report.describe_counts(other)


def test_a_growing_motion_is_not_steady_and_a_fast_one_not_slow():
    time = np.linspace(0, 300, 30001)
    grow = 1 + 0.001 * (time - 200)
    motion = Motion(("q_v", "q_w", "dq_v", "dq_w"), time,
                    np.column_stack([grow * np.sin(2.6 * time), np.sin(1.3 * time)] * 2),
                    np.zeros((30001, 4)), "ok")  # fmt: skip
    table = claims_table(scores(), settings(pairs=[]), {}, {CASE: [motion]}).set_index("claim")
    assert table["verdict"].to_dict() == {
        "steady amplitude of q_v": "not met", "steady amplitude of q_w": "met",
        "motion much slower than the wind": "met",
    }  # fmt: skip
    slow = table.loc["motion much slower than the wind"]
    assert slow["study_value"] == pytest.approx(np.abs(motion.states[:, 2]).max() / 10)


def test_the_first_screen_counts_and_lists_them():
    table = tables(scores())
    counted = table[table["role"] == "counted"]
    held = (
        counted.assign(held=counted["verdict"].isin(paper_claims.HELD_VERDICTS))
        .groupby("statement")["held"]
        .all()
    )
    assert report.describe_counts(table).startswith(f"{held.sum()} of {len(held)} statements")
    assert report.describe_counts(table[~table["role"].eq("counted")]).startswith("No statement")
    rows = report.build_table(table)
    assert [cell.printed for cell in rows["amplitude error from 30000 points"]] == [
        "0.83 %", "1.03 %"]  # fmt: skip
    (found,) = rows["all terms found at noise 0.05"]
    assert (found.printed, found.ours) == ("all", "in 100 % of the realisations")
    (gradual,) = rows["few false terms at noise 0.01"]
    assert (gradual.printed, gradual.ours) == ("appear gradually", "1")
    failed = table["verdict"].isin(("worse", "better", "undecided", "seldom met", "not met"))
    assert (
        len(report.describe_failures(table))
        == (failed & ~table["verdict"].isin(paper_claims.HELD_VERDICTS)).sum()
    )
    drawn(lambda: draw_printed(table, {"case": CASE}))


def test_numbers_outside_the_range_of_the_fit_are_counted():
    study, region = plain(load({})), pd.read_csv(ROOT / "results/reference/paper/paper_region.csv")
    line, table = study["cases"]["internal_resonance"], tables(scores())
    line |= {"wind": {"speed": 10.0}, "damping": {"vertical": 0.005, "horizontal": 0.005}}
    line["initial_state"] |= {"q_v": 0.5, "q_w": 0.7}
    study["identification"]["paper"]["threshold"] = 0.0015
    assert report.count_unfitted(table, region, study) == 0
    assert "were fitted" in report.section(table, None, region, study)["setting"]
    line["wind"]["speed"] = 20.0
    study["identification"]["paper"]["threshold"] = None
    said = report.section(table, None, region, study)["setting"]
    assert "2 of them are outside the range that was fitted" in said and "These" not in said
    assert "poorly" in said
    determined = report.section(table, None, region.assign(verdict="determined"), study)
    assert "poorly" not in determined["setting"]
    assert report.count_unfitted(table, None, study) == 0


def test_other_settings_are_judged_one_at_a_time():
    plan = {"threshold": 0.002, "path_length": 30, "kinematics": "identified", "degree": 3,
            "draws": 3, "seed": 5}  # fmt: skip
    amounts = Amounts(levels=(0.0, 0.05), points=())
    values = {"wind_speed": (12.0, 14.0), "threshold": (0.002, 1.0)}
    drawn_ = paper_draws(RESONANT, name=(CASE,), amounts=amounts, **plan)
    rows = pd.concat(
        [variation_rows(RESONANT, plan, amounts, *each, CASE, drawn_) for each in values.items()]
    )
    assert rows.groupby(["parameter", "value"]).size().nunique() == 1
    assert set(rows.loc[rows["is_default"], "value"]) == {12.0, 0.002}
    exact = rows[rows["claim"] == "exact structure without noise"].set_index("value")[
        "is_reproduced"
    ]
    assert exact.to_dict() == {12.0: True, 14.0: True, 0.002: True, 1.0: False}
    assert set(rows.loc[rows["claim"] == "all terms found at noise 0.01", "verdict"]) == {"not run"}
    said = report.by_settings(rows.assign(case="non_resonant"))
    assert "claims about the non-resonant line" in said


def test_an_inferred_value_says_so_and_another_does_not():
    best = {"key": "wind.speed", "best": 12.0, "low": 9.0, "high": 13.0}
    region = pd.DataFrame([best, {**best, "key": "damping.vertical", "best": 0.004}])
    table = conductor({"cases": CASES}, region).set_index(["case", "key"])
    wind = table.loc[(CASE, "wind.speed")]
    assert wind["provenance"] == "inferred" and "9 to 13" in wind["note"]
    assert table.loc[(CASE, "damping.vertical"), "provenance"] == "assumed"


def test_table_3_in_the_papers_layout():
    rows = [("gamma_1", 0.5, 0.6), ("kappa_1", -1.0, -1.1), ("gamma_8", 2.0, 2.0), ("dq_w^3", 0, 1)]
    table3 = pd.DataFrame(rows, columns=["symbol", "true", "identified"]).assign(case="a")
    table = as_printed(table3)
    assert table["1"].to_list() == ["0.5 (-1)", "0.6 (-1.1)"]
    assert table["8"].to_list() == ["2", "2"] and table["10"].to_list() == ["", ""]
