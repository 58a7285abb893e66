"""Segments of a recording whose equations allow jumps of the state between them.

Weak-constraint estimation (Y. Tremolet, Q. J. R. Meteorol. Soc. 132, 2006): the misfit of the
segments, white or with a spectrum, and its linearisation about a fit.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft
from scipy.linalg import lapack

from galloping.identification.likelihood.shooting import (
    Linearised,
    ShootingData,
    linearise_segments,
    shorten_step,
)
from galloping.identification.work import count_work

# Length of a stretch, in periods. Measured: with 3 to 6 periods, jumps absorb a model's error, and
# amplitudes err by up to three times as much. With 20 periods or more, jumps do not absorb gusts,
# and dampings err by as much.
STRETCH_PERIODS = 10
# Least length to which stretches are halved if the model diverges in them, in periods. In shorter
# ones, jumps replace the model: of five such fits to limit cycles, with libraries of too low
# degree, three forecast nothing, and the models of two came to rest.
MIN_STRETCH_PERIODS = STRETCH_PERIODS / 4
# Number of folds, each of which is left out in turn. Fewer folds give a less accurate covariance,
# and a larger `small_sample_factor`, which is 1.26 for twelve: with six folds standard errors are
# up to twice or half as large. Each further fold costs an elimination, and more folds change
# standard errors by a tenth at most.
FOLDS = 12


def white_autocovariance(record: ShootingData, variance: np.ndarray) -> np.ndarray:
    """Arrange variances (n_recordings, n_observed) of white noise as `StretchFit.misfit`."""
    return np.repeat(variance[:, None, :, None], record.condensed.targets.shape[2], axis=3)


def white_misfit(record: ShootingData, residual: np.ndarray) -> np.ndarray:
    """Estimate the misfit of residuals as white noise, not below the floor."""
    squares = record.condensed.sum_squares(residual) / np.maximum(record.condensed.rows, 1)
    return white_autocovariance(record, np.maximum(squares, record.floor**2))


def coloured_misfit(record: ShootingData, residual: np.ndarray) -> np.ndarray:
    """Estimate the autocovariance of residuals that are treated as coloured noise.

    Returns (n_recordings, n_lags, n_observed, n_rows), with noise at the floor. The autocovariance
    falls to zero over the longest segment, by a Parzen window, which makes its spectrum smooth.
    Errors of a model recur with the motion: as white noise, they would count once per window.
    """
    first, n_lags = record.condensed.first, int(np.diff(record.segments.first).max())
    lags = np.arange(n_lags) / (n_lags + 0.5)
    # Parzen's window; `scipy.signal`, which has it, imports slowly
    inner, outer = 1.0 - 6.0 * lags**2 * (1.0 - lags), 2.0 * (1.0 - lags) ** 3
    taper = np.where(lags < 0.5, inner, outer)[:, None, None]
    misfit = np.empty((len(first) - 1, n_lags, *residual.shape[1:]))
    for r, (a, b) in enumerate(pairwise(first)):
        length = next_fast_len(b - a + n_lags, real=True)
        power = np.abs(rfft(residual[a:b], length, axis=0)) ** 2
        count = np.maximum(record.condensed.is_present[a:b].sum(axis=0), 1)
        misfit[r] = taper * irfft(power, length, axis=0)[:n_lags] / count
    # so that the covariance can be factored
    misfit[:, 0] = (1.0 + 1e-9) * misfit[:, 0] + record.floor[:, :, None] ** 2
    return misfit


@dataclass(frozen=True)
class StretchFit:
    """Iterate of a fit whose state may jump between segments: coefficients, states, noise.

    free, support: (n_candidates,) coefficients and which are present. starts: (n_segments,
    n_states) first states. misfit: (n_recordings, n_lags, n_observed, n_rows) autocovariance of the
    residuals of projections, by the lag in windows, zero beyond the last. jump: (n_states,
    n_states) covariance of the state's jumps at full motion. repeated: as of `linearise_segments`.
    """

    record: ShootingData
    free: np.ndarray
    support: np.ndarray
    starts: np.ndarray
    misfit: np.ndarray
    jump: np.ndarray
    repeated: Sequence[int] | np.ndarray = ()

    @cached_property
    def linearised(self) -> Linearised:
        """Residuals of all segments, linearised about the present fit, in up to FOLDS folds."""
        # `_whitening` is made after the first segment is integrated: most diverging fits fail there
        return linearise_segments(
            self.record, self.free, self.starts, lambda *rows: self._whitening(*rows),
            repeated=self.repeated, n_folds=min(len(self.starts), FOLDS),
        )  # fmt: skip

    @cached_property
    def _whitening(self) -> Callable[[np.ndarray, slice], np.ndarray]:
        """Function that whitens rows (n_windows, n_observed, n_rows, m) of a segment's windows."""
        owner = self.record.window_recordings
        if self.misfit.shape[1] == 1:  # white
            weight = 1.0 / np.sqrt(self.misfit[:, 0, :, :, None])
            return lambda rows, windows: rows * weight[owner[windows.start]]
        lags = np.arange(self.misfit.shape[1])
        covariance = np.moveaxis(self.misfit, 1, -1)[..., np.abs(np.subtract.outer(lags, lags))]
        factors = np.linalg.cholesky(covariance)
        is_present = self.record.condensed.is_present

        def whiten_rows(rows: np.ndarray, windows: slice) -> np.ndarray:
            whitened, n, recording = np.zeros(rows.shape), len(rows), owner[windows.start]
            count_work(1.5e-10 * len(lags) * rows.size)
            for o, k in np.ndindex(rows.shape[1:3]):
                indices = np.flatnonzero(is_present[windows, o, k])
                if not len(indices):  # without rows LAPACK would print a message
                    continue
                factor = factors[recording, o, k, :n, :n]
                if len(indices) < n:
                    factor = np.linalg.cholesky(
                        covariance[recording, o, k][np.ix_(indices, indices)]
                    )
                # `scipy.linalg.solve_triangular` takes three times as long for so few rows
                solved, _ = lapack.dtrtrs(factor.T, rows[indices, o, k], lower=0, trans=1)
                whitened[indices, o, k] = solved
            return whitened

        return whiten_rows


def shorten_until_integrable(fit: StretchFit, next_fit: StretchFit) -> StretchFit:
    """Shorten the step between fits until the model can be integrated over each segment."""

    def linearise(tried: StretchFit) -> StretchFit:
        tried.linearised  # noqa: B018 - cached for the next step
        return tried

    return shorten_step(linearise, fit, next_fit)
