"""Oscillators with terms that are no polynomials, drawn at random, and recordings of them."""

import numpy as np

from galloping import PolynomialModel, Recording, library, parse_model
from galloping.evaluation.bounds import Experiment, state_bound
from galloping.streams import make_generator
from galloping.trajectory.simulation import Simulator

STATES = ("q", "dq")
LIBRARIES = {
    "pendulum": "poly(q, dq; 3) + sin(q)",
    "drag": "poly(q, dq; 3) + |dq| dq",
    "dry friction": "poly(q, dq; 3) + sign(dq)",
}
LEVEL, PERIODS = 0.05, 30


def drawn(kind: str, rng: np.random.Generator) -> tuple[PolynomialModel, np.ndarray, np.ndarray]:
    """A system of a kind on its library, a start, and times of 30 periods.

    The unit of time is any from 1e-3 to 1e3, that of length too, except of an angle.
    """
    omega, size = 10.0 ** rng.uniform(-3.0, 3.0, 2)
    count = int(rng.integers(1000, 3000))
    if kind == "pendulum":
        size = rng.uniform(1.5, 2.8)
        own = f"dq = {-(omega**2)} sin(q) - {omega * rng.uniform(0.005, 0.05)} dq"
    elif kind == "drag":
        own = f"dq = {-(omega**2)} q - {rng.uniform(0.03, 0.3) / size} |dq| dq"
    else:
        friction = omega**2 * size * rng.uniform(0.005, 0.05)
        own = f"dq = {-(omega**2)} q - {omega * rng.uniform(0.005, 0.02)} dq - {friction} sign(dq)"
    terms, _ = library(LIBRARIES[kind], STATES)
    model = parse_model(f"q = dq; {own}").on_library(terms)
    time = np.linspace(0.0, PERIODS * 2.0 * np.pi / omega, count)
    return model, np.array([size, rng.uniform(-0.2, 0.2) * omega * size]), time


def recorded(
    kind: str, seed: int, replicate: int
) -> tuple[PolynomialModel, Recording, np.ndarray, np.ndarray]:
    """A system with its recording, the terms to be found (n, 2), and their bound (n,)."""
    rng = make_generator(seed, f"oscillators/{kind}/{replicate}")
    model, start, time = drawn(kind, rng)
    states = Simulator(model.states, model.terms)(model, start, time).states
    sigma = LEVEL * states.std(axis=0)
    recording = Recording(time, STATES, states + sigma * rng.standard_normal(states.shape))
    free = np.argwhere(model.support & [[False], [True]])
    return model, recording, free, state_bound(model, free, [Experiment(start, time, sigma)]).std
