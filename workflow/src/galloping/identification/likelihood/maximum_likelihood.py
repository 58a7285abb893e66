"""Maximum likelihood estimation of coefficients, initial states and terms.

docs/identification.md describes the method in the order of the code, which begins here.
"""

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import replace
from functools import partial

from numpy.typing import ArrayLike

from galloping.arrays import one_thread
from galloping.identification.aliases import add_alias_rivals
from galloping.identification.findings import Code, Finding
from galloping.identification.free_motion.answer import (
    FREE_MOTION,
    find_free_motion,
    identify_free_motion,
    identify_linear_motion,
    is_of_one_coordinate,
    map_findings,
    with_further_modes,
)
from galloping.identification.free_motion.kinds_of_motion import (
    classify_motion,
    without_further_modes,
)
from galloping.identification.free_motion.rest import MovingRecordings, moving_recordings
from galloping.identification.identified_model import IdentifiedModel
from galloping.identification.inputs import (
    checked_recordings,
    segments_with_inputs,
    validated_problem,
)
from galloping.identification.likelihood.approximate_fit import fit_approximation
from galloping.identification.likelihood.derivative_fit import derivative_fit
from galloping.identification.likelihood.exact_fit import fit_exact
from galloping.identification.likelihood.free_run import fit_free_runs
from galloping.identification.likelihood.starts import (
    TIME_SCALES,
    has_free_equilibrium,
    rescale_start,
    starts_at_equilibria,
)
from galloping.identification.likelihood.trajectory_fit import follows_in_segments, prepare_fit
from galloping.identification.likelihood.verdict import choose_best, have_same_terms
from galloping.identification.likelihood.weak_constraint import MIN_STRETCH_PERIODS, STRETCH_PERIODS
from galloping.identification.no_model import NoModel, NoModelError, attempt
from galloping.identification.postprocessing import (
    add_input_errors,
    add_scale_errors,
    check_prior_conflict,
    expand_terms,
    explain_single_state,
    prepend_path,
    refused_model,
)
from galloping.identification.preparation.interpolation import held_inputs, undersampled_inputs
from galloping.identification.preparation.weak_form import Start, delayed_inputs, make_start
from galloping.identification.prior_knowledge import PRIOR, Coefficient, Prior
from galloping.identification.problem import Problem
from galloping.identification.random_forces.decision import fit_random_forces, try_random_forces
from galloping.identification.random_forces.several_modes import find_unmodelled_modes
from galloping.identification.random_forces.start import is_ambient_candidate
from galloping.identification.work import MAX_WORK, is_exhausted, limit_work, sub_budget
from galloping.model.polynomial import Exponents, PolynomialModel, exponent_matrix
from galloping.recording.samples import Recording

Outcome = IdentifiedModel | NoModel
Findings = tuple[Finding, ...]
# A search takes the objections of earlier searches to a model. It returns its outcome, and whether
# that is certain, so that no further search is needed.
Search = Callable[[Findings], tuple[Outcome, bool]]


@one_thread
def maximum_likelihood(
    recordings: Recording | Sequence[Recording],
    terms: tuple[Exponents, ...],
    known: PolynomialModel | None = None,
    known_states: tuple[str, ...] = (),
    prior: Prior | None = PRIOR,
    start: Start | None = None,
    forced: Sequence[str] | None = None,
    coefficients: Sequence[Coefficient] = (),
    allowed: ArrayLike | None = None,
) -> IdentifiedModel:
    """Identify the differential equations of a system from recordings by maximum likelihood.

    The noise of each channel is assumed to be white and Gaussian; its size is estimated. If the
    values of all recordings are exact, the equations are fitted to the measured rates.

    Parameters
    ----------
    recordings : Recording or sequence of Recording
        Recordings with the same states, at any times; NaN marks missing samples. If a recording
        states the size of its noise, no smaller noise is assumed, and the residuals are compared
        with this size.
    terms : tuple of Exponents
        The candidate terms, in the states, or in the states and the inputs of the first recording.
        All recordings must have these inputs. Stretches without an input are omitted, and
        `initial_states` and `sigma` of the result are those of the remaining stretches.
    known : PolynomialModel, optional
        Model whose equations of `known_states` are known. The equation dX/dt = dX is always known
        if X and dX are states.
    known_states : tuple of str
        States whose equations are known.
    prior : Prior or None
        Prior odds of terms. None replaces them by a penalty of 2 ln N for N samples.
    start : Start, optional
        The result of `weak_form.make_start`, if it exists already.
    forced : sequence of str, optional
        Coordinates or states that unmeasured random forces move, () for all; the model is then that
        of `fit_random_forces`. By default random forces are tried if they could have caused the
        motion.
    coefficients : sequence of Coefficient
        Prior knowledge of single coefficients. Terms with a Gaussian prior are always present.
    allowed : (n_states, n_terms) boolean array, optional
        Equations in which each term is sought; by default all.

    Returns
    -------
    IdentifiedModel
        Its status is `ok`, `not identifiable` (other terms would fit as well), `approximate` (no
        model of the library follows the recordings to their noise) or `refused` (no model).

    Raises
    ------
    ValueError
        If the recordings differ in their states, or an argument has another form.
    """
    recordings = checked_recordings(recordings)
    problem = validated_problem(
        recordings, terms, known, known_states, prior, coefficients, allowed
    )
    if forced is not None:
        return fit_random_forces(problem, recordings, forced)
    segments = attempt(segments_with_inputs, recordings, problem.inputs)
    if isinstance(segments, NoModel):
        return prepend_path(["no model"], refused_model(problem, segments.findings))
    if all(recording.exact for recording in segments):
        identified = prepend_path(["derivatives"], derivative_fit(problem, segments))
    else:
        moving = moving_recordings(segments, problem.terms)
        start = None if moving.findings else start
        with limit_work(segments) as work:
            identified = work.downgrade_if_cut_short(_search_model(problem, moving, start))
        identified = explain_single_state(map_findings(identified, moving), segments)
    identified = add_scale_errors(check_prior_conflict(problem, identified))
    identified = add_input_errors(identified, recordings, segments)
    return add_alias_rivals(problem, identified)


def _search_model(
    problem: Problem, moving: MovingRecordings, start: Start | None
) -> IdentifiedModel:
    """Search for the model of recordings without rests.

    Free motion is tried first for a single coordinate, and if displacements are not measured: this
    takes a tenth of a second.
    """
    recordings = moving.recordings
    if (motion := find_free_motion(moving.until_rest)) is not None:
        with limit_work(recordings, 0.2 * MAX_WORK):
            searches = partial(_fit_free_motion, problem), partial(_approximate_motion, problem)
            outcome = attempt(identify_free_motion, problem, motion, recordings, *searches)
        if isinstance(outcome, IdentifiedModel):
            return outcome
    return _search_time_scales(problem, recordings, start)


def _fit_free_motion(problem: Problem, recordings: list[Recording]) -> Outcome:
    """Fit the model that follows free motion to the noise."""
    return _search_equilibria(make_start(problem, recordings), fit_exact)


def _approximate_motion(
    problem: Problem, recordings: list[Recording], objections: Findings
) -> Outcome:
    """Fit the approximate model of free motion that no model follows for reasons given."""
    return _search_approximate(make_start(problem, recordings), objections)[0]


def _search_time_scales(
    problem: Problem, recordings: list[Recording], start: Start | None
) -> IdentifiedModel:
    """Search from each time scale until one leads to a model: a transient may be faster."""
    objections = []
    for share in TIME_SCALES:
        if is_exhausted():
            break
        prepared = start if share == 1.0 else None
        outcome = attempt(_search_time_scale, problem, recordings, share, prepared)
        if isinstance(outcome, IdentifiedModel):
            return outcome if share == 1.0 else prepend_path([f"time scale {share:g}"], outcome)
        objections.append(outcome.findings)
        if any(each.code is Code.RATE_SCALED for each in outcome.findings):
            break  # for every time scale; from shorter ones noise may hide it
    findings = *find_unmodelled_modes(recordings), *(objections[0] if objections else ())
    return prepend_path(["no model"], refused_model(problem, findings))


def _search_time_scale(
    problem: Problem, recordings: list[Recording], share: float, start: Start | None
) -> Outcome:
    """Run the searches of a time scale in their order.

    Random forces are tried if the motion may be due to them, and first if no model follows the data
    in segments, or if displacements are not measured.
    """
    first = replace(start, problem=problem) if start else make_start(problem, recordings, share)
    rescaled, scales = rescale_start(first, recordings, share)
    searches = [partial(_search_exact, rescaled), partial(_search_approximate, rescaled)]
    if share == 1.0:
        may_be_random = is_ambient_candidate(first)
        exact_first = (
            not may_be_random
            or problem.tables.n_kinks  # near kinks a start may miss the model
            or (not has_free_equilibrium(first) and follows_in_segments(first))
        )
        others = [_search_free_motion, *([_search_stochastic] if may_be_random else [])]
        place = 1 if exact_first else 0
        searches[place:place] = [partial(search, first) for search in others]
    outcome = _run_searches(searches, recordings)
    if isinstance(outcome, NoModel):
        return outcome
    return replace(outcome, diagnostics={**scales, **outcome.diagnostics})


def _run_searches(searches: Sequence[Search], recordings: list[Recording]) -> Outcome:
    """Run searches until one leads to a certain model.

    After an uncertain model, later searches have a quarter of the work to find a better one.
    """
    unsure: IdentifiedModel | None = None
    objections: Findings = ()
    with ExitStack() as limits:
        for search in searches:
            outcome, is_sure = search(objections)
            if isinstance(outcome, NoModel):
                objections = outcome.findings or objections
            elif is_sure:
                break
            else:
                unsure = outcome
                limits.enter_context(limit_work(recordings, 0.25 * MAX_WORK))
    return unsure if unsure and outcome.lacks_useful_forecast else outcome


def _search_exact(start: Start, _: Findings) -> tuple[Outcome, bool]:
    """Search for the model that follows the data to the noise."""
    with sub_budget(0.6):  # the rest of the work is for an approximate model
        return _search_equilibria(start, fit_exact), True


def _search_equilibria(start: Start, search: Callable[[Start], IdentifiedModel]) -> Outcome:
    """Run a search, from several equilibria if displacements are not measured.

    Equilibria are tried until two models have the same terms. The outcome is the best.
    """
    if not has_free_equilibrium(start):
        return attempt(search, start)
    models, failures = [], []
    for name, position in starts_at_equilibria(start):
        outcome = attempt(search, position)
        if isinstance(outcome, NoModel):
            failures.append(outcome)
        else:
            models.append(prepend_path([name], outcome))
        if have_same_terms(models) or is_exhausted():
            break
    return expand_terms(start.problem, choose_best(models)) if models else failures[0]


def _search_free_motion(start: Start, objections: Findings) -> tuple[Outcome, bool]:
    """Search for the model of free motion of several coordinates.

    The motion is used without its further modes and between events. If no model follows it to the
    noise, the model is the linear one of its modes, or else the approximate one.
    """
    if is_of_one_coordinate(start.recordings):  # already tried before all other searches
        return NoModel(objections), False
    motion = classify_motion(start.recordings)
    if motion is None or not (motion.is_linear or motion.decays):
        return NoModel(objections), False
    if motion.further_modes or motion.findings:
        alone = attempt(make_start, start.problem, without_further_modes(motion))
        outcome = alone if isinstance(alone, NoModel) else _search_exact(alone, objections)[0]
        if isinstance(outcome, IdentifiedModel):
            return prepend_path([FREE_MOTION], with_further_modes(outcome, motion)), True
    if motion.is_linear:
        outcome = attempt(identify_linear_motion, start.problem, motion)
        if isinstance(outcome, IdentifiedModel):
            return outcome, True
    return _search_approximate(start, objections)


def _search_stochastic(start: Start, _: Findings) -> tuple[Outcome, bool]:
    """Search for the model in random forces, and decide whether these certainly moved the system.

    An input with a wrong delay, or that varies between its samples, looks like random forces, and
    is named.
    """
    identified, is_sure = try_random_forces(start.problem, start.recordings, start.period)
    if identified is None:
        return NoModel(), False
    findings = *_find_late_inputs(start), *_find_undersampled_inputs(start, identified.model)
    return identified.with_findings(*findings), is_sure


def _search_approximate(start: Start, objections: Findings) -> tuple[Outcome, bool]:
    """Search for the model nearest to the data if none follows them. objections: the reasons."""
    # a score test names a late input, but not by how much it is late
    late = _find_late_inputs(start)
    replaced = {(Code.INPUT_DELAYED, each.subject) for each in late}
    others = [each for each in objections if (each.code, each.subject) not in replaced]
    search = partial(_fit_approximate, objections=(*late, *others))
    return _search_equilibria(start, search), True


def _fit_approximate(start: Start, objections: Findings) -> IdentifiedModel:
    """Fit the approximate model, by the error of free runs if inputs drive the motion."""
    fit = attempt(prepare_fit, start, start.fit, STRETCH_PERIODS, MIN_STRETCH_PERIODS)
    if isinstance(fit, NoModel):
        raise NoModelError(*objections, *(one for one in fit.findings if one not in objections))
    approximation = fit_approximation(fit, start.penalty, objections)
    if start.problem.inputs and approximation.status == "approximate":
        run = attempt(fit_free_runs, fit.record, approximation, start.penalty, objections)
        if isinstance(run, IdentifiedModel):
            return prepend_path(["approximation", str(approximation.diagnostics["path"])], run)
    return prepend_path(["approximation"], approximation)


def _find_late_inputs(start: Start) -> list[Finding]:
    """Find inputs with a delay or advance, and its size.

    An input that is held between its samples seems late by half of its step if it is interpolated.
    """
    if held := held_inputs(start.problem, start.recordings):
        return [Finding.of(Code.INPUT_HELD, name) for name in held]
    late = attempt(delayed_inputs, start)
    if isinstance(late, NoModel):
        return []
    return [Finding.of(Code.INPUT_DELAYED_BY, name, delay_s=s) for name, s in late.items()]


def _find_undersampled_inputs(start: Start, model: PolynomialModel) -> list[Finding]:
    """Find inputs of a model that vary between samples more than a quarter of a period apart."""
    present = model.without_absent_terms()
    exponents = exponent_matrix(present.terms, len(present.names))
    steps = undersampled_inputs(start.recordings, start.period)
    return [
        Finding.of(Code.INPUT_UNDERSAMPLED, name, step_s=steps[name])
        for name, column in zip(present.names, exponents.T, strict=True)
        if name in steps and column.any()
    ]
