"""Solutions of models with inputs, and how they depend on coefficients and start.

By the integrator of the likelihood, in equal steps short enough for its Taylor series.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from galloping.inputs import Input, windowed
from galloping.polynomial import PolynomialModel
from galloping.taylor import ORDER, integrate, system, tables

# Degree of the polynomial that an input is over a step: a cubic spline is hardly more than that
# over two of its samples.
DEGREE, SAMPLES_PER_STEP = 5, 2
# Truncation of a step's Taylor series, relative to the size of each state.
ACCURACY = 1e-10
FAR = 1e4  # of a state, from which its size says nothing about the accuracy before


def first_step(inputs: Sequence[Input]) -> float:
    """s, of the finest input: from one sample to the next where it jumps at them."""
    return min(
        (1 if one.between == "zero" else SAMPLES_PER_STEP) * float(np.median(np.diff(one.time)))
        for one in inputs
    )


def solution(
    model: PolynomialModel,
    inputs: Sequence[Input],
    start: NDArray[np.float64],
    time: NDArray[np.float64],
    step: float,
    most: int,
    free: NDArray[np.int_] | None = None,
) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """The solution of a model, with its derivatives where `free` is given, and the step it took.

    inputs: those of the model, in its order. start: (n_states,) at time[0]. time: (n,) s,
    increasing. step: s, the longest to try. most: steps. free: (n_free, 2) pairs (equation, term).
    Returns states (n, n_states), beyond FAR or not finite where they diverge, and derivatives (n,
    n_states, n_free + n_states) by the free coefficients and the start, of no columns without
    `free`.
    Raises FloatingPointError where more than `most` steps were needed.
    """
    n_states = len(start)
    table = tables(model.terms, n_states)
    wanted = free is not None
    columns = np.asarray(free).reshape(-1, 2) if wanted else np.empty((0, 2), int)
    compiled = system(table, model.coefficients, columns)
    diverged, longest = None, step
    while (windows := max(1, int(np.ceil((time[-1] - time[0]) / step - 1e-9)))) <= most:
        place = (time - time[0]) / step
        window = np.minimum(place.astype(np.int64), windows - 1)
        row = np.arange(len(time)) - np.searchsorted(window, window)
        powers = np.zeros((windows, n_states, row.max() + 1, ORDER + 1))
        powers[window, :, row] = ((place - window)[:, None] ** np.arange(ORDER + 1))[:, None]
        with np.errstate(all="ignore"):
            found, slopes, _, _, truncation = integrate(
                compiled, step, np.array([0, windows]), start[None], powers, np.arange(n_states),
                windowed(inputs, table.factors, time[0], step, windows, DEGREE), wanted,
            )  # fmt: skip
        states, moved = found[window, :, row], slopes[window, :, row]
        bounded = bool(np.all(np.abs(states) < FAR))
        if bounded and truncation < ACCURACY:
            return states, moved, step
        diverged = None if bounded else (states, moved, longest)
        step /= 2.0
    if diverged is not None:
        return diverged
    raise FloatingPointError(f"more than {most} integration steps")
