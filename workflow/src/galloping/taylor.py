"""Taylor integration of polynomial systems with their first-order sensitivities, compiled.

The right-hand side is data (index tables), not code, so one compilation, cached on disk by numba,
serves every library, support, number of states and replicate. Each step of length h yields the
Taylor polynomial of the states and of the sensitivities over the whole step; observations inside
the step are linear functionals of that polynomial (see `condense`). heyoka, which simulates and
follows sensitivities for bounds, compiles its variational equations for every library anew and took
2 to 3.5 times as long over them (`make bench`).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from galloping.polynomial import Exponents, PolynomialModel, slopes
from galloping.recording import Factor, Input, windowed

ORDER = 12  # of the series in time


@dataclass(frozen=True)
class Tables:
    """Index tables of one library: every monomial is an earlier monomial times a signal.

    Signals are the states and then known functions of time, the factors that inputs bring to terms,
    of which a monomial has one at most.
    monomials: the library's terms and all their divisors, by degree, the constant first.
    position: (n_terms,) where each library term stands among the monomials.
    parent, factor: (n_monomials,); monomial m = monomial parent[m] times signal factor[m].
    exponents: (n_monomials, n_signals). divisor: (n_monomials, n_states), the monomial divided by
    a state once, -1 where it does not contain that state. factors: exponents of the inputs, of each
    signal that is none of the states.
    """

    monomials: tuple[Exponents, ...]
    position: np.ndarray
    parent: np.ndarray
    factor: np.ndarray
    exponents: np.ndarray
    divisor: np.ndarray
    factors: tuple[Factor, ...]

    def jacobian(self, coefficients: np.ndarray) -> np.ndarray:
        """(n_states, n_states, n_monomials) on the monomials, the derivative of each equation by
        each state; coefficients: (n_states, n_terms).
        """
        n_states = len(coefficients)
        on_monomials = np.zeros((n_states, len(self.monomials)))
        on_monomials[:, self.position] = coefficients
        found = np.zeros((n_states, n_states, len(self.monomials)))
        for k in range(n_states):
            own = np.flatnonzero(self.divisor[:, k] >= 0)
            found[:, k, self.divisor[own, k]] = on_monomials[:, own] * self.exponents[own, k]
        return found


@lru_cache(maxsize=64)
def tables(terms: tuple[Exponents, ...], n_states: int) -> Tables:
    """Index tables of the library `terms` (n_terms exponents of states, and of inputs if any)."""
    of_inputs = [term[n_states:] for term in terms]
    factors = tuple(dict.fromkeys(factor for factor in of_inputs if any(factor)))
    units = dict(zip(factors, np.eye(len(factors), dtype=int).tolist(), strict=True))
    none = [0] * len(factors)
    terms = tuple(
        (*term[:n_states], *units.get(factor, none))
        for term, factor in zip(terms, of_inputs, strict=True)
    )
    n_signals = n_states + len(factors)
    zero = (0,) * n_signals
    units = np.eye(n_states, n_signals, dtype=int).tolist()
    closed, queue = {zero}, {*terms, *map(tuple, units)}
    while queue:
        closed |= queue
        lowered = (lower for *_, lower in slopes(tuple(queue), n_states))
        queue = set().union(*lowered) - closed
    monomials = tuple(sorted(closed, key=lambda term: (sum(term), [-e for e in term])))
    index = {term: m for m, term in enumerate(monomials)}
    parent = np.zeros(len(monomials), np.int64)
    factor = np.zeros(len(monomials), np.int64)
    divisor = np.full((len(monomials), n_states), -1)
    for m, term in enumerate(monomials[1:], start=1):
        factor[m] = np.flatnonzero(term)[-1]  # of the constant, unless a state is in it
    for k, (places, _, lower) in enumerate(slopes(monomials, n_states)):
        divisor[places, k] = [index[term] for term in lower]
        parent[places], factor[places] = divisor[places, k], k
    position = np.array([index[term] for term in terms])
    return Tables(monomials, position, parent, factor, np.array(monomials), divisor, factors)


class System(NamedTuple):
    """One model in the form the compiled integrator reads, built by `system`.

    rates: (n, 2) int, (equation, monomial) of each coefficient present; rate_values: (n,).
    jacobian: (n, 3) int, (equation, state, monomial); jacobian_values: (n,).
    columns: (n_free, 3) int, (equation, monomial, column) of each free coefficient, by column;
    weights: (n_free,) what it grows by as the column's parameter grows.
    """

    parent: np.ndarray
    factor: np.ndarray
    rates: np.ndarray
    rate_values: np.ndarray
    jacobian: np.ndarray
    jacobian_values: np.ndarray
    columns: np.ndarray
    weights: np.ndarray


def system(
    table: Tables, coefficients: np.ndarray, free: np.ndarray, together: np.ndarray | None = None
) -> System:
    """The model with `coefficients` (n_states, n_terms) and `free` (n_free, 2) index pairs.

    A pair (equation, term) names a coefficient whose sensitivity is wanted; its value may be zero.
    together: (n_free,) slopes of them all along one parameter, whose sensitivity is then wanted.
    """
    present = np.argwhere(coefficients)
    monomial = table.position[present[:, 1]]
    values = coefficients[present[:, 0], present[:, 1]]
    by_states = table.jacobian(coefficients)
    jacobian = np.argwhere(by_states)
    column = np.arange(len(free)) if together is None else np.zeros(len(free))
    return System(
        table.parent,
        table.factor,
        np.column_stack([present[:, 0], monomial]).astype(np.int64).reshape(-1, 2),
        np.ascontiguousarray(values, dtype=float),
        np.ascontiguousarray(jacobian, np.int64),
        by_states[tuple(jacobian.T)],
        np.column_stack([free[:, 0], table.position[free[:, 1]], column]).astype(np.int64),
        np.ones(len(free)) if together is None else np.asarray(together, float),
    )


@njit(cache=True, fastmath={"contract", "reassoc", "nsz", "arcp"}, error_model="numpy")
def _jets(x, inputs, theta, order, h, parent, factor, rates, rate_values):
    """Taylor coefficients (scaled by h^k) of the states `x` and the monomials `theta`.

    x: (order+1, n_states), row 0 given; theta: (order+1, n_monomials); both filled in place.
    inputs: (n_powers, n_factors) those of the factors of the inputs.
    """
    n_states, n_monomials = x.shape[1], len(parent)
    for k in range(order + 1):
        theta[k, 0] = 1.0 if k == 0 else 0.0
        for m in range(1, n_monomials):
            if factor[m] >= n_states:
                theta[k, m] = inputs[k, factor[m] - n_states] if k < len(inputs) else 0.0
                continue
            if parent[m] == 0:
                theta[k, m] = x[k, factor[m]]
                continue
            total = 0.0
            for j in range(k + 1):
                total += theta[j, parent[m]] * x[k - j, factor[m]]
            theta[k, m] = total
        if k < order:
            scale = h / (k + 1)
            for i in range(n_states):
                x[k + 1, i] = 0.0
            for r in range(len(rate_values)):
                x[k + 1, rates[r, 0]] += scale * rate_values[r] * theta[k, rates[r, 1]]


@njit(cache=True, fastmath={"contract", "nsz", "arcp"}, error_model="numpy")
def _sensitivity_jets(s, jac, kind, theta, order, h, columns, weights):
    """Taylor coefficients of the sensitivities `s` (order+1, n_states, n_columns), row 0 given."""
    n_states, n_columns = s.shape[1], s.shape[2]
    for k in range(order):
        scale = h / (k + 1)
        for i in range(n_states):
            row = s[k + 1, i]
            row[:] = 0.0
            for state in range(n_states):
                if kind[i, state] == 0:
                    continue
                last = k if kind[i, state] == 2 else 0
                for j in range(0, last - 2, 4):  # four at once: memory is slower than sums
                    w0, w1 = scale * jac[j, i, state], scale * jac[j + 1, i, state]
                    w2, w3 = scale * jac[j + 2, i, state], scale * jac[j + 3, i, state]
                    for c in range(n_columns):
                        total = row[c] + w0 * s[k - j, state, c]
                        total = total + w1 * s[k - j - 1, state, c]
                        total = total + w2 * s[k - j - 2, state, c]
                        row[c] = total + w3 * s[k - j - 3, state, c]
                for j in range((last + 1) // 4 * 4, last + 1):
                    weight = scale * jac[j, i, state]
                    other = s[k - j, state]
                    for c in range(n_columns):
                        row[c] += weight * other[c]
        for c in range(len(columns)):
            weight = scale * weights[c]
            s[k + 1, columns[c, 0], columns[c, 2]] += weight * theta[k, columns[c, 1]]


@njit(cache=True, fastmath={"contract", "reassoc", "nsz", "arcp"}, error_model="numpy")
def propagate(
    h, order, first, starts, functionals, observed, inputs, sensitive,
    parent, factor, rates, rate_values, jacobian, jacobian_values, columns, weights,
):  # fmt: skip
    """Integrate segments of equal steps and apply linear functionals to every step.

    h: step (s); order: Taylor order. first: (n_segments + 1,) first step of each segment.
    starts: (n_segments, n_states). functionals: (n_steps, n_observed, n_rows, order + 1), applied
    to the Taylor coefficients in the scaled time tau = (t - t_step)/h. observed: (n_observed,)
    state of each channel. inputs: (n_steps, n_powers, n_factors) the factors of the inputs over
    each step, by powers of the same time. sensitive: whether the sensitivities are wanted. The
    rest: `System`.

    Returns predictions (n_steps, n_observed, n_rows), their sensitivities (..., n_columns) with
    respect to the parameters of the columns and then the segment's initial states, the end states
    (n_segments, n_states) and their sensitivities, and the largest truncation error of a step
    relative to the size of each state. States that overflow give inf or nan.
    """
    n_segments, n_states = starts.shape
    n_steps, n_observed, n_rows = functionals.shape[:3]
    n_free = columns[-1, 2] + 1 if len(columns) else 0
    n_columns = n_free + n_states if sensitive else 0
    x = np.zeros((order + 1, n_states))
    theta = np.zeros((order + 1, len(parent)))
    jac = np.zeros((order + 1, n_states, n_states))
    s = np.zeros((order + 1, n_states, (n_columns + 15) // 16 * 16))  # in whole vectors
    kind = np.zeros((n_states, n_states), np.int64)
    for e in range(len(jacobian_values)):
        level = 1 if jacobian[e, 2] == 0 else 2
        kind[jacobian[e, 0], jacobian[e, 1]] = max(level, kind[jacobian[e, 0], jacobian[e, 1]])
    predictions = np.zeros((n_steps, n_observed, n_rows))
    derivatives = np.zeros((n_steps, n_observed, n_rows, n_columns))
    ends = np.zeros((n_segments, n_states))
    end_derivatives = np.zeros((n_segments, n_states, n_columns))
    size = np.zeros(n_states)
    truncation = np.zeros(n_states)
    for g in range(n_segments):
        for i in range(n_states):  # assigning slices would double the time of compilation
            x[0, i] = starts[g, i]
            if sensitive:
                s[0, i, :] = 0.0
                s[0, i, n_free + i] = 1.0
        for w in range(first[g], first[g + 1]):
            _jets(x, inputs[w], theta, order, h, parent, factor, rates, rate_values)
            for i in range(n_states):
                size[i] = max(size[i], abs(x[0, i]))
                truncation[i] = max(truncation[i], abs(x[order, i]))
            if sensitive:
                jac[:] = 0.0
                for e in range(len(jacobian_values)):
                    i, state, m = jacobian[e, 0], jacobian[e, 1], jacobian[e, 2]
                    for k in range(order):
                        jac[k, i, state] += jacobian_values[e] * theta[k, m]
                _sensitivity_jets(s, jac, kind, theta, order, h, columns, weights)
            for o in range(n_observed):
                state = observed[o]
                for r in range(n_rows):
                    for k in range(order + 1):
                        predictions[w, o, r] += functionals[w, o, r, k] * x[k, state]
                    if sensitive:
                        out = derivatives[w, o, r]
                        for k in range(order + 1):
                            weight = functionals[w, o, r, k]
                            source = s[k, state]
                            for c in range(n_columns):
                                out[c] += weight * source[c]
            for k in range(1, order + 1):
                for i in range(n_states):
                    x[0, i] += x[k, i]
                    if sensitive:
                        for c in range(n_columns):
                            s[0, i, c] += s[k, i, c]
        for i in range(n_states):
            ends[g, i] = x[0, i]
            for c in range(n_columns):
                end_derivatives[g, i, c] = s[0, i, c]
    relative = 0.0
    for i in range(n_states):
        if truncation[i] > 0.0:
            relative = max(relative, truncation[i] / (size[i] + 1e-300))
    return predictions, derivatives, ends, end_derivatives, relative


def integrate(
    compiled: System,
    step: float,
    first: np.ndarray,
    starts: np.ndarray,
    functionals: np.ndarray,
    observed: np.ndarray,
    inputs: np.ndarray,
    sensitive: bool,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, float]:
    """`propagate` of a `System`; see there for shapes."""
    return propagate(
        float(step), ORDER, np.ascontiguousarray(first, np.int64),
        np.ascontiguousarray(starts, float), functionals, np.ascontiguousarray(observed, np.int64),
        np.ascontiguousarray(inputs), sensitive, *compiled,
    )  # fmt: skip


# --- solutions of models with inputs ---


# Degree of the polynomial that an input is over a step: a cubic spline is hardly more than that
# over two of its samples.
DEGREE, SAMPLES_PER_STEP = 5, 2
# Truncation of a step's Taylor series, relative to the size of each state.
ACCURACY = 1e-10
SETTLED = 5  # halvings of the step, through which a solution that diverges does so at one time
FAR = 1e4  # of a state, from which its size says nothing about the accuracy before


def first_step(inputs: Sequence[Input]) -> float:
    """s, of the finest input: from one sample to the next where it jumps at them."""
    return min(
        (1 if one.between == "zero" else SAMPLES_PER_STEP) * float(np.median(np.diff(one.time)))
        for one in inputs
    )


@lru_cache(maxsize=2)  # of many models over the same times
def _over_windows(
    inputs: tuple[Input, ...], factors: tuple[Factor, ...], start: float, step: float, windows: int
) -> NDArray[np.float64]:
    return windowed(inputs, factors, start, step, windows, DEGREE)


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
    n_states, wanted = len(start), free is not None
    if not wanted:  # nor are terms that are not there
        model = model.without_absent_terms()
    table = tables(model.terms, n_states)
    columns = np.asarray(free).reshape(-1, 2) if wanted else np.empty((0, 2), int)
    compiled = system(table, model.coefficients, columns)
    diverged, longest, ends = None, step, []
    while (windows := max(1, int(np.ceil((time[-1] - time[0]) / step - 1e-9)))) <= most:
        place = (time - time[0]) / step
        window = np.minimum(place.astype(np.int64), windows - 1)
        row = np.arange(len(time)) - np.searchsorted(window, window)
        powers = np.zeros((windows, n_states, row.max() + 1, ORDER + 1))
        powers[window, :, row] = ((place - window)[:, None] ** np.arange(ORDER + 1))[:, None]
        with np.errstate(all="ignore"):
            found, slopes, _, _, truncation = integrate(
                compiled, step, np.array([0, windows]), start[None], powers, np.arange(n_states),
                _over_windows(tuple(inputs), table.factors, time[0], step, windows), wanted,
            )  # fmt: skip
        states, moved = found[window, :, row], slopes[window, :, row]
        near = np.all(np.abs(states) < FAR, axis=1)
        if near.all() and truncation < ACCURACY:
            return states, moved, step
        diverged = None if near.all() else (states, moved, longest)
        at = int(np.argmin(near))
        ends = [] if near.all() else [*ends[1 - SETTLED :], (time[max(at - 1, 0)], time[at])]
        if len(ends) == SETTLED and np.ptp(ends) <= 0.01 * (ends[-1][1] - time[0]):
            break
        step /= 2.0
    if diverged is not None:
        return diverged
    raise FloatingPointError(f"more than {most} integration steps")
