"""Segments of a recording whose equations hold up to jumps of the state between them.

Weak-constraint estimation (Y. Tremolet, Q. J. R. Meteorol. Soc. 132, 2006): the misfit of the
segments, linearised about a fit, and its normal equations with the states eliminated.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft
from scipy.interpolate import BSpline
from scipy.linalg import lapack

from galloping.identification.likelihood.shooting import HUGE, MOST_HALVINGS, Record
from galloping.identification.work import spend

# Periods of a stretch. Measured: with 3 to 6 a model's error hides in the jumps, and amplitudes are
# up to three times as far off; with 20 or more gusts do not, and dampings are.
STRETCH_PERIODS = 10
STATE_RIDGE = 1e-12  # of the information about a state, where a stretch tells nothing


class Stretches(Record):
    """A record in segments of some periods each, whose chains are not looked at."""

    @cached_property
    def size(self) -> np.ndarray:
        """(n_segments,) root mean square of the motion in each, relative to the whole record, and
        a few percent: jumps are no smaller where it rests.
        """
        mean = np.mean(self.states**2, axis=0) + np.finfo(float).tiny
        squares = np.mean(self.states**2 / mean, axis=1)
        first = self.segments.first
        return np.sqrt(np.add.reduceat(squares, first[:-1]) / np.diff(first) + 0.03**2)

    @cached_property
    def present(self) -> np.ndarray:
        """(n_windows, n_observed, n_rows) whether a projection tells anything."""
        return self.condensed.functionals.any(axis=3)

    @property
    def longest(self) -> int:
        """Windows of the longest segment."""
        return int(np.diff(self.segments.first).max())

    @cached_property
    def followed(self) -> np.ndarray:
        """Indices of the segments that another one of the same recording follows."""
        return np.flatnonzero(np.diff(self.segments.recording) == 0)

    def precision(self, jump: np.ndarray) -> np.ndarray:
        """Of a jump after each segment; jump: its covariance at full motion."""
        return np.linalg.inv(jump) / self.size[:, None, None] ** 2

    def predictions(
        self, free: np.ndarray, starts: np.ndarray, segments: slice = slice(None)
    ) -> np.ndarray:
        """(n_windows, n_observed, n_rows) projections of the solution over consecutive segments,
        not finite where it diverges. starts: (n, n_states) of these.
        """
        first = self.segments.first
        begin, end, _ = segments.indices(len(first) - 1)
        compiled = self.problem.compiled(free, self.problem.candidates[:0])
        with np.errstate(all="ignore"):
            predicted = self.condensed.solution(compiled, first[begin : end + 1], starts, False)[0]
        return np.where(np.abs(predicted) < HUGE, predicted, np.inf)

    def of_variance(self, variance: np.ndarray) -> np.ndarray:
        """(n_recordings, 1, n_observed, n_rows) white misfit of a variance (n_recordings,
        n_observed).
        """
        return np.repeat(variance[:, None, :, None], self.condensed.targets.shape[2], axis=3)

    def white_misfit(self, residual: np.ndarray) -> np.ndarray:
        """Mean squares of a residual, at least the floor, as `of_variance`."""
        squares = self.condensed.squares(residual) / np.maximum(self.condensed.rows, 1)
        return self.of_variance(np.maximum(squares, self.floor**2))

    def coloured_misfit(self, residual: np.ndarray) -> np.ndarray:
        """(n_recordings, n_lags, n_observed, n_rows) autocovariance of a residual, and the floor.

        It falls to zero over the longest segment, as a Parzen window, by which its spectrum is
        smooth. What a model lacks recurs with the motion: were it taken for white noise, it would
        count as many times as there are windows.
        """
        first, n_lags = self.condensed.first, self.longest
        lags = np.arange(n_lags) / (n_lags + 0.5)
        # Parzen's window, up to its height and width; `scipy.signal`, which has it, imports slowly
        parzen = BSpline.basis_element([-2, -1, 0, 1, 2])
        taper = (parzen(2 * lags) / parzen(0.0))[:, None, None]
        misfit = np.empty((len(first) - 1, n_lags, *residual.shape[1:]))
        for r, (a, b) in enumerate(pairwise(first)):
            length = next_fast_len(b - a + n_lags, real=True)
            power = np.abs(rfft(residual[a:b], length, axis=0)) ** 2
            count = np.maximum(self.present[a:b].sum(axis=0), 1)
            misfit[r] = taper * irfft(power, length, axis=0)[:n_lags] / count
        # so that its covariance can be factored
        misfit[:, 0] = (1.0 + 1e-9) * misfit[:, 0] + self.floor[:, :, None] ** 2
        return misfit


@dataclass(frozen=True)
class Linear:
    """Normal equations of every segment in m unknowns, n coefficients and the segment's state.

    free, starts: (n,), (n_segments, n_states), about which they are. information: (n_segments, m,
    m); right: (n_segments, m). residual: (n_windows, n_observed, n_rows). ends: (n_segments,
    n_states), and their derivatives: by_coefficients (n_segments, n_states, n), by_state
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
class Joint:
    """Normal equations of the coefficients, with their priors, the segments' states eliminated.

    response: (n_segments, n_states, n + 1), of the states to a change of the coefficients, and
    constant. variance, covariance: (n_segments, n_states, n_states), of each state, and of each
    with its successor, at given coefficients.
    """

    information: np.ndarray
    right: np.ndarray
    response: np.ndarray
    variance: np.ndarray
    covariance: np.ndarray

    def moved(self, change: np.ndarray) -> np.ndarray:
        """(n_segments, n_states) change of the states with one of the coefficients (n,)."""
        return self.response[:, :, :-1] @ change + self.response[:, :, -1]


@dataclass(frozen=True)
class StretchFit:
    """free, support: (n_candidates,). starts: (n_segments, n_states). misfit: (n_recordings,
    n_lags, n_observed, n_rows) autocovariance of what the projections miss, by the lag in windows,
    zero beyond the last. jump: (n_states, n_states) covariance at full motion.
    """

    record: Stretches
    free: np.ndarray
    support: np.ndarray
    starts: np.ndarray
    misfit: np.ndarray
    jump: np.ndarray

    @cached_property
    def linear(self) -> Linear:
        """Misfit of every segment about the fit. Raises FloatingPointError where that diverges."""
        record = self.record
        problem, condensed, segments = record.problem, record.condensed, record.segments
        compiled = problem.compiled(self.free, problem.candidates)
        count, n = len(self.starts), len(self.free)
        m = n + self.starts.shape[1]
        information, right = np.empty((count, m, m)), np.empty((count, m))
        residual = np.empty(condensed.targets.shape)
        ends, slopes = np.empty(self.starts.shape), np.empty((*self.starts.shape, m))
        for g in range(count):  # one by one: the rows of a long recording do not fit in memory
            own = slice(segments.first[g], segments.first[g + 1])
            predicted, rows, ends[g], slopes[g], _ = condensed.solution(
                compiled, segments.first[g : g + 2], self.starts[g : g + 1], sensitive=True
            )
            if not (np.all(np.abs(ends[g]) < HUGE) and np.all(np.abs(slopes[g]) < HUGE)):
                raise FloatingPointError("the model diverges within a segment")
            if g == 0:  # most that diverge do so by then, and this takes long
                whitened = self._whitening()
            residual[own] = condensed.targets[own] - predicted
            both = np.concatenate([rows, residual[own][..., None]], axis=3)
            spend((8e-9 + 1.5e-10 * self.misfit.shape[1]) * both.size)
            both = whitened(both, own, segments.recording[g]).reshape(-1, m + 1)
            products = both.T @ both
            information[g], right[g] = products[:m, :m], products[:m, m]
        return Linear(
            self.free, self.starts, information, right, residual, ends, slopes[:, :, :n],
            slopes[:, :, n:],
        )  # fmt: skip

    def _whitening(self) -> Callable[[np.ndarray, slice, int], np.ndarray]:
        """What makes projections of a segment independent and of variance one.

        It takes the rows (n_windows, n_observed, n_rows, m) of a segment, the segment's windows and
        its recording, and gives rows that are zero where those are absent.
        """
        if self.misfit.shape[1] == 1:  # white
            weight = 1.0 / np.sqrt(self.misfit[:, 0, :, :, None])
            return lambda rows, own, recording: rows * weight[recording]
        lags = np.arange(self.record.longest)
        covariance = np.moveaxis(self.misfit, 1, -1)[..., np.abs(np.subtract.outer(lags, lags))]
        factors = np.linalg.cholesky(covariance)

        def whitened(rows: np.ndarray, own: slice, recording: int) -> np.ndarray:
            found, n = np.zeros(rows.shape), len(rows)
            for o, k in np.ndindex(rows.shape[1:3]):
                present = self.record.present[own, o, k]
                if not present.any():  # LAPACK prints a message where there are none
                    continue
                at, factor = slice(None), factors[recording, o, k, :n, :n]
                if not present.all():
                    at = np.flatnonzero(present)
                    factor = np.linalg.cholesky(covariance[recording, o, k][np.ix_(at, at)])
                # `scipy.linalg.solve_triangular` takes three times as long for so few rows
                found[at, o, k] = lapack.dtrtrs(factor.T, rows[at, o, k], lower=0, trans=1)[0]
            return found

        return whitened


def integrable(fit: StretchFit, following: StretchFit) -> StretchFit:
    """`following`, or as much of the step to it as can be integrated over every segment."""
    for _ in range(MOST_HALVINGS):
        try:
            following.linear  # noqa: B018 - which the next step needs
            return following
        except FloatingPointError:
            following = replace(
                following,
                free=(fit.free + following.free) / 2.0,
                starts=(fit.starts + following.starts) / 2.0,
                support=fit.support | following.support,
            )
    raise FloatingPointError("no model found that can be integrated over a few periods")


def joint(
    record: Stretches, linear: Linear, precision: np.ndarray, left_out: np.ndarray | None = None
) -> Joint:
    """Eliminate the states of segments, each of which follows the one before up to a jump.

    precision: (n_segments, n_states, n_states) of the jump from each to the next. left_out:
    (n_segments,) whose data, and whose jumps to and from them, do not count.
    """
    starts = linear.starts
    count, n_states = starts.shape
    n = linear.right.shape[1] - n_states
    spend(count * (7e-5 + 5e-10 * n_states * n**2))
    used = np.ones(count) if left_out is None else (~left_out).astype(float)
    information = np.einsum("g,gij->ij", used, linear.information[:, :n, :n])
    right = used @ linear.right[:, :n]
    own = used[:, None, None] * linear.information[:, n:, n:]
    own += STATE_RIDGE * np.diag(np.diag(linear.information[:, n:, n:].mean(axis=0)))
    cross = np.concatenate([linear.information[:, n:, :n], linear.right[:, n:, None]], axis=2)
    cross = used[:, None, None] * cross
    ahead = np.zeros((count, n_states, n_states))
    for g in record.followed:
        if not used[g] * used[g + 1]:
            continue
        slope, by_state = linear.by_coefficients[g], linear.by_state[g]
        aside = np.column_stack([slope, starts[g + 1] - linear.ends[g]])
        weighted = precision[g] @ aside
        information += slope.T @ weighted[:, :n]
        right += slope.T @ weighted[:, n]
        own[g] += by_state.T @ precision[g] @ by_state
        own[g + 1] += precision[g]
        ahead[g] = -by_state.T @ precision[g]
        cross[g] += by_state.T @ weighted
        cross[g + 1] -= weighted
    # block tridiagonal elimination, forward and back
    pivot, reduced = np.empty_like(own), cross.copy()
    for g in range(count):
        if g:
            factor = ahead[g - 1].T @ pivot[g - 1]
            own[g] -= factor @ ahead[g - 1]
            reduced[g] -= factor @ reduced[g - 1]
        pivot[g] = np.linalg.inv((own[g] + own[g].T) / 2.0)
    solved, variance, covariance = np.empty_like(cross), pivot.copy(), np.zeros_like(own)
    for g in range(count - 1, -1, -1):
        rest = reduced[g]
        if g + 1 < count:
            gain = pivot[g] @ ahead[g]
            rest = rest - ahead[g] @ solved[g + 1]
            covariance[g] = -gain @ variance[g + 1]
            variance[g] += gain @ variance[g + 1] @ gain.T
        solved[g] = pivot[g] @ rest
    flat, back = cross.reshape(-1, n + 1), solved.reshape(-1, n + 1)
    information = information - flat[:, :n].T @ back[:, :n]
    right = right - flat[:, :n].T @ back[:, n]
    response = np.concatenate([-solved[:, :, :n], solved[:, :, n:]], axis=2)
    information = (information + information.T) / 2.0
    both = record.problem.with_prior(information, right, linear.free)
    return Joint(*both, response, variance, covariance)


def jump_covariance(
    record: Stretches, linear: Linear, solved: Joint, change: np.ndarray, at: np.ndarray
) -> np.ndarray:
    """(n_states, n_states) expected covariance of the states' jumps at full motion, given the data.

    change: of coefficients. at: (n,) segments after which the state jumps. What a segment begins
    with may have more entries than the states.
    """
    n_states, by_state = record.states.shape[1], linear.by_state[at]
    starts, step = linear.starts, solved.moved(change)
    ends = linear.ends[at] + linear.by_coefficients[at] @ change
    ends += np.einsum("gij,gj->gi", by_state, step[at])
    gap = starts[at + 1] + step[at + 1] - ends
    mixed = by_state @ solved.covariance[at]
    spread = solved.variance[at + 1] + by_state @ solved.variance[at] @ by_state.transpose(0, 2, 1)
    squares = gap[:, :, None] * gap[:, None, :] + (spread - mixed - mixed.transpose(0, 2, 1))
    squares = squares[:, :n_states, :n_states] / record.size[at, None, None] ** 2
    floor = np.mean(record.states**2, axis=0) + np.finfo(float).tiny
    return np.sum(squares, axis=0) / max(len(at), 1) + STATE_RIDGE * np.diag(floor)
