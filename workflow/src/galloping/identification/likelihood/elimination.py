"""Elimination of the segments' states, which leaves a regression on the coefficients alone.

The first state of a segment is free, or equals the end of the segment before, or differs from it by
a jump of known covariance (weak constraint). `square_root` does the computing.
"""

from dataclasses import dataclass, replace

import numpy as np

from galloping.identification.likelihood.shooting import (
    SEGMENT_WORK,
    Linearised,
    Segments,
    ShootingData,
    ShootingFit,
)
from galloping.identification.likelihood.square_root import (
    EQUAL,
    FREE,
    JUMP,
    filter_back,
    follow_states,
    link_segments,
)
from galloping.identification.likelihood.weak_constraint import StretchFit
from galloping.identification.selection import Penalties
from galloping.identification.work import count_work

# Largest derivatives of a chain's end by its first state and by the coefficients, in standard
# errors of one segment. They are larger in a chaotic or very long recording, and integration errors
# grow as much. The last stretch of a chaotic recording has most information: of 288 recordings of
# Lorenz's system with 20 to 40 % of noise, 213 have exact models with a limit of 2,000, 246 with
# 1e6; of 48 others, 39 with 1e6, 37 with 1e8, and 39 with 1e10.
MAX_SEGMENT_GROWTH = 1e6
# Least relative singular value of a direction of a chain's first state that is solved for: three
# times TRUNCATION_ERROR, since integration errors cause singular values of this size.
RANK_TOLERANCE = 3e-7
JUMP_RANK_TOLERANCE = 1e-13  # the same with jumps, whose precision may differ by any factor
MIN_JUMP_VARIANCE = 1e-12  # least variance of a jump, relative to the mean square of a state


@dataclass(frozen=True)
class NormalEquations:
    """Quadratic model of the misfit in the coefficients, about those of a fit.

    information: (n, n), right: (n,) half the decrease of chi^2 with each coefficient.
    """

    information: np.ndarray
    right: np.ndarray

    def choose_terms(
        self, fit: ShootingFit | StretchFit, penalties: Penalties | float
    ) -> np.ndarray:
        """Choose the best terms, (n,), searched from all candidates and from those of the fit."""
        supports, problem = [np.ones(len(fit.support), bool), fit.support], fit.record.problem
        return problem.select_terms(self.information, self.right, supports, penalties, fit.free)

    def best_coefficients(
        self, fit: ShootingFit | StretchFit, support: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Compute the best coefficients (n,) of a support, and their covariance without bounds."""
        # solved for the change: on a long chain, rounding of the coefficients outweighs their noise
        origin = np.where(support, fit.free, 0.0)
        right = self.right + self.information @ (fit.free - origin)
        change, covariance = fit.record.problem.solve_within_bounds(
            self.information, right, support, origin
        )
        return origin + change, covariance


@dataclass(frozen=True)
class Eliminated(NormalEquations):
    """Normal equations of the coefficients after elimination of the segments' first states.

    response: (n_segments, n_states, n + 1), of each state to the coefficients' change, and
    constant. variance, jump_variance: (n_segments, n_states, n_states) covariance of each segment's
    first state, and of the jump after it, at given coefficients, zero in directions that nothing
    determines. gap: (n_states,) largest mismatch between segments without a jump. fall: decrease of
    chi^2 when the first states of chains alone are moved to their best.
    """

    response: np.ndarray
    variance: np.ndarray
    jump_variance: np.ndarray
    gap: np.ndarray
    fall: float

    def move_states(self, change: np.ndarray, starts: np.ndarray | float = 0.0) -> np.ndarray:
        """Move first states `starts` to their best after a change (n,) of the coefficients."""
        return starts + self.response[:, :, :-1] @ change + self.response[:, :, -1]


def chain_segments(linear: Linearised, segments: Segments, longest: float = np.inf) -> Segments:
    """Join consecutive segments into chains, as long as MAX_SEGMENT_GROWTH permits.

    longest: how many segments a chain may have; with one, every segment is free.
    """
    n = linear.right.shape[1]
    of_states = np.sum(linear.rows[:, :, n:-1] ** 2, axis=1).mean(axis=0)
    of_coefficients = np.einsum("kii->i", linear.information)
    root = np.sqrt(np.append(of_coefficients, of_states))
    errors = np.divide(1.0, root, out=np.zeros(len(root)), where=root > 0.0)
    count_work(SEGMENT_WORK * len(linear.ends))
    begins = np.diff(segments.recording, prepend=0) != 0
    chains = link_segments(linear.end_derivatives, begins, errors, longest, MAX_SEGMENT_GROWTH)
    return replace(segments, chains=chains)


def eliminate_chains(linear: Linearised, segments: Segments) -> Eliminated:
    """Reduce a fit with joined segments to normal equations of the coefficients alone."""
    links = np.where(np.diff(segments.chains, append=-1) == 0, EQUAL, FREE)
    roots = np.zeros((*linear.starts.shape, linear.starts.shape[1]))
    return _eliminate(linear, links, roots, RANK_TOLERANCE)


def eliminate_with_jumps(
    linear: Linearised, segments: Segments, roots: np.ndarray, left_out: int | None = None
) -> Eliminated:
    """Reduce stretches with jumps between them to normal equations of the coefficients.

    roots: (n_segments, n_states, n_states) of the inverse covariance of the jump after each.
    left_out: fold whose data, and whose jumps to and from it, do not count.
    """
    links = np.where(np.diff(segments.recording, append=-1) == 0, JUMP, FREE)
    if left_out is not None:
        is_omitted = linear.fold == left_out
        links[is_omitted | np.append(is_omitted[1:], False)] = FREE
        linear = replace(
            linear,
            rows=np.where(is_omitted[:, None, None], 0.0, linear.rows),
            information=np.delete(linear.information, left_out, axis=0),
            right=np.delete(linear.right, left_out, axis=0),
        )
    return _eliminate(linear, links, roots, JUMP_RANK_TOLERANCE)


def _eliminate(
    linear: Linearised, links: np.ndarray, roots: np.ndarray, rcond: float
) -> Eliminated:
    """Eliminate first states. links, roots: of `filter_back`; rcond: of `_solve_first_states`."""
    information, right = linear.information.sum(axis=0), linear.right.sum(axis=0)
    count_work(len(links) * (2 * SEGMENT_WORK + 1e-9 * roots.shape[1] * len(right) ** 2))
    mismatch = linear.ends - np.roll(linear.starts, -1, axis=0)
    n, begins = len(right), np.append(True, links[:-1] == FREE)
    state_rows, equations, relations, spreads = filter_back(
        linear.rows, linear.end_derivatives, mismatch, links, roots
    )
    first, first_root, undetermined = _solve_first_states(state_rows[begins], n, rcond)
    response, variance, jump_variance = follow_states(
        relations, spreads, linear.end_derivatives, begins, first, first_root
    )
    remaining = np.concatenate([equations.reshape(-1, n + 1), undetermined.reshape(-1, n + 1)])
    information = information + remaining[:, :n].T @ remaining[:, :n]
    right = right + remaining[:, n] @ remaining[:, :n]
    fall = float(np.sum(state_rows[begins, :, -1] ** 2) - np.sum(undetermined[:, :, n] ** 2))
    gap = np.abs(mismatch[links == EQUAL]).max(axis=0, initial=0.0)
    return Eliminated(information, right, response, variance, jump_variance, gap, fall)


def _solve_first_states(
    rows: np.ndarray, n: int, rcond: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Solve for the first states of chains, linear in the coefficients' change.

    rows: (n_chains, n_states, n + n_states + 1). Directions that the rows do not determine, with
    relative singular values below `rcond`, remain unchanged. Returns the states, (n_chains,
    n_states, n + 1), the constant last; a root of their covariance; and the equations that remain
    for undetermined directions, a design and a residual, (n_chains, n_states, n + 1), zero
    elsewhere.
    """
    block = rows[:, :, n:-1]
    norm = np.linalg.norm(block, axis=1)
    scale = np.divide(1.0, norm, out=np.zeros(norm.shape), where=norm > 0.0)
    u, s, v = np.linalg.svd(block * scale[:, None, :])
    is_determined = (s > rcond * s[:, :1])[..., None]
    rotated_rows = u.transpose(0, 2, 1) @ np.delete(rows, np.s_[n:-1], axis=2)
    inverse = np.divide(1.0, s[..., None], out=np.zeros(is_determined.shape), where=is_determined)
    root = scale[..., None] * (inverse * v).transpose(0, 2, 1)
    solved = root @ rotated_rows
    solved[:, :, :n] *= -1.0
    return solved, root, np.where(is_determined, 0.0, rotated_rows)


def jump_covariance(
    record: ShootingData,
    linear: Linearised,
    solved: Eliminated,
    change: np.ndarray,
    jumping: np.ndarray,
) -> np.ndarray:
    """Estimate the covariance of the state's jumps between segments, given the data.

    Returns (n_states, n_states), for segments with motion of average size. change: of coefficients.
    jumping: (n_jumps,) segments after which the state jumps. Fluctuations that follow the states of
    `linear` are ignored.
    """
    n, n_states = len(change), record.states.shape[1]
    slopes, step = linear.end_derivatives[jumping], solved.move_states(change)
    ends = linear.ends[jumping] + slopes[:, :, :n] @ change
    ends += np.einsum("gij,gj->gi", slopes[:, :, n:], step[jumping])
    gap = linear.starts[jumping + 1] + step[jumping + 1] - ends
    squares = gap[:, :, None] * gap[:, None, :] + solved.jump_variance[jumping]
    squares = squares[:, :n_states, :n_states] / record.segment_sizes[jumping, None, None] ** 2
    floor = np.mean(record.states**2, axis=0) + np.finfo(float).tiny
    return np.sum(squares, axis=0) / max(len(jumping), 1) + MIN_JUMP_VARIANCE * np.diag(floor)
