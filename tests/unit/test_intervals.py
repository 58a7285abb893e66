"""Draws of models, and roots of covariances."""

from dataclasses import replace

import numpy as np
import pytest

from galloping import IdentifiedModel
from galloping.arrays import first_from, round_down, round_up
from galloping.identification.drawn_models import add_higher_degree_effects, draw_models_and_rivals
from galloping.model.intervals import covariance_root, draw_normal
from galloping.model.polynomial import PolynomialModel


def covariance(rank):
    root = np.random.default_rng(0).standard_normal((4, rank))
    return root @ root.T


@pytest.mark.parametrize("rank", [4, 2, 0])
def test_a_root_is_one_and_is_triangular(rank):
    own = covariance(rank)
    root = covariance_root(own)
    assert root @ root.T == pytest.approx(own, abs=1e-12)
    assert np.all(np.triu(root, 1) == 0.0) and np.all(np.diag(root) >= 0.0)


def test_draws_do_not_depend_on_units():
    own, units = covariance(4), np.array([1e-9, 3.0, 1e7, 1.0])
    mean = np.array([1.0, -2.0, 0.0, 4.0])
    draws = draw_normal(mean, own, 5, np.random.default_rng(3))
    other = draw_normal(units * mean, own * np.outer(units, units), 5, np.random.default_rng(3))
    np.testing.assert_allclose(other, units * draws, rtol=1e-9)


def test_draws_have_their_covariance():
    own = covariance(4)
    draws = draw_normal(np.zeros(4), own, 40_000, np.random.default_rng(1))
    assert np.cov(draws.T) == pytest.approx(own, abs=0.1)


def test_rivals_are_extrapolated_as_the_model_is_in_the_terms_that_they_have():
    coefficients = np.array([[0.0, 1.0, 0.0], [-4.0, -0.1, 0.5]])
    model = PolynomialModel(("q", "dq"), ((1, 0), (0, 1), (3, 0)), coefficients)
    rival = np.array([[0.0, 1.0, 0.0], [-4.1, 0.0, 0.6]])
    found = IdentifiedModel(
        model, is_judged=True, known=(0,), covariance=np.zeros((3, 3)),
        rivals=rival[np.newaxis], rival_share=0.5,
    )  # fmt: skip
    models = draw_models_and_rivals(found, np.random.default_rng(0))
    assert add_higher_degree_effects(models, found, np.random.default_rng(1)) == models
    stated = replace(
        found, extrapolation_shift=np.array([0.2, 0.3, 0.0]),
        extrapolation_covariance=np.zeros((3, 3)),
    )  # fmt: skip
    changed = add_higher_degree_effects(models, stated, np.random.default_rng(1))
    each = np.array([one.coefficients[1] for one in changed])
    assert {tuple(one) for one in each.round(12)} == {(-3.8, 0.2, 0.5), (-3.9, 0.0, 0.6)}


def test_whole_numbers_are_whole_in_every_unit():
    assert round_down(7.0 - 1e-9) == round_up(7.0 + 1e-9) == 7
    assert (round_down(7.9), round_up(7.1)) == (7, 8)


@pytest.mark.parametrize("unit", [1.0, 1e-6, 3.3e5, 0.1])
def test_samples_at_a_moment_are_the_same_in_every_unit(unit):
    time = unit * np.arange(1000) * 0.05
    moments = unit * np.array([0.05 * 30, 1.52, 1e3, -1.0])
    assert first_from(time, moments).tolist() == [30, 31, 1000, 0]
