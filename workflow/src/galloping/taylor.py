"""Integration of polynomial systems, with their first-order sensitivities, by power series in time.

Each step yields the Taylor polynomial of the states over the whole step, and that of the
sensitivities where they are wanted (Jorba and Zou, Experiment. Math. 14, 2005). Two kinds of
steps are taken on the same series:

- `integrate`: equal steps of a given length, of segments with starts of their own; observations
  inside a step are linear functionals of its polynomial (see `condense`);
- `solve`: steps as long as double precision allows, of models without inputs.

The compiled functions stay together in this file: numba, which keeps them on disk, notices no edit
of a function that is imported from another file.
"""

from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from galloping.polynomial import PolynomialModel
from galloping.right_hand_side import System, system, tables, without_idle_monomials, workspace

ORDER = 12  # of the series in time


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
def _sensitivity_jets(s, jac, kind, theta, order, h, jacobian, jacobian_values, columns, weights):
    """Taylor coefficients of the sensitivities `s` (order+1, n_states, n_columns), row 0 given.

    jac: (order+1, n_states, n_states) those of the Jacobian, filled in place.
    """
    n_states, n_columns = s.shape[1], s.shape[2]
    jac[:] = 0.0
    for e in range(len(jacobian_values)):
        i, state, m = jacobian[e, 0], jacobian[e, 1], jacobian[e, 2]
        for k in range(order):
            jac[k, i, state] += jacobian_values[e] * theta[k, m]
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


# --- equal steps ---


@njit(cache=True, fastmath={"contract", "reassoc", "nsz", "arcp"}, error_model="numpy")
def propagate(
    h, first, starts, functionals, observed, inputs, sensitive,
    predictions, derivatives, ends, end_derivatives, size, truncation,
    x, theta, jac, s, kind,
    parent, factor, rates, rate_values, jacobian, jacobian_values, columns, weights,
):  # fmt: skip
    """Integrate segments of equal steps and apply linear functionals to every step.

    h: step (s). first: (n_segments + 1,) first step of each segment. starts: (n_segments,
    n_states). functionals: (n_steps, n_observed, n_rows, order + 1), applied to the Taylor
    coefficients in the scaled time tau = (t - t_step)/h. observed: (n_observed,) state of each
    channel. inputs: (n_steps, n_powers, n_factors) the factors of the inputs over each step, by
    powers of the same time. sensitive: whether the sensitivities are wanted.

    Filled in, zero before: predictions (n_steps, n_observed, n_rows), their derivatives (...,
    n_columns) with respect to the parameters of the columns and then the segment's initial states,
    the end states (n_segments, n_states) and their derivatives, and of each state (n_states,) the
    greatest size and the greatest truncation error of a step. States that overflow give inf or nan.
    Returns the largest truncation error relative to the size of each state. The rest: `Workspace`,
    `System`.
    """
    n_segments, n_states = starts.shape
    n_observed, n_rows = functionals.shape[1:3]
    order, n_columns = len(x) - 1, derivatives.shape[3]
    for g in range(n_segments):
        for i in range(n_states):  # assigning slices would double the time of compilation
            x[0, i] = starts[g, i]
            if sensitive:
                s[0, i, :] = 0.0
                s[0, i, n_columns - n_states + i] = 1.0
        for w in range(first[g], first[g + 1]):
            _jets(x, inputs[w], theta, order, h, parent, factor, rates, rate_values)
            for i in range(n_states):
                size[i] = max(size[i], abs(x[0, i]))
                truncation[i] = max(truncation[i], abs(x[order, i]))
            if sensitive:
                _sensitivity_jets(
                    s, jac, kind, theta, order, h, jacobian, jacobian_values, columns, weights
                )
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
    return relative


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
    """Integrate segments of equal steps of a `System`; shapes as of `propagate`.

    Returns the predictions, their derivatives, the end states, their derivatives, and the largest
    truncation error of a step relative to the size of each state.
    """
    n_segments, n_states = starts.shape
    own = workspace(compiled, ORDER, n_states, sensitive)
    n_columns = compiled.n_free + n_states if sensitive else 0
    predictions, ends = np.zeros(functionals.shape[:3]), np.zeros((n_segments, n_states))
    derivatives = np.zeros((*predictions.shape, n_columns))
    end_derivatives = np.zeros((n_segments, n_states, n_columns))
    size, truncation = np.zeros((2, n_states))
    relative = propagate(
        float(step), np.ascontiguousarray(first, np.int64), np.ascontiguousarray(starts, float),
        functionals, np.ascontiguousarray(observed, np.int64), np.ascontiguousarray(inputs),
        sensitive, predictions, derivatives, ends, end_derivatives, size, truncation, *own,
        *compiled,
    )  # fmt: skip
    return predictions, derivatives, ends, end_derivatives, relative


# --- steps as long as double precision allows ---


# Order of the series, and the size of the last terms kept, relative to the greatest.
PRECISE_ORDER, EPSILON = 20, 2.0**-52


class Ending(IntEnum):
    """Why a solution ends."""

    COMPLETE = 0
    TOO_MANY_STEPS = 1
    NOT_FINITE = 2
    BEYOND_LIMIT = 3


class Solution(NamedTuple):
    """Motion of a model, up to where it ended.

    states: (k, n_states) at the first k times. derivatives: (k, n_states, n_free + n_states) by
    the free coefficients and the start, of no columns where not wanted. end: s, where it ended.
    """

    states: NDArray[np.float64]
    derivatives: NDArray[np.float64]
    end: float
    ending: Ending


@njit(cache=True, error_model="numpy")
def _step_growth(series):
    """By how much the step may grow until the last two terms of every series are rounding errors.

    series: (order + 1, n), scaled to the step. Two terms, for every second one of an odd or even
    function is zero. Each series is judged by its own greatest term, whatever its unit. Returns 0
    where a term is not finite.
    """
    order = len(series) - 1
    before = last = EPSILON**2  # of the greatest: however few terms there are
    for i in range(series.shape[1]):
        greatest = 0.0
        for k in range(order - 1):
            term = abs(series[k, i])
            greatest = term if term > greatest else greatest
        penultimate, ultimate = abs(series[order - 1, i]), abs(series[order, i])
        if not penultimate + ultimate < np.inf:
            return 0.0
        if greatest > 0.0:
            before = penultimate / greatest if penultimate > before * greatest else before
            last = ultimate / greatest if ultimate > last * greatest else last
    growth, other = (EPSILON / before) ** (1.0 / (order - 1)), (EPSILON / last) ** (1.0 / order)
    return growth if growth < other else other


@njit(cache=True, error_model="numpy")
def _rescale(series, growth):
    """Scale series (order + 1, n) to a step that has grown."""
    power = 1.0
    for k in range(1, len(series)):
        power *= growth
        for i in range(series.shape[1]):
            series[k, i] *= power


@njit(cache=True, fastmath={"contract"}, error_model="numpy")
def _evaluate(series, places, totals, values):
    """Sum few series (order + 1, n) at parts (m,) of the step into values (m, n).

    totals: (m,) memory.
    """
    order = len(series) - 1
    for i in range(series.shape[1]):
        for r in range(len(places)):
            totals[r] = series[order, i]
        for k in range(order - 1, -1, -1):
            term = series[k, i]
            for r in range(len(places)):
                totals[r] = totals[r] * places[r] + term
        for r in range(len(places)):
            values[r, i] = totals[r]


@njit(cache=True, fastmath={"contract"}, error_model="numpy")
def _evaluate_once(series, place, values):
    """Sum many series (order + 1, n) at one part of the step into values (n,)."""
    order = len(series) - 1
    for i in range(len(values)):
        values[i] = series[order, i]
    for k in range(order - 1, -1, -1):
        for i in range(len(values)):
            values[i] = values[i] * place + series[k, i]


@njit(cache=True, error_model="numpy")
def _advance(series):
    """Put the sum of series (order + 1, n) at the end of the step in their first row."""
    order = len(series) - 1
    for k in range(order - 1, -1, -1):  # the smallest first
        for i in range(series.shape[1]):
            series[order, i] += series[k, i]
    for i in range(series.shape[1]):
        series[0, i] = series[order, i]


@njit(cache=True, error_model="numpy")
def _crossing(x, limit, values):
    """Part of the step after which the states are further than `limit` from zero; inf if never.

    A step is a fraction of the radius of convergence, over which a motion hardly bends: eight
    places show whether it crosses, and halving finds where. values: (n_states,) memory.
    """
    squares = 0.0
    for i in range(x.shape[1]):
        total = 0.0
        for k in range(len(x)):
            total += abs(x[k, i])
        squares += total * total
    if squares < limit * limit:
        return np.inf
    inside, beyond = 0.0, np.inf
    for trial in range(1, 60):
        place = trial / 8 if beyond == np.inf else (inside + beyond) / 2
        if place > 1.0:
            break
        _evaluate_once(x, place, values)
        squares = 0.0
        for i in range(len(values)):
            squares += values[i] * values[i]
        if squares < limit * limit:
            inside = place
        else:
            beyond = place
    return beyond


@njit(cache=True, error_model="numpy")
def _solve(
    h, time, most, limit, states, derivatives, places, totals, inputs, flat, x, theta, jac, s, kind,
    parent, factor, rates, rate_values, jacobian, jacobian_values, columns, weights,
):  # fmt: skip
    """Fill in states (n, n_states) and derivatives (n, n_states * n_columns) at `time` (n,).

    h: s, a step to begin with. places, totals: (n,) memory. flat: (order + 1, n_states * n_columns)
    the memory of `s`. s: None where no derivatives are wanted: then nothing of them is compiled.
    The motion starts from the first rows of x and s. The rest: `solve`, `Workspace`, `System`.
    Returns how many times were reached, where the motion ended, and the value of its `Ending`.
    """
    row, start = 0, time[0]
    for _ in range(most):
        _jets(x, inputs, theta, len(x) - 1, h, parent, factor, rates, rate_values)
        if s is not None:
            _sensitivity_jets(
                s, jac, kind, theta, len(x) - 1, h, jacobian, jacobian_values, columns, weights
            )
        end = start
        for _ in range(32):  # once or twice, but for the first step
            growth, other = _step_growth(x), _step_growth(flat)
            end = start + h * (growth if growth < other else other)
            end = end if end < time[-1] else time[-1]
            growth = (end - start) / h  # a step ends at a number, so that no time is lost
            h = end - start
            if not h > 0.0:
                return row, start, Ending.NOT_FINITE
            _rescale(x, growth)
            _rescale(flat, growth)
            if 0.9 < growth < 1.1:
                break
        crossing = _crossing(x, limit, states[row])
        if crossing <= 1.0:
            end = start + crossing * h
        first = row
        while row < len(time) and time[row] <= end:
            places[row - first] = (time[row] - start) / h
            _evaluate_once(flat, places[row - first], derivatives[row])
            row += 1
        _evaluate(x, places[: row - first], totals, states[first:row])
        if crossing <= 1.0:
            return row, end, Ending.BEYOND_LIMIT
        if row == len(time):
            return row, end, Ending.COMPLETE
        _advance(x)
        _advance(flat)
        start = end
    return row, start, Ending.TOO_MANY_STEPS


def solve(
    model: PolynomialModel,
    start: NDArray[np.float64],
    time: NDArray[np.float64],
    most: int,
    free: NDArray[np.int_] | None = None,
    limit: float = np.inf,
) -> Solution:
    """Solve a model without inputs to double precision.

    Parameters
    ----------
    start : (n_states,) at time[0].
    time : (n,) s, increasing.
    most : greatest number of steps.
    free : (n_free, 2) pairs (equation, term) of the coefficients to differentiate by. The
        derivatives by the start come with them; none are computed without `free`.
    limit : distance of the states from zero at which the solution ends.
    """
    n_states, sensitive = len(model.states), free is not None
    pairs = np.asarray(free).reshape(-1, 2) if sensitive else np.empty((0, 2), int)
    compiled = system(tables(model.terms, n_states), model.coefficients, pairs)
    compiled = without_idle_monomials(compiled, sensitive)
    own = workspace(compiled, PRECISE_ORDER, n_states, sensitive)
    own.x[0] = start
    if sensitive:
        own.s[0, :, len(pairs) : len(pairs) + n_states] = np.eye(n_states)
    flat = own.s.reshape(PRECISE_ORDER + 1, -1)
    states, derivatives = np.zeros((len(time), n_states)), np.zeros((len(time), flat.shape[1]))
    if time[-1] > time[0]:
        with np.errstate(over="ignore", invalid="ignore"):
            size, rate = np.linalg.norm(start), np.linalg.norm(model(own.x[:1]))
        step = size / rate if size > 0.0 and rate > 0.0 else time[-1] - time[0]
        if not sensitive:
            own = own._replace(s=None)
        count, end, ending = _solve(
            float(step), np.array(time, float), most, float(limit), states, derivatives,
            *np.empty((2, len(time))), np.zeros((1, 0)), flat, *own, *compiled,
        )  # fmt: skip
    else:
        states[:], derivatives[:] = start, flat[0]
        count, end, ending = len(time), float(time[0]), Ending.COMPLETE
    by = compiled.n_free + n_states if sensitive else 0
    derivatives = derivatives.reshape(len(time), n_states, -1)[:count, :, :by]
    return Solution(states[:count], derivatives, end, Ending(ending))
