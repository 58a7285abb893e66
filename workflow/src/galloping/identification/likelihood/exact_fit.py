"""Search for the model that follows recordings to their noise.

Each initial guess is fitted in free segments and joined over the recording, and the residuals show
whether its model is right.
"""

from dataclasses import replace
from functools import partial

import numpy as np

from galloping.identification.answers import (
    prepend_path,
)
from galloping.identification.identified_model import IdentifiedModel
from galloping.identification.likelihood import free_run, starts, trajectory_fit
from galloping.identification.likelihood.instrument import FORCES, find_faults
from galloping.identification.likelihood.missing_terms import find_missing_kind
from galloping.identification.likelihood.residual_tests import (
    MOST_COLOUR,
    ResidualDiagnostics,
    diagnose_residuals,
)
from galloping.identification.likelihood.several_minima import refine_fit
from galloping.identification.likelihood.shooting import ShootingFit, segment_residuals
from galloping.identification.likelihood.verdict import (
    Regression,
    assess_fit,
)
from galloping.identification.no_model import NoModel, attempt
from galloping.identification.observations import Code, Finding
from galloping.identification.preparation.weak_form import Start
from galloping.identification.selection import n_unidentifiable_directions
from galloping.identification.work import is_exhausted


def fit_exact(begun: Start) -> IdentifiedModel | NoModel:
    """Search for a model that fits the data to the noise; return `NoModel` if none does."""
    problem, penalty, largest = begun.problem, begun.penalty, begun.largest
    joined = _fit_starts(begun, largest)
    if joined is None:
        code = Code.LIMIT_OF_WORK if is_exhausted() else Code.ITERATION_DIVERGES
        return NoModel((Finding.of(code),))
    if joined.objection:
        is_cut = joined.objection.code == Code.LIMIT_OF_WORK  # then the data show no cause
        causes = [] if is_cut else _find_causes(joined.free.fit, penalty)
        return NoModel((*causes, joined.objection))
    remaining, shown = _chain_residuals(begun, joined.step.fit)
    if shown.is_coloured and shown.band < MOST_COLOUR:
        joined = _refit_coloured_noise(begun, joined, shown)
        if joined.objection:
            return NoModel((joined.objection,))
        remaining, shown = _chain_residuals(begun, joined.step.fit)
    step, fit, record = joined.step, joined.step.fit, joined.step.fit.record
    sigma, noise = _sample_noise(fit, remaining)
    doubts = [Finding.of(Code.UNSETTLED)]
    if joined.settled:  # residuals of an unsettled fit are not the least, and show no cause
        doubts, is_near = _find_objections(fit, shown, penalty)
        if doubts and not is_near and problem.inputs and free_run.has_forgotten_start(fit):
            near = free_run.approximate_free_runs(fit, step.information, remaining, penalty, doubts)
            return prepend_path(joined.path, near)
        if doubts and not is_near:
            return NoModel(tuple(doubts))
    kept = sum(recording.samples for recording in begun.recordings)
    found = assess_fit(
        problem,
        Regression(step.information, step.right, fit.support, penalty, largest, fit.free),
        doubts,
        fit.follow_recordings(begun.recordings),
        begun.period,
        initial_states=fit.starts[record.first_segments],
        sigma=sigma,
        chi2=shown.chi2,
        diagnostics={
            "chi2_allowed": shown.chi2_allowed,
            "residual_band": shown.band,
            "residual_band_allowed": shown.band_allowed,
            "residual_line": shown.line,
            "residual_line_allowed": shown.line_allowed,
            "removed_share": 1.0 - kept / begun.samples,
            **noise,
        },
    )
    return prepend_path(joined.path, found)


def _fit_starts(begun: Start, largest: np.ndarray) -> trajectory_fit.JoinedFit | None:
    """Fit initial guesses in order until one converges.

    Otherwise the fit is that of the fewest terms of those that follow the data, or the first that
    can be integrated; None if none can.

    Near kinks chi^2 has several minima: if a motion sticks, no gradient leads to another. A guess
    then counts as converged only if its residuals show no misfit, and the best of the others is
    taken.
    """
    best, has_kinks = None, begun.problem.tables.n_kinks > 0

    def quality(one: trajectory_fit.JoinedFit) -> float:
        fit = one.step.fit
        return fit.misfit if has_kinks else float(fit.support.sum())

    followed: dict[bytes, trajectory_fit.Step | None] = {}
    for name, terms, dear in starts.starts_of_terms(begun):
        guess = terms.free.tobytes()  # two guesses may be equal
        if guess not in followed:
            followed[guess] = trajectory_fit.fit_free_segments(begun, terms)
        free = followed[guess]
        if free is None:
            continue
        unseen = n_unidentifiable_directions(free.information, largest) > 0
        joined = trajectory_fit.join_segments(free, begun.price, dear, unseen)
        if has_kinks:
            joined = refine_fit(joined, begun.price)
        joined = replace(joined, path=(name, *free.path(begun.period), *joined.path))
        if dear > 1.0 and joined.settled and unseen:
            # a model of fewer terms can have the same limit cycle
            untold = n_unidentifiable_directions(joined.step.information, largest)
            joined = replace(joined, settled=bool(untold < joined.step.fit.support.sum()))
        if joined.settled and not (has_kinks and _shows_misfit(begun, joined)):
            return joined
        if best is None or (best.objection and not joined.objection):
            best = joined
        elif not joined.objection:
            best = min(best, joined, key=quality)
    return best


def _shows_misfit(begun: Start, joined: trajectory_fit.JoinedFit) -> bool:
    """Decide whether the residuals of a converged fit show that its model is wrong."""
    remaining = attempt(partial(_chain_residuals, begun, joined.step.fit))
    condensed = joined.step.fit.record.condensed
    return isinstance(remaining, NoModel) or bool(
        remaining[1].find_objections(condensed.channel_names(begun.problem.states))
    )


def _chain_residuals(begun: Start, fit: ShootingFit) -> tuple[np.ndarray, ResidualDiagnostics]:
    """Compute residuals of single shooting over every chain, and their diagnostics.

    Raises FloatingPointError if the model diverges over a chain.
    """
    whole = fit.whole_chains
    remaining, _ = segment_residuals(whole.record, fit.free, whole.starts)
    return remaining, diagnose_residuals(
        fit.record.condensed, remaining, fit.n_parameters, begun.period
    )


def _refit_coloured_noise(
    begun: Start, joined: trajectory_fit.JoinedFit, shown: ResidualDiagnostics
) -> trajectory_fit.JoinedFit:
    """Join a fit again with noise as strong as its residuals at the motion's frequencies."""
    fit = joined.step.fit
    noise = np.sqrt(np.where(np.isfinite(shown.band_power), shown.band_power, fit.sigma**2))
    record = replace(fit.record, floor=noise)
    fit = replace(fit, record=record, sigma=noise, reference=noise, chi2=np.inf)
    again = trajectory_fit.join_segments(
        replace(joined.step, before=fit, fit=fit), begun.price, 1.0, False
    )
    path = (*joined.path, "coloured noise", *again.path)
    return replace(again, free=joined.free, path=path)


def _find_objections(
    fit: ShootingFit, shown: ResidualDiagnostics, penalty: float
) -> tuple[list[Finding], bool]:
    """Find contradictions of a converged fit, and whether its model is near nevertheless.

    It is near if the residuals are those of noise and only an instrument is suspected: by design
    this happens to one sound recording in two hundred, which keeps its model with the suspicion.
    """
    causes = find_faults(fit, penalty)
    misfit = shown.find_objections(fit.record.condensed.channel_names(fit.record.problem.states))
    if misfit:
        excess = float(np.sum(shown.excess / fit.sigma**2))
        causes = [fault for fault in causes if fault.can_explain(excess)]
    is_fault = bool(causes) and not causes[0].or_model
    named = _find_missing_kind(fit, penalty) if (misfit or causes) and not is_fault else []
    named = named or [fault.cause for fault in causes[:1]]
    return [*named, *misfit], is_fault and not misfit


def _find_missing_kind(fit: ShootingFit, penalty: float) -> list[Finding]:
    """Find the kind of term that explains most of the residual; none if the work is exhausted."""
    found = [] if is_exhausted() else attempt(partial(find_missing_kind, fit, penalty))
    return [] if isinstance(found, NoModel) else found


def _find_causes(fit: ShootingFit, penalty: float) -> list[Finding]:
    """Find causes for which no model may follow the whole recording; none without work left."""
    if is_exhausted():
        return []
    if named := _find_missing_kind(fit, penalty):
        return named
    over = np.maximum(1.0 - (fit.reference / fit.sigma) ** 2, 0.0)
    excess = float(np.sum(fit.record.condensed.rows * over))
    named = [fault.cause for fault in find_faults(fit, penalty) if fault.can_explain(excess)][:1]
    if fit.misfit < trajectory_fit.CLOSE and not any(each.code in FORCES for each in named):
        # a small fault would not prevent the segments from joining
        forces = FORCES[bool(fit.record.problem.inputs)]
        named += [Finding.of(Code.FOLLOWED_IN_PIECES), Finding.of(forces)]
    return named


def _sample_noise(fit: ShootingFit, remaining: np.ndarray) -> tuple[np.ndarray, dict[str, float]]:
    """Estimate the standard deviation of a sample of each state and of each rate.

    remaining: residuals of single shooting. Returns (n_recordings, n_states), and rates by name
    (see `Condensed.noise_by_state`).
    """
    condensed = fit.record.condensed
    share = fit.n_parameters / max(int(np.count_nonzero(condensed.counts)), 1)
    squares = condensed.sum_squares(remaining) + condensed.remainder
    variance = squares / np.maximum(condensed.counts - share, 1.0)
    variance = np.where(condensed.is_known, condensed.noise_variance, variance)
    return condensed.noise_by_state(fit.record.problem.states, np.sqrt(variance))
