"""States and first-order sensitivities of a polynomial model along a trajectory."""

from __future__ import annotations

import numpy as np

from galloping.identification.likelihood.condense import ORDER, window_count
from galloping.identification.likelihood.constants import (
    BOUND_TRUNCATION,
)
from galloping.identification.likelihood.taylor import System, propagate, system, tables
from galloping.polynomial import PolynomialModel


def sensitivities(
    model: PolynomialModel,
    free: np.ndarray,
    initial_state: np.ndarray,
    time: np.ndarray,
    step: float | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """The solution of `model` at `time` and its derivatives.

    free: (n_free, 2) pairs (equation, term) of the coefficients to differentiate by.
    initial_state: (n_states,) at time[0]. time: (n,), s, increasing. step: of the integrator, s;
    chosen by `suitable_step` where not given.
    Returns the states (n, n_states) and the sensitivities (n, n_states, n_free + n_states), by
    the free coefficients and then by the initial state.
    Raises ValueError where the solution leaves the range of numbers.
    """
    if step is None:
        step = suitable_step(model, initial_state, time[-1] - time[0])
    compiled = system(tables(model.terms), model.coefficients, np.asarray(free).reshape(-1, 2))
    n_states = len(model.states)
    scaled = (time - time[0]) / step
    steps = window_count(time, step)
    window = np.minimum((scaled + 1e-9).astype(np.int64), steps - 1)
    offsets = np.searchsorted(window, np.arange(steps + 1))
    rank = np.arange(len(time)) - offsets[window]
    functionals = np.zeros((steps, n_states, rank.max() + 1, ORDER + 1))
    powers = (scaled - window)[:, None] ** np.arange(ORDER + 1)
    functionals[window, :, rank] = powers[:, None, :]
    x, s, *_ = integrate(
        compiled, step, np.array([0, steps]), np.atleast_2d(initial_state), functionals,
        np.arange(n_states), sensitive=True,
    )  # fmt: skip
    if not np.all(np.isfinite(x)):
        raise ValueError("the solution of the model diverges within the time asked for")
    return x[window, :, rank], s[window, :, rank]


def integrate(
    compiled: System,
    step: float,
    first: np.ndarray,
    starts: np.ndarray,
    functionals: np.ndarray,
    observed: np.ndarray,
    sensitive: bool,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, float]:
    """`taylor.propagate` of a `System`; see there for shapes."""
    return propagate(
        float(step), ORDER, np.ascontiguousarray(first, np.int64),
        np.ascontiguousarray(starts, float), functionals, np.ascontiguousarray(observed, np.int64),
        sensitive, compiled.parent, compiled.factor, compiled.rates, compiled.rate_values,
        compiled.jacobian, compiled.jacobian_values, compiled.columns,
    )  # fmt: skip


def suitable_step(model: PolynomialModel, initial_state: np.ndarray, duration: float) -> float:
    """A step, s, at which the Taylor series of the model is accurate over `duration` s.

    Halves the step until the last term kept is below 1e-8 of each state's size.
    Raises ValueError where the solution diverges or 2^16 steps are not enough.
    """
    compiled = system(tables(model.terms), model.coefficients, np.zeros((0, 2), int))
    n_states = len(model.states)
    for halvings in range(4, 17):
        steps = 2**halvings
        ends, truncation = integrate(
            compiled, duration / steps, np.array([0, steps]), np.atleast_2d(initial_state),
            np.zeros((steps, n_states, 0, ORDER + 1)), np.arange(n_states), sensitive=False,
        )[2::2]  # fmt: skip
        if np.all(np.isfinite(ends)) and truncation < BOUND_TRUNCATION:
            return duration / steps
    raise ValueError("the solution of the model diverges, or its time scale is too short")
