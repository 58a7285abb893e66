"""What is chosen by chi^2 and a penalty for each term, and what a verdict claims of the choice, on
regressions whose truth is known.
"""

import numpy as np
import pytest

from galloping import IdentifiedModel, PolynomialModel, Prior
from galloping.identification.drawn_models import draw_models, draw_models_and_rivals
from galloping.identification.findings import Code, Finding
from galloping.identification.likelihood.verdict import Regression, assess_fit, find_open_questions
from galloping.identification.plausible import (
    Plausible,
    plausible_supports,
    unconditional_errors,
    weigh_by_prior,
)
from galloping.identification.postprocessing import find_weakly_determined_input_terms
from galloping.identification.problem import Problem, make_problem
from galloping.identification.selection import select_support, whiten
from galloping.model.intervals import interval_of_draws

TERMS = tuple((k,) for k in range(12))
PROBLEM = make_problem(("x",), TERMS)


def verdict(
    problem: Problem, columns: np.ndarray, observed: np.ndarray, start: list[int]
) -> IdentifiedModel:
    """Of a regression with unit noise, by selection from the terms `start`."""
    information, right = columns.T @ columns, columns.T @ observed
    penalty = 2.0 * np.log(len(columns))
    starts = [np.isin(np.arange(columns.shape[1]), start)]
    support = select_support(information, right, starts, problem.least_penalties(penalty))
    largest = np.sqrt(np.mean(observed**2)) / np.sqrt(np.mean(columns**2, axis=0))
    return assess_fit(problem, Regression(information, right, support, penalty, largest))


def verdict_on(true: np.ndarray, columns: np.ndarray, rng: np.random.Generator) -> IdentifiedModel:
    observed = columns @ true + rng.normal(size=len(columns))
    return verdict(PROBLEM, columns, observed, [*range(len(true))])


def test_what_ok_claims_holds_and_the_unconditional_interval_covers() -> None:
    # strong terms beside weak ones of any size, in columns that imitate each other
    rng = np.random.default_rng(2024)
    sure = wrong = held = terms = 0
    for _ in range(200):
        columns = rng.normal(size=(2000, 12))
        for k in range(1, 12):
            columns[:, k] = columns[:, k - 1] + rng.choice([0.1, 0.3, 1.0]) * columns[:, k]
        size = 10.0 ** rng.uniform(-2.5, 0.5, 12)
        true = np.where(rng.random(12) < 0.4, size * rng.choice([-1.0, 1.0], 12), 0.0)
        result = verdict_on(true, columns, rng)
        distance = np.abs(result.model.coefficients[0] - true)
        held += np.sum((distance < 1.96 * result.unconditional_errors[0])[true != 0.0])
        terms += np.sum(true != 0.0)
        if result.status == "ok":
            sure += 1
            present = result.support[0]
            limits = result.detection_limits[0][~present]
            wrong += bool(
                np.any(true[present] == 0.0)
                or np.any(np.abs(true[~present]) > limits)
                or np.any(distance[present] > 4.0 * result.unconditional_errors[0][present])
            )
    assert sure > 30
    assert wrong <= 0.02 * 200
    assert 0.93 < held / terms < 0.98


def test_draws_with_rivals_hold_the_truth_where_those_that_trust_the_terms_do_not() -> None:
    rng, held = np.random.default_rng(2025), {draw_models: [], draw_models_and_rivals: []}
    for _ in range(200):
        columns = rng.normal(size=(400, 12))
        columns[:, 1] = columns[:, 0] + 0.3 * columns[:, 1]  # of a weak term, missed half the time
        true = np.array([1.0, 0.55, *np.zeros(10)]) * rng.choice([-1.0, 1.0])
        found = verdict_on(true, columns, rng)
        for draws, inside in held.items():
            first = [each.coefficients[0, 0] for each in draws(found, rng)]
            low, high = interval_of_draws(np.array(first))
            inside.append(low <= true[0] <= high)
    assert np.mean(held[draw_models]) < 0.65
    assert np.mean(held[draw_models_and_rivals]) > 0.8


def test_a_term_that_another_can_replace_is_not_identifiable() -> None:
    rng = np.random.default_rng(3)
    columns = rng.normal(size=(2000, 12))
    columns[:, 1] = columns[:, 0] + 0.005 * columns[:, 1]
    true = np.zeros(12)
    true[0] = 1.0
    result = verdict_on(true, columns, rng)
    assert result.status == "not identifiable"
    rival = result.findings[0]
    assert rival.code == Code.RIVAL_TERMS and " in d(" in rival.data["terms"]


def test_an_absent_term_has_a_limit_and_no_bearing_on_the_verdict() -> None:
    rng = np.random.default_rng(4)
    columns = rng.normal(size=(2000, 12))
    columns[:, 7] *= 1e-4  # the data say little of this term
    result = verdict_on(np.eye(12)[0], columns, rng)
    assert result.status == "ok", result.reason
    limits = result.detection_limits[0]
    assert np.isnan(limits[0])
    assert limits[7] > 1e3 * np.nanmax(np.delete(limits, 7))


def test_nothing_found_is_not_identifiable() -> None:
    rng = np.random.default_rng(5)
    result = verdict_on(np.zeros(12), rng.normal(size=(2000, 12)), rng)
    assert (result.status, result.codes) == ("not identifiable", "no_term")


# of two states to the second degree: x, y and x y are the candidates 1, 2 and 4 of dx/dt
PLANE = ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2))
Y, XY = 2, 4


def alike(
    prior: Prior | None, rows: int = 400
) -> tuple[Problem, np.ndarray, np.ndarray, np.ndarray]:
    """A regression of dx/dt on y, which x y imitates well: its problem, columns and rates."""
    rng = np.random.default_rng(12)
    known = PolynomialModel(("x", "y"), PLANE, np.zeros((2, 6)))
    problem = make_problem(("x", "y"), PLANE, known, ("y",), prior)
    columns = rng.normal(size=(rows, 6))
    columns[:, XY] = columns[:, Y] + 0.2 * rng.normal(size=rows)
    return problem, columns, 3.0 * columns[:, 1], rng.normal(size=rows)


FALSE = [1, XY]  # x and the wrong one of two alike


def test_between_terms_that_the_data_cannot_tell_apart_the_prior_takes_the_simpler() -> None:
    problem, columns, rates, noise = alike(Prior())
    rates = rates + 0.5 * (columns[:, Y] + columns[:, XY]) + noise  # as much for each
    result = verdict(problem, columns, rates, FALSE)
    assert np.flatnonzero(result.support[0]).tolist() == [1, Y]
    assert result.status == "ok"
    told = result.findings[0]
    assert told.code == Code.PRIOR_DECIDES
    assert (told.data["terms"], told.data["rivals"]) == ("y in d(x)/dt", "x y in d(x)/dt")
    without, *_ = alike(None)
    result = verdict(without, columns, rates, FALSE)
    assert result.status == "not identifiable" and result.has_finding(Code.RIVAL_TERMS)


def test_the_prior_yields_to_the_data() -> None:
    problem, columns, rates, noise = alike(Prior(), 4000)
    result = verdict(problem, columns, rates + 3.0 * columns[:, XY] + noise, FALSE)
    assert np.flatnonzero(result.support[0]).tolist() == [1, XY]
    assert (result.status, result.codes) == ("ok", "")


def test_a_simple_term_that_the_data_would_not_show_is_never_under_an_ok() -> None:
    problem, columns, rates, noise = alike(Prior())
    columns[:, Y] *= 0.2  # of little effect on rates unless its coefficient is large
    columns[:, XY] = np.random.default_rng(1).normal(size=400)
    assert verdict(problem, columns, rates + noise, FALSE).status == "ok"
    result = verdict(problem, columns[:40], (rates + noise)[:40], FALSE)
    assert np.flatnonzero(result.support[0]).tolist() == [1]
    assert result.status == "not identifiable"
    assert result.has_finding(Code.TERM_MAY_BE_MISSING)


@pytest.mark.parametrize(("apart", "status"), [(0.03, "ok"), (0.017, "not identifiable")])
def test_a_nonlinear_term_that_others_balance_may_be_twice_its_equation_unseen(
    apart: float, status: str
) -> None:
    """As where x y is nearly x: apart by 3 % it shows from 1.3 times on, by 1.7 % from 3.3 on."""
    problem, columns, rates, noise = alike(Prior(), 4000)
    columns[:, XY] = columns[:, 1] + apart * np.random.default_rng(1).normal(size=4000)
    result = verdict(problem, columns, rates + noise, [1])
    assert (result.status, np.flatnonzero(result.support[0]).tolist()) == (status, [1])
    missing = [f.data["term"] for f in result.findings if f.code == Code.TERM_MAY_BE_MISSING]
    assert missing == (["x y in d(x)/dt"] if status != "ok" else [])


def test_by_default_a_constant_is_cheapest_and_a_nonlinear_term_dearest() -> None:
    constant, *linear = make_problem(("x", "y"), PLANE, prior=Prior()).least_penalties(12.0)[:3]
    nonlinear = make_problem(("x", "y"), PLANE, prior=Prior()).least_penalties(12.0)[3:6]
    assert constant < min(linear) and max(linear) < min(nonlinear)


def test_the_prior_costs_the_same_in_any_unit() -> None:
    problem, *_ = alike(Prior(term=0.5, constant=1.0, nonlinear=0.1))
    paid = problem.least_penalties(2.0 * np.log(400)) - np.log(400)
    assert paid[0] == 0.0
    assert np.allclose(paid[[1, Y]], 2.0 * np.log(2.0))
    assert np.allclose(paid[3:] - paid[1], 2.0 * np.log(10.0))


def test_a_constant_beside_a_displacement_costs_more_than_a_nonlinear_term() -> None:
    """A term of the third degree costs as much as one of the second."""
    line = make_problem(("q", "dq"), (*PLANE, (3, 0)), prior=Prior(nonlinear=0.1))
    plain = make_problem(("x", "y"), PLANE, prior=Prior(nonlinear=0.1))
    rate = line.prior_penalties / np.log(10.0)
    assert np.allclose(rate, 2.0 * np.array([2, 0, 0, 1, 1, 1, 1]))
    assert np.all(plain.term_complexity[[0, 6]] == -1)


def test_simple_terms_told_finely_cost_more_but_not_beside_a_displacement() -> None:
    rows, largest = 400, np.geomspace(1e-3, 1e3, 12)
    for states, dearer in ((("x", "y"), [0, 1, 2, 6, 7, 8]), (("q", "dq"), [])):
        problem = make_problem(states, PLANE, prior=Prior())
        penalty = problem.term_penalties(2.0 * np.log(rows), largest[: len(problem.candidates)])
        terms = np.arange(len(problem.candidates))
        roughly = penalty.with_errors(penalty.width, terms)  # as a prior worth one sample is wide
        assert np.allclose(roughly, problem.least_penalties(2.0 * np.log(rows)))
        finely = penalty.with_errors(penalty.width / 3.0, terms) - roughly
        assert np.allclose(finely, 2.0 * np.log(3.0) * np.isin(terms, dearer))
        assert penalty.with_errors(0.0 * penalty.width + 1e-30, terms).max() <= roughly.max()


def test_supports_that_lack_a_term_may_weigh_a_fifth() -> None:
    problem, columns, rates, _ = alike(None)
    whitened = whiten(columns.T @ columns, columns.T @ rates)
    supports = np.array([np.isin(np.arange(6), place) for place in ([1, Y], [1, XY])])
    nothing = np.zeros(supports.shape)
    for share in (0.15, 0.25):
        weight = np.array([1.0 - share, share])
        plausible = Plausible(supports, np.zeros(2), weight, nothing, nothing)
        codes = [each.code for each in find_open_questions(problem, whitened, plausible)]
        assert (Code.RIVAL_TERMS in codes) == (share > 0.2)


def test_supports_of_which_two_terms_are_others_are_weighed() -> None:
    """Those about the best rivals, not about the one found alone."""
    rng = np.random.default_rng(202611274)
    columns = rng.normal(size=(400, 4))
    columns[:, 2:] = columns[:, :2] + 0.01 * columns[:, 2:]
    right = columns.T @ (columns[:, :2].sum(axis=1) + rng.normal(size=400))
    found = np.array([True, True, False, False])
    others = plausible_supports(whiten(columns.T @ columns, right), found).supports
    assert found.tolist() in others.tolist() and (~found).tolist() in others.tolist()


def test_four_unconditional_errors_hold_a_rival_that_is_far_and_hardly_plausible() -> None:
    supports, weight = np.ones((2, 1), bool), np.array([0.97, 0.03])
    plausible = Plausible(supports, np.zeros(2), weight, np.array([[0.0], [10.0]]), supports**2.0)
    assert 4.0 * unconditional_errors(plausible, np.zeros(1)) >= 10.0


def test_four_unconditional_errors_hold_for_all_coefficients_together() -> None:
    # each of ten coefficients has its own rival, of half of a hundredth of the weight
    weight = np.append(0.95, np.full(10, 0.005))
    supports, coefficients = np.ones((11, 10), bool), np.vstack([np.zeros(10), 10.0 * np.eye(10)])
    plausible = Plausible(supports, np.zeros(11), weight, coefficients, supports**2.0)
    assert np.all(4.0 * unconditional_errors(plausible, np.zeros(10)) >= 10.0)


@pytest.mark.parametrize(("z", "doubted"), [(3.7, False), (4.2, True)])
def test_a_term_that_noise_brings_once_in_a_thousand_is_a_doubt(z: float, doubted: bool) -> None:
    """One of eleven that are absent, by whose z^2 chi^2 falls: less than the penalty, 19.8."""
    rng = np.random.default_rng(202611271)
    rows, present = 20_000, np.array([0, 5])
    columns = np.sqrt(rows) * np.linalg.qr(rng.normal(size=(rows, 12)))[0]
    noise = rng.normal(size=rows)
    noise -= columns @ (columns.T @ noise) / rows
    observed = columns[:, present] @ [1.0, z / np.sqrt(rows)] + noise
    result = verdict(PROBLEM, columns, observed, [0])
    assert np.flatnonzero(result.support[0]).tolist() == [0]
    plausible = [f.data["terms"] for f in result.findings if f.code == Code.TERM_PLAUSIBLE]
    assert plausible == (["x^5 in d(x)/dt"] if doubted else [])


def test_the_prior_settles_ties_and_nothing_else() -> None:
    problem, *_ = alike(Prior(nonlinear=0.1))
    places = ([1, XY], [1, 3], [Y], [1, 3, 5], [1, 3, 5], [1, Y])
    supports = np.array([np.isin(np.arange(6), place) for place in places])
    chi2 = np.array([0.0, 2.0, 9.0, -6.0, -4.0, 2.0])
    nothing = np.zeros(supports.shape)
    alone = Plausible(supports, chi2, np.full(6, 1.0 / 6.0), nothing, nothing)
    weight = weigh_by_prior(problem, alone).weight
    # as dear, fewer terms of less degree, more terms that fit clearly better and hardly, less dear
    assert np.allclose(weight[1:] / weight[0], [1.0, 10.0, 1.0, 0.1, 10.0])
    assert weigh_by_prior(make_problem(("x",), TERMS), alone) is alone


def test_a_law_that_one_mean_wind_does_not_tell_is_said() -> None:
    terms = ((1, 0, 0), (0, 1, 0), (0, 1, 1))  # q, dq, U dq
    model = PolynomialModel(("q", "dq"), terms, [[0, 1, 0], [-4.0, 0, 0.01]], ("U",))
    about = {"U_low": 9.5, "U_high": 10.5}

    def said(limit: float) -> list[Finding]:
        limits = np.array([[np.nan] * 3, [np.nan, limit, np.nan]])
        identified = IdentifiedModel(model, is_judged=True, detection_limits=limits)
        return find_weakly_determined_input_terms(identified, [10.0], about)

    (short,) = said(0.05)
    assert (short.code, short.subject) == (Code.INPUT_RANGE_SHORT, "U")
    assert short.data == {"low": 9.5, "high": 10.5, "terms": "dq in d(dq)/dt"}
    assert said(0.01) == said(np.nan) == []


def chosen(columns, observed, penalty, start=None, sigma=1.0):
    """The terms of a regression with noise `sigma`, from the terms `start` on; None: from all."""
    information, right = columns.T @ columns / sigma**2, columns.T @ observed / sigma**2
    terms = np.arange(columns.shape[1])
    starts = [np.isin(terms, terms if start is None else start)]
    return terms[select_support(information, right, starts, penalty)].tolist()


def test_selection_does_not_depend_on_the_units_of_the_columns() -> None:
    rng = np.random.default_rng(1)
    columns = rng.normal(size=(400, 8))
    columns[:, 1:] += 0.8 * columns[:, :-1]
    observed = columns[:, [0, 2, 5]] @ [1.0, -2.0, 0.7] + rng.normal(size=400)
    assert chosen(10.0 ** np.arange(-8, 8, 2) * columns, observed, 12.0) == [0, 2, 5]


def test_two_terms_that_only_help_together_are_found() -> None:
    rng = np.random.default_rng(2)
    base = rng.normal(size=2000)
    columns = np.column_stack([base + 0.05 * rng.normal(size=2000), base])
    observed = 4.0 * (columns[:, 0] - columns[:, 1]) + 0.1 * rng.normal(size=2000)
    assert chosen(columns, observed, 15.0, start=[], sigma=0.1) == [0, 1]


def test_one_false_term_is_exchanged_for_two_true_ones() -> None:
    # the sum of two columns, with noise of its own, imitates both together; they are worth their
    # penalty in its place, but not beside it
    rng = np.random.default_rng(5)
    columns = rng.normal(size=(3000, 6))
    columns[:, 5] = columns[:, 0] + columns[:, 1] + 0.06 * rng.normal(size=3000)
    observed = columns[:, 0] + columns[:, 1] + 0.5 * columns[:, 3] + rng.normal(size=3000)
    for start in ([3, 5], None, []):
        assert chosen(columns, observed, 16.0, start) == [0, 1, 3]


def test_two_terms_are_exchanged_for_one_that_says_nearly_as_much() -> None:
    rng = np.random.default_rng(202611272)
    columns = rng.normal(size=(3000, 6))
    columns[:, 5] = columns[:, 0] + columns[:, 1] + 0.05 * rng.normal(size=3000)
    observed = columns[:, 0] + columns[:, 1] + 0.5 * columns[:, 3] + rng.normal(size=3000)
    assert chosen(columns, observed, 16.0, [0, 1, 3]) == [3, 5]


def test_terms_that_imitate_each_other_keep_their_digits() -> None:
    # as from a long record: products with an inverse would lose all digits of chi^2 here
    rng = np.random.default_rng(6)
    base = rng.normal(size=4000)
    columns = np.column_stack([base + 1e-4 * rng.normal(size=4000) for _ in range(6)])
    observed = columns[:, :2] @ [3.0, -2.0] + 1e-6 * rng.normal(size=4000)
    assert chosen(columns, observed, 16.0, sigma=1e-6) == [0, 1]
