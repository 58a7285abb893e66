"""What the paper leaves out is told by its numbers: tried on studies whose settings are known."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from lines import RESONANT
from pictures import drawn

from galloping.figures.against_paper import draw_region
from galloping.identification.sparse.evidence import Regressions
from galloping.identification.sparse.stlsq import normalised, raw
from galloping.paper import draws, unknowns
from galloping.paper.draws import Amounts
from galloping.paper.quick import QuickStudy, found_coefficients
from galloping.paper.unknowns import BASE, BY_NAME, HIGH, LOW, NAMES, UNKNOWNS, MethodReading
from galloping.polynomial import library
from galloping.tables import inference as tables
from galloping.trials import paper_search

pytestmark = pytest.mark.xdist_group("inference")

KNOWN = dict(zip(NAMES, (7.5, 0.0054, 0.0031, 0.5, 0.71, 0.134, 0.003), strict=True))


@pytest.fixture(scope="module")
def moved():
    return draws.line_motion(BASE.case(RESONANT, KNOWN), 300, 100)


@pytest.mark.parametrize(("method", "threshold"), [(raw, 0.003), (raw, None), (normalised, 0.003)])
def test_quick_thresholds_are_those_of_the_method(moved, method, threshold):
    motion, line = moved
    terms, rng = library(4, 3), np.random.default_rng(3)
    products = draws.DerivativeNoise(motion, terms, np.ones(4)).draw(0.05, 10000, rng, draws=3)
    quick = found_coefficients(products, MethodReading(threshold, columns=method.__name__))
    for reduced, found in zip(products.regressions(line.states, terms), quick, strict=True):
        evidence = Regressions(reduced, reduced)
        model = method(evidence, threshold=threshold, path_length=draws.PATH_LENGTH).model
        np.testing.assert_allclose(found, model.coefficients, rtol=1e-6, atol=1e-9)


def test_quick_motions_are_those_of_the_simulator(moved):
    amounts = Amounts(levels=(0.03,), points=(10000,))
    quick = QuickStudy(*moved, amounts).draws(MethodReading(0.003), 12, np.random.default_rng(1))
    exact = draws.paper_draws(
        BASE.case(RESONANT, KNOWN), draws=12, seed=1, name=("x",), threshold=0.003,
        kinematics="known", amounts=amounts,
    )  # fmt: skip
    for column in ("r2_q_w", "amplitude_error_q_v_percent", "mean_error_cubic_percent"):
        assert np.all(np.isfinite(quick[column]))
        medians = [np.median(table[column]) for table in (quick, exact)]
        np.testing.assert_allclose(*medians, rtol=0.6, atol=0.02)
    still = QuickStudy(*moved, amounts).draws(
        MethodReading(0.003), 1, np.random.default_rng(1), still=(0.03,)
    )
    assert np.isnan(still.loc[still["points"] > 10000, "r2_q_v"]).all()


def test_a_study_is_more_probable_at_its_own_setting(moved):
    """Of settings with other winds and thresholds, one draw's numbers tell the right one."""
    rng = np.random.default_rng(5)
    printed = paper_search.evaluated(BASE, KNOWN, 1, rng)["draws"][0]
    claims = [
        replace(c, paper_value=printed[c.name]) if c.is_number else c for c in unknowns.PRINTED
    ]
    claims = [c for c in claims if c.is_number or c.met(np.array([printed[c.name]]))[0]]
    others = [KNOWN, {**KNOWN, "threshold": 0.0008}, {**KNOWN, "wind_speed": 12.0}]
    found = [
        sum(unknowns.log_probabilities(
            paper_search.evaluated_scores(BASE, values, 24, rng), printed=claims
        ).values())
        for values in others
    ]  # fmt: skip
    assert np.argmax(found) == 0


def test_bounds_and_numbers_of_a_cell_hold_in_the_same_draw():
    """Two draws, one with the printed errors, one that keeps the bounds: neither does both."""
    both = pd.DataFrame(
        {"kind": kind, "level": level, "points": points or 30001, "draw": draw, "missing": 0,
         "r2_q_v": 0.9999, "r2_q_w": 0.99999,
         **{claim.column: claim.paper_value for claim in unknowns.NUMBERS
            if unknowns.cell_of(claim) == (kind, level, points)}}
        for kind, level, points in unknowns.CELLS
        for draw in range(2)
    )  # fmt: skip
    at_once, apart = unknowns.log_probabilities(both), both.copy()
    whole = (apart["kind"] == "noise") & (apart["level"] == 0.05)
    apart.loc[whole & (apart["draw"] == 0), "r2_q_v"] = 0.5
    apart.loc[whole & (apart["draw"] == 1), "mean_error_linear_percent"] = 300.0
    assert unknowns.log_probabilities(apart)["noise 0.05"] < at_once["noise 0.05"] - 2
    assert unknowns.log_probabilities(apart)["noise 0.1"] == at_once["noise 0.1"]


def test_the_region_is_that_of_a_probability_that_is_known(monkeypatch):
    """Of a search about the middle of the ranges, where it is a bell, scattered."""
    monkeypatch.setattr(paper_search, "STEPS", 800)
    rng, centre, width = np.random.default_rng(0), 0.5, 0.1
    x = np.clip(rng.normal(centre, 2 * width, size=(300, len(NAMES))), 0, 1)
    height = -0.5 * np.sum(((x - centre) / width) ** 2, axis=1) + 0.3 * rng.standard_normal(300)
    rows = pd.DataFrame(np.exp(LOW + x * (HIGH - LOW)), columns=list(NAMES)).assign(
        variant=BASE.name, stage="searched", change=0.005, height=height, log_probability=height,
        without_amplitudes=height,
    )  # fmt: skip
    first, second = (paper_search.samples(rows, "log_probability", 4) for _ in range(2))
    pd.testing.assert_frame_equal(first, second)  # the same seed, the same region
    x = (np.log(first.to_numpy()) - LOW) / (HIGH - LOW)
    np.testing.assert_allclose(x.mean(axis=0), centre, atol=0.05)
    np.testing.assert_allclose(x.std(axis=0), width, rtol=0.35)


@pytest.fixture(scope="module")
def searched():
    rows = paper_search.trial(1, BASE.name, [0], {}, draws=8, screened=3, evaluations=9, judged=16)
    return pd.DataFrame(rows)


def test_a_search_tries_steady_settings_and_judges_its_best(searched):
    tried = searched[searched["stage"].isin(("screened", "searched"))]
    known = tried[tried["log_probability"].notna()]
    assert len(tried) >= 12 and (known["change"] < paper_search.STEADY).all()
    best = searched[searched["stage"] == "best"].iloc[0]
    assert 0 <= best["R2 of q_v at noise 0.05"] <= 1
    for unknown in UNKNOWNS:
        assert tried[unknown.name].between(unknown.low * 0.999, unknown.high * 1.001).all()


def test_tables_and_figure(searched, monkeypatch):
    for name, value in (("STEPS", 60), ("BURN_IN", 20), ("SAMPLES", 50), ("DEPTH", 1e9)):
        monkeypatch.setattr(paper_search, name, value)
    monkeypatch.setattr(tables, "PREDICTED", 2)
    other = searched.assign(variant="sine")
    numbers = ["height", "log_probability", "noise 0.05"]
    other[numbers] -= 10.0
    parts = {"one": searched, "two": other}
    readings = tables.paper_readings(parts)
    assert dict(zip(readings["reading"], readings["verdict"], strict=True)) == {
        BASE.name: "probable", "sine": "ruled out",
    }  # fmt: skip
    assert readings.set_index("reading").loc["sine", "least"] == "noise 0.05"
    samples = tables.region_samples({"one": searched}, {"seed": 1})
    table = tables.region_table(samples, readings).set_index("unknown")
    assert (table.loc[list(NAMES), "low"] <= table.loc[list(NAMES), "high"]).all()
    assert table.loc["mode shape", "verdict"] == "determined"
    left = tables.left_out(samples)
    assert len(left) == 10 and (left["all_low"] <= left["all_high"]).all()
    pairs = tables.exclusions(parts)
    assert (pairs["both"] <= pairs[["first", "second"]].min(axis=1)).all()
    drawn(lambda: draw_region(samples, readings))


def test_every_reading_is_a_line_that_can_gallop():
    loads = [variant.case(RESONANT, KNOWN)["ice"]["vertical"] for variant in BY_NAME.values()]
    assert all(b1 > 0 > b3 for b1, _, b3 in loads)
    assert len({b2 for _, b2, _ in loads}) == 4
