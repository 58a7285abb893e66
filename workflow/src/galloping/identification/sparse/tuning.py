"""The settings that pysindy leaves to its user, tried on a recording: smoothing and test functions.

All of them are scaled by the shortest period that a recording shows, and judged by the same
integrals of its raw samples over held-out stretches (see `cross_validation`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise, product

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from galloping.identification.sparse.cross_validation import judge
from galloping.identification.sparse.filters import Filtered, savitzky_golay, weak_form
from galloping.identification.sparse.regression import BLOCKS, Regression, regression
from galloping.identification.sparse.supports import forward_supports
from galloping.polynomial import Exponents, design_matrix
from galloping.recording import Recording

SMALLEST, WINDOWS = 7, 7  # samples of the smallest window, number of windows up to one period
ORDERS = (5, 3)  # of the local polynomials
HALF_WIDTHS = (1 / 8, 1 / 4, 1 / 2)  # of the test functions, in periods
ENDS = (2, 8)  # orders of the test functions at their ends
JUDGE = (1 / 2, 4)  # half width in periods, and order at the ends, of the test functions that judge
ROWS = 7500  # of a recording that are kept, or up to twice as many: their neighbours say the same
STEPS = 15  # terms up to which models grow to compare settings by


def smoothings(recordings: Sequence[Recording], terms: tuple[Exponents, ...]) -> list[Regression]:
    """A regression for each window and order of Savitzky-Golay filters on states and slopes.

    Empty where derivatives were measured, samples are not equally spaced, or the stretches of a
    recording are too short to be held out.
    """
    return _tried(recordings, terms, _smoothed)


def test_functions(
    recordings: Sequence[Recording], terms: tuple[Exponents, ...]
) -> list[Regression]:
    """A regression in the weak form for each length and order of test functions.

    They stand on the rows that `smoothings` keep; empty where those are.
    """
    return _tried(recordings, terms, _weak)


def best_setting(settings: Sequence[Regression]) -> int:
    """The one whose models, grown term by term, err least on held-out stretches.

    Errors of each state derivative in units of the least of all settings, added up.
    """
    path = partial(forward_supports, steps=STEPS)
    errors = np.stack([judge(problem, path).best for problem in settings])
    return int(np.sum(errors / errors.min(axis=0), axis=1).argmin())


class _Frame:
    """The rows of one recording to regress on, in stretches, and the integrals that judge.

    values: (n, m), step: s between them, samples: in a period. rows: (r,) samples, none nearer to
    an end than half a period. centres: (c,) of them where the test functions stand that judge,
    each within one stretch. weights, slopes: the test function on the rows, its slope on samples.
    """

    def __init__(self, recording: Recording, period: float) -> None:
        n, self.states, self.values = len(recording.time), recording.states, recording.values
        self.step = float(recording.time[-1] - recording.time[0]) / (n - 1)
        self.samples = max(period / self.step, SMALLEST)
        margin, stride = int(self.samples / 2) + 2, max(1, n // ROWS)
        self.rows = np.arange(margin, n - margin, stride)
        self.edges = np.linspace(0, len(self.rows), BLOCKS + 1).astype(int)
        half = max(2, round(JUDGE[0] * self.samples / stride))
        self.centres = [np.arange(a + half, b - half, half // 2) for a, b in pairwise(self.edges)]
        self.weights = _bump(half, stride * self.step)[0]
        self.slopes = _bump(half * stride, self.step)[1]

    @property
    def can_be_held_out(self) -> bool:
        return all(map(len, self.centres))

    def regression(
        self,
        library: np.ndarray,
        targets: np.ndarray,
        predictors: np.ndarray,
        terms: tuple[Exponents, ...],
    ) -> Regression:
        """Of rows (r, p) and (r, m), judged by the integrals of the library `predictors` (r, p)."""
        m, blocks = targets.shape[1], [slice(a, b) for a, b in pairwise(self.edges)]
        reduced = regression(
            ((library[b], targets[b]) for b in blocks), np.full(m, len(library)), self.states, terms
        )
        products = []
        for centres in self.centres:
            raw = -_integrals(self.values, self.slopes, self.rows[centres])
            rows = np.hstack([_integrals(predictors, self.weights, centres), raw])
            products.append(rows.T @ rows)
        return replace(reduced, held_out=np.stack(products))


def _tried(recordings, terms, applied: Callable) -> list[Regression]:
    if not all(r.derivatives is None and r.is_uniform for r in recordings):
        return []
    period = min(map(_period, recordings))
    frames = [_Frame(recording, period) for recording in recordings]
    if not all(frame.can_be_held_out for frame in frames):
        return []
    return [_joined(parts) for parts in zip(*(applied(f, terms) for f in frames), strict=True)]


def _smoothed(frame: _Frame, terms: tuple[Exponents, ...]) -> Iterator[Regression]:
    windows = 2 * (np.geomspace(SMALLEST, frame.samples, WINDOWS) / 2).astype(int) + 1
    filtered = Filtered(frame.values, windows[-1])
    for window, order in product(windows.tolist(), ORDERS):
        states, slopes = (
            filtered(kernel, frame.rows) for kernel in savitzky_golay(window, order, frame.step)
        )
        library = design_matrix(states, terms)
        yield frame.regression(library, slopes, library, terms)


def _weak(frame: _Frame, terms: tuple[Exponents, ...]) -> Iterator[Regression]:
    raw = design_matrix(frame.values, terms)
    halves = [max(2, int(share * frame.samples)) for share in HALF_WIDTHS]
    longest = 2 * halves[-1] + 1
    library, states = Filtered(raw, longest), Filtered(frame.values, longest)
    for half, order in product(halves, ENDS):
        weights, slopes = weak_form(half, order, frame.step)
        yield frame.regression(
            library(weights, frame.rows), states(slopes, frame.rows), raw[frame.rows], terms
        )


def _joined(parts: Sequence[Regression]) -> Regression:
    """One regression on all recordings."""
    return Regression(
        np.concatenate([part.library for part in parts]),
        np.concatenate([part.targets for part in parts]),
        sum(part.observations for part in parts),
        parts[0].states,
        parts[0].terms,
        np.concatenate([part.held_out for part in parts]),
    )


def _period(recording: Recording) -> float:
    """The shortest period, s, of the strongest spectral lines of the channels."""
    n = len(recording.time)
    spectrum = np.abs(np.fft.rfft(recording.values - recording.values.mean(axis=0), axis=0))
    line = 1 + spectrum[1:].argmax(axis=0).max()
    return float(recording.time[-1] - recording.time[0]) * n / (n - 1) / line


def _bump(half: int, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Weights (2 half + 1,) of int phi f and int phi' f for phi = (1 - u^2)^order."""
    order, u = JUDGE[1], np.arange(-half, half + 1) / half
    inside = 1 - u**2
    return step * inside**order, -2 * order * u * inside ** (order - 1) / half


def _integrals(columns: np.ndarray, weights: np.ndarray, centres: np.ndarray) -> np.ndarray:
    """Sums of weights times columns (n, m) around each centre: (len(centres), m)."""
    return sliding_window_view(columns, len(weights), axis=0)[centres - len(weights) // 2] @ weights
