"""What the paper leaves out is inferred from its numbers: tried where the truth is known."""

from dataclasses import replace
from functools import reduce
from operator import getitem

import numpy as np
import pandas as pd
import pytest
from lines import RESONANT
from scipy.special import logsumexp

from galloping.configuration.load import load, plain
from galloping.configuration.yaml_file import read
from galloping.figures.against_paper import draw_region
from galloping.identification.sparse.evidence import Regressions
from galloping.identification.sparse.stlsq import fit_normalised, fit_raw
from galloping.model.polynomial import polynomial_library
from galloping.paper import agreement, draws, unknowns
from galloping.paper.agreement import (
    CLAIM_GROUPS,
    NUMBER_CLAIMS,
    PRINTED_CLAIMS,
    cell_of,
    log_likelihoods,
)
from galloping.paper.draws import Amounts
from galloping.paper.quick import QuickStudy, identify_coefficients
from galloping.paper.unknowns import FIRST_READING
from galloping.tables import inference as tables
from galloping.trials import paper_inference

pytestmark = pytest.mark.xdist_group("inference")

VALUES = (10.0, 0.0059, 0.0054, 0.53, 0.66, 0.109, 0.0017)
KNOWN = dict(zip(unknowns.UNKNOWN_NAMES, VALUES, strict=True))


@pytest.fixture(scope="module")
def moved():
    return draws.line_motion(FIRST_READING.case_at(KNOWN, RESONANT), 300, 100)


@pytest.mark.parametrize(
    ("columns", "threshold"), [("raw", 0.003), ("raw", None), ("normalised", 0.003)]
)
def test_quick_thresholds_are_those_of_the_method(moved, columns, threshold):
    motion, line = moved
    terms, rng = polynomial_library(4, 3), np.random.default_rng(3)
    products = draws.DerivativeNoise(motion, terms, np.ones(4)).draw(0.05, 10000, rng, draws=3)
    quick = identify_coefficients(products, unknowns.MethodReading(threshold, columns=columns))
    for reduced, found in zip(products.regressions(line.states, terms), quick, strict=True):
        fit = fit_raw if columns == "raw" else fit_normalised
        problem = reduced if columns == "raw" else Regressions(reduced)
        model = fit(problem, threshold=threshold, path_length=draws.N_THRESHOLDS).model
        np.testing.assert_allclose(found, model.coefficients, rtol=1e-6, atol=1e-9)


def test_quick_motions_are_those_of_the_simulator(moved):
    amounts, method = Amounts(levels=(0.03,), points=(10000,)), unknowns.MethodReading(0.0017)
    quick = QuickStudy(*moved, amounts).draw_scores(method, 12, np.random.default_rng(1))
    exact = draws.paper_draws(
        FIRST_READING.case_at(KNOWN, RESONANT), draws=12, seed=1, name=("x",),
        threshold=0.0017, path_length=30, kinematics="known", degree=3, amounts=amounts,
    )  # fmt: skip
    for column in ("r2_q_w", "amplitude_error_q_v_percent", "mean_error_cubic_percent"):
        assert np.all(np.isfinite(quick[column]))
        medians = [np.median(table[column]) for table in (quick, exact)]
        np.testing.assert_allclose(*medians, rtol=0.6, atol=0.02)
    unmoved = QuickStudy(*moved, amounts).draw_scores(
        method, 1, np.random.default_rng(1), unsimulated_levels=(0.03,)
    )
    assert np.isnan(unmoved.loc[unmoved["points"] > 10000, "r2_q_v"]).all()


def draw_values(values, count, rng):
    """What draws at a setting of the first reading give for each claim."""
    motion, line = draws.line_motion(FIRST_READING.case_at(values, RESONANT), 300, 100)
    study = QuickStudy(motion, line, paper_inference.AMOUNTS)
    method = FIRST_READING.method_at(values)
    scores = study.draw_scores(method, count, rng, unsimulated_levels=agreement.UNSIMULATED_LEVELS)
    return agreement.scores_by_claim(scores)


def test_a_study_is_more_probable_at_its_own_setting():
    """One draw's numbers single out the right setting among other winds and thresholds."""
    rng = np.random.default_rng(5)
    printed = draw_values(KNOWN, 1, rng)
    claims = [replace(c, printed=printed[c.name][0]) if c.is_number else c for c in PRINTED_CLAIMS]
    claims = [c for c in claims if c.is_number or c.is_met(printed[c.name])[0]]
    settings = KNOWN, {**KNOWN, "threshold": 0.0004}, {**KNOWN, "wind_speed": 12.0}
    found = [
        sum(log_likelihoods(draw_values(values, 24, rng), claims=claims).values())
        for values in settings
    ]
    assert np.argmax(found) == 0


def as_printed(draws_=2):
    """Values of draws that have what the paper prints, by claim."""
    values = {c.name: np.full(draws_, c.printed if c.is_number else 0.0) for c in PRINTED_CLAIMS}
    better = {c.name: np.full(draws_, 1.0) for c in PRINTED_CLAIMS if c.kind == "at_least"}
    return values | better


def test_numbers_and_bounds_of_a_cell_count_in_the_same_draw():
    """Two draws, one with the printed errors, one that keeps the bounds: neither does both."""
    at_once, apart = as_printed(), as_printed()
    apart["R2 of q_v at noise 0.05"] = np.array([0.5, 0.999])
    apart["mean error of linear terms at noise 0.05"] = np.array([9.56, 300.0])
    assert log_likelihoods(apart)["noise 0.05"] < log_likelihoods(at_once)["noise 0.05"] - 2
    assert log_likelihoods(apart)["noise 0.1"] == log_likelihoods(at_once)["noise 0.1"]


def test_false_terms_count_the_more_the_more_there_are():
    logs = []
    for number in (0, 5, 32):
        values = as_printed() | {"few false terms at noise 0.01": np.full(2, float(number))}
        logs.append(log_likelihoods(values)["noise 0.01"])
    assert logs[0] == 0.0 and logs[0] - logs[1] == pytest.approx(1.0) and logs[2] < -6
    without = log_likelihoods(values, left_out=("terms",))
    assert "noise 0.01" in without and without["noise 0.01"] == 0.0  # R2 of q_w above q_v is left


def test_every_claim_with_noise_belongs_to_a_cell_and_to_a_group():
    assert {cell_of(claim) for claim in PRINTED_CLAIMS} == set(agreement.CELLS)
    assert {agreement.group_of(claim) for claim in PRINTED_CLAIMS} == set(CLAIM_GROUPS)
    assert len(NUMBER_CLAIMS) == 10


def test_importance_sampling_integrates_a_likelihood_that_is_known():
    """Of a bell in the middle of the ranges, by proposals that learn where it is."""
    rng, proposal = np.random.default_rng(1), paper_inference.Proposal()
    first = np.array([proposal.draw(rng) for _ in range(2000)])
    centre, width = first.mean(axis=0), 0.35 * first.std(axis=0)
    for _ in range(6):
        points = np.array([proposal.draw(rng) for _ in range(300)])
        log_bell = -0.5 * np.sum(((points - centre) / width) ** 2, axis=1)
        log_weights = log_bell - proposal.log_density(points)
        proposal = paper_inference.Proposal.fit(points, log_weights, 0.1)
    evidence = logsumexp(log_weights) - np.log(len(points))
    assert evidence == pytest.approx(np.sum(np.log(width * np.sqrt(2 * np.pi))), abs=0.4)
    np.testing.assert_allclose(proposal.centre, centre, atol=0.4 * width.max())


@pytest.fixture(scope="module")
def tried():
    extent = {"pilot_rounds": (3,), "pilot_draws": 4, "settings": 4, "draws": 9, "climb": 3}
    return pd.DataFrame(paper_inference.trial(1, FIRST_READING.name, [0], {}, **extent))


def test_a_run_keeps_its_conditions_and_judges_its_best(tried):
    settings = tried[tried["stage"] == "tried"]
    assert len(settings) == 4 and (settings["proposed"] > 4).all()
    assert (settings["attack"] <= FIRST_READING.attack_limit).all()
    assert (settings["change"] < paper_inference.MAX_AMPLITUDE_CHANGE).all()
    for unknown in unknowns.UNKNOWNS:
        assert settings[unknown.name].between(unknown.low, unknown.high).all()
    judged = tried[tried["stage"] == "judged"]
    assert len(judged) == 3 and np.isfinite(judged["log_likelihood"]).all()
    assert (tried["stage"] == "draw").sum() == 2 * len(settings)  # that share no subset


def test_tables_and_figure(tried):
    other = tried.assign(reading="sine")
    other[["log_weight", "noise 0.05"]] -= 10.0
    parts = {"readings/one": tried, "readings/two": other}
    readings = tables.paper_readings(parts)
    assert readings["reading"].to_list() == [FIRST_READING.name, "sine"]
    assert readings["verdict"].to_list() == ["first", "ruled out as tried"]
    assert readings["log10_bayes_factor"].iloc[1] == pytest.approx(-10 / np.log(10))
    assert readings["worst_claims"].iloc[1] == "noise 0.05"
    samples = tables.region_samples(parts)
    for group in ("all", *CLAIM_GROUPS):
        sums = samples.groupby("stage")[f"weight_{group}"].sum()
        np.testing.assert_allclose(sums, 1.0)
    table = tables.region_table(samples, readings).set_index("unknown")
    rows = table.loc[list(unknowns.UNKNOWN_NAMES)]
    assert (rows["low"] <= rows["high"]).all()
    assert table.loc["mode shape", "verdict"] == "determined"
    predicted = tables.predictions(samples)
    assert len(predicted) == len(PRINTED_CLAIMS)
    numbers = predicted[predicted["kind"] == "value"]
    assert (numbers["predicted_low"] <= numbers["predicted_high"]).all()
    assert predicted["predicted_share"].between(0, 1).all()
    pairs = tables.exclusions(parts)
    assert (pairs["both"] <= pairs[["first", "second"]].min(axis=1)).all()
    region = tables.region_table(samples, readings)
    figure = draw_region(region, readings)
    known = (table.loc[list(unknowns.UNKNOWN_NAMES), "verdict"].dropna() == "determined").sum()
    assert f"{known} of {len(unknowns.UNKNOWN_NAMES)}" in figure.get_label()
    shares = [bar.get_width() for bar in figure.axes[0].containers[1]]
    assert len(shares) == len(unknowns.UNKNOWN_NAMES) and all(0 <= share <= 100 for share in shares)


def test_every_reading_is_a_line_that_can_gallop():
    loads = [
        reading.case_at(KNOWN, RESONANT)["ice"]["vertical"]
        for reading in unknowns.READINGS_BY_NAME.values()
    ]
    assert all(b1 > 0 > b3 for b1, _, b3 in loads)
    assert len({b2 for _, b2, _ in loads}) == 4


def test_the_default_study_is_as_probable_as_the_best_setting_that_was_found(root):
    """Within what the likelihoods of settings scatter by, and under the same conditions."""
    study = plain(load(read(root / "config" / "config.yaml")))
    case = study["cases"]["internal_resonance"]
    own = {u.name: reduce(getitem, u.path, case) for u in unknowns.UNKNOWNS if u.path}
    own["threshold"] = study["identification"]["paper"]["threshold"]
    row = paper_inference.estimate(FIRST_READING, own, 200, np.random.default_rng(2))
    readings = pd.read_csv(root / "results" / "reference" / "paper" / "paper_readings.csv")
    best = readings.set_index("reading").loc[FIRST_READING.name]
    assert row["log_likelihood"] > best["log_likelihood"] - 1.0
    assert row["attack"] <= FIRST_READING.attack_limit
