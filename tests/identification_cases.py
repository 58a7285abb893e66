"""Systems whose coefficients are known, and recordings of them, for the identification tests."""

import numpy as np
from lines import simulate

from galloping import IdentifiedModel, PolynomialModel, Recording
from galloping import polynomial_library as library
from galloping.evaluation.bounds import sensitivities
from galloping.identification.problem import make_problem

TIME = np.linspace(0.0, 300.0, 30_001)
RELEASE = np.array([0.1, 0.1, 0.0, 0.0])


def model(states: tuple[str, ...], degree: int, *rows: dict[str, float]) -> PolynomialModel:
    """The model whose equations have the given terms, by name."""
    terms = library(len(states), degree)
    empty = PolynomialModel(states, terms, np.zeros((len(states), len(terms))))
    coefficients = np.array([[row.get(name, 0.0) for name in empty.term_names] for row in rows])
    return PolynomialModel(states, terms, coefficients)


def line(name: str = "internal_resonance") -> PolynomialModel:
    """A default line on its candidate library."""
    return simulate(name)[0].on_library(library(4, 3))


def solution(true: PolynomialModel, start: np.ndarray, time: np.ndarray) -> np.ndarray:
    return sensitivities(true, np.zeros((0, 2), int), np.asarray(start, float), time)[0]


def noisy(
    true: PolynomialModel, x: np.ndarray, time: np.ndarray, level: float, seed: int
) -> Recording:
    """Protocol `state`: noise of `level` standard deviations on each state."""
    noise = np.random.default_rng(seed).normal(size=x.shape)
    return Recording(time, true.states, x + level * x.std(axis=0) * noise)


def unknown_support(true: PolynomialModel) -> np.ndarray:
    """The terms to be found: those of the equations that are not known by their states' names."""
    unknown = make_problem(true.states, true.terms, inputs=true.inputs).unknown
    return true.support & np.isin(np.arange(len(true.states)), unknown)[:, np.newaxis]


LINE = line()
SUPPORT, X = unknown_support(LINE), solution(LINE, RELEASE, TIME)


def deviations(
    found: IdentifiedModel, true: PolynomialModel, std: np.ndarray | None = None
) -> np.ndarray:
    """Errors of the coefficients to be found, in their standard errors or in others, `std`."""
    true = true.on_library(found.model.terms)
    support = unknown_support(true)
    own = found.standard_errors[support] if std is None else std
    return (found.model.coefficients - true.coefficients)[support] / own


def assert_found(
    found: IdentifiedModel, true: PolynomialModel, within: float = 4.0, spread: float = np.inf
) -> None:
    """All terms to be found, no other, and errors as large as the standard errors say: each, and
    their root mean square.
    """
    assert found.status == "ok", found.reason
    assert np.array_equal(found.support, unknown_support(true.on_library(found.model.terms)))
    errors = deviations(found, true)
    assert np.max(np.abs(errors)) < within and np.sqrt(np.mean(errors**2)) < spread
