"""Gauss-Newton on the coefficients and the first states of all segments, terms chosen."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from galloping.identification.likelihood.condense import Condensed
from galloping.identification.likelihood.constants import MOST_HALVINGS
from galloping.identification.likelihood.problem import Problem
from galloping.identification.likelihood.selection import select, solve_support
from galloping.identification.likelihood.shooting import Segments, chained, eliminate, linearise
from galloping.passes import passing

CLOSE = 1.5  # chi^2 per row below which a fit is good enough to choose terms by

DIVERGES = "no model found that follows the data: the iteration diverges"


@dataclass(frozen=True)
class Fit:
    """Where the iteration stands.

    free: (n_candidates,) coefficients; support: the same, boolean. starts: (n_segments,
    n_states). sigma: (n_recordings, n_observed) noise of the projections, not below `floor`.
    reference: the same as first estimated. chi2: by that, of the fit before this one.
    """

    free: np.ndarray
    support: np.ndarray
    starts: np.ndarray
    sigma: np.ndarray
    floor: np.ndarray
    reference: np.ndarray
    chi2: float


@dataclass(frozen=True)
class Step:
    """A Gauss-Newton step from one `Fit`, `before`, to the next.

    information: of the regression on all candidates; right: half the fall of chi^2 with each, at
    the new fit. covariance: of the supported ones. misfit: chi^2 before the step, by the
    noise of its fit. decrement: squared length of the step, in units of its
    covariance. gap: largest mismatch of segments before the step. segments: in the chains that
    were matched.
    """

    before: Fit
    fit: Fit
    information: np.ndarray
    right: np.ndarray
    covariance: np.ndarray
    misfit: float
    decrement: float
    gap: float
    segments: Segments


def is_close(condensed: Condensed, fit: Fit) -> bool:
    """Whether a fit is good enough to choose terms by."""
    return fit.chi2 < CLOSE * float(np.sum(condensed.rows))


def guarded_step(
    problem: Problem,
    condensed: Condensed,
    segments: Segments,
    previous: Fit,
    fit: Fit,
    longest: float | None,
    cost: np.ndarray | None,
) -> Step:
    """A step from `fit`, or, where that diverges or raises the misfit, from nearer to `previous`.

    The other arguments as in `gauss_newton`. Raises FloatingPointError where halving the way
    does not help.
    """
    passing("follow the recording in segments")
    close = CLOSE * float(np.sum(condensed.rows))
    for _ in range(MOST_HALVINGS):
        try:
            step = gauss_newton(problem, condensed, segments, fit, longest, cost)
        except FloatingPointError:
            fit = _between(previous, fit)
            continue
        if step.fit.chi2 < max(1.5 * fit.chi2, close):
            return step
        fit = _between(previous, fit)
    raise FloatingPointError(DIVERGES)


def _between(a: Fit, b: Fit) -> Fit:
    free, starts = (a.free + b.free) / 2.0, (a.starts + b.starts) / 2.0
    return replace(a, free=free, support=a.support | b.support, starts=starts)


def gauss_newton(
    problem: Problem,
    condensed: Condensed,
    segments: Segments,
    fit: Fit,
    longest: float | None,
    cost: np.ndarray | None,
) -> Step:
    """Linearise, choose the terms (unless `cost`, of each, is None), move, re-estimate the noise.

    The noise is that of the projections, which hold the information: where the noise is not
    white it differs from the noise between samples. longest: as in `chained`, None to keep the
    chains that there are.
    """
    linear = linearise(problem, condensed, fit.sigma, segments, fit.free, fit.starts)
    if longest is not None:
        segments = chained(linear, segments, longest)
    quadratic = eliminate(linear, segments, fit.starts)
    support = fit.support
    if cost is not None:
        tried = [np.ones(len(support), bool), fit.support]
        about = problem.chosen_about(fit.free)
        support = select(quadratic.information, quadratic.right, tried, cost, about)
    # solved for the change: on a long chain, rounding of the coefficients outweighs their noise
    free = np.where(support, fit.free, 0.0)
    rest = quadratic.right + quadratic.information @ (fit.free - free)
    step, covariance = solve_support(quadratic.information, rest, support)
    free = free + step
    change = free - fit.free
    starts = fit.starts + quadratic.states[:, :, :-1] @ change + quadratic.states[:, :, -1]
    squares = linear.squares * fit.sigma**2
    chains = segments.chains[-1] + 1
    share = (support.sum() + chains * len(problem.states)) / max(np.count_nonzero(squares), 1)
    sigma = np.sqrt(squares / np.maximum(condensed.rows - share, 0.2 * condensed.rows + 1.0))
    return Step(
        fit,
        Fit(
            free,
            support,
            starts,
            np.maximum(sigma, fit.floor),
            fit.floor,
            fit.reference,
            chi2=float(np.sum(squares / fit.reference**2)),
        ),
        quadratic.information,
        quadratic.right - quadratic.information @ change,
        covariance,
        float(np.sum(linear.squares)),
        float(change @ quadratic.information @ change),
        quadratic.gap,
        segments,
    )
