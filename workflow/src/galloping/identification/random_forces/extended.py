"""Polynomial systems in white forces, compiled: the extended Kalman filter, and random motions.

From sample to sample the mean of the states follows the equations (the fourth-order method of C.
Runge and W. Kutta) and their covariance the slopes of the equations in the middle of each step
(A. H. Jazwinski, Stochastic Processes and Filtering Theory, 1970): exact for linear systems but for
the steps, good where the motion is nearly linear over what a sample leaves uncertain.
"""

import numpy as np
from numba import njit

from galloping.polynomial import slopes


@njit(cache=True, error_model="numpy")
def _monomials(x, exponents, out):
    for j in range(len(exponents)):
        product = 1.0
        for k in range(len(x)):
            for _ in range(exponents[j, k]):
                product *= x[k]
        out[j] = product


@njit(cache=True, error_model="numpy")
def _rates(x, exponents, coefficients, terms, out):
    """x: states, and then factors of inputs. terms: room for the monomials, which stay there."""
    _monomials(x, exponents, terms)
    for i in range(len(out)):
        total = 0.0
        for j in range(len(terms)):
            total += coefficients[i, j] * terms[j]
        out[i] = total


def lowered_terms(exponents: np.ndarray, n_states: int) -> np.ndarray:
    """(n_slopes, 3 + n_signals) the derivatives of terms by states, `polynomial.slopes`, one a row:
    term, state, exponent, and the exponents of what is left. exponents: (n_terms, n_signals).
    """
    by_state = slopes(tuple(map(tuple, exponents.tolist())), n_states)
    rows = [
        (term, state, power, *left)
        for state, own in enumerate(by_state)
        for term, power, left in zip(*own, strict=True)
    ]
    return np.array(rows, np.int64).reshape(-1, 3 + exponents.shape[1])


@njit(cache=True, error_model="numpy")
def _jacobian(x, lowered, coefficients, out):
    out[:] = 0.0
    for row in range(len(lowered)):
        term, state, slope = lowered[row, 0], lowered[row, 1], float(lowered[row, 2])
        for m in range(len(x)):
            for _ in range(lowered[row, 3 + m]):
                slope *= x[m]
        for i in range(len(out)):
            out[i, state] += coefficients[i, term] * slope


@njit(cache=True, error_model="numpy")
def _product(a, b, out):
    for i in range(len(a)):
        for j in range(b.shape[1]):
            out[i, j] = 0.0
        for k in range(len(b)):
            if a[i, k] != 0.0:
                for j in range(b.shape[1]):
                    out[i, j] += a[i, k] * b[k, j]


@njit(cache=True, error_model="numpy")
def _congruent(a, b, work, out):
    """a b a' of a symmetric `b`."""
    _product(a, b, work)
    for i in range(len(a)):
        for j in range(i + 1):
            total = 0.0
            for k in range(len(a)):
                total += work[i, k] * a[j, k]
            out[i, j] = out[j, i] = total


@njit(cache=True, error_model="numpy")
def _moved(x, h, force, driven, exponents, coefficients, terms, stages, middle):
    """Change `x` to `h` s later, in a constant force; `middle` to where it is half way.

    driven: (3, n_factors) at the begin, half way and at the end.
    """
    d = len(coefficients)
    before = stages[4]
    before[:] = x[:d]
    for stage in range(4):
        x[d:] = driven[(stage + 1) // 2]
        _rates(x, exponents, coefficients, terms, stages[stage])
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
    is_rate, kept, noise, x, p, candidates,
):  # fmt: skip
    """Innovations and their variances, (n, n_channels) each, NaN where samples are missing or the
    filter fails; the means of the states (n, n_states) after each sample; and the slopes of the
    innovations (n, n_channels, n_candidates) with coefficients, the gains held.

    samples, step_of, noise, x, p: as of `kalman_filter`. lengths, substeps: (n_steps,) s, and into
    how many each is divided. driven: (3 n_substeps of all steps + 1, n_factors) factors of inputs,
    as of `Steps.driven`. exponents: (n_terms, n_states + n_factors), coefficients:
    (n_states, n_terms) of the equations; lowered: their `lowered_terms`. white: (n_states,
    n_states) covariance of their forces in a second. sensed, is_rate: (n_channels,) the state of
    each channel, and whether its rate is measured. kept: indices of the states whose mean rates
    since the last sample are measured, by the last channels; the last states are what they were
    then. candidates: (n_candidates, 2) equation and term.
    """  # fmt: skip
    n, channels = samples.shape
    d, many, place = len(x), len(candidates), 0
    innovations = np.full((n, channels), np.nan)
    variances = np.full((n, channels), np.nan)
    means = np.full((n, d), np.nan)
    by_candidate = np.zeros((n, channels, many))
    told = np.zeros((d, many))  # slopes of the states
    terms, stages = np.zeros(len(exponents)), np.zeros((5, d))
    here, middle = np.append(x, driven[0]), np.append(x, driven[0])
    a, square, cube, fourth, over, half, work, added, jacobian = np.zeros((9, d, d))
    before, unit, still, gain, row = np.zeros(d), np.eye(d), np.zeros(d), np.zeros(d), np.zeros(d)
    moved, seen = np.zeros((d, many)), np.zeros(many)
    for k in range(n):
        if step_of[k] >= 0:
            count = substeps[step_of[k]]
            h = lengths[step_of[k]] / count
            for j in range(len(kept)):
                last = d - len(kept) + j
                here[last] = here[kept[j]]
                told[last] = told[kept[j]]
                p[last] = p[kept[j]]
                p[:, last] = p[:, kept[j]]
            for _ in range(count):
                now = driven[place : place + 3]
                _moved(here, h, still, now, exponents, coefficients, terms, stages, middle)
                place += 3
                _jacobian(middle, lowered, coefficients, jacobian)
                for i in range(d):
                    for j in range(d):
                        a[i, j] = h * jacobian[i, j]
                _product(a, a, square)
                _product(square, a, cube)
                _product(square, square, fourth)
                for i in range(d):
                    for j in range(d):
                        one, two = unit[i, j], a[i, j]
                        over[i, j] = one + two + square[i, j] / 2.0 + cube[i, j] / 6.0
                        over[i, j] += fourth[i, j] / 24.0
                        half[i, j] = one + two / 2.0 + square[i, j] / 8.0 + cube[i, j] / 48.0
                        half[i, j] += fourth[i, j] / 384.0
                _congruent(half, white, work, added)
                for i in range(d):
                    for j in range(d):
                        p[i, j] += h / 6.0 * white[i, j]
                        added[i, j] = h / 6.0 * (white[i, j] + 4.0 * added[i, j])
                _congruent(over, p, work, cube)
                for i in range(d):
                    for j in range(d):
                        p[i, j] = cube[i, j] + added[i, j]
                if many:
                    _monomials(middle, exponents, terms)
                    _product(over, told, moved)
                    told, moved = moved, told
                    for c in range(many):
                        for i in range(d):
                            acts = half[i, candidates[c, 0]] * terms[candidates[c, 1]]
                            told[i, c] += h * acts
        here[d:] = driven[place]
        if not np.all(np.isfinite(here)):
            break
        _rates(here, exponents, coefficients, terms, stages[0])
        _jacobian(here, lowered, coefficients, jacobian)
        before[:] = here[:d]
        for c in range(channels):
            if np.isnan(samples[k, c]):
                continue
            own, last = sensed[c], d - channels + c
            at_sample = is_rate[c] and len(kept) == 0
            error = samples[k, c] - (stages[0, own] if at_sample else before[own])
            if is_rate[c] and not at_sample:
                length = lengths[step_of[k]]
                error = samples[k, c] - (before[own] - before[last]) / length
            for i in range(d):
                row[i] = jacobian[own, i] if at_sample else unit[own, i]
                if is_rate[c] and not at_sample:
                    row[i] = (row[i] - unit[last, i]) / length
                error -= row[i] * (here[i] - before[i])
            spread = noise[c]
            for i in range(d):
                gain[i] = 0.0
                for j in range(d):
                    gain[i] += p[i, j] * row[j]
                spread += row[i] * gain[i]
            innovations[k, c], variances[k, c] = error, spread
            for j in range(many):
                seen[j] = 0.0
                for i in range(d):
                    seen[j] += row[i] * told[i, j]
                if at_sample and candidates[j, 0] == own:
                    seen[j] += terms[candidates[j, 1]]
                by_candidate[k, c, j] = -seen[j]
            for i in range(d):
                gain[i] /= spread
                here[i] += gain[i] * error
                for j in range(many):
                    told[i, j] -= gain[i] * seen[j]
            for i in range(d):
                for j in range(i + 1):
                    p[i, j] -= gain[i] * gain[j] * spread
                    p[j, i] = p[i, j]
        means[k] = here[:d]
    x[:] = here[:d]
    return innovations, variances, means, by_candidate


@njit(cache=True, error_model="numpy")
def random_motion(x, step_of, lengths, substeps, driven, exponents, coefficients, root, noise):
    """(n, n_states) from `x` on, in forces whose covariance in a second is root root'.

    All until `coefficients`: as of `extended_filter`. noise: (n_substeps
    of all steps, n_states) of unit variance.
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
                _moved(here, h, force, now, exponents, coefficients, terms, stages, middle)
                place += 1
        states[k] = here[:d]
    return states
