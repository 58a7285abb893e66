"""Maximum likelihood estimation of coefficients, initial states and terms.

docs/identification.md describes the method in the order of this module: the initial guesses, each
of which is fitted in free segments and joined over the recording; the residuals; the assessment;
and the searches if no model of the library is right.
"""

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import replace
from functools import partial

from numpy.typing import ArrayLike

from galloping.arrays import one_thread
from galloping.identification.aliases import add_alias_rivals
from galloping.identification.answers import (
    add_input_errors,
    check_prior_conflict,
    expand_terms,
    explain_single_state,
    prepend_path,
    refused_model,
)
from galloping.identification.free_motion.answer import (
    PATH,
    find_free_motion,
    identify_free_motion,
    identify_linear_motion,
    is_of_one_coordinate,
    with_findings,
    with_further_modes,
)
from galloping.identification.free_motion.kinds_of_motion import (
    classify_motion,
    without_further_modes,
)
from galloping.identification.free_motion.rest import Moving, moving_recordings
from galloping.identification.identified_model import IdentifiedModel
from galloping.identification.inputs import (
    checked_recordings,
    segments_with_inputs,
    validated_problem,
)
from galloping.identification.likelihood import free_run, starts, trajectory_fit
from galloping.identification.likelihood.derivative_fit import derivative_fit
from galloping.identification.likelihood.exact_fit import fit_exact
from galloping.identification.likelihood.model_error import fit_approximation
from galloping.identification.likelihood.verdict import (
    best_of,
    have_same_terms,
)
from galloping.identification.likelihood.weak_constraint import STRETCH_PERIODS
from galloping.identification.no_model import NoModel, attempt
from galloping.identification.observations import Code, Finding
from galloping.identification.preparation.interpolation import held_inputs
from galloping.identification.preparation.weak_form import Start, delayed_inputs, make_start
from galloping.identification.prior_knowledge import PRIOR, Coefficient, Prior
from galloping.identification.problem import Problem
from galloping.identification.random_forces.decision import fit_random_forces, try_random_forces
from galloping.identification.random_forces.start import is_ambient_candidate
from galloping.identification.random_forces.unmodelled import find_unmodelled_modes
from galloping.identification.work import MOST, is_exhausted, limit_work, sub_budget
from galloping.model.polynomial import Exponents, PolynomialModel
from galloping.recording.samples import Recording

FREE = 0.2  # share of a search's work in which a nonlinear model of free motion is sought

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
    used = attempt(partial(segments_with_inputs, recordings, problem.inputs))
    if isinstance(used, NoModel):
        return prepend_path(["no model"], refused_model(problem, used.findings))
    if all(recording.exact for recording in used):
        found = prepend_path(["derivatives"], derivative_fit(problem, used))
    else:
        moving = moving_recordings(used, problem.terms)
        with limit_work(used) as work:
            begun = None if moving.findings else start
            found = work.downgrade_if_ended(_search_model(problem, moving, begun))
        found = explain_single_state(with_findings(found, moving), used)
    found = add_input_errors(check_prior_conflict(problem, found), recordings, used)
    return add_alias_rivals(problem, found)


def _search_model(problem: Problem, moving: Moving, start: Start | None) -> IdentifiedModel:
    """Search for the model of recordings without rests.

    Free motion is tried first for a single coordinate, and if displacements are not measured: this
    takes a tenth of a second, and often replaces longer searches.
    """
    recordings = moving.recordings
    if (motion := find_free_motion(moving.until_rest)) is not None:
        with limit_work(recordings, FREE * MOST):
            search = partial(_fit_free_motion, problem)
            found = identify_free_motion(problem, motion, recordings, search)
        if isinstance(found, IdentifiedModel):
            return found
    return _search_time_scales(problem, recordings, start)


def _fit_free_motion(problem: Problem, recordings: list[Recording]) -> Outcome:
    """Fit the model that follows free motion to the noise."""
    begun = attempt(partial(make_start, problem, recordings))
    return begun if isinstance(begun, NoModel) else _search_rest_positions(begun, fit_exact)


def _search_time_scales(
    problem: Problem, recordings: list[Recording], start: Start | None
) -> IdentifiedModel:
    """Search from each time scale until a start leads to a model.

    The spectrum shows the shortest period of most of the power; a transient or a relaxation is
    faster.
    """
    objections = []
    for share in starts.TIME_SCALES:
        if is_exhausted():
            break
        begun = start if share == 1.0 else None
        found = attempt(partial(_search_time_scale, problem, recordings, share, begun))
        if isinstance(found, IdentifiedModel):
            return found if share == 1.0 else prepend_path([f"time scale {share:g}"], found)
        objections.append(found.findings)
    first = objections[0] if objections else ()
    return prepend_path(
        ["no model"], refused_model(problem, (*find_unmodelled_modes(recordings), *first))
    )


def _search_time_scale(
    problem: Problem, recordings: list[Recording], share: float, begun: Start | None
) -> Outcome:
    """Run the searches of a time scale in their order.

    They are for a model that follows the data, for random forces, and for an approximate model.
    Random forces are tried if the motion may be due to them, and first if no model follows the data
    in segments, or if displacements are not measured.
    """
    first = replace(begun, problem=problem) if begun else make_start(problem, recordings, share)
    begun, told = starts.rescale_start(first, recordings, share)
    searches = [partial(_search_exact, begun), partial(_search_approximate, begun)]
    if share == 1.0:
        may_be_random = is_ambient_candidate(first)
        follows = (
            not may_be_random
            or problem.tables.n_kinks  # near kinks a start may miss the model
            or (
                not starts.has_free_equilibrium(first) and trajectory_fit.follows_in_segments(first)
            )
        )
        tried = [
            partial(_search_free_motion, first),
            *([partial(_search_stochastic, first)] if may_be_random else []),
        ]
        place = 1 if follows else 0
        searches[place:place] = tried
    found = _run_searches(searches, recordings)
    if isinstance(found, NoModel):
        return found
    return replace(found, diagnostics={**told, **found.diagnostics})


def _run_searches(searches: Sequence[Search], recordings: list[Recording]) -> Outcome:
    """Run searches until one leads to a certain model.

    If a model is uncertain, later searches have a quarter of the work to find one that forecasts
    better. Each search receives the objections of earlier ones to a model.
    """
    unsure: IdentifiedModel | None = None
    objections: Findings = ()
    with ExitStack() as limits:
        for search in searches:
            found, is_sure = search(objections)
            if isinstance(found, NoModel):
                objections = found.findings or objections
            elif is_sure:
                break
            else:
                unsure = found
                limits.enter_context(limit_work(recordings, 0.25 * MOST))
    return unsure if unsure and found.tells_little else found


def _search_exact(begun: Start, _: Findings) -> tuple[Outcome, bool]:
    """Search for the model that follows the data to the noise."""
    with sub_budget(0.6):  # the rest of the work is for an approximate model
        return _search_rest_positions(begun, fit_exact), True


def _search_rest_positions(begun: Start, search: Callable[[Start], Outcome]) -> Outcome:
    """Run a search, from several equilibria if displacements are not measured.

    Equilibria are tried until two models have the same terms. The outcome is the best.
    """
    if not starts.has_free_equilibrium(begun):
        return attempt(partial(search, begun))
    found, objections = [], []
    for name, position in starts.positions_of_rest(begun):
        outcome = attempt(partial(search, position))
        if isinstance(outcome, NoModel):
            objections.append(outcome)
        else:
            found.append(prepend_path([name], outcome))
        if have_same_terms(found) or is_exhausted():
            break
    return expand_terms(begun.problem, best_of(found)) if found else objections[0]


def _search_free_motion(begun: Start, objections: Findings) -> tuple[Outcome, bool]:
    """Search for the model of free motion of several coordinates.

    The motion is used without its further modes and between events. If no model follows it to the
    noise, the model is the linear one of its modes. In free motion without further modes and
    events, random forces are not tried.
    """
    if is_of_one_coordinate(begun.recordings):  # already tried before all other searches
        return NoModel(objections), False
    motion = classify_motion(begun.recordings)
    if motion is None or not (motion.is_linear or motion.decays):
        return NoModel(objections), False
    found: Outcome = NoModel(objections)
    if motion.further or motion.findings:
        alone = attempt(partial(make_start, begun.problem, without_further_modes(motion)))
        found = alone if isinstance(alone, NoModel) else _search_exact(alone, objections)[0]
    if isinstance(found, IdentifiedModel):
        return prepend_path([PATH], with_further_modes(found, motion)), True
    if motion.is_linear:
        found = identify_linear_motion(begun.problem, motion)
        if isinstance(found, IdentifiedModel):
            return found, True
    return _search_approximate(begun, objections)


def _search_stochastic(begun: Start, _: Findings) -> tuple[Outcome, bool]:
    """Search for the model in random forces, and decide whether these certainly moved the system.

    An input with a wrong delay looks like random forces, and is named.
    """
    found, is_sure = try_random_forces(begun.problem, begun.recordings, begun.period)
    if found is None:
        return NoModel(), False
    return found.with_findings(*_find_late_inputs(begun)), is_sure


def _search_approximate(begun: Start, objections: Findings) -> tuple[Outcome, bool]:
    """Search for the model nearest to the data if none follows them. objections: the reasons."""
    # a score test names a late input, but not by how much it is late
    late = _find_late_inputs(begun)
    named = {each.subject for each in late}
    other = (
        each
        for each in objections
        if not (each.code == Code.INPUT_DELAYED and each.subject in named)
    )
    search = partial(_fit_approximate, objections=(*late, *other))
    return _search_rest_positions(begun, search), True


def _fit_approximate(begun: Start, objections: Findings) -> Outcome:
    """Fit the approximate model, by the error of free runs if inputs drive the motion."""
    start = attempt(partial(trajectory_fit.prepare_fit, begun, begun.fit, STRETCH_PERIODS))
    if isinstance(start, NoModel):
        return NoModel((*objections, *(one for one in start.findings if one not in objections)))
    near = fit_approximation(start, begun.penalty, objections)
    if isinstance(near, NoModel):
        return near
    if begun.problem.inputs and near.status == "approximate":
        runs = partial(free_run.fit_free_runs, start.record, near, begun.penalty, objections)
        run = attempt(runs)
        if isinstance(run, IdentifiedModel):
            return prepend_path(["approximation", str(near.diagnostics["path"])], run)
    return prepend_path(["approximation"], near)


def _find_late_inputs(begun: Start) -> list[Finding]:
    """Find inputs with a delay or advance, and its size.

    An input that is held between its samples seems late by half of its step if it is interpolated.
    """
    held = held_inputs(begun.problem, begun.recordings)
    late = {} if held else attempt(partial(delayed_inputs, begun))
    found = [Finding.of(Code.INPUT_HELD, name) for name in held]
    if not isinstance(late, NoModel):
        found += [Finding.of(Code.INPUT_DELAYED_BY, name, delay_s=s) for name, s in late.items()]
    return found
