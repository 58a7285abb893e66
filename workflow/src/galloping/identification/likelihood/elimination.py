"""Elimination of the segments' states, which leaves a regression on the coefficients alone.

The first state of a segment is free, or equals the end of the segment before, or differs from it by
a jump of known covariance (weak constraint). `square_root` does the computing.
"""

from dataclasses import dataclass, replace

import numpy as np

from galloping.identification.likelihood.shooting import (
    SEGMENT,
    Linearised,
    Segments,
    ShootingData,
)
from galloping.identification.likelihood.square_root import (
    EQUAL,
    FREE,
    JUMP,
    filter_back,
    follow_states,
    link_segments,
)
from galloping.identification.likelihood.weak_constraint import LinearisedStretches
from galloping.identification.work import count_work

# Of a chain's end with its first state; errors of the integrator grow alike. With 1e8 and with 1e10
# the models of 37 and 39 of 48 recordings of Lorenz's system are exact, with 1e6 those of 39.
MAX_SEGMENT_GROWTH = 1e6
# Relative singular value below which a direction of a state is not solved for: three times
# TRUNCATION, the integrator's relative error, which makes up singular values of its own size.
# Between jumps, whose precision may differ by any factor, only rounding counts.
UNDETERMINED, UNDETERMINED_WITH_JUMPS = 3e-7, 1e-13
LEAST_JUMP = 1e-12  # variance of a jump, relative to the mean square of a state


@dataclass(frozen=True)
class Eliminated:
    """Normal equations of the coefficients after elimination of the segments' first states.

    information: (n, n), right: (n,) of the coefficients' change. response: (n_segments, n_states, n
    + 1), of each state to the coefficients' change, and constant. variance, jump_variance:
    (n_segments, n_states, n_states) covariance of each segment's first state, and of the jump after
    it, at given coefficients, zero in directions that nothing determines. gap: (n_states,) largest
    mismatch between segments without a jump. fall: decrease of chi^2 when the first states of
    chains alone are moved to their best.
    """

    information: np.ndarray
    right: np.ndarray
    response: np.ndarray
    variance: np.ndarray
    jump_variance: np.ndarray
    gap: np.ndarray
    fall: float

    def move_states(self, change: np.ndarray, starts: np.ndarray | float = 0.0) -> np.ndarray:
        """Compute the segments' best initial states after a change of the coefficients.

        change: (n,). starts: the present states. Returns (n_segments, n_states).
        """
        return starts + self.response[:, :, :-1] @ change + self.response[:, :, -1]


def chain_segments(linearised: Linearised, segments: Segments, longest: float = np.inf) -> Segments:
    """Join consecutive segments into chains whose ends are not too sensitive to their starts.

    The chains are as long as possible. longest: how many segments a chain may have; with one, every
    segment is free. A new chain begins where the derivatives of the end by the first state of the
    chain and the coefficients, in standard errors of one segment, exceed MAX_SEGMENT_GROWTH, as in
    a chaotic or very long recording. The last stretch of a chaotic recording has most information:
    of 288 recordings of Lorenz's system with 20 to 40 % of noise, chains that grow by 2,000 lead to
    213 exact models, by 1e6 to 246.
    """
    n = len(linearised.right)
    of_states = np.sum(linearised.rows[:, :, n:-1] ** 2, axis=1).mean(axis=0)
    told = np.sqrt(np.append(np.diag(linearised.information), of_states))
    errors = np.divide(1.0, told, out=np.zeros(len(told)), where=told > 0.0)
    count_work(SEGMENT * len(linearised.ends))
    begins = np.diff(segments.recording, prepend=0) != 0
    chains = link_segments(linearised.end_derivatives, begins, errors, longest, MAX_SEGMENT_GROWTH)
    return replace(segments, chains=chains)


def eliminate_chains(linearised: Linearised, segments: Segments, starts: np.ndarray) -> Eliminated:
    """Reduce a linearised multiple-shooting fit to normal equations of the coefficients alone.

    Each segment of a chain begins where the one before ends. starts: (n_segments, n_states), about
    which the segments are linearised.
    """
    (count, n_states), n = starts.shape, len(linearised.right)
    count_work(count * (2 * SEGMENT + 1e-9 * n_states * n**2))
    links = np.full(count, FREE)
    links[:-1][np.diff(segments.chains) == 0] = EQUAL
    roots = np.zeros((count, n_states, n_states))
    mismatch = linearised.ends - np.roll(starts, -1, axis=0)
    return _eliminate(
        linearised.rows, linearised.information, linearised.right, linearised.end_derivatives,
        mismatch, links, roots, UNDETERMINED,
    )  # fmt: skip


def eliminate_with_jumps(
    record: ShootingData,
    linear: LinearisedStretches,
    roots: np.ndarray,
    left_out: np.ndarray | None = None,
) -> Eliminated:
    """Reduce stretches with jumps between them to normal equations of the coefficients.

    The priors of coefficients are included. roots: (n_segments, n_states, n_states) of the inverse
    covariance of the jump after each. left_out: (n_segments,) whose data, and whose jumps to and
    from them, do not count.
    """
    count, n = len(linear.starts), linear.right.shape[1]
    count_work(count * (7e-5 + 5e-10 * roots.shape[1] * n**2))
    used = np.ones(count, bool) if left_out is None else ~left_out
    links = np.full(count, FREE)
    links[record.followed_segments] = JUMP
    links[~used] = FREE
    links[:-1][~used[1:]] = FREE
    found = _eliminate(
        np.where(used[:, None, None], linear.rows, 0.0),
        linear.information[used].sum(axis=0), linear.right[used].sum(axis=0),
        linear.end_derivatives, linear.ends - np.roll(linear.starts, -1, axis=0), links, roots,
        UNDETERMINED_WITH_JUMPS,
    )  # fmt: skip
    information, right = record.problem.with_prior(found.information, found.right, linear.free)
    return replace(found, information=information, right=right)


def _eliminate(
    rows: np.ndarray,
    information: np.ndarray,
    right: np.ndarray,
    end_derivatives: np.ndarray,
    mismatch: np.ndarray,
    links: np.ndarray,
    roots: np.ndarray,
    rcond: float,
) -> Eliminated:
    """Eliminate the segments' first states, see `square_root.filter_back`.

    information, right: from rows without states. rcond: as of `_solve_first_states`.
    """
    n, begins = len(right), np.append(True, links[:-1] == FREE)
    kept, left, relations, spreads = filter_back(rows, end_derivatives, mismatch, links, roots)
    first, first_variance, undetermined = _solve_first_states(kept[begins], n, rcond)
    response, variance, jump_variance = follow_states(
        relations, spreads, end_derivatives, begins, first, first_variance
    )
    remaining = np.concatenate([left.reshape(-1, n + 1), undetermined.reshape(-1, n + 1)])
    information = information + remaining[:, :n].T @ remaining[:, :n]
    right = right + remaining[:, n] @ remaining[:, :n]
    fall = float(np.sum(kept[begins, :, -1] ** 2) - np.sum(undetermined[:, :, n] ** 2))
    gap = np.abs(mismatch[links == EQUAL]).max(axis=0, initial=0.0)
    return Eliminated(information, right, response, variance, jump_variance, gap, fall)


def _solve_first_states(
    rows: np.ndarray, n: int, rcond: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Solve for the first states of chains, linear in the coefficients' change.

    rows: (n_chains, n_states, n + n_states + 1). Directions that the rows do not determine, with
    relative singular values below `rcond`, remain unchanged. Returns the states, (n_chains,
    n_states, n + 1), the constant last; their covariance; and the equations that remain for
    undetermined directions, a design and a residual, (n_chains, n_states, n + 1), zero elsewhere.
    """
    block = rows[:, :, n:-1]
    norm = np.linalg.norm(block, axis=1)
    scale = np.divide(1.0, norm, out=np.zeros(norm.shape), where=norm > 0.0)
    u, s, v = np.linalg.svd(block * scale[:, None, :])
    known = (s > rcond * s[:, :1])[..., None]
    turned = u.transpose(0, 2, 1) @ np.delete(rows, np.s_[n:-1], axis=2)
    inverse = np.divide(1.0, s[..., None], out=np.zeros(known.shape), where=known)
    root = scale[..., None] * (inverse * v).transpose(0, 2, 1)
    solved = root @ turned
    solved[:, :, :n] *= -1.0
    return solved, root @ root.transpose(0, 2, 1), np.where(known, 0.0, turned)


def jump_covariance(
    record: ShootingData,
    linear: LinearisedStretches,
    solved: Eliminated,
    change: np.ndarray,
    at: np.ndarray,
) -> np.ndarray:
    """Estimate the covariance of the state's jumps between segments, given the data.

    Returns (n_states, n_states), for segments with motion of average size. change: of coefficients.
    at: (n_jumps,) segments after which the state jumps. Fluctuations that follow the states of
    `linear` are ignored.
    """
    n, n_states = len(change), record.states.shape[1]
    slopes, step = linear.end_derivatives[at], solved.move_states(change)
    ends = linear.ends[at] + slopes[:, :, :n] @ change
    ends += np.einsum("gij,gj->gi", slopes[:, :, n:], step[at])
    gap = linear.starts[at + 1] + step[at + 1] - ends
    squares = gap[:, :, None] * gap[:, None, :] + solved.jump_variance[at]
    squares = squares[:, :n_states, :n_states] / record.segment_sizes[at, None, None] ** 2
    floor = np.mean(record.states**2, axis=0) + np.finfo(float).tiny
    return np.sum(squares, axis=0) / max(len(at), 1) + LEAST_JUMP * np.diag(floor)
