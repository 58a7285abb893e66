"""Segments of a recording whose equations allow jumps of the state between them.

Weak-constraint estimation (Y. Tremolet, Q. J. R. Meteorol. Soc. 132, 2006): the misfit of the
segments, white or with a spectrum, and its normal equations, linearised about a fit.
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
from galloping.identification.work import count_work

# Periods of a stretch. Measured: with 3 to 6 a model's error hides in the jumps, and amplitudes are
# up to three times as far off; with 20 or more gusts do not, and dampings are.
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
class NormalEquations:
    """Normal equations of each segment, in the coefficients and the segment's initial state.

    There are m unknowns, n coefficients and the state. free, starts: (n,), (n_segments, n_states),
    about which the equations are linearised. information: (n_segments, m, m); right: (n_segments,
    m). residual: (n_windows, n_observed, n_rows), not whitened. ends: (n_segments, n_states) last
    states, and derivatives of these: by_coefficients (n_segments, n_states, n), by_state
    (n_segments, n_states, n_states).
    """

    free: np.ndarray
    starts: np.ndarray
    information: np.ndarray
    right: np.ndarray
    residual: np.ndarray
    ends: np.ndarray
    by_coefficients: np.ndarray
    by_state: np.ndarray


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
    def normal_equations(self) -> NormalEquations:
        """Normal equations of all segments, linearised about the present fit.

        Raises FloatingPointError if the fit diverges.
        """
        record, count, n = self.record, len(self.starts), len(self.free)
        m = n + self.starts.shape[1]
        information, right = np.empty((count, m, m)), np.empty((count, m))
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
            both = np.concatenate([rows, left[..., None]], axis=3)
            count_work((8e-9 + 1.5e-10 * self.misfit.shape[1]) * both.size)
            both = whitened(both, own, record.segments.recording[group.start]).reshape(-1, m + 1)
            products = both.T @ both
            information[group], right[group] = products[:m, :m], products[:m, m]
        return NormalEquations(
            self.free, self.starts, information, right, residual, ends, slopes[:, :, :n],
            slopes[:, :, n:],
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
            following.normal_equations  # noqa: B018 - which the next step needs
            return following
        except FloatingPointError:
            following = replace(
                following,
                free=(fit.free + following.free) / 2.0,
                starts=(fit.starts + following.starts) / 2.0,
                support=fit.support | following.support,
            )
    raise FloatingPointError("no model found that can be integrated over a few periods")
