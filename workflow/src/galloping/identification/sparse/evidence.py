"""Reduction of recordings for sparse regression: derivatives on a library.

Derivatives are measured, or come from noisy states by least-squares splines, whose smoothness
follows the data.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.interpolate import BSpline
from scipy.linalg import cho_solve_banded, cholesky_banded
from scipy.sparse import csr_array

from galloping.identification.findings import Code
from galloping.identification.no_model import IdentificationError
from galloping.identification.sparse.regression import (
    ReducedRegression,
    block_slices,
    reduce_blocks,
)
from galloping.identification.sparse.tuning import (
    TriedFilter,
    best_filter,
    smoothing_filters,
    tried_filters,
    weak_form_filters,
)
from galloping.model.polynomial import Exponents, design_matrix
from galloping.recording.samples import Recording

DEGREE = 7  # degree of splines; it truncates less than rounding in noise-free 100 Hz recordings
# Numbers of samples between knots, from smooth to rough splines.
KNOT_SPACINGS = (128, 96, 64, 48, 32, 24, 16, 12, 8, 4, 2)
GRID_TOLERANCE = 1e-3  # largest distance of a sample from a uniform grid, in steps
MAX_GRID_RATIO = 100  # largest ratio of grid points to samples
STOP_SCORE_RATIO = 1.05  # ratio of every channel's score to its best at which the scan stops


def differentiate(
    time: np.ndarray, values: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Smooth channels by splines; return them, their derivatives and effective sample counts.

    time: (n,) s, increasing, regular or not; values: (n, n_channels). Returns two (n, n_channels)
    arrays and (n_channels,) counts of spline coefficients, the numbers of independent values in
    smoothed channels. Raises ValueError for samples too few for a spline.
    """
    splines, effective = _fit_splines(time, values)
    derivatives = [spline.derivative()(time) for spline in splines]
    return _evaluate_splines(splines, time), np.column_stack(derivatives), effective


def with_missing_samples(recording: Recording) -> Recording:
    """Fill the missing samples of a recording by interpolation, if its times are on a uniform grid.

    Values between the samples are from smoothing splines, so that one algorithm serves all samples
    of a recording and a random subset of them. A recording is unchanged if its times are on no
    grid, or on all of one. Raises ValueError for samples too few for a spline.
    """
    steps = np.diff(recording.time)
    places = np.r_[0.0, np.cumsum(steps)] / steps.min()
    count = round(places[-1]) + 1
    is_on_grid = np.all(np.abs(places - np.rint(places)) < GRID_TOLERANCE)
    if count == len(places) or not is_on_grid or count > MAX_GRID_RATIO * len(places):
        return recording
    time = np.linspace(recording.time[0], recording.time[-1], count)
    values = _evaluate_splines(_fit_splines(recording.time, recording.values)[0], time)
    values[np.rint(places).astype(int)] = recording.values
    return Recording(time, recording.states, values)


def _fit_splines(time: np.ndarray, values: np.ndarray) -> tuple[list[BSpline], np.ndarray]:
    """Fit a least-squares spline of degree 7 to each channel, and count its coefficients.

    It has a knot at every m-th sample; m is chosen by generalised cross-validation (Craven and
    Wahba 1979).
    """
    n, channels = values.shape
    score, effective = np.full(channels, np.inf), np.zeros(channels, dtype=int)
    splines: dict[int, BSpline] = {}
    for every in KNOT_SPACINGS:
        knots = _clamped_knots(time, every)
        p = len(knots) - DEGREE - 1
        # With few degrees of freedom the score is unreliable. With 0.9 no model of the study's
        # subsets of 1,000 samples changes; with 0.3 a third of them do.
        if p < DEGREE + 2 or p > 0.6 * n:
            continue
        design, bands = _spline_basis(time.tobytes(), every)
        coefficients = cho_solve_banded((bands, False), design.T @ values)
        gcv = n * np.sum((values - design @ coefficients) ** 2, axis=0) / (n - p) ** 2
        for channel in np.flatnonzero(gcv < score).tolist():
            splines[channel] = BSpline(knots, coefficients[:, channel], DEGREE)
            score[channel], effective[channel] = gcv[channel], p
        if np.all(gcv > STOP_SCORE_RATIO * score):
            break
    if not np.all(effective):
        raise IdentificationError(Code.RECORDING_SHORT, samples=n)
    return [splines[channel] for channel in range(channels)], effective


def _evaluate_splines(splines: list[BSpline], time: np.ndarray) -> np.ndarray:
    return np.column_stack([spline(time) for spline in splines])


def _clamped_knots(time: np.ndarray, every: int) -> np.ndarray:
    """Place clamped knots at every m-th sample, so that each span contains data."""
    inner = time[every:-every:every]
    return np.r_[[time[0]] * (DEGREE + 1), inner, [time[-1]] * (DEGREE + 1)]


@lru_cache(maxsize=len(KNOT_SPACINGS))  # replicates mostly share their times
def _spline_basis(time: bytes, every: int) -> tuple[csr_array, np.ndarray]:
    """Compute B-splines at the times, (n, p), and the Cholesky bands of their normal equations."""
    instants = np.frombuffer(time)
    # no sample is outside; to check this would cost as much as the matrix
    knots = _clamped_knots(instants, every)
    design = BSpline.design_matrix(instants, knots, DEGREE, extrapolate=True)
    gram = design.T @ design
    bands = [np.pad(gram.diagonal(k), (k, 0)) for k in range(DEGREE, -1, -1)]
    return design, cholesky_banded(np.stack(bands))


@dataclass(frozen=True)
class Regressions:
    """Regressions of state derivatives on candidate terms, with the smoothing chosen from the data.

    They are of the recordings of one noise realisation. tuned: by the smoothing that predicts
    held-out stretches best, or by `reduce_by_splines` if there is none to choose. filters: all that
    were tried.
    """

    tuned: ReducedRegression
    filters: tuple[TriedFilter, ...] = ()


def reduce_by_splines(
    recordings: Sequence[Recording], terms: tuple[Exponents, ...]
) -> ReducedRegression:
    """Reduce recordings of one system to a regression of state derivatives on candidate terms.

    Derivatives that were not measured, and the states, are those of splines whose smoothness
    generalised cross-validation chooses for each channel. Raises IdentificationError if a value is
    missing, ValueError for samples too few for a spline.
    """
    _check_complete(recordings)
    if recordings[0].exact:
        parts = [(r.values, r.rates, np.full(len(r.states), len(r.time))) for r in recordings]
    else:
        filled = map(with_missing_samples, recordings)
        parts = [differentiate(each.time, each.values) for each in filled]
    states, rates, observations = zip(*parts, strict=True)
    x, dx = np.concatenate(states), np.concatenate(rates)
    # block by block, so that a block's library stays in the cache
    blocks = ((design_matrix(x[rows], terms), dx[rows]) for rows in block_slices(len(x)))
    return reduce_blocks(blocks, np.sum(observations, axis=0), recordings[0].states, terms)


def reduce(recordings: Sequence[Recording], terms: tuple[Exponents, ...]) -> Regressions:
    """Reduce recordings of one system to regressions with every candidate smoothing filter.

    If derivatives were measured, or samples are not part of equally spaced ones, there is no filter
    to choose. Raises IdentificationError if a value is missing.
    """
    _check_complete(recordings)
    filled = list(recordings if recordings[0].exact else map(with_missing_samples, recordings))
    tried = tried_filters(filled, terms, smoothing_filters)
    if not tried:
        return Regressions(reduce_by_splines(recordings, terms))
    return Regressions(best_filter(tried).reduced, tuple(tried))


def _check_complete(recordings: Sequence[Recording]) -> None:
    for recording in recordings:
        if not np.all(np.isfinite(recording.values)):
            raise IdentificationError(Code.INCOMPLETE_SAMPLES, "state")
        rates = recording.rates if recording.exact else None
        if rates is not None and not np.all(np.isfinite(rates)):
            raise IdentificationError(Code.INCOMPLETE_SAMPLES, "derivative")


def reduce_weakly(recordings: Sequence[Recording], terms: tuple[Exponents, ...]) -> Regressions:
    """Reduce recordings of one system to weak-form regressions: integrals with test functions.

    Weak SINDy (Messenger and Bortz 2021; Reinbold et al. 2020) with pysindy's test functions.
    Raises ValueError for irregular, short or missing samples.
    """
    if not all(recording.is_uniform for recording in recordings):
        raise IdentificationError(Code.IRREGULAR_SAMPLES)
    _check_complete(recordings)
    tried = tried_filters(recordings, terms, weak_form_filters)
    if not tried:
        samples = sum(len(one.time) for one in recordings)
        raise IdentificationError(Code.RECORDING_SHORT, samples=samples)
    return Regressions(best_filter(tried).reduced, tuple(tried))
