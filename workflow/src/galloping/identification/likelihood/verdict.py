"""Tests of the terms of a fit against rival terms, whose findings decide its status.

The status of a model follows from all its findings (`findings.status_of`). Other modules add
findings on the recordings, the residuals and the model's behaviour.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache, partial
from typing import Any

import numpy as np
from scipy.special import chdtri

from galloping.identification.findings import Code, Finding, as_warnings
from galloping.identification.identified_model import IdentifiedModel
from galloping.identification.likelihood.repetition import FollowedRecording, is_periodic
from galloping.identification.plausible import (
    MISS_RATE,
    Plausible,
    detection_limits,
    plausible_supports,
    unconditional_errors,
    weigh_by_prior,
)
from galloping.identification.postprocessing import fitted_model
from galloping.identification.problem import Problem
from galloping.identification.selection import (
    Whitened,
    added_deviation,
    make_tableau,
    mixture_information,
    solve_support,
    whiten,
)
from galloping.model.intervals import FALSE_ALARM_RATE, MIN_SIGNIFICANCE, covariance_root

# Largest total weight, under an `ok`, of plausible supports that lack a selected term. At most one
# in fifty `ok` models then has a false term (docs/identification_parts.csv).
MAX_RIVAL_WEIGHT = 0.2
# Largest undetected simple term of an `ok` model, relative to its equation
# (docs/identification_parts.csv).
MAX_HIDDEN_TERM = 0.25
# Largest undetected other term of an `ok` model, relative to its equation. A term twice as large is
# balanced by others, as where all recorded states are near a surface.
MAX_BALANCED_TERM = 2.0
# Largest mixture of terms that changes the fit of an `ok` model by less than noise, relative to its
# equations. It was 15 to 45 times as large in seven wrong `ok` models of a wake, and more than ten
# times in one of 179 right models (docs/identification_parts.csv).
MAX_MIXTURE = 12.0
FOLLOWING_STATUSES = ("ok", "not identifiable")  # statuses of models that follow data to the noise


@dataclass(frozen=True)
class Regression:
    """Quadratic model of chi^2 in all candidate terms' coefficients, and the selected terms.

    The model is about a fit. information, right: as in `selection.solve_support`. support: (n,)
    boolean. penalty: 2 ln N of N samples. largest: (n,) coefficients as in
    `problem.largest_coefficients`. origin: (n,) coefficients of the fit, zero outside the support,
    from which `right` is measured.
    """

    information: np.ndarray
    right: np.ndarray
    support: np.ndarray
    penalty: float
    largest: np.ndarray
    origin: np.ndarray | float = 0.0


def assess_fit(
    problem: Problem,
    regression: Regression,
    doubts: Sequence[Finding] = (),
    followed: Sequence[FollowedRecording] = (),
    period: float = np.inf,
    **fitted: Any,
) -> IdentifiedModel:
    """Turn a reliable fit into an `IdentifiedModel` with the status `ok` or `not identifiable`.

    `ok` claims: the terms are right, every absent term is smaller than its stated limit, and no
    simple term that matters may be undetected. A finding of an `ok` model says if another term may
    be undetected, or if the prior determines the terms and the data alone would not. Intervals and
    limits are those of the data alone.

    doubts: why the terms are not certain, none if they are. followed: the recordings, to test
    whether their motion only repeats; none if derivatives were measured. period: s, the shortest of
    the motion. fitted: initial_states, sigma, chi2 and diagnostics, as in `IdentifiedModel`.
    """
    support, penalty = regression.support, regression.penalty
    information, right, origin = regression.information, regression.right, regression.origin
    free, covariance = problem.solve_within_bounds(information, right, support, origin)
    free = free + origin
    findings, notes = [Finding.of(Code.NO_TERM)], []
    errors = added_deviation(information, support)
    rival_fields: dict[str, Any] = {}
    if support.any():
        ruled_out, contradicted = find_beyond_bounds(problem, regression)
        allowed = np.where(np.logical_or.outer(ruled_out, ruled_out), 0.0, information)
        offset = problem.selection_offset(origin)
        whitened = whiten(allowed, np.where(ruled_out, 0.0, right), offset)
        plausible = plausible_supports(whitened, support)
        posterior = weigh_by_prior(problem, plausible)
        limits = detection_limits(unconditional_errors(posterior, errors), support, penalty)
        simple = mark_simple_terms(problem, support)
        find_hidden = partial(find_hidden_term, problem, support, regression.largest)
        # `find_unseen_mixture` treats terms that are not simple and that others imitate exactly
        stated_limits = np.where(simple | np.isfinite(limits), limits, 0.0)
        most = np.where(simple, MAX_HIDDEN_TERM, MAX_BALANCED_TERM)
        missing = find_hidden(stated_limits, most, Code.TERM_MAY_BE_MISSING)
        questions = find_open_questions(problem, whitened, posterior)
        mixed = find_unseen_mixture(information, regression.largest)
        findings = [*contradicted, *doubts, *questions, *missing, *mixed]
        notes = find_hidden(limits, MAX_HIDDEN_TERM, Code.TERM_MAY_HIDE)
        share, rival = _heaviest_rival(problem, plausible)
        if problem.prior and share > MAX_RIVAL_WEIGHT:
            notes = [Finding.of(Code.PRIOR_DECIDES, **rival), *notes]
        errors = unconditional_errors(plausible, errors)
        rival_fields = _draw_rivals(problem, regression, posterior)
    if followed and is_periodic(problem.model(free), followed, period):
        findings = [Finding.of(Code.MOTION_REPEATS), *findings]
    return fitted_model(
        problem,
        free,
        support,
        covariance,
        findings or notes,
        unconditional_errors=problem.on_library(errors, fixed=0.0),
        detection_limits=problem.on_library(detection_limits(errors, support, penalty)),
        **rival_fields,
        **fitted,
    )


def assess_approximation(
    problem: Problem,
    free: np.ndarray,
    support: np.ndarray,
    information: np.ndarray,
    covariance: np.ndarray,
    penalty: float,
    findings: Iterable[Finding],
    **fitted: Any,
) -> IdentifiedModel:
    """Turn an approximate fit into an `IdentifiedModel` with the status `approximate`.

    It is used if no model of the library is right. The result claims only its distance from the
    data, which is among the findings.

    free: (n,) coefficients, zero outside `support` (n,). information: (n, n) of all coefficients.
    covariance: (n_support, n_support). penalty: of a term, in units of chi^2, at which the terms
    were chosen. fitted: as of `assess_fit`.
    """
    limits = detection_limits(added_deviation(information, support), support, penalty)
    return fitted_model(
        problem,
        free,
        support,
        covariance,
        as_warnings(findings),
        detection_limits=problem.on_library(limits),
        **fitted,
    )


def _draw_rivals(problem: Problem, regression: Regression, posterior: Plausible) -> dict[str, Any]:
    """Draw 40 models of rival supports, as fields of a result; none if rarer than MISS_RATE."""
    rng, weights, rivals = np.random.default_rng(0), posterior.weight[1:], []
    share = float(weights.sum())
    if share < MISS_RATE:
        return {}
    # most rivals are drawn several times
    fit_once = cache(lambda k: _fit_rival(regression, posterior.supports[1 + k]))
    for k in rng.choice(len(weights), 40, p=weights / share):
        best, root = fit_once(k)
        free = best.copy()
        free[posterior.supports[1 + k]] += root @ rng.standard_normal(len(root))
        rivals.append(problem.coefficients(free))
    return {"rivals": np.array(rivals), "rival_share": share}


def _fit_rival(regression: Regression, support: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Fit the terms of a support (n,): coefficients (n,), and the root of their covariance."""
    free = np.where(support, regression.origin, 0.0)
    right = regression.right + regression.information @ (regression.origin - free)
    change, covariance = solve_support(regression.information, right, support)
    return free + change, covariance_root(covariance)


def find_beyond_bounds(
    problem: Problem, regression: Regression
) -> tuple[np.ndarray, list[Finding]]:
    """Find coefficients whose estimates from the data alone would violate their bounds.

    Returns the absent terms that would have such a coefficient, (n,) boolean, and findings of the
    coefficients that the recording alone would certainly put there.
    """
    ruled_out, contradicted = np.zeros(len(regression.support), bool), []
    lower, upper = problem.coefficient_bounds
    for k in np.flatnonzero(np.isfinite(lower) | np.isfinite(upper)).tolist():
        with_term = regression.support.copy()
        with_term[k] = True
        change, covariance = solve_support(regression.information, regression.right, with_term)
        value = (change + regression.origin)[k]
        excess = abs(value - np.clip(value, lower[k], upper[k]))
        ruled_out[k] = excess > 0.0 and not regression.support[k]
        error = np.sqrt(covariance[with_term[:k].sum(), with_term[:k].sum()])
        if excess > MIN_SIGNIFICANCE * error > 0.0:
            contradicted.append(Finding.of(
                Code.BOUNDS_CONTRADICTED, problem.states[problem.candidates[k, 0]],
                term=problem.candidate_names([k]), value=value, least=lower[k], most=upper[k],
            ))  # fmt: skip
    return ruled_out, contradicted


def have_same_terms(models: list[IdentifiedModel]) -> bool:
    """Decide whether the last model follows the data with the same terms as an earlier one."""
    following = [one for one in models if one.status in FOLLOWING_STATUSES]
    if not following or following[-1] is not models[-1]:
        return False
    return any(np.array_equal(one.support, models[-1].support) for one in following[:-1])


def choose_best(models: list[IdentifiedModel]) -> IdentifiedModel:
    """Choose the best of several models from different initial guesses.

    The best model has the fewest terms of those that follow the data, or else the best forecasts.
    It is not `ok` if no other model follows the data: a better one may then be missed.
    """

    def preference_key(identified: IdentifiedModel) -> tuple[int, float]:
        if identified.status in FOLLOWING_STATUSES:
            return 0, float(identified.support.sum())
        if identified.status == "approximate":
            return 1, -float(identified.diagnostics["forecast_r2"])
        return 2, 0.0

    best = min(models, key=preference_key)
    if best.status == "ok" and sum(one.status in FOLLOWING_STATUSES for one in models) < 2:
        return best.with_findings(Finding.of(Code.SINGLE_START))
    return best


def find_open_questions(
    problem: Problem, whitened: Whitened, plausible: Plausible
) -> list[Finding]:
    """Find reasons why the selected terms are uncertain, such as models that fit equally well.

    The terms are uncertain if the plausible supports that lack any of them have more total weight
    than MAX_RIVAL_WEIGHT, or if an absent term, or a pair, improves the fit more than noise does,
    yet less than selection requires.
    """
    share, rival = _heaviest_rival(problem, plausible)
    questions = []
    if share > MAX_RIVAL_WEIGHT:
        questions.append(Finding.of(Code.RIVAL_TERMS, share=share, **rival))
    tableau = make_tableau(whitened, plausible.supports[0])
    for count in (1, 2):
        (rises,), _, added = tableau.rises(0, count)
        # With five times this rate, 55 of 1,000 models were doubted only for this, 5 of them wrong.
        if len(rises) and -rises.min() > chdtri(count, FALSE_ALARM_RATE / len(rises)):
            names = problem.candidate_names(added[np.argmin(rises)])
            questions.append(Finding.of(Code.TERM_PLAUSIBLE, terms=names, chi2=rises.min()))
    return questions


def mark_simple_terms(problem: Problem, support: np.ndarray) -> np.ndarray:
    """Decide which candidate terms have no higher degree than the simplest selected term.

    Returns (n,) boolean. The comparison is with the selected terms of the same equation; terms of
    the first degree always count as simple.
    """
    degrees, equations = problem.degrees, problem.candidates[:, 0]
    simplest = [min(degrees[support & (equations == i)], default=1) for i in equations]
    return degrees <= np.maximum(simplest, 1)


def find_unseen_mixture(information: np.ndarray, largest: np.ndarray) -> list[Finding]:
    """Check whether a large combination of terms could be present but leave the fit unchanged.

    Returns a finding if so. Nothing is found if rounding errors are too large to decide. Arguments
    as of `mixture_information`, of all candidates.
    """
    known = mixture_information(information, largest)
    if max(known[0], len(known) * np.finfo(float).eps * known[-1]) * MAX_MIXTURE**2 > 1.0:
        return []
    return [Finding.of(Code.MIXTURE_MAY_HIDE, times=MAX_MIXTURE)]


def find_hidden_term(
    problem: Problem,
    support: np.ndarray,
    largest: np.ndarray,
    limits: np.ndarray,
    most: np.ndarray | float,
    code: Code,
) -> list[Finding]:
    """Check whether an absent term could be large enough to matter but remain undetected.

    Returns a finding on the worst such term, or none. largest: (n,) as in
    `problem.largest_coefficients`. limits: (n,) of `detection_limits`, including the prior. most:
    (n,) share of its equation above which each must be detectable. code: of the finding.
    """
    share = np.where(support, 0.0, limits / np.maximum(largest, np.finfo(float).tiny))
    k = int(np.argmax(share / most))
    if share[k] < np.broadcast_to(most, len(share))[k]:
        return []
    return [Finding.of(code, term=problem.candidate_names([k]), share=share[k])]


def _heaviest_rival(problem: Problem, plausible: Plausible) -> tuple[float, dict[str, Any]]:
    """Weigh all supports that lack a selected term; describe the heaviest as data of a finding."""
    support = plausible.supports[0]
    lacking = np.where(plausible.supports[:, support].all(axis=1), 0.0, plausible.weight)
    rival = int(np.argmax(lacking))
    other, rise = plausible.supports[rival], plausible.chi2[rival] - plausible.chi2[0]
    gone = problem.candidate_names(np.flatnonzero(support & ~other))
    instead = problem.candidate_names(np.flatnonzero(other & ~support)) or "nothing"
    return float(lacking.sum()), {"terms": gone, "rivals": instead, "chi2": float(rise)}
