"""Linear systems in white forces from sample to sample, for any sampling, and their Kalman filter.

dx = A x dt + dW, of covariance G dt, has x(t + h) = exp(A h) x(t) + w, with the covariance of w
the integral of exp(A s) G exp(A s)' from 0 to h; both by the eigenvectors of A.
The filter, compiled, takes channels in one after another, so that samples may be missing from any
of them. While the sampling stays the same and no sample is missing, gains that have settled are
used again. (R. E. Kalman, 1960; J. Durbin and S. J. Koopman, Time Series Analysis by State Space
Methods, 2012.)
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numba import njit

from galloping.recording import Factor, Input, extrapolated

TICKS = 1000  # of the median step, to which times are rounded: so that equal steps are one
FEWEST = 1e-10  # relative determinant of the eigenvectors: fewer than n of them, but for rounding


@dataclass(frozen=True)
class Steps:
    """lengths: (n_steps,) s, that occur between samples. of: (n,) index of the step before each
    sample, -1 before the first. time: (n,) s. inputs: what is known beside the motion.
    """

    lengths: np.ndarray
    of: np.ndarray
    time: np.ndarray
    inputs: tuple[Input, ...] = ()

    @classmethod
    def between(cls, time: np.ndarray, inputs: Sequence[Input] = ()) -> "Steps":
        """Of times (n,) s, increasing."""
        tick = np.median(np.diff(time)) / TICKS
        counts = np.diff(np.round((time - time[0]) / tick).astype(np.int64))
        occurring, index = np.unique(np.maximum(counts, 1), return_inverse=True)
        return cls(occurring * tick, np.append(-1, index), time, tuple(inputs))

    def driven(self, substeps: np.ndarray, factors: Sequence[Factor]) -> np.ndarray:
        """(3 n_substeps + 1, n_factors) factors of the inputs at the begin, half way and just
        before the end of each of the substeps, (n_steps,) of a step, of all steps, and at the last
        time.

        The last ones are kept: a fit asks for the same of nearly every model that it tries.
        """
        asked = substeps.tobytes(), tuple(factors)
        if asked not in self._last:
            self._last.clear()
            self._last[asked] = self._driven(substeps, factors)
        return self._last[asked]

    @cached_property
    def _last(self) -> dict[tuple, np.ndarray]:
        return {}

    def _driven(self, substeps: np.ndarray, factors: Sequence[Factor]) -> np.ndarray:
        halves = 2 * substeps[self.of[1:]]
        if not factors:
            return np.empty((halves.sum() // 2 * 3 + 1, 0))
        begins = np.cumsum(halves) - halves
        share = (np.arange(halves.sum()) - np.repeat(begins, halves)) / np.repeat(halves, halves)
        time = np.repeat(self.time[:-1], halves) + share * np.repeat(np.diff(self.time), halves)
        time = np.append(time, self.time[-1])
        values = []
        for one in self.inputs:
            at, ends = extrapolated(one, time), time[2::2]
            held = one.between == "zero"  # and may jump at the end
            before = extrapolated(one, np.nextafter(ends, -np.inf)) if held else at[2::2]
            values.append(np.append(np.stack([at[:-1:2], at[1::2], before], axis=1), at[-1]))
        powers = np.array(factors, float)[:, :, np.newaxis]
        return np.ascontiguousarray(np.prod(np.array(values) ** powers, axis=1).T)


def discretised(
    system: np.ndarray, forces: np.ndarray, lengths: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Transitions and covariances (n_steps, n, n) over steps of `lengths`, s.

    system: (n, n), A; forces: (n, n), G. Raises numpy.linalg.LinAlgError where A has too few
    eigenvectors, as at critical damping.
    """
    values, vectors = np.linalg.eig(system)
    inverse = np.linalg.inv(vectors)
    if np.linalg.cond(vectors) * np.finfo(float).eps > FEWEST:
        raise np.linalg.LinAlgError("two modes, or a critically damped one, cannot be told apart")
    moved = np.exp(values * lengths[:, np.newaxis])
    transitions = ((vectors * moved[:, np.newaxis, :]) @ inverse).real
    rates = values[:, np.newaxis] + values.conj()
    grown = rates * lengths[:, np.newaxis, np.newaxis]
    slow = np.abs(grown) < 1e-8
    duration = lengths[:, np.newaxis, np.newaxis] * (1.0 + grown / 2.0)
    inside = np.where(slow, duration, np.expm1(grown) / np.where(rates == 0.0, 1.0, rates))
    own = inside * (inverse @ forces @ inverse.conj().T)
    covariance = vectors @ own @ vectors.conj().T
    return np.ascontiguousarray(transitions), np.ascontiguousarray(covariance.real)


def with_means(
    transitions: np.ndarray, disturbances: np.ndarray, lengths: np.ndarray, of: Sequence[int]
) -> tuple[np.ndarray, np.ndarray]:
    """The same of the states and, behind them, of the mean rates of the states `of` over a step."""
    unit, length = np.eye(transitions.shape[1]), lengths[:, np.newaxis, np.newaxis]
    rates = (transitions[:, of] - unit[of]) / length
    moved = np.concatenate([transitions, rates], axis=1)
    wider = np.concatenate([moved, np.zeros((*moved.shape[:2], len(of)))], axis=2)
    own = np.concatenate([np.broadcast_to(unit, transitions.shape), unit[of] / length], axis=1)
    return wider, np.ascontiguousarray(own @ disturbances @ own.transpose(0, 2, 1))


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
