"""The Kalman filter of a linear system in white forces, compiled: innovations and their variances.

Channels are taken in one after another, so samples may be missing from any of them. While the
sampling stays the same and no sample is missing, gains that have settled are used again.
(R. E. Kalman, 1960; J. Durbin and S. J. Koopman, Time Series Analysis by State Space Methods,
2012.)
"""

import numpy as np
from numba import njit

SETTLED = 1e-12  # relative change of the covariance of the states from sample to sample


@njit(cache=True, error_model="numpy")
def kalman_filter(samples, step_of, transitions, disturbances, sensing, noise, x, p):
    """Innovations and their variances, (n, n_channels) each, NaN where samples are missing, and
    the means of the states (n, n_states) after each sample.

    samples: (n, n_channels), NaN where missing. step_of: (n,) index of the step before each sample,
    negative where there is none. transitions, disturbances: (n_steps, n_states, n_states) of each
    step, x' = transition x + w, w of covariance disturbance. sensing: (n_channels, n_states).
    noise: (n_channels,) variances. x, p: mean and covariance of the states before the first
    sample; after the last one in return: they are changed in place.
    """
    n, channels = samples.shape
    d = len(x)
    innovations = np.full((n, channels), np.nan)
    variances = np.full((n, channels), np.nan)
    means = np.empty((n, d))
    gains = np.zeros((channels, d))
    spread = np.zeros(channels)
    work, moved, before = np.zeros((d, d)), np.zeros(d), np.zeros((d, d))
    settled, last = False, -2
    for k in range(n):
        step = step_of[k]
        complete = True
        for c in range(channels):
            complete &= not np.isnan(samples[k, c])
        again = settled and complete and step == last
        if step >= 0:
            f = transitions[step]
            for i in range(d):
                moved[i] = 0.0
                for j in range(d):
                    moved[i] += f[i, j] * x[j]
            for i in range(d):
                x[i] = moved[i]
            if not again:
                for i in range(d):
                    for j in range(d):
                        work[i, j] = 0.0
                        for m in range(d):
                            work[i, j] += f[i, m] * p[m, j]
                for i in range(d):
                    for j in range(i + 1):
                        total = disturbances[step, i, j]
                        for m in range(d):
                            total += work[i, m] * f[j, m]
                        p[i, j] = total
                        p[j, i] = total
        for c in range(channels):
            if np.isnan(samples[k, c]):
                continue
            error = samples[k, c]
            for j in range(d):
                error -= sensing[c, j] * x[j]
            if not again:
                spread[c] = noise[c]
                for i in range(d):
                    gains[c, i] = 0.0
                    for j in range(d):
                        gains[c, i] += p[i, j] * sensing[c, j]
                    spread[c] += sensing[c, i] * gains[c, i]
                for i in range(d):
                    gains[c, i] /= spread[c]
                for i in range(d):
                    for j in range(i + 1):
                        p[i, j] -= gains[c, i] * gains[c, j] * spread[c]
                        p[j, i] = p[i, j]
            innovations[k, c] = error
            variances[k, c] = spread[c]
            for i in range(d):
                x[i] += gains[c, i] * error
        for i in range(d):
            means[k, i] = x[i]
        if not again:
            change = 0.0
            for i in range(d):
                for j in range(d):
                    scale = np.sqrt(p[i, i] * p[j, j])
                    change = max(change, abs(p[i, j] - before[i, j]) / max(scale, 1e-300))
                    before[i, j] = p[i, j]
            settled = complete and step == last and change < SETTLED
            last = step
    return innovations, variances, means
