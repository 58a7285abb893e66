"""Multiple shooting over condensed recordings (H. G. Bock, 1983).

The misfit of segments is linearised in their first states and in the coefficients. Chains of one
segment leave all first states free; one chain per recording is, at convergence, single shooting.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any, Self, TypeVar

import numpy as np

from galloping.identification.findings import Code, Finding
from galloping.identification.likelihood.condense import Condensed
from galloping.identification.likelihood.repetition import FollowedRecording
from galloping.identification.likelihood.square_root import separate_states
from galloping.identification.no_model import NotConvergedError
from galloping.identification.problem import Problem
from galloping.identification.work import count_work
from galloping.recording.samples import Recording
from galloping.trajectory.taylor import at_points, integrate

# Ratio of a diverged solution to the recorded motion, or of its derivatives to their expected size.
# Products of such numbers are finite.
DIVERGENCE_RATIO = 1e30
# Most trials of windows and segments, and of a Gauss-Newton step, each half as long as the one
# before (docs/identification_parts.csv).
MAX_TRIALS = 6
Fit = TypeVar("Fit", bound=Any)  # with `record`, `free`, `support` and `starts`
Result = TypeVar("Result")
SEGMENT_WORK = 5e-5  # work to linearise a segment, or to put it in a chain, s


@dataclass(frozen=True)
class Segments:
    """Division of recordings into segments for multiple shooting, and of these into chains.

    A segment consists of whole windows, a chain of consecutive segments with joined ends. first:
    (n_segments + 1,) first window of each, and the number of windows. recording: (n_segments,)
    index of the recording of each. chains: (n_segments,) the chain of each segment, non-decreasing.
    """

    first: np.ndarray
    recording: np.ndarray
    chains: np.ndarray

    @property
    def bounds(self) -> np.ndarray:
        """First segment of each chain, and at the end the number of segments, (n_chains + 1,)."""
        return np.flatnonzero(np.diff(self.chains, prepend=-1, append=-1))


@dataclass(frozen=True)
class ShootingData:
    """Data of a multiple-shooting fit: projected samples, their segments, and the problem.

    states: (n_windows, n_states) smoothed, where the windows begin. floor: (n_recordings,
    n_observed) least standard deviation of the projections' noise.
    """

    problem: Problem
    condensed: Condensed
    segments: Segments
    states: np.ndarray
    floor: np.ndarray

    @property
    def starts(self) -> np.ndarray:
        """Smoothed states at the beginning of each segment, (n_segments, n_states)."""
        return self.states[self.segments.first[:-1]]

    @property
    def first_segments(self) -> np.ndarray:
        """Index of the first segment of each recording, (n_recordings,)."""
        return np.unique(self.segments.recording, return_index=True)[1]

    @cached_property
    def followed_segments(self) -> np.ndarray:
        """Indices of the segments that are not the last of their recording."""
        return np.flatnonzero(np.diff(self.segments.recording) == 0)

    @cached_property
    def window_recordings(self) -> np.ndarray:
        """Index of the recording of each window, (n_windows,)."""
        return np.repeat(self.segments.recording, np.diff(self.segments.first))

    @property
    def stretch(self) -> float:
        """Median length of the segments, s."""
        return float(np.median(np.diff(self.segments.first)) * self.condensed.step)

    @cached_property
    def segment_sizes(self) -> np.ndarray:
        """Root mean square of the motion in each segment, relative to that of all recordings.

        Shape (n_segments,). 3 % is added in squares: jumps are no smaller if the motion rests. With
        half or twice as much, 1 of 10 models of `make exam` changes, by 0.02 standard errors.
        """
        mean = np.mean(self.states**2, axis=0) + np.finfo(float).tiny
        squares = np.mean(self.states**2 / mean, axis=1)
        first = self.segments.first
        return np.sqrt(np.add.reduceat(squares, first[:-1]) / np.diff(first) + 0.03**2)

    def predict_projections(
        self, free: np.ndarray, starts: np.ndarray, segments: slice = slice(None)
    ) -> np.ndarray:
        """Simulate consecutive segments, and project the solution like the samples.

        starts: (n, n_states) first states of the segments. Returns (n_windows, n_observed, n_rows),
        not finite where the solution diverges.
        """
        first = self.segments.first
        begin, end, _ = segments.indices(len(first) - 1)
        compiled = self.problem.compile_system(free, self.problem.candidates[:0])
        with np.errstate(all="ignore"):
            ends = first[begin : end + 1]
            predicted = self.condensed.integrate_segments(compiled, ends, starts, False)[0]
        size = np.abs(self.condensed.targets).max(axis=(0, 2)) + np.finfo(float).tiny
        return np.where(np.abs(predicted) < DIVERGENCE_RATIO * size[:, None], predicted, np.inf)

    @cached_property
    def extent(self) -> np.ndarray:
        """Largest absolute value of each smoothed state, (n_states,)."""
        return np.abs(self.states).max(axis=0) + np.finfo(float).tiny

    def derivative_units(self, pairs: np.ndarray) -> np.ndarray:
        """Estimate the sizes of the states' derivatives by coefficients and initial states.

        pairs: (n_pairs, 2) coefficients (equation, term). Returns (n_states, n_pairs + n_states),
        of each state's derivative by these coefficients over a window, and by first states.
        """
        table, inputs = self.problem.tables, np.abs(self.condensed.inputs[:, 0])
        signals = np.append(self.extent, inputs.max(axis=0) + np.finfo(float).tiny)
        terms = np.prod(signals ** table.exponents[table.position], axis=1)
        relative = self.condensed.step * terms[pairs[:, 1]] / self.extent[pairs[:, 0]]
        return self.extent[:, None] * np.append(relative, 1.0 / self.extent)

    def jump_roots(self, jump: np.ndarray) -> np.ndarray:
        """Compute a root of the inverse covariance of the state's jump after each segment.

        jump: (n_states, n_states) covariance at full motion. Returns (n_segments, n_states,
        n_states).
        """
        return np.linalg.inv(np.linalg.cholesky(jump)) / self.segment_sizes[:, None, None]

    def iterate_linearised(
        self, free: np.ndarray, starts: np.ndarray, pairs: np.ndarray, at_once: int
    ) -> Iterator[tuple[slice, slice, np.ndarray, np.ndarray, np.ndarray, np.ndarray]]:
        """Yield simulations of groups of segments, with derivatives by coefficients and states.

        A group has `at_once` segments, which begin at `starts`. pairs: (n_pairs, 2) coefficients
        (equation, term); derivatives are by these and by the first states. Yields the segments,
        their windows, the residual (n_windows, n_observed, n_rows), derivatives of the predicted
        projections (..., n_pairs + n_states), the ends (n, n_states) and derivatives of the ends.
        Raises FloatingPointError if a solution diverges.
        """
        compiled, first = self.problem.compile_system(free, pairs), self.segments.first
        most = DIVERGENCE_RATIO * self.extent, DIVERGENCE_RATIO * self.derivative_units(pairs)
        for begin in range(0, len(starts), at_once):
            group = slice(begin, min(begin + at_once, len(starts)))
            edges = first[group.start : group.stop + 1]
            windows = slice(edges[0], edges[-1])
            predicted, slopes, *ends, _ = self.condensed.integrate_segments(
                compiled, edges, starts[group], sensitive=True
            )
            if not all(np.all(np.abs(each) < m) for each, m in zip(ends, most, strict=True)):
                raise FloatingPointError("the model diverges within a segment")
            yield group, windows, self.condensed.targets[windows] - predicted, slopes, *ends


@dataclass(frozen=True)
class Linearised:
    """Residuals of all segments, linearised in the coefficients and the segments' initial states.

    A segment's rows are rotated so that only the first of them contain its state: these are `rows`;
    the others are regressions on the coefficients alone. Otherwise the remainder after elimination
    of the state, a small part of the whole, would be lost in rounding.

    starts: (n_segments, n_states), about which they are linearised. rows: (n_segments, m, n + m +
    1), of coefficients, state and residual; m is n_states, or more with repeated columns (see
    `linearise_segments`). fold: (n_segments,) index of the part of the data that each belongs to.
    information: (n_folds + 1, n, n), right: (n_folds + 1, n), of the other rows of each fold, and
    of the prior. residual: (n_windows, n_observed, n_rows), not whitened. ends: (n_segments,
    n_states) last states; end_derivatives: (n_segments, n_states, n + n_states).
    """

    starts: np.ndarray
    rows: np.ndarray
    fold: np.ndarray
    information: np.ndarray
    right: np.ndarray
    residual: np.ndarray
    ends: np.ndarray
    end_derivatives: np.ndarray


def linearise_segments(
    record: ShootingData,
    free: np.ndarray,
    starts: np.ndarray,
    whiten: Callable[[np.ndarray, slice], np.ndarray],
    *,
    pairs: np.ndarray | None = None,
    columns: np.ndarray | None = None,
    repeated: Sequence[int] | np.ndarray = (),
    n_folds: int = 1,
) -> Linearised:
    """Linearise the residuals of segments in coefficients and initial states.

    free: (n_candidates,) coefficients, starts: (n_segments, n_states), about which to linearise.
    whiten: function of rows (n, n_observed, n_rows, n_columns) and of their windows that returns
    the rows in units of the noise, and may overwrite them; with folds, of a single segment. pairs:
    (n_pairs, 2) coefficients (equation, term) to linearise by, by default the candidates. columns:
    (n_windows, n_observed, n_rows, n_columns), derivatives of the predicted projections by
    parameters of the instrument, which count as coefficients after the others. repeated:
    coefficients whose columns are repeated after the state, for their deviations in the segment.
    n_folds: parts of the data, of nearly as many consecutive segments each. Raises
    FloatingPointError if the solution diverges within a segment.
    """
    problem, targets = record.problem, record.condensed.targets
    pairs = problem.candidates if pairs is None else pairs
    (count, n_states), direct = starts.shape, 0 if columns is None else columns.shape[3]
    n, m = len(pairs) + direct, n_states + len(repeated)
    state_rows, fold = np.empty((count, m, n + m + 1)), np.arange(count) * n_folds // count
    information, right = np.zeros((n_folds + 1, n, n)), np.zeros((n_folds + 1, n))
    residual, ends = np.empty(targets.shape), np.empty(starts.shape)
    slopes = np.zeros((*starts.shape, n + n_states))
    by_dynamics = np.r_[: len(pairs), n : n + n_states]
    # segments with some 500 windows in all, whose derivatives fit in the cache
    at_once = max(500 * count // len(targets), 1) if n_folds == 1 else 1
    for group, windows, group_residual, rows, *reached in record.iterate_linearised(
        free, starts, pairs, at_once
    ):
        residual[windows] = group_residual
        ends[group], slopes[group][..., by_dynamics] = reached
        if columns is not None:
            rows = np.insert(rows, [len(pairs)] * direct, columns[windows], axis=3)
        rows = np.concatenate([rows, rows[..., list(repeated)], group_residual[..., None]], axis=3)
        rows = np.ascontiguousarray(whiten(rows, windows)).reshape(-1, n + m + 1)
        first = record.segments.first[group.start : group.stop + 1] - windows.start
        state_rows[group], others = separate_states(rows, first * group_residual[0].size, n)
        k = fold[group.start]
        information[k] += others[:, :n].T @ others[:, :n]
        right[k] += others[:, -1] @ others[:, :n]
    count_work((1.1e-8 + 3e-11 * n) * (n + m) * targets.size + SEGMENT_WORK * count)
    precision, expected, values = (
        problem.candidate_values(each, pairs)
        for each in (problem.precision, problem.expected, problem.coefficients(free))
    )
    known = np.arange(len(pairs))
    information[-1, known, known] = precision
    right[-1, known] = precision * (expected - values)
    return Linearised(starts, state_rows, fold, information, right, residual, ends, slopes)


@dataclass(frozen=True)
class ShootingFit:
    """Iterate of a multiple-shooting fit: coefficients, segments' initial states, and noise.

    free: (n_candidates,) coefficients, zero outside the support (n_candidates,), boolean. starts:
    (n_segments, n_states) first states. sigma: (n_recordings, n_observed) standard deviation of the
    projections' noise, not below the floor. reference: the same as first estimated. chi2: misfit in
    units of `reference`, of the fit before the last step; infinite before any step. In
    `several_minima`, that of this fit.
    """

    record: ShootingData
    free: np.ndarray
    support: np.ndarray
    starts: np.ndarray
    sigma: np.ndarray
    reference: np.ndarray
    chi2: float = np.inf

    @property
    def misfit(self) -> float:
        """Misfit per projection of the samples: chi^2 divided by the number of projections."""
        return self.chi2 / float(np.sum(self.record.condensed.rows))

    @property
    def n_parameters(self) -> int:
        """Number of fitted parameters: coefficients, and the initial states of all chains."""
        chains = int(self.record.segments.chains[-1]) + 1
        return int(self.support.sum()) + chains * self.starts.shape[1]

    @property
    def whole_chains(self) -> Self:
        """The same fit with each chain as one segment, from the first state of the chain."""
        segments, bounds = self.record.segments, self.record.segments.bounds
        begins = bounds[:-1]
        whole = Segments(segments.first[bounds], segments.recording[begins], np.arange(len(begins)))
        record = replace(self.record, segments=whole)
        return replace(self, record=record, starts=self.starts[begins])

    def linearise(
        self, pairs: np.ndarray | None = None, columns: np.ndarray | None = None
    ) -> Linearised:
        """Linearise the residuals; arguments and exceptions are those of `linearise_segments`."""
        record, weight = self.record, 1.0 / self.sigma[:, :, None, None]

        def whiten(rows: np.ndarray, windows: slice) -> np.ndarray:
            rows *= weight[record.window_recordings[windows]]
            return rows

        return linearise_segments(
            record, self.free, self.starts, whiten, pairs=pairs, columns=columns
        )

    def states_at(self, places: np.ndarray) -> np.ndarray:
        """Compute the states, (n_windows, n_places, n_states), at some times of every window.

        places: (n_places,) times from the window's beginning, in windows. Raises FloatingPointError
        if the motion diverges.
        """
        record, windows, n = self.record, len(self.record.states), self.starts.shape[1]
        compiled = record.problem.compile_system(self.free, record.problem.candidates[:0])
        window = np.repeat(np.arange(windows), len(places))
        powers, samples, _ = at_points(compiled, window, np.tile(places, windows), windows, n)
        states, *_ = integrate(
            compiled, record.condensed.step, record.segments.first, self.starts, powers,
            np.arange(n), record.condensed.inputs, False, samples,
        )  # fmt: skip
        if not np.all(np.abs(states) < DIVERGENCE_RATIO):
            raise FloatingPointError("the model diverges within a segment")
        return states.transpose(0, 2, 1)

    def follow_recordings(self, recordings: Sequence[Recording]) -> list[FollowedRecording]:
        """Return the fitted states at the beginnings of the segments, for each recording."""
        segments, condensed = self.record.segments, self.record.condensed
        owner = segments.recording
        times = condensed.step * (segments.first[:-1] - condensed.first[owner])
        return [
            FollowedRecording(times[owner == k], self.starts[owner == k], np.ptp(one.time))
            for k, one in enumerate(recordings)
        ]


def cut_segments(condensed: Condensed, windows: int, allowed: np.ndarray) -> Segments:
    """Divide recordings into shooting segments of some windows, each a chain of its own.

    allowed: (n_windows,) whether a segment may start at a window, besides the first of a recording;
    otherwise it starts at the nearest window that is allowed.
    """
    first, recording = [], []
    for r, (a, b) in enumerate(pairwise(condensed.first)):
        pieces = max(1, round((b - a) / windows))
        starts = np.linspace(a, b, pieces + 1).round().astype(np.int64)[:-1]
        permitted = np.append(a, a + 1 + np.flatnonzero(allowed[a + 1 : b]))
        next_indices = np.minimum(np.searchsorted(permitted, starts), len(permitted) - 1)
        previous_indices = np.maximum(next_indices - 1, 0)
        nearer = starts - permitted[previous_indices] <= np.abs(permitted[next_indices] - starts)
        starts = np.unique(np.where(nearer, permitted[previous_indices], permitted[next_indices]))
        first.append(starts)
        recording.append(np.full(len(starts), r))
    owner = np.concatenate(recording)
    bounds = np.append(np.concatenate(first), condensed.first[-1])
    return Segments(bounds, owner, np.arange(len(owner)))


def segment_residuals(
    record: ShootingData, free: np.ndarray, starts: np.ndarray
) -> tuple[np.ndarray, float]:
    """Simulate every segment, and subtract the solution from the projected samples.

    Returns the residuals, (n_windows, n_observed, n_rows), and the integrator's relative error.
    Raises FloatingPointError if the solution diverges within a segment.
    """
    compiled = record.problem.compile_system(free, record.problem.candidates[:0])
    predicted, _, ends, _, truncation = record.condensed.integrate_segments(
        compiled, record.segments.first, starts, sensitive=False
    )
    if not np.all(np.abs(ends) < DIVERGENCE_RATIO * record.extent):
        raise FloatingPointError("the model diverges over the recording")
    return record.condensed.targets - predicted, truncation


def shorten_step(use: Callable[[Fit], Result], before: Fit, fit: Fit) -> Result:
    """Call a function of a fit, and halve the step to the fit as long as this fails.

    before: the fit from which the step leads to `fit`; fits between have its noise. Raises
    NotConvergedError if the function raises FloatingPointError MAX_TRIALS times.
    """
    for _ in range(MAX_TRIALS):
        try:
            return use(fit)
        except FloatingPointError:
            fit = replace(
                before,
                record=fit.record,
                free=(before.free + fit.free) / 2.0,
                starts=(before.starts + fit.starts) / 2.0,
                support=before.support | fit.support,
            )
    raise NotConvergedError(Finding.of(Code.ITERATION_DIVERGES))
