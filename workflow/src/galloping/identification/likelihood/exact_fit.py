"""Search for the model that follows recordings to their noise, from several initial guesses."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from galloping.identification.findings import Code, Finding
from galloping.identification.identified_model import IdentifiedModel
from galloping.identification.likelihood.free_run import approximate_free_runs, has_forgotten_start
from galloping.identification.likelihood.instrument import FORCE_CODES, find_faults
from galloping.identification.likelihood.missing_terms import find_imitated_drag, find_missing_kind
from galloping.identification.likelihood.residual_tests import (
    MAX_COLOUR_RATIO,
    ResidualDiagnostics,
    diagnose_residuals,
)
from galloping.identification.likelihood.several_minima import refine_fit
from galloping.identification.likelihood.shooting import ShootingFit, segment_residuals
from galloping.identification.likelihood.starts import starts_of_terms
from galloping.identification.likelihood.trajectory_fit import (
    CLOSE_MISFIT,
    JoinedFit,
    Step,
    fit_free_segments,
    join_segments,
)
from galloping.identification.likelihood.verdict import Regression, assess_fit
from galloping.identification.no_model import NoModel, NoModelError, attempt
from galloping.identification.postprocessing import prepend_path
from galloping.identification.preparation.weak_form import Start
from galloping.identification.selection import n_unidentifiable_directions
from galloping.identification.work import is_exhausted


def fit_exact(start: Start) -> IdentifiedModel:
    """Search for a model that fits the data to the noise; raise NoModelError if none does."""
    problem, penalty, largest = start.problem, start.penalty, start.largest
    chain_fit = _fit_guesses(start, largest)
    if chain_fit is None:
        code = Code.LIMIT_OF_WORK if is_exhausted() else Code.ITERATION_DIVERGES
        raise NoModelError(Finding.of(code))
    if chain_fit.objection:
        is_cut = chain_fit.objection.code == Code.LIMIT_OF_WORK  # then the data show no cause
        causes = [] if is_cut else _find_causes(chain_fit.free_step.fit, penalty)
        raise NoModelError(*causes, chain_fit.objection)
    residual, tests = _chain_residuals(start, chain_fit.step.fit)
    if tests.is_coloured and tests.band < MAX_COLOUR_RATIO:
        chain_fit = _refit_coloured_noise(start, chain_fit, tests)
        if chain_fit.objection:
            raise NoModelError(chain_fit.objection)
        residual, tests = _chain_residuals(start, chain_fit.step.fit)
    step, fit = chain_fit.step, chain_fit.step.fit
    sigma, noise_of_rates = _sample_noise(fit, residual)
    doubts = [Finding.of(Code.UNSETTLED)]
    if chain_fit.settled:  # residuals of an unsettled fit are not the least, and show no cause
        doubts, is_near = _find_objections(fit, tests, penalty)
        if doubts and not is_near:
            if not (problem.inputs and has_forgotten_start(fit)):
                raise NoModelError(*doubts)
            approximation = approximate_free_runs(fit, step.information, residual, penalty, doubts)
            return prepend_path(chain_fit.path, approximation)
        doubts = doubts or _find_terms(find_imitated_drag, fit)
    kept_samples = sum(recording.samples for recording in start.recordings)
    identified = assess_fit(
        problem,
        Regression(step.information, step.right, fit.support, penalty, largest, fit.free),
        doubts,
        fit.follow_recordings(start.recordings),
        start.period,
        initial_states=fit.starts[fit.record.first_segments],
        sigma=sigma,
        chi2=tests.chi2,
        diagnostics={
            "chi2_allowed": tests.chi2_allowed,
            "residual_band": tests.band,
            "residual_band_allowed": tests.band_allowed,
            "residual_line": tests.line,
            "residual_line_allowed": tests.line_allowed,
            "removed_share": 1.0 - kept_samples / start.samples,
            **noise_of_rates,
        },
    )
    return prepend_path(chain_fit.path, identified)


def _fit_guesses(start: Start, largest: np.ndarray) -> JoinedFit | None:
    """Fit initial guesses in order until one converges.

    Otherwise the fit is that of the fewest terms of those that follow the data, or the first that
    can be integrated; None if none can. Near kinks chi^2 has several minima: a guess then counts as
    converged only if its residuals show no misfit, and the fit of the least misfit is taken.
    """
    best, has_kinks = None, start.problem.tables.n_kinks > 0

    def quality(one: JoinedFit) -> float:
        fit = one.step.fit
        return fit.misfit if has_kinks else float(fit.support.sum())

    steps: dict[bytes, Step | None] = {}
    for name, guess, penalty_factor in starts_of_terms(start):
        key = guess.free.tobytes()  # two guesses may be equal
        if key not in steps:
            steps[key] = fit_free_segments(start, guess)
        free_step = steps[key]
        if free_step is None:
            continue
        has_unseen = n_unidentifiable_directions(free_step.information, largest) > 0
        chain_fit = join_segments(free_step, start.penalties, penalty_factor, has_unseen)
        if has_kinks:
            chain_fit = refine_fit(chain_fit, start.penalties)
        chain_fit = replace(chain_fit, path=(name, *free_step.path(start.period), *chain_fit.path))
        if penalty_factor > 1.0 and chain_fit.settled and has_unseen:
            # a model of fewer terms can have the same limit cycle
            n_unseen = n_unidentifiable_directions(chain_fit.step.information, largest)
            n_terms = int(chain_fit.step.fit.support.sum())
            chain_fit = replace(chain_fit, settled=n_unseen < n_terms)
        if chain_fit.settled and not (has_kinks and _shows_misfit(start, chain_fit.step.fit)):
            return chain_fit
        if best is None or (best.objection and not chain_fit.objection):
            best = chain_fit
        elif not chain_fit.objection:
            best = min(best, chain_fit, key=quality)
    return best


def _shows_misfit(start: Start, fit: ShootingFit) -> bool:
    """Decide whether the residuals of a converged fit show that its model is wrong."""
    residuals = attempt(_chain_residuals, start, fit)
    return isinstance(residuals, NoModel) or bool(residuals[1].objections)


def _chain_residuals(start: Start, fit: ShootingFit) -> tuple[np.ndarray, ResidualDiagnostics]:
    """Compute residuals of single shooting over every chain, and their diagnostics."""
    whole, condensed = fit.whole_chains, fit.record.condensed
    residual, _ = segment_residuals(whole.record, fit.free, whole.starts)
    tests = diagnose_residuals(
        condensed, residual, fit.n_parameters, start.period, start.recordings
    )
    return residual, tests


def _refit_coloured_noise(
    start: Start, chain_fit: JoinedFit, tests: ResidualDiagnostics
) -> JoinedFit:
    """Join a fit again with noise as strong as its residuals at the motion's frequencies."""
    fit = chain_fit.step.fit
    noise = np.sqrt(np.where(np.isfinite(tests.band_power), tests.band_power, fit.sigma**2))
    record = replace(fit.record, floor=noise)
    fit = replace(fit, record=record, sigma=noise, reference=noise, chi2=np.inf)
    step = replace(chain_fit.step, before=fit, fit=fit)
    again = join_segments(step, start.penalties, 1.0, False)
    path = (*chain_fit.path, "coloured noise", *again.path)
    return replace(again, free_step=chain_fit.free_step, path=path)


def _find_objections(
    fit: ShootingFit, tests: ResidualDiagnostics, penalty: float
) -> tuple[list[Finding], bool]:
    """Find contradictions of a converged fit, and whether its model is near nevertheless.

    It is near if only an instrument is suspected, as by design of one sound recording in 200.
    """
    faults = find_faults(fit, penalty)
    if misfit := tests.objections:
        excess = float(np.sum(tests.excess / fit.sigma**2))
        faults = [fault for fault in faults if fault.can_explain(excess)]
    is_fault = bool(faults) and not faults[0].or_model
    is_unclear = (misfit or faults) and not is_fault
    causes = _find_terms(find_missing_kind, fit, penalty) if is_unclear else []
    causes = causes or [fault.cause for fault in faults[:1]]
    return [*causes, *misfit], is_fault and not misfit


def _find_terms(search: Callable[..., list[Finding]], *fit: Any) -> list[Finding]:
    """Search for terms that the library lacks; none if it fails, or the work is exhausted."""
    found = [] if is_exhausted() else attempt(search, *fit)
    return [] if isinstance(found, NoModel) else found


def _find_causes(fit: ShootingFit, penalty: float) -> list[Finding]:
    """Find causes for which no model may follow the whole recording; none without work left."""
    if is_exhausted():
        return []
    if causes := _find_terms(find_missing_kind, fit, penalty):
        return causes
    excess_share = np.maximum(1.0 - (fit.reference / fit.sigma) ** 2, 0.0)
    excess = float(np.sum(fit.record.condensed.rows * excess_share))
    causes = [fault.cause for fault in find_faults(fit, penalty) if fault.can_explain(excess)][:1]
    if fit.misfit < CLOSE_MISFIT and not any(each.code in FORCE_CODES for each in causes):
        # a small fault would not prevent the segments from joining
        forces = FORCE_CODES[bool(fit.record.problem.inputs)]
        causes += [Finding.of(Code.FOLLOWED_IN_PIECES), Finding.of(forces)]
    return causes


def _sample_noise(fit: ShootingFit, residual: np.ndarray) -> tuple[np.ndarray, dict[str, float]]:
    """Estimate the noise of a sample of each state and rate, as `Condensed.noise_by_state`."""
    condensed = fit.record.condensed
    share = fit.n_parameters / max(int(np.count_nonzero(condensed.counts)), 1)
    squares = condensed.sum_squares(residual) + condensed.remainder
    variance = squares / np.maximum(condensed.counts - share, 1.0)
    variance = np.where(condensed.is_known, condensed.noise_variance, variance)
    return condensed.noise_by_state(np.sqrt(variance))
