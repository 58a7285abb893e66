"""Segments joined into one trajectory of each recording, and the terms chosen on the way."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from galloping.identification.likelihood.free_fit import FreeFit
from galloping.identification.likelihood.gauss_newton import (
    CLOSE,
    Fit,
    Step,
    guarded_step,
    is_close,
)
from galloping.identification.likelihood.problem import Problem
from galloping.identification.likelihood.selection import select

# Segments that are joined in the first pass, and how many times more in the next. Measured: with
# whole chains at once 6 of 92 clear lines did not settle, with these none; of 30 recordings of
# published systems one more is `ok` and wrong.
FIRST_CHAIN, CHAIN_GROWTH = 4, 4
MOST_PASSES, CHOOSING_PASSES = 20, 14  # in all, and those of them in which terms are chosen
CONVERGED = 0.01  # squared length of a step, in standard deviations
JOINED = 1e-3  # gap between segments, relative to each state


@dataclass(frozen=True)
class JoinedFit:
    """Where an iteration over joined segments ended.

    fit: the last but one where it converged, about which `step` is a quadratic model of chi^2;
    path: in words. settled: whether it converged with the same terms. objection: why it does not
    follow the data, '' where it does.
    """

    free: FreeFit
    fit: Fit
    step: Step
    path: tuple[str, ...]
    settled: bool
    objection: str


def unseen_mixtures(information: np.ndarray, largest: np.ndarray) -> int:
    """How many mixtures of terms, together as large as the motion, change the fit by no noise.

    information: of the coefficients. largest: (n_candidates,) each alone as large as the motion.
    """
    return int(np.sum(np.linalg.eigvalsh(information * largest * largest[:, None]) < 1.0))


def join(
    problem: Problem, free: FreeFit, costs: np.ndarray, dear: float, unseen: bool
) -> JoinedFit:
    """Gauss-Newton with segments joined in chains; terms chosen at every pass but the last ones.

    Chains grow from pass to pass until the terms stay the same: about a rough fit, that of too
    many terms above all, the solution over a long chain is far from linear in the coefficients,
    and the terms that seem best then lead astray. Where those of the start are the best already,
    the chains are whole from the first.
    costs: (n_candidates,) of the terms, in units of chi^2. dear: how many times as much they cost
    in the first two passes; half as much, but no less than `costs`, in the next two, and so on.
    unseen: whether mixtures of terms go unseen; then what does not settle while terms are chosen
    never will, and the last of the models that follow the data alike is one of them.
    """
    condensed, segments, step = free.condensed, free.segments, free.step
    previous, fit, count = step.before, step.fit, len(segments.chains)
    every = np.ones(len(fit.support), bool)
    about = problem.chosen_about(fit.free)
    best = select(step.information, step.right, [every, fit.support], dear * costs, about)
    chain = count if np.array_equal(best, fit.support) else FIRST_CHAIN
    whole, settled = False, False
    try:
        for passed in range(MOST_PASSES):
            price = max(dear / 2 ** (passed // 2), 1.0)
            choosing = passed < CHOOSING_PASSES
            if unseen and not choosing:
                break
            longest = None if whole else chain
            step = guarded_step(
                problem,
                condensed,
                segments,
                previous,
                fit,
                longest,
                price * costs if choosing else None,
            )
            unchanged = np.array_equal(step.fit.support, step.before.support)
            previous, fit = step.before, step.fit
            if price == 1.0 and not fit.support.any():
                raise FloatingPointError("no term stands out of the noise")
            was_whole = whole or chain >= count
            converged = step.decrement < CONVERGED and step.gap < JOINED and price == 1.0
            settled = unchanged and was_whole and converged
            if settled:
                break
            whole = unchanged and was_whole
            if whole:
                segments = step.segments  # chains that come and go would never settle
            else:
                chain = count if unchanged else chain * CHAIN_GROWTH
    except FloatingPointError as error:
        return JoinedFit(free, fit, step, ("left",), False, str(error))
    misfit = fit.chi2 / float(np.sum(condensed.rows))
    follows = settled or (unseen and was_whole and is_close(condensed, fit))
    what = "follows the data" if misfit > CLOSE else "is preferred by the data"
    objection = "" if follows else f"no model found that {what}: chi2/n {misfit:.3g}"
    return JoinedFit(free, fit, step, ("settled" if settled else "unsettled",), settled, objection)
