"""Elimination of the segments' states, which leaves a regression on the coefficients alone.

If the segments of a chain match, their states follow from the chain's first one, which is
eliminated by rotations of its rows: otherwise the information of a chain on the coefficients, a
small part of the whole, would be lost in rounding. If the state may jump from segment to segment
(weak constraint), states are eliminated from normal equations, which are block tridiagonal.
"""

from dataclasses import dataclass, replace

import numpy as np
from numba import njit

from galloping.identification.likelihood.shooting import (
    SEGMENT,
    Linearised,
    Segments,
    ShootingData,
    eliminate_states,
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
    other = np.diff(segments.recording, prepend=0) != 0
    chains = _link_segments(
        linearised.end_derivatives, other, unit[n:], inverse, longest, MAX_SEGMENT_GROWTH
    )
    return replace(segments, chains=chains)


@njit(cache=True, error_model="numpy")
def _apply_chain_rule(slopes, relation, n, out):
    """Write slopes by n coefficients and an earlier state to `out`, from those of a later state.

    slopes: (n_states, n + n_states) by the coefficients and the later state. relation: as large, of
    the later state by the coefficients and the earlier state.
    """
    for i in range(len(out)):
        for c in range(out.shape[1]):
            total = slopes[i, c] if c < n else 0.0
            for k in range(len(relation)):
                total += slopes[i, n + k] * relation[k, c]
            out[i, c] = total


@njit(cache=True, error_model="numpy")
def _link_segments(end_derivatives, other, size, inverse, longest, most):
    """Return the chain of each segment, (n_segments,).

    end_derivatives: as of `Linearised`. other: (n_segments,) whether a recording begins. size:
    (n_states,), inverse: (n + n_states,) units of the ends, and of the coefficients and starts.
    longest, most: segments of a chain, and growth, in these units, in all.
    """
    count, n_states, width = end_derivatives.shape
    n = width - n_states
    chains, length = np.zeros(count, np.int64), 1
    identity = np.eye(n_states, width, n)
    relation, following = identity.copy(), identity.copy()
    for g in range(1, count):
        _apply_chain_rule(end_derivatives[g - 1], relation, n, following)
        growth = 0.0
        for i in range(n_states):
            for c in range(width):
                growth += (following[i, c] * size[i] * inverse[c]) ** 2
        broken = other[g] or not growth < most**2 or length >= longest
        chains[g] = chains[g - 1] + broken
        length = 1 if broken else length + 1
        relation[:] = identity if broken else following
    return chains


@njit(cache=True, error_model="numpy")
def _relate_states(end_derivatives, mismatch, begins):
    """Express the first state of every segment by that of its chain.

    mismatch: (n_segments, n_states) of the end of each with the beginning of the next. begins:
    (n_segments,) whether a chain begins. Returns (n_segments, n_states, n + n_states) derivatives
    by the coefficients and the chain's first state, and (n_segments, n_states) constants.
    """
    count, n_states, width = end_derivatives.shape
    n = width - n_states
    relations, constants = np.zeros((count, n_states, width)), np.zeros((count, n_states))
    for g in range(count):
        if begins[g]:
            for i in range(n_states):
                relations[g, i, n + i] = 1.0
            continue
        _apply_chain_rule(end_derivatives[g - 1], relations[g - 1], n, relations[g])
        for i in range(n_states):
            constants[g, i] = mismatch[g - 1, i]
            for k in range(n_states):
                constants[g, i] += end_derivatives[g - 1, i, n + k] * constants[g - 1, k]
    return relations, constants


def eliminate_chains(
    linearised: Linearised, segments: Segments, starts: np.ndarray
) -> ContinuousNormalEquations:
    """Reduce a linearised multiple-shooting fit to normal equations of the coefficients alone.

    The segments of each chain match, and the chain's first state is eliminated. starts:
    (n_segments, n_states), about which the segments are linearised.
    """
    n_segments, n_states = starts.shape
    n = len(linearised.right)
    count_work(n_segments * (2 * SEGMENT + 1e-9 * n_states * n**2))
    bounds, rows = segments.bounds, linearised.rows
    begins = np.isin(np.arange(n_segments), bounds)
    mismatch = linearised.ends - np.roll(starts, -1, axis=0)
    relations, constants = _relate_states(linearised.end_derivatives, mismatch, begins)
    joined = rows[:, :, n:-1] @ relations
    joined[:, :, :n] += rows[:, :, :n]
    residual = rows[:, :, -1] - np.einsum("gij,gj->gi", rows[:, :, n:-1], constants)
    stacked = np.concatenate([joined, residual[..., None]], axis=2).reshape(-1, n + n_states + 1)
    kept, remaining = eliminate_states(stacked, bounds * n_states, n)
    first, undetermined = _solve_first_states(kept, n)
    remaining = np.vstack([np.delete(remaining, np.s_[n:-1], axis=1), *undetermined])
    fall = float(np.sum(kept[:, :, -1] ** 2) - np.sum(undetermined[:, :, -1] ** 2))
    information = linearised.information + remaining[:, :n].T @ remaining[:, :n]
    right = linearised.right + remaining[:, n] @ remaining[:, :n]
    response = relations[:, :, n:] @ np.repeat(first, np.diff(bounds), axis=0)
    response[:, :, :n] += relations[:, :, :n]
    response[:, :, n] += constants
    gap = np.abs(mismatch[:-1][~begins[1:]]).max(axis=0, initial=0.0)
    return ContinuousNormalEquations(information, right, response, gap, fall)


def _solve_first_states(rows: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Solve for the first states of chains, linear in the coefficients' change.

    rows: (n_chains, n_states, n + n_states + 1). Directions that the rows do not determine remain
    unchanged. Returns the states, (n_chains, n_states, n + 1), the constant last, and the equations
    that remain for these directions, a design and a residual, as large, zero elsewhere.
    """
    block = rows[:, :, n:-1]
    scale = 1.0 / np.maximum(np.linalg.norm(block, axis=1), np.finfo(float).tiny)
    u, s, v = np.linalg.svd(block * scale[:, None, :])
    known = (s > UNDETERMINED * s[:, :1])[..., None]
    turned = u.transpose(0, 2, 1) @ np.delete(rows, np.s_[n:-1], axis=2)
    shares = np.divide(turned, s[..., None], out=np.zeros(turned.shape), where=known)
    solved = scale[..., None] * (v.transpose(0, 2, 1) @ shares)
    solved[:, :, :n] *= -1.0
    return solved, np.where(known, 0.0, turned)


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
