"""Search for the least of several minima of chi^2, as models with kinks have.

A motion that sticks no longer depends on its beginning. At the limit of sticking, or of one more
swing, chi^2 has a kink: Gauss-Newton steps alternate across it, or end in another minimum than the
least. Therefore steps are shortened until chi^2 of the whole motion falls, and other minima are
searched for in the range allowed by the samples before the swing in which the motion stuck: in
another minimum it may stick a turn earlier or later.
"""

from dataclasses import replace

import numpy as np

from galloping.identification.findings import Code, Finding
from galloping.identification.likelihood.elimination import (
    Eliminated,
    chain_segments,
    eliminate_chains,
)
from galloping.identification.likelihood.shooting import ShootingFit, segment_residuals
from galloping.identification.likelihood.trajectory_fit import (
    CLOSE_MISFIT,
    DECREMENT_TOLERANCE,
    JoinedFit,
    Step,
    update_noise,
)
from galloping.identification.no_model import NoModel, NotConvergedError, attempt
from galloping.identification.selection import Penalties, solve_support
from galloping.identification.work import is_exhausted
from galloping.model.intervals import draw_normal
from galloping.trajectory.simulation import STICKING_TOLERANCE

DRAWN_FITS = 40  # number of drawn models from which other minima are searched for
SWING_TURNS = 2  # number of turns of the motion in the last swing before it sticks


def refine_fit(chain_fit: JoinedFit, penalties: Penalties) -> JoinedFit:
    """Search several local minima of chi^2 for the lowest, and select the best terms there.

    The search is from the joined segments and, if that leads to no fit that follows the data, from
    the free segments. chain_fit: returned unchanged if neither does.
    """
    for step in (chain_fit.step, chain_fit.free_step):
        least = attempt(_settle_terms, step, penalties)
        if not isinstance(least, NoModel) and least.fit.misfit < CLOSE_MISFIT:
            path = (*chain_fit.path, "least of several minima")
            return JoinedFit(chain_fit.free_step, least, path, True, None)
    return chain_fit


def _settle_terms(step: Step, penalties: Penalties) -> Step:
    """Step to the least minimum whose terms are the best there; an error if terms come and go."""
    record = step.fit.record
    record = replace(record, segments=chain_segments(step.fit.linearise(), record.segments))
    support = step.choose_terms(step.fit, penalties)
    for _ in range(5):  # choices of terms, each by the quadratic model at the last minimum
        if not support.any() or is_exhausted():
            break
        free = np.where(support, step.fit.free, 0.0)
        step = _find_least(replace(step.fit, record=record, support=support, free=free))
        support = step.choose_terms(step.fit, penalties)
        if np.array_equal(support, step.fit.support):
            return step
    raise NotConvergedError(Finding.of(Code.NO_TERM))


def _find_least(fit: ShootingFit) -> Step:
    """Step to the least minimum that is found with the terms of a fit."""
    best = _descend_chi2(fit)
    for _ in range(3):
        lower = best
        for drawn in _draw_fits(best.fit):
            if is_exhausted():
                break
            tried = _descend_chi2(drawn)
            lower = tried if tried.fit.chi2 < lower.fit.chi2 - 1.0 else lower
        if lower is best:
            break
        best = lower
    return best


def _descend_chi2(fit: ShootingFit) -> Step:
    """Take steps with the terms of a fit, each so short that chi^2 falls.

    The quadratic model of the last step is about the fit that it leads to; if no step is short
    enough, as at a kink, its slope counts as zero.
    """
    fit = _match_segments(fit)
    for _ in range(12):
        quadratic, change = _quadratic_model(fit)
        starts, share, better = quadratic.move_states(change), 1.0, None
        for _ in range(7):  # halvings of the step
            trial = replace(fit, free=fit.free + share * change, starts=fit.starts + share * starts)
            outcome = attempt(_match_segments, trial)
            if not isinstance(outcome, NoModel) and outcome.chi2 < fit.chi2:
                better = outcome
                break
            share /= 2.0
        fall = 0.0 if better is None else fit.chi2 - better.chi2
        previous_fit, fit = fit, better or fit
        if fall < DECREMENT_TOLERANCE or is_exhausted():
            break
    quadratic, change = _quadratic_model(fit)
    decrement = float(change @ quadratic.information @ change)
    right = quadratic.right
    if decrement > DECREMENT_TOLERANCE:  # at a kink
        right = right - quadratic.information @ change
    return Step(
        quadratic.information, right, previous_fit, fit, decrement, float(quadratic.gap.max())
    )


def _quadratic_model(fit: ShootingFit) -> tuple[Eliminated, np.ndarray]:
    """Compute the normal equations of a fit, and its Gauss-Newton step of the coefficients (n,)."""
    quadratic = eliminate_chains(fit.linearise(), fit.record.segments)
    free, _ = quadratic.best_coefficients(fit, fit.support)
    return quadratic, free - fit.free


def _match_segments(fit: ShootingFit) -> ShootingFit:
    """Move all segments of a chain to the motion from its first state, and update the noise."""
    whole = fit.whole_chains
    residual, _ = segment_residuals(whole.record, fit.free, whole.starts)
    starts = whole.states_at(np.zeros(1))[fit.record.segments.first[:-1], 0]
    return update_noise(replace(fit, starts=starts), fit.record.condensed.sum_squares(residual))


def _draw_fits(fit: ShootingFit) -> list[ShootingFit]:
    """Draw fits from which other minima may be reached, the best first; none if nothing sticks.

    The recording before the last swing has one minimum, and determines a range that contains the
    least one: models are drawn from it.
    """
    moving = _fit_while_moving(fit)
    if moving is None:
        return []
    step = _descend_chi2(moving)
    (quadratic, _), free = _quadratic_model(step.fit), step.fit.free
    _, covariance = solve_support(step.information, np.zeros(len(free)), fit.support)
    changes = np.zeros((1 + DRAWN_FITS, len(free)))
    changes[1:, fit.support] = draw_normal(
        np.zeros(len(covariance)), covariance, DRAWN_FITS, np.random.default_rng(0)
    )
    fits = []
    for change in changes:
        starts = quadratic.move_states(change, step.fit.starts)
        trial = replace(fit, free=free + change, starts=starts)
        outcome = attempt(_match_segments, trial)
        if not isinstance(outcome, NoModel):
            fits.append(outcome)
    return sorted(fits, key=lambda each: each.chi2)[:3]


def _fit_while_moving(fit: ShootingFit) -> ShootingFit | None:
    """Restrict a fit to the windows before the last swing before anything sticks.

    None if nothing sticks, or too few windows remain.
    """
    record, condensed = fit.record, fit.record.condensed
    states = fit.whole_chains.states_at(np.zeros(1))[:, 0]
    stuck = np.zeros(len(states), bool)
    for weights, offset in record.problem.tables.arguments[: record.problem.tables.n_kinks]:
        argument = states @ weights + offset
        is_still = np.abs(argument) < STICKING_TOLERANCE * np.abs(argument).max()
        is_still &= np.append(is_still[1:], True)
        turns = np.flatnonzero(argument[:-1] * argument[1:] < 0.0)
        for begin in np.flatnonzero(is_still & ~np.append(False, is_still[:-1])):
            turns_before = turns[turns < begin]
            if len(turns_before) >= SWING_TURNS:
                is_still[turns_before[-SWING_TURNS] : begin] = True
        stuck |= is_still
    is_shown, samples = condensed.is_present.any(axis=(1, 2)), condensed.samples
    few = np.sum(~stuck & is_shown) < 0.1 * np.sum(is_shown)
    if samples is None or few or not np.any(stuck & is_shown):
        return None
    functionals = np.where(stuck[:, None, None, None], 0.0, condensed.functionals)
    is_stuck = np.repeat(stuck, np.diff(samples.offsets))
    moving_data = replace(
        condensed,
        functionals=functionals,
        targets=np.where(stuck[:, None, None], 0.0, condensed.targets),
        samples=samples._replace(basis=np.where(is_stuck[:, None, None], 0.0, samples.basis)),
        rows=np.add.reduceat(functionals.any(axis=3).sum(axis=2), condensed.first[:-1]),
    )
    return replace(fit, record=replace(record, condensed=moving_data))
