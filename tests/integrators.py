"""Motions by the integrators of scipy, beside those of the library."""

import numpy as np
from scipy.integrate import solve_ivp

from galloping.model.polynomial import design_matrix


def moved(rates, start, time, **options):
    """States (n, n_states) of dx/dt = rates(t, x), at times (n,)."""
    given = {"rtol": 1e-10, "atol": 1e-12} | options
    return solve_ivp(rates, (time[0], time[-1]), start, t_eval=time, **given).y.T


def moved_with_derivatives(model, free, start, time, **tolerances):
    """States (n, n_states) of a model, and their derivatives (n, n_states, n_free + n_states) by
    the coefficients at places `free` (n_free, 2) and by the initial state.
    """
    n, count = len(start), len(free)

    def rates(_, both):
        x, moved = both[np.newaxis, :n], both[n:].reshape(n, -1)
        change = model.jacobian(x)[0] @ moved
        change[free[:, 0], np.arange(count)] += design_matrix(x, model.terms)[0, free[:, 1]]
        return np.append(model(x)[0], change)

    both = np.append(start, np.eye(n, count + n, count))
    found = moved(rates, both, time, method="DOP853", **tolerances)
    return found[:, :n], found[:, n:].reshape(len(time), n, -1)
