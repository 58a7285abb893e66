"""Segments matched in chains, and the terms chosen on the way."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from galloping.identification.likelihood.ambiguity import costs, preferred
from galloping.identification.likelihood.condense import Condensed
from galloping.identification.likelihood.gauss_newton import (
    CLOSE,
    Fit,
    Step,
    gauss_newton,
    guarded_step,
    is_close,
)
from galloping.identification.likelihood.problem import Problem
from galloping.identification.likelihood.selection import select, whiten
from galloping.identification.likelihood.shooting import Segments

# Segments that are matched in the first pass, and how many times more in the next. Measured: with
# whole chains at once 6 of 92 clear lines did not settle, with these none.
FIRST_CHAIN, CHAIN_GROWTH = 4, 4


class Passes(NamedTuple):
    """Passes of a try of `matching.match`.

    name: of the try. most: in all. choosing: those of them in which terms are chosen. alike: with
    chains of one length, unless the step is SHORT before. raised: what a term costs in the first,
    in penalties.
    """

    name: str
    most: int
    choosing: int
    alike: int
    raised: tuple[int, ...] = ()


# Measured: of five recordings of chaotic lines that do not settle in the first try, four do in the
# patient one, with the right terms. Of six of clear lines in which a mixture of terms goes unseen
# and which do not settle in the first, four do with 16 penalties at first, each with the right
# terms, two with 4; among many terms of which some make up others the choice goes round in circles.
FIRST_TRY, PATIENT_TRY = Passes("first try", 20, 14, 1), Passes("patient try", 40, 28, 4)
SPARSE_TRY = Passes("sparse try", 26, 20, 1, raised=(16, 16, 8, 8, 4, 4, 2, 2))
SHORT = 100.0  # squared length of a step, in standard deviations
CONVERGED = 0.01  # squared length of a step, in standard deviations
MATCHED = 1e-3  # gap between segments, relative to each state


def unseen_mixtures(information: np.ndarray, largest: np.ndarray) -> int:
    """How many mixtures of terms, together as large as the motion, change the fit by no noise.

    information: of the coefficients. largest: (n_candidates,) each alone as large as the motion.
    """
    return int(np.sum(np.linalg.eigvalsh(information * largest * largest[:, None]) < 1.0))


def match(
    problem: Problem,
    condensed: Condensed,
    segments: Segments,
    step: Step,
    penalty: float,
    unseen: bool,
    largest: np.ndarray,
) -> tuple[Fit, Step, tuple[str, ...]]:
    """Gauss-Newton with segments matched in chains; terms chosen at every pass but the last ones.

    Chains grow from pass to pass until the terms stay the same: about a rough fit, that of too
    many terms above all, the solution over a long chain is far from linear in the coefficients,
    and the terms that seem best then lead astray. Where those of the start, `step`, are the best
    already, the chains are whole from the first. What does not settle, as a chaotic recording may
    not, is tried again with more passes at each length, and believed where it follows the data.
    unseen: whether a mixture of terms goes unseen (`unseen_mixtures`, with `largest` as there);
    then it is tried again from few terms, and believed where it follows the data and has more terms
    than mixtures go unseen: a limit cycle looks like one of fewer terms. What does not settle while
    terms are chosen never will: it ends with the last of the models that follow the data alike, or
    with the free segments that it began with where none follows the whole. Which try it was and how
    it ended comes with it, in words.
    Raises FloatingPointError where it diverges, or does not settle, on other recordings.
    """
    ends, objections = [], []
    for passes in (FIRST_TRY, SPARSE_TRY if unseen else PATIENT_TRY):
        try:
            fit, last, ended = _matched(problem, condensed, segments, step, penalty, unseen, passes)
        except FloatingPointError as error:
            objections.append(error)
            continue
        told = not unseen or unseen_mixtures(last.information, largest) < fit.support.sum()
        if last.settled and (passes is FIRST_TRY or (told and is_close(condensed, fit))):
            return fit, last, (passes.name, *ended)
        if not last.settled:
            ends.append((fit, last, (passes.name, *ended)))
    if ends:
        return ends[0]
    if unseen:
        free = gauss_newton(problem, condensed, segments, step.fit, 1, None)
        if is_close(condensed, free.fit):
            return step.fit, replace(free, settled=False), ("free segments",)
    raise objections[0]


def _matched(
    problem: Problem,
    condensed: Condensed,
    segments: Segments,
    step: Step,
    penalty: float,
    unseen: bool,
    passes: Passes,
) -> tuple[Fit, Step, tuple[str, ...]]:
    """A try of `match`, of so many passes.

    Where it does not settle while terms are chosen, though the whole is followed, the last step.
    """
    previous, fit = step.before, step.fit
    every = np.ones(len(fit.support), bool)
    best = select(step.information, step.right, [every, fit.support], penalty, fit.free)
    longest = np.inf if np.array_equal(best, fit.support) else FIRST_CHAIN
    preferring, alike = False, 1
    for passed in range(passes.most):
        choosing = passed < passes.choosing and not preferring
        price = penalty * (passes.raised[passed] if passed < len(passes.raised) else 1)
        if unseen and not (choosing or preferring):
            break
        step = guarded_step(
            problem, condensed, segments, previous, fit, longest, price if choosing else None
        )
        unchanged = np.array_equal(step.fit.support, step.before.support)
        previous, fit = step.before, step.fit
        whole = longest is None or longest >= len(segments.chains)
        settled = step.decrement < CONVERGED and step.gap < MATCHED and passed >= len(passes.raised)
        if unchanged and whole and settled:
            whitened = whiten(step.information, step.right, fit.free)
            support = fit.support
            if not preferring:
                support = preferred(whitened, support, costs(problem, penalty))
            if np.array_equal(support, fit.support):
                return fit, step, ("preferred",) * preferring + ("settled",)
            preferring = True
            fit = replace(fit, support=support)
        stays = not unchanged and alike < passes.alike and step.decrement > SHORT
        alike = alike + 1 if stays else 1
        if unchanged and whole:
            segments, longest = step.segments, None  # chains that come and go would never settle
        elif unchanged:
            longest = np.inf
        else:
            longest = (longest or np.inf) * (1 if stays else CHAIN_GROWTH)
    if unseen and whole and is_close(condensed, fit):
        return fit, replace(step, settled=False), ("unsettled",)
    misfit = fit.cost / float(np.sum(condensed.rows))
    what = "follows the data" if misfit > CLOSE else "is preferred by the data"
    raise FloatingPointError(f"no model found that {what}: chi2/n {misfit:.3g}")
