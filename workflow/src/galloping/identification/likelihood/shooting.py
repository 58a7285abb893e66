"""Multiple shooting over condensed recordings (H. G. Bock, 1983): linearised misfit, matching and
elimination, so that a Gauss-Newton step is a regression on the coefficients alone. Chains of one
segment leave all segment states free; one chain per recording is, at convergence, single shooting.
"""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from galloping.identification.likelihood.condense import Condensed
from galloping.identification.likelihood.problem import Problem
from galloping.identification.work import spend

HUGE = 1e30  # of a state or a derivative, from which a solution counts as diverged
MOST_HALVINGS = 6  # of the integrator's step, and of a Gauss-Newton step
# Segments and chains.
UNDETERMINED = 3e-7  # relative singular value below which a direction of a state is not solved for
SEGMENT = 5e-5  # s, that one takes when it is linearised, or chained


@dataclass(frozen=True)
class Segments:
    """first: (n_segments + 1,) first window of each; recording: (n_segments,) which it is cut from.

    chains: (n_segments,) the chain of each segment, non-decreasing.
    """

    first: np.ndarray
    recording: np.ndarray
    chains: np.ndarray

    @property
    def bounds(self) -> np.ndarray:
        """(n_chains + 1,) the first segment of each chain, and the number of segments."""
        return np.flatnonzero(np.diff(self.chains, prepend=-1, append=-1))


@dataclass(frozen=True)
class Record:
    """What is fitted. states: (n_windows, n_states) smoothed, where the windows begin. floor:
    (n_recordings, n_observed) least noise of the projections.
    """

    problem: Problem
    condensed: Condensed
    segments: Segments
    states: np.ndarray
    floor: np.ndarray

    @property
    def starts(self) -> np.ndarray:
        """(n_segments, n_states) smoothed states at the beginning of each segment."""
        return self.states[self.segments.first[:-1]]

    @property
    def begins(self) -> np.ndarray:
        """(n_recordings,) index of the first segment of each."""
        return np.unique(self.segments.recording, return_index=True)[1]

    @property
    def stretch(self) -> float:
        """s, that a segment is long."""
        return float(np.median(np.diff(self.segments.first)) * self.condensed.step)


@dataclass(frozen=True)
class Fit:
    """Where an iteration stands.

    free: (n_candidates,) coefficients; support: the same, boolean. starts: (n_segments,
    n_states). sigma: (n_recordings, n_observed) noise of the projections, not below the floor.
    reference: the same as first estimated. chi2: by that, of the fit before this one.
    """

    record: Record
    free: np.ndarray
    support: np.ndarray
    starts: np.ndarray
    sigma: np.ndarray
    reference: np.ndarray
    chi2: float = np.inf

    @property
    def misfit(self) -> float:
        """chi^2 per row."""
        return self.chi2 / float(np.sum(self.record.condensed.rows))

    @property
    def parameters(self) -> int:
        """Number of terms, and of entries of the first states of chains."""
        chains = int(self.record.segments.chains[-1]) + 1
        return int(self.support.sum()) + chains * self.starts.shape[1]


@dataclass(frozen=True)
class Linearised:
    """Misfit of every segment, linearised in the coefficients and the segment's state.

    A segment's rows are rotated so that only the first n_states of them contain its state: these
    are `rows`; the others are regressions on the coefficients alone. Only so is what is left when
    the state is eliminated, a small part of the whole, not lost in rounding.

    rows: (n_segments, n_states, n + n_states + 1), of coefficients, state and residual.
    information: (n, n), right: (n,), of all other rows together. squares: (n_recordings,
    n_observed) sums of squared residuals, in units of sigma^2.
    ends: (n_segments, n_states); end_derivatives: (n_segments, n_states, n + n_states).
    """

    rows: np.ndarray
    information: np.ndarray
    right: np.ndarray
    squares: np.ndarray
    ends: np.ndarray
    end_derivatives: np.ndarray


@dataclass(frozen=True)
class Eliminated:
    """The regression on the coefficients, and how the segment states follow them.

    information: (n, n), right: (n,) of the coefficients' change. states: (n_segments, n_states,
    n + 1), the change of each segment's state, linear in the coefficients' change and constant.
    gap: (n_states,) largest mismatch between segments of a chain. fall: of chi^2, when the states
    alone are moved to their best.
    """

    information: np.ndarray
    right: np.ndarray
    states: np.ndarray
    gap: np.ndarray
    fall: float


def cut(condensed: Condensed, windows: int, allowed: np.ndarray) -> Segments:
    """Segments of about `windows` windows, each its own chain.

    allowed: (n_windows,) whether a segment may start at a window, else it starts at the nearest one
    where it may; every recording's first may.
    """
    first, recording = [], []
    for r, (a, b) in enumerate(zip(condensed.first[:-1], condensed.first[1:], strict=True)):
        pieces = max(1, round((b - a) / windows))
        starts = np.linspace(a, b, pieces + 1).round().astype(np.int64)[:-1]
        may = np.append(a, a + 1 + np.flatnonzero(allowed[a + 1 : b]))
        after = np.minimum(np.searchsorted(may, starts), len(may) - 1)
        before = np.maximum(after - 1, 0)
        nearer = starts - may[before] <= np.abs(may[after] - starts)
        starts = np.unique(np.where(nearer, may[before], may[after]))
        first.append(starts)
        recording.append(np.full(len(starts), r))
    owner = np.concatenate(recording)
    windows = np.append(np.concatenate(first), condensed.first[-1])
    return Segments(windows, owner, np.arange(len(owner)))


def linearise(
    fit: Fit, pairs: np.ndarray | None = None, columns: np.ndarray | None = None
) -> Linearised:
    """Misfit of the condensed samples about the candidates' coefficients and segment states.

    pairs: (n_pairs, 2) coefficients (equation, term) to linearise by, the candidates
    where not given. columns: (n_windows, n_observed, n_rows, n_columns), derivatives of the
    predicted projections by parameters of the instrument, which count as coefficients after the
    others. Raises FloatingPointError where the solution diverges within a segment.
    """
    record, sigma, free, starts = fit.record, fit.sigma, fit.free, fit.starts
    problem, condensed, segments = record.problem, record.condensed, record.segments
    pairs = problem.candidates if pairs is None else pairs
    compiled = problem.compiled(free, pairs)
    n_states = starts.shape[1]
    direct = 0 if columns is None else columns.shape[3]
    n = len(pairs) + direct
    m = n + n_states
    kept = np.empty((len(starts), n_states, m + 1))
    information, right = np.zeros((n, n)), np.zeros(n)
    squares = np.zeros(sigma.shape)
    ends = np.empty(starts.shape)
    end_derivatives = np.zeros((*starts.shape, m))
    by_dynamics = np.r_[: len(pairs), n:m]
    for batch in range(0, len(starts), 8):  # as what is held at once fits in the cache
        group = slice(batch, min(batch + 8, len(starts)))
        first = segments.first[group.start : group.stop + 1]
        span = slice(first[0], first[-1])
        predicted, derivatives, ends[group], moved, _ = condensed.solution(
            compiled, first, starts[group], sensitive=True
        )
        end_derivatives[group][..., by_dynamics] = moved
        if columns is not None:
            derivatives = np.insert(derivatives, [len(pairs)] * direct, columns[span], axis=3)
        reached = (ends[group], end_derivatives[group])
        if not all(np.all(np.abs(values) < HUGE) for values in reached):
            raise FloatingPointError("the model diverges within a segment")
        residual = condensed.targets[span] - predicted
        for g in range(group.start, group.stop):
            own = slice(segments.first[g] - first[0], segments.first[g + 1] - first[0])
            weight = 1.0 / sigma[segments.recording[g]][:, None]
            scaled = residual[own] * weight
            squares[segments.recording[g]] += np.einsum("wor,wor->o", scaled, scaled)
            rows = derivatives[own]
            rows *= weight[..., None]
            kept[g], rest, gap = _rotated(rows.reshape(-1, m), scaled.ravel(), n)
            information += rest.T @ rest
            right += gap @ rest
    spend((1.1e-8 + 3e-11 * n) * m * condensed.targets.size + SEGMENT * len(starts))
    own = problem.of_candidates(problem.precision, pairs)
    values = problem.of_candidates(problem.coefficients(free), pairs)
    information[np.diag_indices(len(pairs))] += own
    right[: len(pairs)] += own * (problem.of_candidates(problem.expected, pairs) - values)
    return Linearised(kept, information, right, squares, ends, end_derivatives)


def _rotated(
    rows: np.ndarray, residual: np.ndarray, n: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows rotated so that only the first contain the columns from `n` on: those, with the residual
    as last column, and the design and residual of the others.
    """
    q, r = np.linalg.qr(rows[:, n:])
    design = q.T @ rows[:, :n]
    own = q.T @ residual
    first = np.hstack([design, r, own[:, None]])
    return first, rows[:, :n] - q @ design, residual - q @ own


def chained(linearised: Linearised, segments: Segments, longest: float = np.inf) -> Segments:
    """The segments in the longest chains whose ends depend not too much on their beginnings.

    longest: of how many segments a chain may be; of one, every segment is free.
    A chain is broken where its end state, in units of what a segment tells about it, moves by more
    than 2,000 such units of its first state and the coefficients: on a chaotic or very long
    recording the elimination, which squares that ratio, would otherwise be lost in rounding. With
    1e-16 of it, what such a chain says about a term is known better than what `selection.tableau`
    holds for imitated.
    """
    n, n_states = len(linearised.right), linearised.ends.shape[1]
    of_states = np.sum(linearised.rows[:, :, n:-1] ** 2, axis=1).mean(axis=0)
    unit = np.sqrt(np.append(np.diag(linearised.information), of_states))
    inverse = np.divide(1.0, unit, out=np.zeros(len(unit)), where=unit > 0.0)
    spend(SEGMENT * len(linearised.ends))
    chains = np.zeros(len(linearised.ends), np.int64)
    identity = np.hstack([np.zeros((n_states, n)), np.eye(n_states)])
    relation, length = identity, 1
    for g in range(1, len(chains)):
        derivative = linearised.end_derivatives[g - 1]
        relation = derivative[:, n:] @ relation
        relation[:, :n] += derivative[:, :n]
        growth = np.linalg.norm(relation * inverse * unit[n:, None], 2)
        other = segments.recording[g] != segments.recording[g - 1]
        broken = other or growth > 2e3 or length == longest
        chains[g] = chains[g - 1] + broken
        length += 1
        if broken:
            relation, length = identity, 1
    return replace(segments, chains=chains)


def eliminate(linearised: Linearised, segments: Segments, starts: np.ndarray) -> Eliminated:
    """Match the segments of each chain and eliminate its first state."""
    n_segments, n_states = starts.shape
    n = len(linearised.right)
    spend(n_segments * (2 * SEGMENT + 1e-9 * n_states * n**2))
    information, right = linearised.information.copy(), linearised.right.copy()
    states = np.zeros((n_segments, n_states, n + 1))
    gap, fall = np.zeros(n_states), 0.0
    for begin, end in pairwise(segments.bounds):
        relation = np.hstack([np.zeros((n_states, n)), np.eye(n_states)])
        constant = np.zeros(n_states)
        relations, rows, residual = [], [], []
        for g in range(begin, end):
            relations.append((relation, constant))
            own = linearised.rows[g]
            row = own[:, n:-1] @ relation
            row[:, :n] += own[:, :n]
            rows.append(row)
            residual.append(own[:, -1] - own[:, n:-1] @ constant)
            derivative = linearised.end_derivatives[g]
            if g + 1 < end:
                mismatch = linearised.ends[g] - starts[g + 1]
                gap = np.maximum(gap, np.abs(mismatch))
                constant = derivative[:, n:] @ constant + mismatch
                relation = derivative[:, n:] @ relation
                relation[:, :n] += derivative[:, :n]
        kept, rest, left = _rotated(np.vstack(rows), np.concatenate(residual), n)
        first, undetermined = _first_state(kept, n)
        fall += float(np.sum(kept[:, -1] ** 2) - np.sum(undetermined[:, -1] ** 2))
        rest = np.vstack([rest, undetermined[:, :n]])
        information += rest.T @ rest
        right += np.append(left, undetermined[:, n]) @ rest
        for g, (matrix, shift) in zip(range(begin, end), relations, strict=True):
            states[g] = matrix[:, n:] @ first
            states[g, :, :n] += matrix[:, :n]
            states[g, :, n] += shift
    return Eliminated(information, right, states, gap, fall)


def _first_state(rows: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray]:
    """The best first state, linear in the coefficients' change, and constant, (n_states, n + 1),
    where directions that the rows (n_states, n + n_states + 1) do not determine stay, and what
    these leave to say, a design and a residual, (n_undetermined, n + 1).
    """
    block = rows[:, n:-1]
    scale = 1.0 / np.maximum(np.linalg.norm(block, axis=0), np.finfo(float).tiny)
    u, s, v = np.linalg.svd(block * scale)
    known = s > UNDETERMINED * s[0]
    turned = u.T @ np.delete(rows, np.s_[n:-1], axis=1)
    solved = scale[:, None] * (v[known].T / s[known] @ turned[known])
    solved[:, :n] *= -1.0
    return solved, turned[~known]


def residuals(record: Record, free: np.ndarray, starts: np.ndarray) -> tuple[np.ndarray, float]:
    """Projections of the samples less those of the solution, and the integrator's relative error.

    The residuals are (n_windows, n_observed, n_rows). Raises FloatingPointError where the
    solution diverges within a segment.
    """
    compiled = record.problem.compiled(free, record.problem.candidates[:0])
    predicted, _, ends, _, truncation = record.condensed.solution(
        compiled, record.segments.first, starts, sensitive=False
    )
    if not np.all(np.abs(ends) < HUGE):
        raise FloatingPointError("the model diverges over the recording")
    return record.condensed.targets - predicted, truncation
