"""Elimination of the segments' states, which leaves a regression on the coefficients alone.

If the segments of a chain match, their states follow from the chain's first one, which is
eliminated by rotations of its rows: otherwise the information of a chain on the coefficients, a
small part of the whole, would be lost in rounding. If the state may jump from segment to segment
(weak constraint), states are eliminated from normal equations, which are block tridiagonal.
"""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from galloping.identification.likelihood.shooting import (
    SEGMENT,
    Linearised,
    Segments,
    ShootingData,
    qr_eliminate,
)
from galloping.identification.likelihood.weak_constraint import NormalEquations
from galloping.identification.work import count_work

# Of the end of a chain with its beginning. The elimination squares the growth: of 1e12, rounding
# leaves 2e-4 of what a segment tells.
MAX_SEGMENT_GROWTH = 1e6
# Relative singular value below which a direction of a state is not solved for: three times
# TRUNCATION, the integrator's relative error, which makes up singular values of its own size.
UNDETERMINED = 3e-7
STATE_RIDGE = 1e-12  # of the information about a state, added: a stretch may tell nothing of it


@dataclass(frozen=True)
class Eliminated:
    """Normal equations of the coefficients after elimination of the segments' initial states.

    information: (n, n), right: (n,) of the coefficients' change. response: (n_segments, n_states, n
    + 1), of each state to the coefficients' change, and constant.
    """

    information: np.ndarray
    right: np.ndarray
    response: np.ndarray

    def move_states(self, change: np.ndarray, starts: np.ndarray | float = 0.0) -> np.ndarray:
        """Compute the segments' best initial states after a change of the coefficients.

        change: (n,). starts: the present states. Returns (n_segments, n_states).
        """
        return starts + self.response[:, :, :-1] @ change + self.response[:, :, -1]


@dataclass(frozen=True)
class ContinuousNormalEquations(Eliminated):
    """Normal equations of the coefficients if each segment must start where the previous one ends.

    gap: (n_states,) largest mismatch between segments of a chain. fall: decrease of chi^2 when the
    states alone are moved to their best.
    """

    gap: np.ndarray
    fall: float


@dataclass(frozen=True)
class JumpNormalEquations(Eliminated):
    """Normal equations of the coefficients if the state may jump between segments.

    They include the priors of coefficients. variance, covariance: (n_segments, n_states, n_states),
    of each segment's first state, and of that with the next segment's, at given coefficients.
    """

    variance: np.ndarray
    covariance: np.ndarray


def chain_segments(linearised: Linearised, segments: Segments, longest: float = np.inf) -> Segments:
    """Join consecutive segments into chains whose ends are not too sensitive to their starts.

    The chains are as long as possible. longest: how many segments a chain may have; with one, every
    segment is free. A chain is broken where its end state, in units of a segment's error of it,
    moves by more than MAX_SEGMENT_GROWTH such units of its first state and the coefficients, as in
    a chaotic or very long recording. The last stretch of a chaotic recording has most information:
    of 288 recordings of Lorenz's system with 20 to 40 % of noise, chains that grow by 2,000 lead to
    213 exact models, by 1e6 to 246.
    """
    n, n_states = len(linearised.right), linearised.ends.shape[1]
    of_states = np.sum(linearised.rows[:, :, n:-1] ** 2, axis=1).mean(axis=0)
    unit = np.sqrt(np.append(np.diag(linearised.information), of_states))
    inverse = np.divide(1.0, unit, out=np.zeros(len(unit)), where=unit > 0.0)
    count_work(SEGMENT * len(linearised.ends))
    chains = np.zeros(len(linearised.ends), np.int64)
    identity = np.eye(n_states, n + n_states, n)
    relation, length = identity, 1
    for g in range(1, len(chains)):
        relation = _apply_chain_rule(linearised.end_derivatives[g - 1], relation, n)
        growth = np.linalg.norm(relation * inverse * unit[n:, None], 2)
        other = segments.recording[g] != segments.recording[g - 1]
        broken = other or growth > MAX_SEGMENT_GROWTH or length == longest
        chains[g] = chains[g - 1] + broken
        relation, length = (identity, 1) if broken else (relation, length + 1)
    return replace(segments, chains=chains)


def eliminate_states(
    linearised: Linearised, segments: Segments, starts: np.ndarray
) -> ContinuousNormalEquations:
    """Reduce a linearised multiple-shooting fit to normal equations of the coefficients alone.

    The segments of each chain match, and the chain's first state is eliminated. starts:
    (n_segments, n_states), about which the segments are linearised.
    """
    n_segments, n_states = starts.shape
    n = len(linearised.right)
    count_work(n_segments * (2 * SEGMENT + 1e-9 * n_states * n**2))
    information, right = linearised.information.copy(), linearised.right.copy()
    response = np.zeros((n_segments, n_states, n + 1))
    gap, fall = np.zeros(n_states), 0.0
    for begin, end in pairwise(segments.bounds):
        relation, constant = np.eye(n_states, n + n_states, n), np.zeros(n_states)
        relations, rows, residual = [], [], []
        for g in range(begin, end):
            relations.append((relation, constant))
            own, derivative = linearised.rows[g], linearised.end_derivatives[g]
            rows.append(_apply_chain_rule(own[:, :-1], relation, n))
            residual.append(own[:, -1] - own[:, n:-1] @ constant)
            if g + 1 < end:
                mismatch = linearised.ends[g] - starts[g + 1]
                gap = np.maximum(gap, np.abs(mismatch))
                constant = derivative[:, n:] @ constant + mismatch
                relation = _apply_chain_rule(derivative, relation, n)
        kept, remaining, left = qr_eliminate(np.vstack(rows), np.concatenate(residual), n)
        first, undetermined = _solve_first_state(kept, n)
        fall += float(np.sum(kept[:, -1] ** 2) - np.sum(undetermined[:, -1] ** 2))
        remaining = np.vstack([remaining, undetermined[:, :n]])
        information += remaining.T @ remaining
        right += np.append(left, undetermined[:, n]) @ remaining
        for g, (relation, constant) in zip(range(begin, end), relations, strict=True):
            response[g] = _apply_chain_rule(relation, first, n)
            response[g, :, n] += constant
    return ContinuousNormalEquations(information, right, response, gap, fall)


def _apply_chain_rule(slopes: np.ndarray, state: np.ndarray, n: int) -> np.ndarray:
    """Apply the chain rule: slopes of a result by n coefficients and by what a state depends on.

    slopes: (m, n + n_states) of the result by the coefficients and the state. state: (n_states, n
    or more) of the state by the coefficients and whatever else it depends on.
    """
    found = slopes[:, n:] @ state
    found[:, :n] += slopes[:, :n]
    return found


def _solve_first_state(rows: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Solve for the first state of a chain, linear in the coefficients' change.

    rows: (n_states, n + n_states + 1). Directions that the rows do not determine remain unchanged.
    Returns the state, (n_states, n + 1), the constant last, and the remaining equations of these
    directions, a design and a residual, (n_undetermined, n + 1).
    """
    block = rows[:, n:-1]
    scale = 1.0 / np.maximum(np.linalg.norm(block, axis=0), np.finfo(float).tiny)
    u, s, v = np.linalg.svd(block * scale)
    known = s > UNDETERMINED * s[0]
    turned = u.T @ np.delete(rows, np.s_[n:-1], axis=1)
    solved = scale[:, None] * (v[known].T / s[known] @ turned[known])
    solved[:, :n] *= -1.0
    return solved, turned[~known]


def eliminate_with_jumps(
    record: ShootingData,
    linear: NormalEquations,
    precision: np.ndarray,
    left_out: np.ndarray | None = None,
) -> JumpNormalEquations:
    """Eliminate segment states from normal equations that allow state jumps between segments.

    precision: (n_segments, n_states, n_states) of the jump from each to the next. left_out:
    (n_segments,) whose data, and whose jumps to and from them, do not count.
    """
    starts = linear.starts
    count, n_states = starts.shape
    n = linear.right.shape[1] - n_states
    count_work(count * (7e-5 + 5e-10 * n_states * n**2))
    used = np.ones(count) if left_out is None else (~left_out).astype(float)
    information = np.einsum("g,gij->ij", used, linear.information[:, :n, :n])
    right = used @ linear.right[:, :n]
    own = used[:, None, None] * linear.information[:, n:, n:]
    own += STATE_RIDGE * np.diag(np.diag(linear.information[:, n:, n:].mean(axis=0)))
    cross = np.concatenate([linear.information[:, n:, :n], linear.right[:, n:, None]], axis=2)
    cross = used[:, None, None] * cross
    ahead = np.zeros((count, n_states, n_states))
    for g in record.followed_segments:
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
        remaining = reduced[g]
        if g + 1 < count:
            gain = pivot[g] @ ahead[g]
            remaining = remaining - ahead[g] @ solved[g + 1]
            covariance[g] = -gain @ variance[g + 1]
            variance[g] += gain @ variance[g + 1] @ gain.T
        solved[g] = pivot[g] @ remaining
    flat, back = cross.reshape(-1, n + 1), solved.reshape(-1, n + 1)
    information = information - flat[:, :n].T @ back[:, :n]
    right = right - flat[:, :n].T @ back[:, n]
    response = np.concatenate([-solved[:, :, :n], solved[:, :, n:]], axis=2)
    information = (information + information.T) / 2.0
    both = record.problem.with_prior(information, right, linear.free)
    return JumpNormalEquations(*both, response, variance, covariance)


def jump_covariance(
    record: ShootingData,
    linear: NormalEquations,
    solved: JumpNormalEquations,
    change: np.ndarray,
    at: np.ndarray,
) -> np.ndarray:
    """Estimate the covariance of the state's jumps between segments, given the data.

    Returns (n_states, n_states), for segments with motion of average size. change: of coefficients.
    at: (n,) segments after which the state jumps. The initial state of a segment may have more
    entries than the states.
    """
    n_states, by_state = record.states.shape[1], linear.by_state[at]
    starts, step = linear.starts, solved.move_states(change)
    ends = linear.ends[at] + linear.by_coefficients[at] @ change
    ends += np.einsum("gij,gj->gi", by_state, step[at])
    gap = starts[at + 1] + step[at + 1] - ends
    mixed = by_state @ solved.covariance[at]
    spread = solved.variance[at + 1] + by_state @ solved.variance[at] @ by_state.transpose(0, 2, 1)
    squares = gap[:, :, None] * gap[:, None, :] + (spread - mixed - mixed.transpose(0, 2, 1))
    squares = squares[:, :n_states, :n_states] / record.segment_sizes[at, None, None] ** 2
    floor = np.mean(record.states**2, axis=0) + np.finfo(float).tiny
    return np.sum(squares, axis=0) / max(len(at), 1) + STATE_RIDGE * np.diag(floor)
