"""Trials: lines are drawn by number, and a row says what a model claims and whether it holds."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from statuses import finding_for

from galloping.configuration.kinds import EXAMPLES, KINDS, WIND_CASES
from galloping.figures.verdicts import draw_published_intervals, draw_published_terms
from galloping.identification import registry
from galloping.identification.identified_model import IdentifiedModel
from galloping.line.galerkin import coefficients, make_model
from galloping.model.polynomial import polynomial_library
from galloping.report.data_dictionary import meaning
from galloping.report.results_in_words import verdicts
from galloping.streams import make_generator
from galloping.summary.sample_files import FILES
from galloping.tables.trial_summaries import paths, published_intervals, published_terms, trust
from galloping.trials import free_decays, published, recorded_lines
from galloping.trials.ambient import DAMPING, FREQUENCIES, RandomMotion, compute_decays
from galloping.trials.attempts import against_truth
from galloping.trials.free_decays import FreeDecay
from galloping.trials.real_lines import TRUTHS
from galloping.trials.recorded_lines import FAULTS, LONG_RECORDINGS, MOTION_SELECTORS, draw_line

TERMS = polynomial_library(4, 3)
METHODS = {"maximum_likelihood": registry.BY_NAME["maximum_likelihood"].settings({}, seed=0)}


KNOWN = {
    "sensor_faults": FAULTS,
    "long_and_steady": {*LONG_RECORDINGS, *MOTION_SELECTORS, "limit cycle"},
    "model_error": TRUTHS,
    "published_terms": published.PUBLISHED_SETTINGS,
    "files": FILES | EXAMPLES,
}


@pytest.mark.parametrize("kind", KNOWN)
def test_the_cases_of_a_kind_are_those_that_its_trial_knows(kind):
    assert {*KINDS[kind].cases} == {*KNOWN[kind]}
    if kind == "model_error":
        assert {*WIND_CASES} == {name for name, truth in TRUTHS.items() if truth.wind}


def drawn(number):
    return draw_line(make_generator(1, "a line", number))


def test_a_line_is_drawn_by_its_number_and_gallops():
    case, starts = drawn(3)
    assert case == drawn(3)[0] != drawn(4)[0]
    assert starts.shape == (2, 4)
    for number in range(20):
        case = drawn(number)[0]
        assert coefficients(case)["gamma_1"] < 0
        assert 150 < case["line"]["span"] < 500


@pytest.fixture
def result():
    true = make_model(coefficients(drawn(3)[0])).on_library(TERMS)
    present = np.where(true.support, np.abs(true.coefficients) / 100, np.nan)
    errors = np.where(true.support, present, 1e-3)
    sure = IdentifiedModel(
        true, is_judged=True, standard_errors=present, unconditional_errors=2 * errors,
        detection_limits=np.where(true.support, np.nan, 0.01), known=(0, 1),
    )  # fmt: skip
    return true, sure


def test_claims_that_hold(result):
    true, sure = result
    row = against_truth(true, sure)
    assert row["exact_support"] and not row["ok_and_wrong"]
    assert row["terms"] == row["covered_unconditional"] == row["covered_given_terms"]
    assert row["terms"] == np.sum(true.support[2:]) and row["width_ratio"] == 2.0


@pytest.mark.parametrize(
    ("fault", "term", "factor", "added"),
    [("spurious_terms", (0, 0, 0, 0), 1.0, 0.5), ("missing_above_limit", (1, 0, 0, 0), 0.0, 0.0),
     ("beyond_4_standard_errors", (1, 0, 0, 0), 1.09, 0.0)],
)  # fmt: skip
def test_claims_that_do_not_hold(result, fault, term, factor, added):
    true, sure = result
    values = true.coefficients.copy()
    values[2, TERMS.index(term)] = factor * values[2, TERMS.index(term)] + added
    wrong = replace(sure, model=replace(true, coefficients=values))
    if fault != "beyond_4_standard_errors":
        # the limits and errors of the terms that the method then has
        wrong = replace(wrong, detection_limits=np.full((4, 35), 0.01))
    row = against_truth(true, wrong)
    assert row[fault] == 1 and row["ok_and_wrong"]
    doubted = wrong.with_findings(finding_for("not identifiable"))
    assert not against_truth(true, doubted)["ok_and_wrong"]


def of_a_random_line(seed, number, **options):
    """The fits to its two recordings, one after the other."""
    given = {"protocols": ["state"], "levels": [0.05], "durations": [300.0]} | options
    return recorded_lines.of_random_lines(seed, "all", [number], METHODS, **given)


def test_random_lines_and_their_table():
    fits = pd.DataFrame(of_a_random_line(5, 0, durations=[60.0]))
    assert list(fits["release"]) == [0, 1]
    assert all(meaning("fits", column) for column in fits)
    table = trust(fits)
    line = table[table["case"] == "all"].to_dict("records")[0]
    assert (line["group"], line["fits"], line["level"]) == ("random lines", 2, 0.05)
    answers = ("ok", "not_identifiable", "approximate", "refused")
    assert sum(line[name] for name in answers) == 2
    assert set(table["case"]) <= {"all", "every t > 9"}
    (sentence,) = verdicts(table)
    assert f"{line['ok']} of 2 " in sentence
    parts = {"lines/all_0_to_0": fits, "reality/x": fits[["method", "status", "seconds"]]}
    counted = paths(parts, {"kinds": {"lines": "random_lines", "reality": "model_error"}})
    own = counted[counted["group"] == "random lines"]
    assert own["fits"].sum() == 2 and own["ok"].sum() == line["ok"]
    assert set(own["path"]) == set(fits["path"])
    (other,) = counted[counted["group"] == "model error"].to_dict("records")
    assert (other["fits"], other["path"]) == (2, "") and np.isnan(other["ok_and_wrong"])


def test_a_weak_term_that_is_left_out_is_no_drift_of_a_sensor():
    """Without dq_v^2, too weak to be chosen, what remains looks like a slow drift of q_v."""
    fit = next(of_a_random_line(910213, 9))
    assert fit["status"] == "ok" and not fit["ok_and_wrong"]


@pytest.mark.slow
def test_terms_that_do_not_settle_are_never_ok_and_wrong():
    """Both recordings would settle, the second with 40 passes; the limit of work ends before."""
    for fit in of_a_random_line(14959787, 295):
        assert (
            fit["status"] != "ok" and not fit["ok_and_wrong"] and "limit_of_work" in fit["findings"]
        )


@pytest.mark.slow
def test_terms_that_make_up_others_are_followed_from_few_on_but_not_on_a_limit_cycle():
    """Both recordings leave mixtures of terms unseen: the first fewer than its model has terms."""
    fit = next(of_a_random_line(3316624, 314))
    assert fit["status"] in ("ok", "not identifiable") and not fit["ok_and_wrong"]
    settled = recorded_lines.of_long_and_steady_motions(
        3162278, "limit cycle, random lines", [9], METHODS, levels=[0.05]
    )
    assert next(settled)["status"] in ("not identifiable", "approximate")


def test_a_system_is_compared_with_its_bound():
    system = next(published.systems(5, "van_der_pol", [0], METHODS, samples=[500], levels=[0.01]))
    assert system["exact_support"] and 0.2 < system["error_over_bound"] < 3.0
    assert np.isnan(system["fault_diagnosed"])


@pytest.mark.parametrize(
    ("fault", "size"),
    [("late channels", 0.02), ("clock", 0.001), ("velocity scale", 1.005),
     ("multiplicative noise", 0.01)],
)  # fmt: skip
def test_a_fault_is_named(fault, size):
    """Late channels also where the data are followed in pieces only."""
    fit = next(recorded_lines.of_faulty_recordings(4711, fault, [0], METHODS, levels=[0.05]))
    assert fit["fault_diagnosed"] and fit["status"] != "ok" and fit["size"] >= size
    assert all(meaning("fits", column) for column in fit)


def test_published_settings_stand_beside_their_numbers():
    settings = {"levels": [0.1], "durations": [4.0]}
    fits = pd.DataFrame(published.exact_terms(5, "lorenz", [0, 1], METHODS, **settings))
    (row,) = published_terms({"lorenz": fits}).to_dict("records")
    assert (row["system"], row["duration"], row["level"], row["fits"]) == ("lorenz", 4.0, 0.1, 2)
    assert (row["odr_bindy"], row["ensemble_weak_sindy"]) == (128 / 128, 1 / 128)
    share = row["share_exact_support"]
    assert row["share_exact_support_low"] < share or share == 0.0
    again = pd.DataFrame(published.exact_terms(5, "lorenz", [1], METHODS, **settings))
    assert [*again["min_coefficient_over_bound"]] == [fits["min_coefficient_over_bound"][1]]
    table = published_terms({"lorenz": fits})
    assert draw_published_terms(table).axes
    assert draw_published_terms(table.assign(method="weak_gls")).axes  # says that there is none


def test_intervals_after_selection_stand_beside_their_numbers():
    fits = {
        case: pd.DataFrame(
            published.relaxation_intervals(5, case, range(4), METHODS, samples=[800])
        )
        for case in ("gamma 0", "gamma 0.16")
    }
    table = published_intervals(fits).set_index("case")
    assert table.loc["gamma 0.16", "share_with_term_published"] == 0.6485
    assert np.isnan(table.loc["gamma 0.16", "coverage_published_low"])
    assert (
        table.loc["gamma 0", "coverage"] == 1.0 and table.loc["gamma 0", "share_with_term"] == 0.0
    )
    assert table.loc["gamma 0.16", "share_with_term"] == 1.0
    assert draw_published_intervals(table.reset_index()).axes
    without = draw_published_intervals(table.reset_index().assign(method="weak_gls"))
    assert without.axes and "nan" not in without.get_label()


def test_recordings_are_drawn_by_number_within_the_ranges():
    motion = RandomMotion.draw(make_generator(1, "ambient", 3))
    again = RandomMotion.draw(make_generator(1, "ambient", 3))
    np.testing.assert_array_equal(motion.recording.values, again.recording.values)
    values, _ = compute_decays(motion.system, ())
    slower, faster = np.abs(values) / (2 * np.pi)
    assert FREQUENCIES[0] - 1e-9 <= slower < faster <= FREQUENCIES[1] + 1e-9
    ratio = -values.real / np.abs(values)
    assert DAMPING[0] - 1e-9 <= ratio.min() <= ratio.max() <= DAMPING[1] + 1e-9
    np.testing.assert_allclose(np.nanstd(motion.recording.values[:, :2], axis=0), 1.0, rtol=0.4)


def test_free_decays_are_drawn_by_number_and_judged():
    case = "free decay with a second mode"
    decay = FreeDecay.draw(make_generator(1, "free_decays", case, 3))
    again = FreeDecay.draw(make_generator(1, "free_decays", case, 3))
    assert decay.recording == again.recording
    (row,) = free_decays.trial(1, case, [3], METHODS)
    assert row["status"] == "ok" and row["sensors"] == decay.sensor
    assert abs(row["frequency_v_error_percent"]) < 0.1
    error = row["damping_v_error_percent"] / row["damping_v_bound_percent"]
    assert 0.0 < abs(error) < 4.0


def test_rests_are_found_with_an_accelerometer_of_unknown_offset():
    """A drift that is subtracted from all samples moves those at rest."""
    rows = list(free_decays.trial(8284271, "free decay with a second mode", [22, 46], METHODS))
    assert [row["sensors"] for row in rows] == ["acceleration"] * 2
    assert [row["findings"] for row in rows] == ["released", "released came_to_rest"]


@pytest.mark.slow
def test_free_decays_are_told_with_intervals_that_hold():
    # of another seed than the method was designed with
    case = "free decay with a second mode"
    rows = pd.DataFrame(free_decays.trial(8284271, case, range(100), METHODS))
    assert (rows["status"] == "ok").sum() >= 95
    assert 0.93 <= rows["coverage"].mean() <= 0.97
    assert not rows["path"].str.contains("random forces").any()
    assert rows["seconds"].median() < 3.0 and rows["seconds"].max() < 20.0
    over_bound = rows["damping_v_error_percent"] / rows["damping_v_bound_percent"]
    assert np.sqrt((over_bound**2).mean()) < 1.2


def test_slopes_of_decays_are_differences():
    system = RandomMotion.draw(make_generator(1, "ambient", 4)).system
    places = [(i, np.array([j])) for i in (2, 3) for j in range(4)] + [(2, np.array([], int))]
    _, slopes = compute_decays(system, places)
    assert np.all(slopes[:, -1] == 0.0)
    for k, (i, j) in enumerate(places[:-1]):
        moved = system.copy()
        moved[i, j] += 1e-6
        change = (compute_decays(system, ())[0] - compute_decays(moved, ())[0]).real / 1e-6
        np.testing.assert_allclose(slopes[:, k], change, rtol=1e-3, atol=1e-6)


def test_the_bound_of_a_decay_is_little_above_that_of_its_envelope_alone():
    motion = RandomMotion.draw(make_generator(1, "ambient", 6))
    values, _ = compute_decays(motion.system, ())
    alone = np.sqrt(-values.real / motion.recording.time[-1])  # an Ornstein-Uhlenbeck process
    assert np.all(motion.compute_bound() > alone)
    np.testing.assert_allclose(motion.compute_bound(), alone, rtol=0.06)
