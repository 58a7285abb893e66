"""Systems whose coefficients are known, and recordings of them, for the identification tests."""

from __future__ import annotations

import numpy as np

from galloping.bounds.sensitivity import sensitivities
from galloping.identification.likelihood.problem import posed
from galloping.polynomial import PolynomialModel, library
from galloping.recording import Recording

LINE_STATES = ("q_v", "q_w", "dq_v", "dq_w")
TIME = np.linspace(0.0, 300.0, 30_001)
RELEASE = np.array([0.1, 0.1, 0.0, 0.0])

VERTICAL = ("dq_v", "q_v", "q_v^2", "q_w^2", "dq_v^2", "dq_v^3", "q_v^3", "q_v q_w^2")
HORIZONTAL = ("dq_w", "q_w", "q_v q_w", "q_v^2 q_w", "q_w^3", "dq_v")
RESONANT = (
    (-3.393285e-2, 6.979585, -1.256278, -4.256673e-1, -2.016001e-2, 3.064528e-3, 7.545046e-2,
     7.669510e-2),
    (1.344773e-2, 1.808415, -6.496859e-1, 5.852896e-2, 5.949446e-2, -3.903898e-1),
)  # fmt: skip
NON_RESONANT = (
    (-3.730903e-2, 5.309054, -8.369494e-1, -2.966248e-1, -2.033295e-2, 3.103822e-3, 5.738147e-2,
     6.101003e-2),
    (1.591157e-2, 2.531781, -5.441056e-1, 5.595604e-2, 5.949446e-2, -4.348106e-1),
)  # fmt: skip


def model(states: tuple[str, ...], degree: int, *rows: dict[str, float]) -> PolynomialModel:
    """The model whose equations have the given terms, by name."""
    terms = library(len(states), degree)
    empty = PolynomialModel(states, terms, np.zeros((len(states), len(terms))))
    coefficients = np.array([[row.get(name, 0.0) for name in empty.term_names] for row in rows])
    return PolynomialModel(states, terms, coefficients)


def line(values: tuple[tuple[float, ...], tuple[float, ...]] = RESONANT) -> PolynomialModel:
    """The galloping line with the gammas and kappas `values`, negated in its equations."""
    vertical = {name: -value for name, value in zip(VERTICAL, values[0], strict=True)}
    horizontal = {name: -value for name, value in zip(HORIZONTAL, values[1], strict=True)}
    return model(LINE_STATES, 3, {"dq_v": 1.0}, {"dq_w": 1.0}, vertical, horizontal)


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
    support = true.support.copy()
    support[list(set(range(len(true.states))) - set(posed(true.states, true.terms).unknown))] = 0
    return support
