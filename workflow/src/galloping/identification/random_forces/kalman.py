"""Kalman filters of linear and polynomial systems in white forces, and random motions: compiled.

A filter takes channels in one after another, so that samples may be missing from any of them. (R.
E. Kalman, 1960; J. Durbin and S. J. Koopman, Time Series Analysis by State Space Methods, 2012.)
The filter of a linear system reuses its gains once they have settled, as long as the time step
stays the same and no sample is missing.

In the extended filter, the mean of the states follows the equations from sample to sample (the
fourth-order method of C. Runge and W. Kutta). Their covariance follows the slopes of the equations
in the middle of each step (A. H. Jazwinski, Stochastic Processes and Filtering Theory, 1970). For
linear systems, this is exact except for the error of the steps. Otherwise it is accurate if the
equations are nearly linear within the uncertainty of the states after each sample.

All compiled functions are in one module, for a cached one notices edits of its own module alone.
"""

import numpy as np
from numba import njit

from galloping.model.polynomial import differentiate_terms

# Largest relative change of the states' covariance per sample with which gains are reused.
COVARIANCE_TOLERANCE = 1e-12


@njit(cache=True, error_model="numpy")
def _multiply_into(a, b, out):
    """Multiply a by b into `out`, which is neither of these."""
    out[:] = 0.0
    for i in range(len(a)):
        for k in range(len(b)):
            if a[i, k] != 0.0:
                for j in range(b.shape[1]):
                    out[i, j] += a[i, k] * b[k, j]


@njit(cache=True, error_model="numpy")
def _add_congruence(a, b, begin, work, out):
    """Write a b a' plus `begin`, both symmetric, to `out`, which may be `b`. work: as large."""
    _multiply_into(a, b, work)
    for i in range(len(a)):
        for j in range(i + 1):
            total = begin[i, j]
            for k in range(len(a)):
                total += work[i, k] * a[j, k]
            out[i, j] = out[j, i] = total


@njit(cache=True, error_model="numpy")
def _update_covariance(p, row, noise, gain):
    """Update a covariance by a sample, `row` x plus noise; return the variance of the sample.

    noise: its variance. `gain` becomes the gain of the states, and `p` their covariance after the
    sample.
    """
    d, variance = len(row), noise
    for i in range(d):
        gain[i] = 0.0
        for j in range(d):
            gain[i] += p[i, j] * row[j]
        variance += row[i] * gain[i]
    for i in range(d):
        gain[i] /= variance
    for i in range(d):
        for j in range(i + 1):
            p[i, j] -= gain[i] * gain[j] * variance
            p[j, i] = p[i, j]
    return variance


@njit(cache=True, error_model="numpy")
def kalman_filter(samples, step_of, transitions, disturbances, sensing, noise, x, p):
    """Run the Kalman filter of a linear system over samples, some of which may be missing.

    Returns innovations and their variances, (n, n_channels) each, NaN where samples are missing,
    and the means of the states (n, n_states) after each sample.

    samples: (n, n_channels), NaN where missing. step_of: (n,) index of the step before each sample,
    negative where there is none. transitions, disturbances: (n_steps, n_states, n_states) of each
    step, x' = transition x + w, w of covariance disturbance. sensing: (n_channels, n_states).
    noise: (n_channels,) variances. x, p: mean and covariance of the states before the first sample;
    changed in place to those after the last one.
    """
    n, channels = samples.shape
    d = len(x)
    innovations, variances = np.full((2, n, channels), np.nan)
    means, gains, spread = np.empty((n, d)), np.zeros((channels, d)), np.zeros(channels)
    work, moved, before = np.zeros((d, d)), np.zeros(d), np.zeros((d, d))
    settled, last = False, -2
    for k in range(n):
        step = step_of[k]
        complete = not np.any(np.isnan(samples[k]))
        again = settled and complete and step == last
        if step >= 0:
            f = transitions[step]
            for i in range(d):
                moved[i] = 0.0
                for j in range(d):
                    moved[i] += f[i, j] * x[j]
            x[:] = moved
            if not again:
                _add_congruence(f, p, disturbances[step], work, p)
        for c in range(channels):
            if np.isnan(samples[k, c]):
                continue
            error = samples[k, c]
            for j in range(d):
                error -= sensing[c, j] * x[j]
            if not again:
                spread[c] = _update_covariance(p, sensing[c], noise[c], gains[c])
            innovations[k, c], variances[k, c] = error, spread[c]
            for i in range(d):
                x[i] += gains[c, i] * error
        means[k] = x
        if not again:
            change = 0.0
            for i in range(d):
                for j in range(d):
                    scale = np.sqrt(p[i, i] * p[j, j])
                    change = max(change, abs(p[i, j] - before[i, j]) / max(scale, 1e-300))
            before[:] = p
            settled = complete and step == last and change < COVARIANCE_TOLERANCE
            last = step
    return innovations, variances, means


@njit(cache=True, error_model="numpy")
def _evaluate_monomials(x, exponents, out):
    for j in range(len(exponents)):
        product = 1.0
        for k in range(len(x)):
            for _ in range(exponents[j, k]):
                product *= x[k]
        out[j] = product


@njit(cache=True, error_model="numpy")
def _evaluate_rates(x, exponents, coefficients, terms, out):
    """Evaluate the rates of states x, with factors of inputs. terms: memory for monomials."""
    _evaluate_monomials(x, exponents, terms)
    for i in range(len(out)):
        total = 0.0
        for j in range(len(terms)):
            total += coefficients[i, j] * terms[j]
        out[i] = total


def tabulate_monomial_derivatives(exponents: np.ndarray, n_states: int) -> np.ndarray:
    """Tabulate the derivatives of monomials by the states, one derivative in each row.

    Returns (n_slopes, 3 + n_signals). As of `polynomial.differentiate_terms`, a row is: term,
    state, exponent, and the remaining exponents. exponents: (n_terms, n_signals).
    """
    by_state = differentiate_terms(tuple(map(tuple, exponents.tolist())), n_states)
    rows = [
        (term, state, power, *remainder)
        for state, derivatives in enumerate(by_state)
        for term, power, remainder in zip(*derivatives, strict=True)
    ]
    return np.array(rows, np.int64).reshape(-1, 3 + exponents.shape[1])


@njit(cache=True, error_model="numpy")
def _evaluate_jacobian(x, lowered, coefficients, out):
    out[:] = 0.0
    for row in range(len(lowered)):
        term, state, slope = lowered[row, 0], lowered[row, 1], float(lowered[row, 2])
        for m in range(len(x)):
            for _ in range(lowered[row, 3 + m]):
                slope *= x[m]
        for i in range(len(out)):
            out[i, state] += coefficients[i, term] * slope


@njit(cache=True, error_model="numpy")
def _expand_exponential(a, square, cube, fourth, parts, out):
    """Write exp(a / parts) to `out`, to the fourth order; square, cube, fourth: powers of `a`."""
    second, third, last = 2.0 * parts**2, 6.0 * parts**3, 24.0 * parts**4
    for i in range(len(a)):
        for j in range(len(a)):
            first = (1.0 if i == j else 0.0) + a[i, j] / parts
            out[i, j] = first + square[i, j] / second + cube[i, j] / third + fourth[i, j] / last


@njit(cache=True, error_model="numpy")
def _advance_state(x, h, force, driven, exponents, coefficients, terms, stages, middle):
    """Advance `x` by `h` s in a constant force; write the state half way to `middle`.

    driven: (3, n_factors) at the beginning, half way and at the end.
    """
    d = len(coefficients)
    before = stages[4]
    before[:] = x[:d]
    for stage in range(4):
        x[d:] = driven[(stage + 1) // 2]
        _evaluate_rates(x, exponents, coefficients, terms, stages[stage])
        for i in range(d):
            stages[stage, i] += force[i]
        ahead = h if stage == 2 else 0.5 * h
        if stage < 3:
            for i in range(d):
                x[i] = before[i] + ahead * stages[stage, i]
        if stage == 1:
            middle[:] = x
    for i in range(d):
        total = stages[0, i] + 2.0 * stages[1, i] + 2.0 * stages[2, i] + stages[3, i]
        x[i] = before[i] + h / 6.0 * total


@njit(cache=True, error_model="numpy")
def extended_filter(
    samples, step_of, lengths, substeps, driven, exponents, lowered, coefficients, white, sensed,
    is_rate, lagged, noise, x, p, candidates,
):  # fmt: skip
    """Run the extended Kalman filter of a system of polynomial equations over samples.

    Returns innovations and their variances, (n, n_channels) each, NaN where samples are missing or
    the filter fails; the means of the states (n, n_states) after each sample; and the slopes of the
    innovations (n, n_channels, n_candidates) with coefficients, at constant gains.

    samples, step_of, noise, x, p: as of `kalman_filter`. lengths, substeps: (n_steps,) s, and into
    how many each is divided. driven: (3 n_substeps of all steps + 1, n_factors) factors of inputs,
    as of `Steps.input_factors`. exponents: (n_terms, n_states + n_factors), coefficients:
    (n_states, n_terms) of the equations; lowered: their table by
    `tabulate_monomial_derivatives`. white: (n_states, n_states) covariance of their forces per
    second. sensed, is_rate: (n_channels,) the state of each channel, and whether its rate is
    measured. lagged: indices of the states whose mean rates since the last sample are measured,
    by the last channels; the last states are their values at that sample. candidates:
    (n_candidates, 2) equation and term.
    """
    n, channels = samples.shape
    d, many, place = len(x), len(candidates), 0
    innovations, variances = np.full((2, n, channels), np.nan)
    means = np.full((n, d), np.nan)
    by_candidate = np.zeros((n, channels, many))
    state_slopes = np.zeros((d, many))  # by the coefficients
    terms, stages = np.zeros(len(exponents)), np.zeros((5, d))
    here, middle = np.append(x, driven[0]), np.append(x, driven[0])
    a, square, cube, fourth, over, half, work, added, jacobian, none = np.zeros((10, d, d))
    before, still, gain, row = np.zeros((4, d))
    unit = np.eye(d)
    moved, seen = np.zeros((d, many)), np.zeros(many)
    for k in range(n):
        if step_of[k] >= 0:
            count = substeps[step_of[k]]
            h = lengths[step_of[k]] / count
            for j in range(len(lagged)):
                last = d - len(lagged) + j
                here[last] = here[lagged[j]]
                state_slopes[last] = state_slopes[lagged[j]]
                p[last] = p[lagged[j]]
                p[:, last] = p[:, lagged[j]]
            for _ in range(count):
                now = driven[place : place + 3]
                _advance_state(here, h, still, now, exponents, coefficients, terms, stages, middle)
                place += 3
                _evaluate_jacobian(middle, lowered, coefficients, jacobian)
                a[:] = h * jacobian
                _multiply_into(a, a, square)
                _multiply_into(square, a, cube)
                _multiply_into(square, square, fourth)
                _expand_exponential(a, square, cube, fourth, 1, over)
                _expand_exponential(a, square, cube, fourth, 2, half)
                _add_congruence(half, white, none, work, added)
                for i in range(d):
                    for j in range(d):
                        p[i, j] += h / 6.0 * white[i, j]
                        added[i, j] = h / 6.0 * (white[i, j] + 4.0 * added[i, j])
                _add_congruence(over, p, none, work, p)
                p += added
                if many:
                    _evaluate_monomials(middle, exponents, terms)
                    _multiply_into(over, state_slopes, moved)
                    state_slopes, moved = moved, state_slopes
                    for c in range(many):
                        for i in range(d):
                            acts = half[i, candidates[c, 0]] * terms[candidates[c, 1]]
                            state_slopes[i, c] += h * acts
        here[d:] = driven[place]
        if not np.all(np.isfinite(here)):
            break
        _evaluate_rates(here, exponents, coefficients, terms, stages[0])
        _evaluate_jacobian(here, lowered, coefficients, jacobian)
        before[:] = here[:d]
        for c in range(channels):
            if np.isnan(samples[k, c]):
                continue
            own, last = sensed[c], d - channels + c
            at_sample = is_rate[c] and len(lagged) == 0
            error = samples[k, c] - (stages[0, own] if at_sample else before[own])
            if is_rate[c] and not at_sample:
                length = lengths[step_of[k]]
                error = samples[k, c] - (before[own] - before[last]) / length
            for i in range(d):
                row[i] = jacobian[own, i] if at_sample else unit[own, i]
                if is_rate[c] and not at_sample:
                    row[i] = (row[i] - unit[last, i]) / length
                error -= row[i] * (here[i] - before[i])
            innovations[k, c], variances[k, c] = error, _update_covariance(p, row, noise[c], gain)
            for j in range(many):
                seen[j] = 0.0
                for i in range(d):
                    seen[j] += row[i] * state_slopes[i, j]
                if at_sample and candidates[j, 0] == own:
                    seen[j] += terms[candidates[j, 1]]
                by_candidate[k, c, j] = -seen[j]
            for i in range(d):
                here[i] += gain[i] * error
                for j in range(many):
                    state_slopes[i, j] -= gain[i] * seen[j]
        means[k] = here[:d]
    x[:] = here[:d]
    return innovations, variances, means, by_candidate


@njit(cache=True, error_model="numpy")
def random_motion(x, step_of, lengths, substeps, driven, exponents, coefficients, root, noise):
    """Simulate a system of polynomial equations under white random forces.

    Returns the states, (n, n_states), from `x` on. root root' is the covariance of the forces per
    second. All until `coefficients`: as of `extended_filter`. noise: (n_substeps of all steps,
    n_states) of unit variance.
    """
    d, place = len(x), 0
    states = np.empty((len(step_of), d))
    terms, stages = np.zeros(len(exponents)), np.zeros((5, d))
    here, middle = np.append(x, driven[0]), np.append(x, driven[0])
    for k in range(len(step_of)):
        if step_of[k] >= 0:
            h = lengths[step_of[k]] / substeps[step_of[k]]
            for _ in range(substeps[step_of[k]]):
                force = root @ noise[place] / np.sqrt(h)
                now = driven[3 * place : 3 * place + 3]
                _advance_state(here, h, force, now, exponents, coefficients, terms, stages, middle)
                place += 1
        states[k] = here[:d]
    return states
