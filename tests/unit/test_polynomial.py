"""Polynomial models on candidate libraries."""

import numpy as np
import pysindy as ps
import pytest

from galloping.polynomial import PolynomialModel, design_matrix, library

STATES = ("q_v", "q_w", "dq_v", "dq_w")


@pytest.mark.parametrize("n_states", [1, 2, 4])
@pytest.mark.parametrize("degree", [1, 2, 3, 5])
def test_library_is_that_of_pysindy(n_states, degree):
    terms = library(n_states, degree)
    x = np.random.default_rng(0).standard_normal((20, n_states))
    theirs = ps.PolynomialLibrary(degree=degree)
    assert design_matrix(x, terms) == pytest.approx(np.asarray(theirs.fit_transform(x)), rel=1e-12)
    names = STATES[:n_states]
    model = PolynomialModel(names, terms, np.zeros((n_states, len(terms))))
    assert list(model.term_names) == theirs.get_feature_names(list(names))


def test_model_on_another_library():
    model = PolynomialModel(("a", "b"), ((1, 0), (0, 3)), np.array([[1.0, 2.0], [0.0, 3.0]]))
    x = np.array([[0.5, 2.0]])
    assert model(x) == pytest.approx(np.array([[16.5, 24.0]]))
    assert model.on_library(library(2, 3))(x) == pytest.approx(model(x))
    assert model.support.sum() == 3
    with pytest.raises(ValueError, match=r"term b\^3 is not in the library"):
        model.on_library(library(2, 2))


def test_shape_of_coefficients_is_checked():
    with pytest.raises(ValueError, match=r"coefficients: shape \(1, 1\), expected \(1, 2\)"):
        PolynomialModel(("a",), ((1,), (2,)), np.zeros((1, 1)))
