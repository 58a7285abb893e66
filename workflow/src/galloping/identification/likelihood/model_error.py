"""Identification where no model of the library follows the data to the noise.

The equations hold up to a random disturbance: between short segments the state may jump, by an
amount whose covariance is estimated with the coefficients (weak-constraint variational
estimation; Tremolet, Q. J. R. Meteorol. Soc. 132, 2006). Where the model is nearly right the jumps
vanish and the record counts as a whole; where it is not, each stretch counts for itself.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from galloping.identification.likelihood.condense import Condensed
from galloping.identification.likelihood.problem import Problem
from galloping.identification.likelihood.selection import select, solve_support
from galloping.identification.likelihood.shooting import (
    Linearised,
    Segments,
    linearise,
)

MOST_PASSES = 30
CONVERGED = 0.05  # squared length of a step, in standard deviations


@dataclass(frozen=True)
class Noise:
    """sigma: (n_recordings, n_observed) of the projections. jump: (n_states, n_states)."""

    sigma: np.ndarray
    jump: np.ndarray


@dataclass(frozen=True)
class Joint:
    """Normal equations of coefficients and segment states, the states eliminated.

    information (n, n), right (n,): of the coefficients. response: (n_segments, n_states, n + 1),
    the states' change, linear in the coefficients' and constant. variance: (n_segments, n_states,
    n_states) of the states and covariance: (n_segments, ...) of each with its successor, at given
    coefficients.
    """

    information: np.ndarray
    right: np.ndarray
    response: np.ndarray
    variance: np.ndarray
    covariance: np.ndarray
    log_det: float


def _follows(segments: Segments) -> np.ndarray:
    """(n_segments - 1,) whether a segment continues the one before."""
    return np.diff(segments.recording) == 0


def joint(
    linear: Linearised, segments: Segments, starts: np.ndarray, jump: np.ndarray, size: np.ndarray
) -> Joint:
    """Eliminate the states of segments that jump with covariance `jump` from one to the next."""
    count, s = starts.shape
    n = linear.right.shape[1] - s
    whole = np.linalg.inv(jump)
    own = linear.information[:, n:, n:].copy()  # (G, s, s) diagonal blocks
    cross = np.concatenate([linear.information[:, n:, :n], linear.right[:, n:, None]], axis=2)
    next_ = np.zeros((count, s, s))  # coupling to the next one
    information = linear.information[:, :n, :n].sum(axis=0)
    right = linear.right[:, :n].sum(axis=0)
    for g in np.flatnonzero(_follows(segments)):
        by_c, by_x = linear.end_derivatives[g, :, :n], linear.end_derivatives[g, :, n:]
        gap = starts[g + 1] - linear.ends[g]
        precision = whole / size[g] ** 2
        information += by_c.T @ precision @ by_c
        right += by_c.T @ precision @ gap
        own[g] += by_x.T @ precision @ by_x
        own[g + 1] += precision
        next_[g] = -by_x.T @ precision
        cross[g, :, :n] += by_x.T @ precision @ by_c
        cross[g, :, n] += by_x.T @ precision @ gap
        cross[g + 1, :, :n] -= precision @ by_c
        cross[g + 1, :, n] -= precision @ gap
    # block tridiagonal elimination, forward and back
    pivot, reduced = np.empty_like(own), cross.copy()
    for g in range(count):
        block = own[g]
        if g:
            factor = next_[g - 1].T @ pivot[g - 1]
            block = block - factor @ next_[g - 1]
            reduced[g] = reduced[g] - factor @ reduced[g - 1]
        pivot[g] = np.linalg.inv((block + block.T) / 2)
    solved, variance, covariance = np.empty_like(cross), np.empty_like(own), np.zeros_like(own)
    for g in range(count - 1, -1, -1):
        rest, variance[g] = reduced[g], pivot[g]
        if g + 1 < count:
            gain = pivot[g] @ next_[g]
            rest = rest - next_[g] @ solved[g + 1]
            covariance[g] = -gain @ variance[g + 1]
            variance[g] = variance[g] + gain @ variance[g + 1] @ gain.T
        solved[g] = pivot[g] @ rest
    flat, back = cross.reshape(-1, n + 1), solved.reshape(-1, n + 1)
    information = information - flat[:, :n].T @ back[:, :n]
    right = right - flat[:, :n].T @ back[:, n]
    response = np.concatenate([-solved[:, :, :n], solved[:, :, n:]], axis=2)
    log_det = -np.linalg.slogdet(pivot)[1].sum() + np.linalg.slogdet(jump)[1] * _follows(segments).sum() + 2*s*np.log(size[:-1]).sum()
    return Joint((information + information.T) / 2, right, response, variance, covariance, log_det)


def jumps(linear: Linearised, segments: Segments, starts: np.ndarray, solved: Joint, size) -> np.ndarray:
    """Expected covariance of the jumps between segments."""
    n = linear.right.shape[1] - starts.shape[1]
    total, used = np.zeros((starts.shape[1],) * 2), np.flatnonzero(_follows(segments))
    for g in used:
        by_x = linear.end_derivatives[g, :, n:]
        gap = starts[g + 1] - linear.ends[g]
        mixed = by_x @ solved.covariance[g]
        total += (
            np.outer(gap, gap)
            + solved.variance[g + 1]
            + by_x @ solved.variance[g] @ by_x.T
            - mixed
            - mixed.T
        ) / size[g] ** 2
    return total / max(len(used), 1)
