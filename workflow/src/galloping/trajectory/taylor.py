"""Integration of models, with their first-order sensitivities, by power series in time.

Each step yields the Taylor polynomial of the states over the whole step, and that of the
sensitivities where they are wanted (Jorba and Zou, Experiment. Math. 14, 2005). Two kinds of
steps are taken on the same series:

- `integrate`: equal steps of a given length, of segments with starts of their own; observations
  inside a step are linear functionals of its polynomial (see `condense`);
- `solve`: steps as long as double precision allows, of models without inputs.

Elementary functions of states are further signals, with series by the differential equations that
they obey (R. E. Moore, Interval Analysis, 1966): for e = exp(u), de/dt = e du/dt. Where a term has
a kink, |u| or sign(u), a series ends at the zero of u and another begins there. A zero to which the
motion returns from both sides is stuck to, as by dry friction: then sign(u) is the number that
keeps u at zero, while it is between -1 and 1 (A. F. Filippov, Differential Equations with
Discontinuous Righthand Sides, 1988).

Libraries with functions are compiled for apart, at their first use. The compiled functions stay
together in this file: numba, which keeps them on disk, notices no edit of a function that is
imported from another file.
"""

from enum import IntEnum
from math import comb
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from galloping.model.polynomial import PolynomialModel
from galloping.trajectory.right_hand_side import (
    System,
    compile_system,
    make_tables,
    make_workspace,
    without_idle_monomials,
)

# As `right_hand_side.CODES`: compiled functions read no constants of other modules.
SIN, COS, EXP, ABS, SIGN, INVERSE = range(6)

ORDER = 12  # order of the series in time
PRECISE_ORDER = 20  # order of the series in time at full precision
EPSILON = 2.0**-52  # size of the last terms of that series, relative to the greatest
MAX_PIECES = 64  # largest number of pieces between kinks in an equal step; more need a shorter step
BINOMIALS = np.array(
    [[comb(n, k) for k in range(PRECISE_ORDER + 1)] for n in range(PRECISE_ORDER + 1)], float
)
# numba's options of relaxed arithmetic. A function with such options is inlined if others call it:
# numba optimises it once in the process that compiles it, and twice in the code that is cached,
# which then has other last bits.
RELAXED = {"contract", "reassoc", "nsz", "arcp"}


# --- series of one step ---


@njit(cache=True, forceinline=True, fastmath=RELAXED, error_model="numpy")
def _fill_monomials(k, x, inputs, theta, parent, factor):
    """Fill Taylor coefficients of order k of monomials, from those of signals, into `theta`."""
    n_signals, n_monomials, order = x.shape[1], len(parent), theta.shape[1] - 1
    for i in range(n_signals):
        theta[n_monomials + i, order - k] = x[k, i]
    theta[0, k] = 1.0 if k == 0 else 0.0
    for m in range(1, n_monomials):
        if factor[m] >= n_signals:
            theta[m, k] = inputs[k, factor[m] - n_signals] if k < len(inputs) else 0.0
        elif parent[m] == 0:
            theta[m, k] = x[k, factor[m]]
        else:
            ascending, descending = theta[parent[m]], theta[n_monomials + factor[m], order - k :]
            total = 0.0
            for j in range(k + 1):
                total += ascending[j] * descending[j]
            theta[m, k] = total


@njit(cache=True, error_model="numpy")
def _fill_functions(k, x, u, modes, signals):
    """Fill Taylor coefficients of order k of arguments and of their functions.

    Arguments go into `u` (order+1, n_arguments), functions into the last columns of `x`; signs of
    sticking arguments, of mode 0, are zero at first.
    """
    n_arguments, n_states = signals.weights.shape
    for a in range(n_arguments):
        u[k, a] = signals.offsets[a] if k == 0 else 0.0
        for i in range(n_states):
            u[k, a] += signals.weights[a, i] * x[k, i]
    for f in range(len(signals.kind)):
        kind, a, own = signals.kind[f], signals.argument[f], n_states + f
        total = 0.0
        if kind == ABS:
            total = modes[a] * u[k, a]
        elif kind == SIGN:
            total = modes[a] if k == 0 else 0.0
        elif k == 0:
            if kind == SIN:
                total = np.sin(u[0, a])
            elif kind == COS:
                total = np.cos(u[0, a])
            elif kind == EXP:
                total = np.exp(u[0, a])
            else:
                total = 1.0 / u[0, a]
        elif kind == INVERSE:
            for j in range(1, k + 1):
                total -= u[j, a] * x[k - j, own]
            total *= x[0, own]
        else:
            other = n_states + signals.partner[f]
            for j in range(1, k + 1):
                total += j * u[j, a] * x[k - j, other]
            total /= -k if kind == COS else k
        x[k, own] = total


@njit(cache=True, error_model="numpy")
def _solve_linear(matrix, right):
    """Divide `right` (n, m) by a small matrix (n, n), both in place, by Gauss elimination."""
    n = len(matrix)
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(matrix[i, k]) > abs(matrix[best, k]):
                best = i
        for j in range(n):
            matrix[k, j], matrix[best, j] = matrix[best, j], matrix[k, j]
        for j in range(right.shape[1]):
            right[k, j], right[best, j] = right[best, j], right[k, j]
        for i in range(n):
            if i != k:
                ratio = matrix[i, k] / matrix[k, k]
                for j in range(k, n):
                    matrix[i, j] -= ratio * matrix[k, j]
                for j in range(right.shape[1]):
                    right[i, j] -= ratio * right[k, j]
    for k in range(n):
        for j in range(right.shape[1]):
            right[k, j] /= matrix[k, k]


@njit(cache=True, error_model="numpy")
def _fill_rates(k, theta, rates, rate_values, out):
    """Fill Taylor coefficients of order k of the rates of the states, from those of monomials."""
    r = 0
    for i in range(len(out)):
        total = 0.0
        while r < len(rate_values) and rates[r, 0] == i:  # sorted by equation
            total += rate_values[r] * theta[rates[r, 1], k]
            r += 1
        out[i] = total


@njit(cache=True, error_model="numpy")
def _fill_slides(k, theta, signals, out):
    """Fill the derivative of order k of each equation by each sign(u) into `out` (n_states, n)."""
    out[:] = 0.0
    for r in range(len(signals.slide_values)):
        i, kink, m = signals.slides[r]
        out[i, kink] += signals.slide_values[r] * theta[m, k]


@njit(cache=True, error_model="numpy")
def _balance_signs(signals, stuck, slides, rate):
    """Make the linear system of the signs that keep arguments in place.

    Returns matrix (n, n) and right-hand side (n, 1). stuck: (n,) indices of the arguments. slides:
    of `_fill_slides`. rate: of `_fill_rates` without these signs.
    """
    n = len(stuck)
    matrix, right = np.zeros((n, n)), np.zeros((n, 1))
    for a in range(n):
        for i in range(len(rate)):
            weight = signals.weights[stuck[a], i]
            right[a, 0] -= weight * rate[i]
            for b in range(n):
                matrix[a, b] += weight * slides[i, stuck[b]]
    return matrix, right


@njit(cache=True, forceinline=True, fastmath=RELAXED, error_model="numpy")
def _fill_jets(
    x, inputs, theta, order, h, n_states, parent, factor, rates, rate_values, u, modes, signals
):
    """Fill Taylor coefficients (scaled by h^k) of the signals `x` and the monomials `theta`.

    x: (order+1, n_states + n_functions), the states of row 0 given. x, theta and u: (order+1,
    n_arguments) are filled in place. inputs: (n_powers, n_factors) those of
    the factors of the inputs. modes: (n_kinks,) the sign of each argument with a kink, 0 if it
    sticks.
    """
    if signals is not None:
        stuck = np.flatnonzero(modes == 0.0)
        slides, rate = np.zeros((n_states, len(modes))), np.zeros(n_states)
    for k in range(order + 1):
        if signals is not None:
            _fill_functions(k, x, u, modes, signals)
        _fill_monomials(k, x, inputs, theta, parent, factor)
        if signals is not None and len(stuck) and k < order:
            if k == 0:
                _fill_slides(0, theta, signals, slides)
            _fill_rates(k, theta, rates, rate_values, rate)
            matrix, right = _balance_signs(signals, stuck, slides, rate)
            _solve_linear(matrix, right)
            for a in range(len(stuck)):
                x[k, n_states + signals.sign[stuck[a]]] = right[a, 0]
            _fill_monomials(k, x, inputs, theta, parent, factor)
        if k < order:
            _fill_rates(k, theta, rates, rate_values, x[k + 1, :n_states])
            for i in range(n_states):
                x[k + 1, i] *= h / (k + 1)


@njit(cache=True, forceinline=True, fastmath={"contract", "nsz", "arcp"}, error_model="numpy")
def _sensitivity_jets(
    s, jac, kind, theta, order, h, jacobian, jacobian_values, columns, weights, modes, signals
):
    """Fill Taylor coefficients of the sensitivities `s` (order+1, n_states, n_columns) after row 0.

    jac: (order+1, n_states, n_states) those of the Jacobian, filled in place.
    """
    n_states, n_columns = s.shape[1], s.shape[2]
    jac[:] = 0.0
    for e in range(len(jacobian_values)):
        i, state, m = jacobian[e, 0], jacobian[e, 1], jacobian[e, 2]
        for k in range(order):
            jac[k, i, state] += jacobian_values[e] * theta[m, k]
    if signals is not None:
        stuck = np.flatnonzero(modes == 0.0)
        if len(stuck):
            slides = np.zeros((order, n_states, len(modes)))
            signs = np.zeros((order, len(stuck), n_columns))
            for k in range(order):
                _fill_slides(k, theta, signals, slides[k])
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
            s[k + 1, columns[c, 0], columns[c, 2]] += weight * theta[columns[c, 1], k]
        if signals is not None and len(stuck):
            _hold_sensitivities(k, s, slides, signs, stuck, scale, signals)


@njit(cache=True, error_model="numpy")
def _hold_sensitivities(k, s, slides, signs, stuck, scale, signals):
    """Add the effect of signs that keep arguments at zero to sensitivities of order k + 1.

    The sensitivities of these signs, of order k, are filled into `signs`.
    """
    n_states, n_columns, n = s.shape[1], s.shape[2], len(stuck)
    for j in range(1, k + 1):
        for b in range(n):
            for i in range(n_states):
                weight = scale * slides[j, i, stuck[b]]
                if weight != 0.0:
                    for c in range(n_columns):
                        s[k + 1, i, c] += weight * signs[k - j, b, c]
    matrix, _ = _balance_signs(signals, stuck, slides[0], np.zeros(n_states))
    right = np.zeros((n, n_columns))
    for a in range(n):
        for i in range(n_states):
            weight = signals.weights[stuck[a], i] / scale
            for c in range(n_columns):
                right[a, c] -= weight * s[k + 1, i, c]
    _solve_linear(matrix, right)
    signs[k] = right
    for b in range(n):
        for i in range(n_states):
            weight = scale * slides[0, i, stuck[b]]
            for c in range(n_columns):
                s[k + 1, i, c] += weight * right[b, c]


@njit(cache=True, error_model="numpy")
def _first_negative(series):
    """Find the least time in [0, 1] from which a polynomial is negative, 2 if it never is.

    series: (order+1,) its coefficients; 2 too if they are not finite. It is bounded by its
    Bernstein coefficients on ever smaller intervals (G. Farin, Curves and Surfaces for CAGD, 2002,
    ch. 6), so that no root is missed.
    """
    n, most = len(series), 48  # halvings, to some roundings
    heap = np.empty((most + 2, n))
    places, widths = np.empty(most + 2), np.empty(most + 2)
    for i in range(n):
        heap[0, i] = 0.0
        for k in range(i + 1):
            heap[0, i] += series[k] * BINOMIALS[i, k] / BINOMIALS[n - 1, k]
        if not abs(heap[0, i]) < np.inf:
            return 2.0
    places[0], widths[0], top = 0.0, 1.0, 0
    while top >= 0:
        here = heap[top]
        if here.min() >= 0.0:
            top -= 1
            continue
        if widths[top] < 0.5**most:
            return places[top]
        after = heap[top + 1]  # the left half, looked at first; the right one stays
        for level in range(n):
            after[level] = here[0]
            for i in range(n - 1 - level):
                here[i] = 0.5 * (here[i] + here[i + 1])
        widths[top] *= 0.5
        places[top + 1], widths[top + 1] = places[top], widths[top]
        places[top] += widths[top]
        top += 1
    return 2.0


@njit(cache=True, error_model="numpy")
def _next_kink(x, u, n_states, modes, fresh, signals):
    """Find when in a step the first argument with a kink passes zero or ceases to stick.

    Returns the share of the step, 2 if none does, and the argument's index. fresh: (n_kinks,)
    number of derivatives of each argument, from itself on, that are zero at the beginning.
    """
    order = len(x) - 1
    first, which = 2.0, -1
    series = np.zeros(order + 1)
    for kink in range(len(modes)):
        if modes[kink] != 0.0:
            for k in range(order + 1):
                series[k] = modes[kink] * u[k, kink] if k >= fresh[kink] else 0.0
            at = _first_negative(series)
            if at < first:
                first, which = at, kink
            continue
        own = n_states + signals.sign[kink]
        for side in (-1.0, 1.0):
            series[0] = max(1.0 - side * x[0, own], 0.0)
            for k in range(1, order):
                series[k] = -side * x[k, own]
            series[order] = 0.0
            at = _first_negative(series)
            if at < first:
                first, which = at, kink
    return first, which


@njit(cache=True, error_model="numpy")
def _settle_modes(x, inputs, theta, parent, factor, rates, rate_values, u, modes, fresh, signals):
    """Decide in which direction arguments of mode 0 leave their zeros, and fill their modes.

    An argument sticks if the equations on both sides lead back; else it leaves to the side to which
    they lead. Returns the rates (n_states,) of the states then.
    """
    n_states = signals.weights.shape[1]
    slides, rate = np.zeros((n_states, len(modes))), np.zeros(n_states)
    while True:
        stuck = np.flatnonzero(modes == 0.0)
        _fill_functions(0, x, u, modes, signals)
        _fill_monomials(0, x, inputs, theta, parent, factor)
        _fill_rates(0, theta, rates, rate_values, rate)
        _fill_slides(0, theta, signals, slides)
        matrix, right = _balance_signs(signals, stuck, slides, rate)
        leaving, side, most = -1, 0.0, 1.0
        for a in range(len(stuck)):
            if not matrix[a, a] < 0.0:  # no sign leads back
                leaving, side = a, -right[a, 0]
        if leaving < 0:
            _solve_linear(matrix, right)
            for a in range(len(stuck)):
                if not abs(right[a, 0]) <= most:
                    leaving, side, most = a, right[a, 0], abs(right[a, 0])
        if leaving < 0:
            break
        modes[stuck[leaving]] = -1.0 if side < 0.0 else 1.0
        fresh[stuck[leaving]] = 1
    for a in range(len(stuck)):
        x[0, n_states + signals.sign[stuck[a]]] = right[a, 0]
    _fill_monomials(0, x, inputs, theta, parent, factor)
    _fill_rates(0, theta, rates, rate_values, rate)
    return rate


@njit(cache=True, error_model="numpy")
def _cross_kink(s, n_columns, before, after, weights):
    """Update sensitivities across a kink. before, after: (n_states,) rates of the states."""
    pace = 0.0
    for i in range(len(before)):
        pace += weights[i] * before[i]
    for c in range(n_columns if pace != 0.0 else 0):
        early = 0.0
        for i in range(len(before)):
            early += weights[i] * s[0, i, c]
        for i in range(len(before)):
            s[0, i, c] += (after[i] - before[i]) * early / pace


@njit(cache=True, error_model="numpy")
def _begin_modes(
    x, s, n_columns, inputs, theta, parent, factor, rates, rate_values, u, modes, fresh, signals
):
    """Fill the modes of arguments with a kink at the beginning of a motion.

    Sensitivities to a sticking initial state are those of its approach from beside.
    """
    for kink in range(len(modes)):
        argument = signals.offsets[kink]
        for i in range(signals.weights.shape[1]):
            argument += signals.weights[kink, i] * x[0, i]
        modes[kink], fresh[kink] = np.sign(argument), 0
    if len(modes):
        after = _settle_modes(
            x, inputs, theta, parent, factor, rates, rate_values, u, modes, fresh, signals
        )
        if s is not None and n_columns:
            for kink in np.flatnonzero(modes == 0.0):
                modes[kink], before = 1.0, np.zeros(len(after))
                _fill_functions(0, x, u, modes, signals)
                _fill_monomials(0, x, inputs, theta, parent, factor)
                _fill_rates(0, theta, rates, rate_values, before)
                _cross_kink(s, n_columns, before, after, signals.weights[kink])
                modes[kink] = 0.0


@njit(cache=True, error_model="numpy")
def _shift_polynomial(powers, by):
    """Rewrite a polynomial on [0, 1], (n_powers, n), in the time since `by` over 1 - by."""
    found = np.zeros(powers.shape)
    for m in range(len(powers)):
        for k in range(m, len(powers)):
            found[m] += BINOMIALS[k, m] * by ** (k - m) * (1.0 - by) ** m * powers[k]
    return found


@njit(cache=True, error_model="numpy")
def _pass_step(
    x, s, n_columns, share, kink, length, theta, parent, factor, rates, rate_values, u, modes,
    fresh, signals, driven,
):  # fmt: skip
    """Move states and sensitivities to a kink, a share of the series, and across it.

    A motion that reaches the zero of an argument crosses it or sticks there, and one that stuck
    leaves it. Sensitivities change by those of the time of arrival, times the change of the rates
    (saltation; M. di Bernardo et al., Piecewise-smooth Dynamical Systems, 2008, ch. 2). n_columns:
    of the sensitivities, 0 if they are not needed and `s` may be None. driven: (n_powers,
    n_factors) of the inputs, as of `propagate`, after the kink.
    """
    n_states, order = signals.weights.shape[1], len(x) - 1
    before, power = np.zeros(n_states), 1.0
    side = x[0, n_states + signals.sign[kink]] if modes[kink] == 0.0 else 0.0
    for k in range(1, order + 1):
        for i in range(n_states):
            before[i] += k * power / length * x[k, i]
        if modes[kink] == 0.0:
            side += power * share * x[k, n_states + signals.sign[kink]]
        power *= share
        for i in range(n_states):
            x[0, i] += power * x[k, i]
            if s is not None:
                for c in range(n_columns):
                    s[0, i, c] += power * s[k, i, c]
    if share > 0.0:
        fresh[:] = 0
    if modes[kink] == 0.0:
        modes[kink], fresh[kink] = np.sign(side), 2
        return
    modes[kink] = 0.0
    after = _settle_modes(
        x, driven, theta, parent, factor, rates, rate_values, u, modes, fresh, signals
    )
    if s is not None:
        _cross_kink(s, n_columns, before, after, signals.weights[kink])


@njit(cache=True, error_model="numpy")
def _read_samples(
    samples, w, begin, end, length, x, s, observed, n_columns, predictions, derivatives
):
    """Add the samples of a window between two of its times to functionals of the window.

    length: s, of the series, which begin at `begin` and extend to the end of the window.
    """
    order = len(x) - 1
    at = np.zeros(order + 1)
    for n in range(samples.offsets[w], samples.offsets[w + 1]):
        tau = samples.tau[n]
        if not tau < end or (tau < begin and begin > 0.0):  # by rounding tau may be below zero
            continue
        place = (tau - begin) / (1.0 - begin)
        for o in range(len(observed)):
            derivative, state = samples.order[o], observed[o]
            for k in range(order + 1):
                at[k] = 0.0
                if k >= derivative:
                    at[k] = place ** (k - derivative) / length**derivative
                    for j in range(derivative):
                        at[k] *= k - j
            value = 0.0
            for k in range(order + 1):
                value += at[k] * x[k, state]
            for r in range(samples.basis.shape[2]):
                weight = samples.basis[n, o, r]
                if weight == 0.0:
                    continue
                predictions[o, r] += weight * value
                for k in range(order + 1 if n_columns else 0):
                    source = s[k, state]
                    for c in range(n_columns):
                        derivatives[o, r, c] += weight * at[k] * source[c]


class Samples(NamedTuple):
    """Sample times in each integration step, and their weights in linear functionals.

    offsets: (n_windows + 1,) first sample of each window. tau: (n_samples,) times in their windows,
    0 to 1. basis: (n_samples, n_observed, n_rows) weights of a sample in each functional. order:
    (n_observed,) of the time derivative that each channel measures.
    """

    offsets: np.ndarray
    tau: np.ndarray
    basis: np.ndarray
    order: np.ndarray


# --- equal steps ---


@njit(cache=True, fastmath=RELAXED, error_model="numpy")
def propagate(
    h, first, starts, functionals, observed, inputs, sensitive, samples,
    predictions, derivatives, ends, end_derivatives, size, truncation,
    x, theta, jac, s, kind, u, modes, fresh,
    parent, factor, rates, rate_values, jacobian, jacobian_values, columns, weights, signals,
):  # fmt: skip
    """Integrate trajectory segments in equal Taylor steps, and apply linear functionals to them.

    h: step (s). first: (n_segments + 1,) first step of each segment. starts: (n_segments,
    n_states). functionals: (n_steps, n_observed, n_rows, order + 1), applied to the Taylor
    coefficients in the scaled time tau = (t - t_step)/h. observed: (n_observed,) state of each
    channel. inputs: (n_steps, n_powers, n_factors) the factors of the inputs over each step, by
    powers of the same time. sensitive: whether to compute the sensitivities. samples: whose sums
    are the functionals, if terms have kinks, else None.

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
        if signals is not None and first[g] < first[g + 1]:
            _begin_modes(
                x, s, n_columns, inputs[first[g]], theta, parent, factor, rates, rate_values, u,
                modes, fresh, signals,
            )  # fmt: skip
        for w in range(first[g], first[g + 1]):
            begin, driven = 0.0, inputs[w]
            for piece in range(MAX_PIECES):
                length, share, kink = h * (1.0 - begin), 2.0, -1
                _fill_jets(
                    x, driven, theta, order, length, n_states, parent, factor, rates, rate_values,
                    u, modes, signals,
                )  # fmt: skip
                if signals is not None:
                    share, kink = _next_kink(x, u, n_states, modes, fresh, signals)
                    if share <= 1.0 and piece == MAX_PIECES - 1:
                        share, truncation[0] = 2.0, np.inf
                for i in range(n_states):
                    size[i] = max(size[i], abs(x[0, i]))
                    if share > 1.0:
                        truncation[i] = max(truncation[i], abs(x[order, i]))
                    else:
                        truncation[i] = max(truncation[i], abs(x[order, i]) * share**order)
                if sensitive:
                    _sensitivity_jets(
                        s, jac, kind, theta, order, length, jacobian, jacobian_values, columns,
                        weights, modes, signals,
                    )  # fmt: skip
                in_pieces = begin > 0.0 or share <= 1.0
                if samples is not None and in_pieces:
                    end = np.inf if share > 1.0 else begin + (1.0 - begin) * share
                    _read_samples(
                        samples, w, begin, end, length, x, s, observed, n_columns, predictions[w],
                        derivatives[w],
                    )  # fmt: skip
                if not in_pieces:
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
                if share > 1.0:
                    for k in range(1, order + 1):
                        for i in range(n_states):
                            x[0, i] += x[k, i]
                            if sensitive:
                                for c in range(n_columns):
                                    s[0, i, c] += s[k, i, c]
                    fresh[:] = 0
                    break
                if signals is not None:
                    _pass_step(
                        x, s, n_columns, share, kink, length, theta, parent, factor, rates,
                        rate_values, u, modes, fresh, signals, _shift_polynomial(driven, share),
                    )  # fmt: skip
                    begin += (1.0 - begin) * share
                    driven = _shift_polynomial(inputs[w], begin)
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
    samples: Samples | None = None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, float]:
    """Integrate trajectory segments of a compiled model; return predictions and sensitivities.

    The shapes are those of `propagate`. Returns the predictions, their derivatives, the end states,
    their derivatives, and the largest truncation error of a step relative to the size of each
    state.
    """
    n_segments, n_states = starts.shape
    workspace = make_workspace(compiled, ORDER, n_states, sensitive)
    n_columns = compiled.n_free + n_states if sensitive else 0
    predictions, ends = np.zeros(functionals.shape[:3]), np.zeros((n_segments, n_states))
    derivatives = np.zeros((*predictions.shape, n_columns))
    end_derivatives = np.zeros((n_segments, n_states, n_columns))
    size, truncation = np.zeros((2, n_states))
    relative = propagate(
        float(step), np.ascontiguousarray(first, np.int64), np.ascontiguousarray(starts, float),
        functionals, np.ascontiguousarray(observed, np.int64), np.ascontiguousarray(inputs),
        sensitive, samples, predictions, derivatives, ends, end_derivatives, size, truncation,
        *workspace, *compiled,
    )  # fmt: skip
    return predictions, derivatives, ends, end_derivatives, relative


def at_points(
    compiled: System, window: np.ndarray, tau: np.ndarray, windows: int, n_states: int
) -> tuple[np.ndarray, Samples | None, np.ndarray]:
    """Make linear functionals that evaluate the Taylor series of integration steps at given times.

    window: (n,) the step of each point, non-decreasing. tau: (n,) its time in the step, 0 to 1.
    Returns arguments of `integrate`, functionals of all states (windows, n_states, n_rows, ORDER +
    1) and samples, and of each point (n,) its row.
    """
    row = np.arange(len(window)) - np.searchsorted(window, window)
    functionals = np.zeros((windows, n_states, row.max() + 1, ORDER + 1))
    functionals[window, :, row] = (tau[:, None] ** np.arange(ORDER + 1))[:, None]
    if compiled.signals is None or not compiled.signals.n_kinks:
        return functionals, None, row
    basis = np.zeros((len(window), n_states, row.max() + 1))
    basis[np.arange(len(window)), :, row] = 1.0
    offsets = np.searchsorted(window, np.arange(windows + 1))
    samples = Samples(offsets, np.asarray(tau, float), basis, np.zeros(n_states, np.int64))
    return functionals, samples, row


# --- steps as long as double precision allows ---


class Ending(IntEnum):
    """Reason why an integration ended."""

    COMPLETE = 0
    TOO_MANY_STEPS = 1
    NOT_FINITE = 2
    BEYOND_LIMIT = 3


class Solution(NamedTuple):
    """Solution of a model: states, sensitivities, and time and reason of the end.

    states: (k, n_states) at the first k times. derivatives: (k, n_states, n_free + n_states) by the
    free coefficients and the start, without columns if not computed. end: s, time of the end.
    """

    states: NDArray[np.float64]
    derivatives: NDArray[np.float64]
    end: float
    ending: Ending


@njit(cache=True, error_model="numpy")
def _step_growth(series):
    """Compute the growth of the step at which the last two terms of every series are rounding.

    series: (order + 1, n), scaled to the step. Two terms, since every second one of an odd or even
    function is zero. Each series is compared with its own greatest term, in any unit. Returns 0 if
    a term is not finite.
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
def _rescale_series(series, growth):
    """Scale series (order + 1, n) to a step that has grown."""
    power = 1.0
    for k in range(1, len(series)):
        power *= growth
        for i in range(series.shape[1]):
            series[k, i] *= power


@njit(cache=True, forceinline=True, fastmath={"contract"}, error_model="numpy")
def _evaluate_series(series, places, totals, values):
    """Sum few series (order + 1, n) at parts (m,) of the step into values (m, n).

    totals: (m,) memory.
    """
    order = len(series) - 1
    for i in range(values.shape[1]):
        for r in range(len(places)):
            totals[r] = series[order, i]
        for k in range(order - 1, -1, -1):
            term = series[k, i]
            for r in range(len(places)):
                totals[r] = totals[r] * places[r] + term
        for r in range(len(places)):
            values[r, i] = totals[r]


@njit(cache=True, forceinline=True, fastmath={"contract"}, error_model="numpy")
def _evaluate_once(series, place, values):
    """Sum many series (order + 1, n) at one part of the step into values (n,)."""
    order = len(series) - 1
    for i in range(len(values)):
        values[i] = series[order, i]
    for k in range(order - 1, -1, -1):
        for i in range(len(values)):
            values[i] = values[i] * place + series[k, i]


@njit(cache=True, error_model="numpy")
def _advance_series(series):
    """Write the sum of series (order + 1, n) at the end of the step to their first row."""
    order = len(series) - 1
    for k in range(order - 1, -1, -1):  # the smallest first
        for i in range(series.shape[1]):
            series[order, i] += series[k, i]
    for i in range(series.shape[1]):
        series[0, i] = series[order, i]


@njit(cache=True, error_model="numpy")
def _find_crossing(x, limit, values):
    """Find the part of the step after which the states exceed `limit`; inf if never.

    A step is a fraction of the radius of convergence, over which a motion hardly bends: eight
    points show whether it crosses, and bisection finds where. values: (n_states,) memory.
    """
    squares = 0.0
    for i in range(len(values)):
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
def _solve_compiled(
    h, time, most, limit, states, derivatives, places, totals, inputs, flat,
    x, theta, jac, s, kind, u, modes, fresh,
    parent, factor, rates, rate_values, jacobian, jacobian_values, columns, weights, signals,
):  # fmt: skip
    """Fill in states (n, n_states) and derivatives (n, n_states * n_columns) at `time` (n,).

    h: s, initial step. places, totals: (n,) memory. flat: (order + 1, n_states * n_columns) the
    memory of `s`. s: None without derivatives: then nothing of them is compiled. The motion starts
    from the first rows of x and s. The rest: `solve`, `Workspace`, `System`. Returns the number of
    times reached, the time of the end, and the value of its `Ending`.
    """
    row, start, n_states = 0, time[0], states.shape[1]
    if signals is not None:
        _begin_modes(
            x, s, flat.shape[1] // n_states, inputs, theta, parent, factor, rates, rate_values, u,
            modes, fresh, signals,
        )  # fmt: skip
    for _ in range(most):
        _fill_jets(
            x, inputs, theta, len(x) - 1, h, n_states, parent, factor, rates, rate_values, u, modes,
            signals,
        )  # fmt: skip
        if s is not None:
            _sensitivity_jets(
                s, jac, kind, theta, len(x) - 1, h, jacobian, jacobian_values, columns, weights,
                modes, signals,
            )  # fmt: skip
        end = start
        for _ in range(32):  # once or twice, but for the first step
            growth, other = _step_growth(x), _step_growth(flat)
            end = start + h * (growth if growth < other else other)
            end = end if end < time[-1] else time[-1]
            growth = (end - start) / h  # a step ends at a number, so that no time is lost
            h = end - start
            if not h > 0.0:
                return row, start, Ending.NOT_FINITE
            _rescale_series(x, growth)
            _rescale_series(flat, growth)
            if signals is not None:
                _rescale_series(u, growth)
            if 0.9 < growth < 1.1:
                break
        share, kink = 2.0, -1
        if signals is not None:
            share, kink = _next_kink(x, u, n_states, modes, fresh, signals)
            if share <= 1.0:
                end = start + share * h
        crossing = _find_crossing(x, limit, states[row])
        crossing = np.inf if crossing > share else crossing
        if crossing <= 1.0:
            end = start + crossing * h
        first = row
        while row < len(time) and time[row] <= end:
            places[row - first] = (time[row] - start) / h
            _evaluate_once(flat, places[row - first], derivatives[row])
            row += 1
        _evaluate_series(x, places[: row - first], totals, states[first:row])
        if crossing <= 1.0:
            return row, end, Ending.BEYOND_LIMIT
        if row == len(time):
            return row, end, Ending.COMPLETE
        if signals is not None and share <= 1.0:
            _pass_step(
                x, s, flat.shape[1] // n_states, share, kink, h, theta, parent, factor, rates,
                rate_values, u, modes, fresh, signals, inputs,
            )  # fmt: skip
        else:
            _advance_series(x)
            _advance_series(flat)
            fresh[:] = 0
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
    """Integrate a model without inputs from an initial state to double precision.

    A kink, which ends a step, is located to the rounding error of the step. start: (n_states,) at
    time[0]. time: (n,) s, increasing. most: greatest number of steps. free: (n_free, 2) pairs
    (equation, term) of the coefficients to differentiate by. The derivatives by the start come with
    them; none are computed without `free`. limit: distance of the states from zero at which the
    solution ends.
    """
    n_states, sensitive = len(model.states), free is not None
    pairs = np.asarray(free).reshape(-1, 2) if sensitive else np.empty((0, 2), int)
    compiled = compile_system(make_tables(model.terms, n_states), model.coefficients, pairs)
    compiled = without_idle_monomials(compiled, sensitive)
    workspace = make_workspace(compiled, PRECISE_ORDER, n_states, sensitive)
    workspace.x[0, :n_states] = start
    if sensitive:
        workspace.s[0, :, len(pairs) : len(pairs) + n_states] = np.eye(n_states)
    flat = workspace.s.reshape(PRECISE_ORDER + 1, -1)
    states, derivatives = np.zeros((len(time), n_states)), np.zeros((len(time), flat.shape[1]))
    if time[-1] > time[0]:
        with np.errstate(over="ignore", invalid="ignore"):
            size, rate = np.linalg.norm(start), np.linalg.norm(model(workspace.x[:1, :n_states]))
        step = size / rate if size > 0.0 and rate > 0.0 else time[-1] - time[0]
        if not sensitive:
            workspace = workspace._replace(s=None)  # type: ignore[arg-type]  # another signature to numba
        count, end, ending = _solve_compiled(  # type: ignore[call-arg]  # numba has no types
            float(step), np.array(time, float), most, float(limit), states, derivatives,
            *np.empty((2, len(time))), np.zeros((1, 0)), flat, *workspace, *compiled,
        )  # fmt: skip
    else:
        states[:], derivatives[:] = start, flat[0]
        count, end, ending = len(time), float(time[0]), Ending.COMPLETE
    n_derivatives = compiled.n_free + n_states if sensitive else 0
    derivatives = derivatives.reshape(len(time), n_states, -1)[:count, :, :n_derivatives]
    return Solution(states[:count], derivatives, end, Ending(ending))
