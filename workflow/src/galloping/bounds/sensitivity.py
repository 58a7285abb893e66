"""How the motion of a polynomial model depends on its coefficients and on where it starts."""

from collections.abc import Mapping
from functools import lru_cache

import heyoka as hy
import numpy as np

from galloping.driven import first_step, solution
from galloping.inputs import Input
from galloping.polynomial import Exponents, PolynomialModel, beside, design_matrix
from galloping.simulation import (
    COMPILATION,
    EQUAL_STEPS,
    check_inputs,
    equations,
    most_steps,
)

MAX_STEPS = 2**16
Places = tuple[tuple[int, int], ...]


def sensitivities(
    model: PolynomialModel,
    free: np.ndarray,
    initial_state: np.ndarray,
    time: np.ndarray,
    inputs: Mapping[str, Input] | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """The solution of `model` at `time` and its derivatives, without inputs to double precision.

    free: (n_free, 2) pairs (equation, term) of the coefficients to differentiate by; absent ones
    too. initial_state: (n_states,) at time[0]. time: (n,), s, increasing. inputs: the model's.
    Returns the states (n, n_states) and the sensitivities (n, n_states, n_free + n_states), by
    the free coefficients and then by the initial state.
    Raises ValueError where the solution leaves the range of numbers.
    """
    n, n_free = len(model.states), len(free)
    diverges = "the solution of the model diverges, or its time scale is too short"
    if model.inputs:
        own = list(check_inputs(model, inputs or {}, time).values())
        most = EQUAL_STEPS * most_steps(time)
        try:
            states, moved, _ = solution(
                model, own, np.asarray(initial_state, float), time, first_step(own), most, free
            )
        except FloatingPointError:
            raise ValueError(diverges) from None
        if not (np.all(np.isfinite(states)) and np.all(np.isfinite(moved))):
            raise ValueError(diverges)
        return states, moved
    support = model.support
    support[free[:, 0], free[:, 1]] = True
    ta = _integrator(model.states, model.terms, _places(np.argwhere(support)), _places(free))
    ta.pars[:] = model.coefficients[support]
    ta.time = time[0]
    ta.state[:] = np.concatenate([initial_state, np.eye(n, n_free + n, n_free).ravel()])
    outcome, *_, states = ta.propagate_grid(time, max_steps=MAX_STEPS)
    if outcome != hy.taylor_outcome.time_limit:
        raise ValueError(diverges)
    return states[:, :n], states[:, n:].reshape(len(time), n, -1)


def rate_sensitivities(
    model: PolynomialModel,
    free: np.ndarray,
    states: np.ndarray,
    moved: np.ndarray,
    inputs: np.ndarray | None = None,
) -> np.ndarray:
    """Those of the states' derivatives, shaped alike, from what `sensitivities` returns.

    inputs: (n, n_inputs) of a model with inputs.
    """
    rates = model.jacobian(states, inputs) @ moved
    theta = design_matrix(beside(states, inputs), model.terms)
    rates[:, free[:, 0], np.arange(len(free))] += theta[:, free[:, 1]]
    return rates


def _places(pairs: np.ndarray) -> Places:
    return tuple(map(tuple, pairs.tolist()))


@lru_cache(maxsize=16)
def _integrator(
    states: tuple[str, ...], terms: tuple[Exponents, ...], present: Places, free: Places
) -> hy.taylor_adaptive:
    """Of the states and their derivatives; the parameters are the coefficients `present`."""
    support = np.zeros((len(states), len(terms)), bool)
    support[tuple(np.transpose(present))] = True
    system = equations(states, terms, support)
    by = [*(hy.par[present.index(place)] for place in free), *(v for v, _ in system)]
    return hy.taylor_adaptive(
        hy.var_ode_sys(system, by), [0.0] * len(states), pars=[0.0] * len(present), **COMPILATION
    )
