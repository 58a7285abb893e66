"""How the search for a model goes on from what each step finds: steps whose misfits are given, and
the weighings of the weak form.
"""

from types import SimpleNamespace

import numpy as np
import pytest
from identification_cases import model, noisy

from galloping import simulate
from galloping.identification.likelihood import trajectory_fit
from galloping.identification.likelihood.shooting import ShootingFit
from galloping.identification.preparation.weak_form import make_start, whitened_weak_form
from galloping.identification.problem import make_problem
from galloping.identification.selection import Price, solve_support

PRICE = Price(*np.ones((3, 8)))


def fit(misfit=10.0, support=(), place=0.0, segments=1, periods=6.0, select=None):
    """All of its coefficients are `place`, and its misfit is chi^2 of one row."""
    condensed = SimpleNamespace(rows=np.ones(1))
    problem = SimpleNamespace(select_terms=select)
    record = SimpleNamespace(problem=problem, condensed=condensed, stretch=periods)
    chosen = np.isin(np.arange(8), support)
    starts, noise = np.zeros((segments, 1)), np.ones((1, 1))
    return ShootingFit(record, np.full(8, place), chosen, starts, noise, noise, misfit)


def step(before, to, decrement=0.0):
    """Its decrement of one or more is that of an iteration that has not settled."""
    return trajectory_fit.Step(before, to, np.eye(8), np.zeros(8), decrement, 0.0)


@pytest.mark.parametrize(
    ("limit", "misfit"),
    [
        pytest.param(1.0 / 2.0, np.inf, id="diverges"),
        pytest.param(1.0 / 32.0, np.inf, id="diverges until it is tried for the sixth time"),
        pytest.param(1.0 / 2.0, 16.0, id="misfit half as large again"),
    ],
)
def test_a_step_that_goes_too_far_is_halved(monkeypatch, limit, misfit):
    def gauss_newton(own, *_):
        if own.free[0] > limit and misfit == np.inf:
            raise FloatingPointError
        return step(own, fit(misfit if own.free[0] > limit else 9.0))

    monkeypatch.setattr(trajectory_fit, "_gauss_newton", gauss_newton)
    found = trajectory_fit.take_guarded_step(fit(place=0.0), fit(place=1.0), None, None)
    assert found.before.free[0] == limit


@pytest.mark.parametrize(
    ("misfits", "periods"),
    [
        pytest.param({6: [9, 8, 7, 6, 1.4]}, 6, id="close at the fifth step"),
        pytest.param({6: [9, 2, 2, 2, 2], 3: [1.4]}, 3, id="not close above 1.5"),
        pytest.param({6: [40], 3: [19], 1.5: [18], 0.75: [2]}, 3, id="the last that halves it"),
    ],
)
def test_segments_are_as_long_as_they_may_be(monkeypatch, misfits, periods):
    left = {length: iter([*of_steps, *5 * of_steps[-1:]]) for length, of_steps in misfits.items()}
    monkeypatch.setattr(trajectory_fit, "prepare_fit", lambda _, __, length: fit(periods=length))

    def guarded_step(_, own, *__):
        return step(own, fit(next(left[own.record.stretch]), periods=own.record.stretch))

    monkeypatch.setattr(trajectory_fit, "take_guarded_step", guarded_step)
    found = trajectory_fit.fit_free_segments(SimpleNamespace(period=1.0), None)
    assert found.fit.record.stretch == periods


@pytest.mark.parametrize("unseen", [False, True])
def test_chains_grow_while_terms_change_and_terms_are_kept_in_the_last_passes(monkeypatch, unseen):
    """Where mixtures go unseen passes end with the choice, and a fit that follows the data but has
    not settled is a model.
    """
    longest, choosing, tried = [], [], []

    def guarded_step(_, own, chain, price):
        longest.append(chain)
        choosing.append(price is not None)
        return step(own, fit(1.0, [len(longest) % 8], segments=1000), decrement=1.0)

    def select(_, __, starts, *___):
        tried.append([np.flatnonzero(start).tolist() for start in starts])
        return np.isin(np.arange(8), 1)

    monkeypatch.setattr(trajectory_fit, "take_guarded_step", guarded_step)
    begun = fit(1.0, [0, 2], segments=1000, select=select)
    joined = trajectory_fit.join_segments(step(begun, begun), PRICE, 1.0, unseen)
    assert tried == [[list(range(8)), [0, 2]]]  # from all terms and from those before
    assert longest[:5] == [4, 16, 64, 256, 1024]
    assert choosing == 14 * [True] + (0 if unseen else 6) * [False]
    assert not joined.settled and bool(joined.objection) != unseen


def test_the_weak_form_is_weighed_until_its_coefficients_move_by_less_than_their_errors():
    true = model(("x", "dx"), 3, {"dx": 1.0}, {"x": -1.0, "dx": 0.3, "x^2 dx": -0.3})
    time = np.linspace(0.0, 60.0, 1201)
    recording = noisy(true, simulate(true, (0.5, 0.0), time).states, time, 0.1, 202611275)
    begun = make_start(make_problem(true.states, true.terms), [recording])
    weighed = begun.problem.coefficients(begun.fit.free)
    rows, rates = whitened_weak_form(begun.problem, begun.smoothed[0], weighed)
    again, covariance = solve_support(rows.T @ rows, rows.T @ rates, begun.fit.support)
    moved = (again - begun.fit.free)[begun.fit.support] / np.sqrt(np.diag(covariance))
    assert np.max(np.abs(moved)) < 0.1
