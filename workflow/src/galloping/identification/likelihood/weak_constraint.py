"""Segments of a recording whose equations allow jumps of the state between them.

Weak-constraint estimation (Y. Tremolet, Q. J. R. Meteorol. Soc. 132, 2006): the misfit of the
segments, white or with a spectrum, and its linearisation about a fit.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft
from scipy.interpolate import BSpline
from scipy.linalg import lapack

from galloping.identification.likelihood.shooting import MOST_HALVINGS, ShootingData
from galloping.identification.likelihood.square_root import separate_states
from galloping.identification.problem import Problem
from galloping.identification.work import count_work
from galloping.model.polynomial import exponent_matrix

# Periods of a stretch. Measured: with 3 to 6 jumps absorb a model's error, and amplitudes are up to
# three times as far off; with 20 or more they do not absorb gusts, and dampings are as far off.
STRETCH_PERIODS = 10


def white_autocovariance(record: ShootingData, variance: np.ndarray) -> np.ndarray:
    """Arrange noise variances as the autocovariance of white noise, which has only lag zero.

    Returns (n_recordings, 1, n_observed, n_rows). variance: (n_recordings, n_observed).
    """
    return np.repeat(variance[:, None, :, None], record.condensed.targets.shape[2], axis=3)


def white_misfit(record: ShootingData, residual: np.ndarray) -> np.ndarray:
    """Estimate the variance of residuals that are treated as white noise.

    Returns an array as of `white_autocovariance`, not below the floor's square.
    """
    squares = record.condensed.sum_squares(residual) / np.maximum(record.condensed.rows, 1)
    return white_autocovariance(record, np.maximum(squares, record.floor**2))


def coloured_misfit(record: ShootingData, residual: np.ndarray) -> np.ndarray:
    """Estimate the autocovariance of residuals that are treated as coloured noise.

    The result includes noise at the floor. Returns (n_recordings, n_lags, n_observed, n_rows).

    The autocovariance falls to zero over the longest segment, by a Parzen window, which makes its
    spectrum smooth. Errors of a model recur with the motion: as white noise, they would count as
    many times as there are windows.
    """
    first, n_lags = record.condensed.first, int(np.diff(record.segments.first).max())
    lags = np.arange(n_lags) / (n_lags + 0.5)
    # Parzen's window, up to its height and width; `scipy.signal`, which has it, imports slowly
    parzen = BSpline.basis_element([-2, -1, 0, 1, 2])
    taper = (parzen(2 * lags) / parzen(0.0))[:, None, None]
    misfit = np.empty((len(first) - 1, n_lags, *residual.shape[1:]))
    for r, (a, b) in enumerate(pairwise(first)):
        length = next_fast_len(b - a + n_lags, real=True)
        power = np.abs(rfft(residual[a:b], length, axis=0)) ** 2
        count = np.maximum(record.condensed.is_present[a:b].sum(axis=0), 1)
        misfit[r] = taper * irfft(power, length, axis=0)[:n_lags] / count
    # so that its covariance can be factored
    misfit[:, 0] = (1.0 + 1e-9) * misfit[:, 0] + record.floor[:, :, None] ** 2
    return misfit


@dataclass(frozen=True)
class LinearisedStretches:
    """Whitened residuals of each segment, linearised in the coefficients and the segment's state.

    free, starts: (n,), (n_segments, n_states), about which they are linearised. rows: (n_segments,
    n_states + n_rates, n + n_states + 1) of coefficients, state and residual; information:
    (n_segments, n, n), right: (n_segments, n), of all other rows, which contain the coefficients
    alone. residual: (n_windows, n_observed, n_rows), not whitened. ends: (n_segments, n_states)
    last states; end_derivatives: (n_segments, n_states, n + n_states). wide_rows: `rows` with the
    columns of the coefficients `rates` (n_rates,) repeated after the state, for deviations of these
    coefficients in the segment.
    """

    free: np.ndarray
    starts: np.ndarray
    rows: np.ndarray
    information: np.ndarray
    right: np.ndarray
    residual: np.ndarray
    ends: np.ndarray
    end_derivatives: np.ndarray
    wide_rows: np.ndarray
    rates: np.ndarray


def rate_coefficients(problem: Problem) -> np.ndarray:
    """Return the indices of candidates linear in a state whose equation is identified.

    They are the dampings of a line.
    """
    equation, term = problem.candidates.T
    exponents = exponent_matrix(problem.terms, len(problem.names))[term]
    of_rate = exponents[:, np.unique(equation)].sum(axis=1) == 1
    linear = (np.abs(exponents).sum(axis=1) == 1) & (problem.degrees == 1)
    return np.flatnonzero(linear & of_rate)


@dataclass(frozen=True)
class StretchFit:
    """Iterate of a fit whose state may jump between segments: coefficients, states, noise.

    free, support: (n_candidates,) coefficients and which are present. starts: (n_segments,
    n_states) first states. misfit: (n_recordings, n_lags, n_observed, n_rows) autocovariance of the
    residuals of projections, by the lag in windows, zero beyond the last. jump: (n_states,
    n_states) covariance of the state's jumps at full motion.
    """

    record: ShootingData
    free: np.ndarray
    support: np.ndarray
    starts: np.ndarray
    misfit: np.ndarray
    jump: np.ndarray

    @cached_property
    def linearised(self) -> LinearisedStretches:
        """Residuals of all segments, linearised about the present fit.

        Raises FloatingPointError if the fit diverges.
        """
        record, (count, n_states), n = self.record, self.starts.shape, len(self.free)
        m, rates = n + n_states, rate_coefficients(record.problem)
        wide_rows = np.zeros((count, n_states + len(rates), m + len(rates) + 1))
        information, right = np.empty((count, n, n)), np.empty((count, n))
        residual = np.empty(record.condensed.targets.shape)
        ends, slopes = np.empty(self.starts.shape), np.empty((*self.starts.shape, m))
        whitened = None
        at_once = 1  # segment: the rows of all of a long recording do not fit in memory
        for group, own, left, rows, *reached in record.iterate_linearised(
            self.free, self.starts, record.problem.candidates, at_once
        ):
            # after the first segment, in which most fits diverge that do: whitening takes long
            whitened = whitened or self._make_whitening()
            residual[own], (ends[group], slopes[group]) = left, reached
            both = np.concatenate([rows, rows[..., rates], left[..., None]], axis=3)
            count_work((8e-9 + 1.5e-10 * self.misfit.shape[1]) * rows.size)
            both = whitened(both, own, record.segments.recording[group.start])
            both = np.ascontiguousarray(both).reshape(-1, both.shape[3])
            wide_rows[group], others = separate_states(both, np.array([0, len(both)]), n)
            information[group] = others[:, :n].T @ others[:, :n]
            right[group] = others[:, -1] @ others[:, :n]
        rows = np.delete(wide_rows, np.s_[m:-1], axis=2)
        return LinearisedStretches(
            self.free, self.starts, rows, information, right, residual, ends, slopes, wide_rows,
            rates,
        )  # fmt: skip

    def _make_whitening(self) -> Callable[[np.ndarray, slice, int], np.ndarray]:
        """Make a function that whitens the projections of a segment, to variance one.

        The function takes rows (n_windows, n_observed, n_rows, m) of a segment, the segment's
        windows and its recording's index, and returns rows of the same shape, zero where a
        projection is absent.
        """
        if self.misfit.shape[1] == 1:  # white
            weight = 1.0 / np.sqrt(self.misfit[:, 0, :, :, None])
            return lambda rows, own, recording: rows * weight[recording]
        lags = np.arange(self.misfit.shape[1])
        covariance = np.moveaxis(self.misfit, 1, -1)[..., np.abs(np.subtract.outer(lags, lags))]
        factors = np.linalg.cholesky(covariance)
        there = self.record.condensed.is_present

        def whiten_rows(rows: np.ndarray, own: slice, recording: int) -> np.ndarray:
            found, n = np.zeros(rows.shape), len(rows)
            for o, k in np.ndindex(rows.shape[1:3]):
                present = there[own, o, k]
                if not present.any():  # LAPACK prints a message where there are none
                    continue
                at = np.flatnonzero(present)
                factor = factors[recording, o, k, :n, :n]
                if len(at) < n:
                    factor = np.linalg.cholesky(covariance[recording, o, k][np.ix_(at, at)])
                # `scipy.linalg.solve_triangular` takes three times as long for so few rows
                found[at, o, k] = lapack.dtrtrs(factor.T, rows[at, o, k], lower=0, trans=1)[0]
            return found

        return whiten_rows


def make_integrable(fit: StretchFit, following: StretchFit) -> StretchFit:
    """Shorten the step of the coefficients until the model can be integrated over each segment."""
    for _ in range(MOST_HALVINGS):
        try:
            following.linearised  # noqa: B018 - which the next step needs
            return following
        except FloatingPointError:
            following = replace(
                following,
                free=(fit.free + following.free) / 2.0,
                starts=(fit.starts + following.starts) / 2.0,
                support=fit.support | following.support,
            )
    raise FloatingPointError("no model found that can be integrated over a few periods")
