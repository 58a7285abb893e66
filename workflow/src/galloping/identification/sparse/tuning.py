"""Tuning of pysindy's settings on a recording: smoothing and test functions.

All settings are scaled by the shortest period of a recording, and validated by the same integrals
of its raw samples over held-out stretches (see `regression`). On equally spaced samples they are
linear filters, whose kernels are the impulse responses of pysindy's own classes; applying those
classes to every sample would take 10^3 times longer.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial
from itertools import product

import numpy as np
import pysindy as ps
from numpy.lib.stride_tricks import sliding_window_view
from scipy.fft import irfft, next_fast_len, rfft

from galloping.identification.sparse.regression import (
    ReducedRegression,
    block_slices,
    judge_path,
    reduce_blocks,
)
from galloping.identification.sparse.supports import forward_models
from galloping.model.polynomial import Exponents, design_matrix
from galloping.recording.samples import Recording

MIN_WINDOW_SAMPLES = 7  # samples of the smallest window
VALIDATION_HALF_WIDTH = 1 / 2  # half width of the validating test functions, in periods
VALIDATION_ORDER = 4  # order of the validating test functions at their ends
MIN_ROWS = 7500  # least number of rows used of a long recording; at most twice as many are used
MAX_TERMS = 15  # most terms of the models by which settings are compared
Block = tuple[np.ndarray, np.ndarray]  # rows of a library (r, p) and of targets (r, m)


@dataclass(frozen=True)
class TriedFilter:
    """Result of applying a filter to recordings: data to fit models and to validate the filter.

    states, terms, products, held_out: as of `ReducedRegression`. blocks: library and targets of
    each stretch.
    """

    states: tuple[str, ...]
    terms: tuple[Exponents, ...]
    products: np.ndarray
    held_out: np.ndarray
    blocks: list[Block]

    @cached_property
    def reduced(self) -> ReducedRegression:
        """Regression on the filtered recordings, reduced to few rows."""
        observations = np.full(len(self.states), sum(len(library) for library, _ in self.blocks))
        return reduce_blocks(self.blocks, observations, self.states, self.terms, self.held_out)


def best_filter(tried: Sequence[TriedFilter]) -> TriedFilter:
    """Choose the filter whose greedily grown models have the least error on held-out data.

    The errors of the state derivatives, each relative to the least of all filters, are added.
    """
    path = partial(forward_models, steps=MAX_TERMS)
    judged = [judge_path(each.products, each.held_out, len(each.states), path) for each in tried]
    errors = np.stack([each.best for each in judged])
    return tried[np.sum(errors / errors.min(axis=0), axis=1).argmin()]


@lru_cache(maxsize=64)
def savitzky_golay(window: int, order: int, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Compute the Savitzky-Golay convolution kernels of a smoothed state and of its derivative.

    window: odd number of samples, order: of the local polynomial, step: between samples, s.
    Returns two kernels (window,): that of the state from SmoothedFiniteDifference, that of the
    slope from SINDyDerivative.
    """
    half = window // 2
    impulse = np.zeros((4 * half + 1, 1))
    impulse[2 * half] = 1
    inner = slice(half, 3 * half + 1)  # where no end shortens a window
    options = {"window_length": window, "polyorder": order}
    smoother = ps.SmoothedFiniteDifference(smoother_kws=options)
    smoother(impulse, t=1.0)
    slope = ps.SINDyDerivative(
        kind="savitzky_golay", left=half, right=half, order=order, iwindow=True,
        periodic=True, period=len(impulse) / half,  # else windows at the ends have too few samples
    )  # fmt: skip
    # in half windows as unit of time: well conditioned
    slopes = np.asarray(slope(impulse, t=1 / half)) / half
    return np.asarray(smoother.smoothed_x_)[inner, 0], slopes[inner, 0] / step


@lru_cache(maxsize=64)
def weak_form(half: int, order: int, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Compute the convolution kernels of the weak form, for terms and for state derivatives.

    half: half length of the test function, in samples; order: of its ends. Returns
    two kernels (2 half + 1,): WeakPDELibrary's weights of one test function, which are the same at
    any place.
    """
    random_state = np.random.get_state()
    # the cell holds these 2 half + 1 samples wherever its centre is drawn
    library = ps.WeakPDELibrary(
        function_library=ps.PolynomialLibrary(degree=1),
        spatiotemporal_grid=step * np.arange(-half - 1, half + 2),
        K=1,
        H_xt=step * (half + 0.5),
        p=order,
    )
    np.random.set_state(random_state)
    return library.fullweights0[0][::-1], -library.fulltweights[0][::-1]


class Convolution:
    """Fourier transform of data columns, stored to convolve them with many kernels.

    columns: (n, m). longest: samples of the longest kernel.
    """

    def __init__(self, columns: np.ndarray, longest: int) -> None:
        self._length = next_fast_len(len(columns) + longest, real=True)
        self._spectrum = rfft(np.ascontiguousarray(columns.T), self._length)

    def __call__(self, kernel: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Convolve with a kernel of odd length, centred on `rows`: (len(rows), m)."""
        full = irfft(self._spectrum * rfft(kernel, self._length), self._length)
        return full[:, rows + len(kernel) // 2].T


class _Frame:
    """Rows of one recording for regression, in stretches, and the integrals that validate.

    values: (n, m), step: s between them, samples: in a period. rows: samples, none nearer to an end
    than half a period. stretches: of the rows. centres: (c,) rows of each stretch at which the
    validating test functions are centred. weights, slopes: the test function on the rows, its slope
    on samples.
    """

    def __init__(self, recording: Recording, period: float, terms: tuple[Exponents, ...]) -> None:
        n, self.states, self.values = len(recording.time), recording.states, recording.values
        self.step = float(recording.time[-1] - recording.time[0]) / (n - 1)
        self.samples, self.terms = max(period / self.step, MIN_WINDOW_SAMPLES), terms
        margin, stride = int(self.samples / 2) + 2, max(1, n // MIN_ROWS)
        self.rows = np.arange(margin, n - margin, stride)
        self.stretches = block_slices(len(self.rows))
        half = max(2, round(VALIDATION_HALF_WIDTH * self.samples / stride))
        self.centres = [
            np.arange(each.start + half, each.stop - half, half // 2) for each in self.stretches
        ]
        self.weights = _test_function(half, stride * self.step)[0]
        self.slopes = _test_function(half * stride, self.step)[1]

    @cached_property
    def _raw(self) -> list[np.ndarray]:
        return [-_weighted_sums(self.values, self.slopes, self.rows[c]) for c in self.centres]

    def held_out(self, library: np.ndarray) -> np.ndarray:
        """Compute inner products of integrals of a library (r, p) and of raw samples' slopes."""
        stretches = zip(self.centres, self._raw, strict=True)
        return _inner_products(
            (_weighted_sums(library, self.weights, c), raw) for c, raw in stretches
        )

    def try_filter(
        self, library: np.ndarray, targets: np.ndarray, held_out: np.ndarray | None = None
    ) -> TriedFilter:
        """Make the filter with this library and targets. held_out: if already computed."""
        held_out = self.held_out(library) if held_out is None else held_out
        blocks = [(library[each], targets[each]) for each in self.stretches]
        return TriedFilter(self.states, self.terms, _inner_products(blocks), held_out, blocks)


def tried_filters(
    recordings: Sequence[Recording],
    terms: tuple[Exponents, ...],
    make_filters: Callable[[_Frame], Iterator[TriedFilter]],
) -> list[TriedFilter]:
    """Apply each candidate smoothing filter to all recordings; return its regression problems.

    make_filters: `smoothing_filters` or `weak_form_filters`. Empty if derivatives were measured,
    samples are not equally spaced, or the stretches of a recording are too short.
    """
    if any(each.exact or not each.is_uniform for each in recordings):
        return []
    period = min(map(_shortest_line_period, recordings))
    frames = [_Frame(recording, period, terms) for recording in recordings]
    if not all(frame.centres and all(map(len, frame.centres)) for frame in frames):
        return []
    return [_join_filters(parts) for parts in zip(*map(make_filters, frames), strict=True)]


def smoothing_filters(frame: _Frame) -> Iterator[TriedFilter]:
    """Yield a Savitzky-Golay filter for each window length, up to one period, and order."""
    windows = 2 * (np.geomspace(MIN_WINDOW_SAMPLES, frame.samples, 7) / 2).astype(int) + 1
    filtered = Convolution(frame.values, windows[-1])
    for window, order in product(windows.tolist(), (5, 3)):
        kernels = savitzky_golay(window, order, frame.step)
        states, slopes = (filtered(kernel, frame.rows) for kernel in kernels)
        yield frame.try_filter(design_matrix(states, frame.terms), slopes)


def weak_form_filters(frame: _Frame) -> Iterator[TriedFilter]:
    """Yield a weak-form filter for each half width, in periods, and order of test functions."""
    raw = design_matrix(frame.values, frame.terms)
    halves = [max(2, int(share * frame.samples)) for share in (1 / 8, 1 / 4, 1 / 2)]
    longest = 2 * halves[-1] + 1
    library, states = Convolution(raw, longest), Convolution(frame.values, longest)
    held_out = frame.held_out(raw[frame.rows])
    for half, order in product(halves, (2, 8)):
        weights, slopes = weak_form(half, order, frame.step)
        yield frame.try_filter(library(weights, frame.rows), states(slopes, frame.rows), held_out)


def _join_filters(parts: Sequence[TriedFilter]) -> TriedFilter:
    return replace(
        parts[0],
        products=np.concatenate([part.products for part in parts]),
        held_out=np.concatenate([part.held_out for part in parts]),
        blocks=[block for part in parts for block in part.blocks],
    )


def _inner_products(blocks: Iterable[Block]) -> np.ndarray:
    """Compute inner products of all columns of each block: (blocks, p + m, p + m)."""
    return np.stack([rows.T @ rows for rows in map(np.hstack, blocks)])


def _shortest_line_period(recording: Recording) -> float:
    """Find the shortest period, s, of the strongest spectral lines of the channels."""
    n = len(recording.time)
    spectrum = np.abs(rfft(recording.values - recording.values.mean(axis=0), axis=0))
    line = 1 + spectrum[1:].argmax(axis=0).max()
    return float(recording.time[-1] - recording.time[0]) * n / (n - 1) / line


def _test_function(half: int, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Compute weights (2 half + 1,) of int phi f and int phi' f for phi = (1 - u^2)^order."""
    order, u = VALIDATION_ORDER, np.arange(-half, half + 1) / half
    inside = 1 - u**2
    return step * inside**order, -2 * order * u * inside ** (order - 1) / half


def _weighted_sums(columns: np.ndarray, weights: np.ndarray, centres: np.ndarray) -> np.ndarray:
    """Sum weights times columns (n, m) around each centre: (len(centres), m)."""
    return sliding_window_view(columns, len(weights), axis=0)[centres - len(weights) // 2] @ weights
