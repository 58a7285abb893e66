"""Maximum likelihood: coefficients, initial states and terms at the limit the data set.

The method is on a page, docs/identification.md, in the order of this module: the starts, of which
each is fitted in free segments and joined over the recording; what the residuals show; the verdict;
and what is asked where no model of the library is right.
"""

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from galloping.arrays import one_thread
from galloping.identification.aliases import with_alias_rivals
from galloping.identification.answers import beside_known, by, on_terms_of, refused, with_inputs
from galloping.identification.free_motion.answer import (
    PATH,
    free_at_once,
    free_model,
    is_of_one_coordinate,
    linear_model,
    with_beside,
    with_findings,
)
from galloping.identification.free_motion.kinds_of_motion import (
    Kind,
    motion_of,
    without_further_modes,
)
from galloping.identification.free_motion.rest import moving_recordings
from galloping.identification.identified_model import IdentifiedModel
from galloping.identification.inputs import asked, checked_recordings, while_driven
from galloping.identification.likelihood import free_run, starts, trajectory_fit
from galloping.identification.likelihood.derivative_fit import derivative_fit
from galloping.identification.likelihood.instrument import FORCES, faults
from galloping.identification.likelihood.missing_terms import missing_kind
from galloping.identification.likelihood.model_error import approximation
from galloping.identification.likelihood.residual_tests import MOST_COLOUR, Residue, residue
from galloping.identification.likelihood.several_minima import refined
from galloping.identification.likelihood.shooting import Segments, ShootingFit, residuals
from galloping.identification.likelihood.verdict import Regression, agree, best_of, judged
from galloping.identification.likelihood.weak_constraint import STRETCH_PERIODS
from galloping.identification.likelihood.weak_gls import weak_gls
from galloping.identification.no_model import NoModel, attempt
from galloping.identification.observations import Code, Finding
from galloping.identification.preparation.interpolation import held_inputs
from galloping.identification.preparation.weak_form import Start, begin, delayed_inputs
from galloping.identification.prior_knowledge import PRIOR, Coefficient, Prior
from galloping.identification.problem import Problem
from galloping.identification.random_forces.decision import moved_at_random, random_forces
from galloping.identification.random_forces.start import may_be_moved_at_random
from galloping.identification.random_forces.unmodelled import unmodelled
from galloping.identification.selection import unseen_mixtures
from galloping.identification.work import MOST, is_spent, limited, portion
from galloping.model.polynomial import Exponents, PolynomialModel
from galloping.recording.samples import Recording

FREE = 0.2  # of the work of a search, for a model that follows free motion that is not linear

Outcome = IdentifiedModel | NoModel
Findings = tuple[Finding, ...]
# Takes what an earlier search found to speak against a model; gives an outcome, and whether that is
# sure, so that no further search is needed.
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
    """Identify one polynomial model from one or several recordings of a system.

    recordings: sharing their states; any sampling, NaN where samples or channels are missing. The
    noise of each channel of each recording is taken for white and Gaussian. Its size is estimated;
    where a recording says it, no less is assumed, and the misfit is held against what it says.
    Where the values of all recordings are exact, the equations are fitted to their rates directly.
    terms: the library, in the states or in the states and the inputs of the first recording, which
    all must have; a recording counts in the stretches in which they are there, and `initial_states`
    and `sigma` of the result are those of the stretches. known: model whose equations of
    `known_states` hold; the equation of a state X is known to be dX/dt = dX where a state has that
    name. start: of `weak_form.begin`, where it is made already.
    coefficients: what is known of single ones, which are then always there. allowed: (n_states,
    n_terms) boolean, in which equations each term is sought; in all by default.
    prior: of the terms (see `Prior`); None: the data alone choose them and speak in the verdict.
    forced: names of coordinates or states that unmeasured random forces move, () for all: then
    `random_forces` answers. By default such forces are tried where the motion may be theirs.
    The status is `ok`, `not identifiable` (other terms could be there as well), `approximate` (no
    model of the library follows the data to the noise; see `model_error`), or `refused`.
    Raises ValueError where the recordings differ in their states, and for other input.
    """
    recordings = checked_recordings(recordings)
    problem = asked(recordings, terms, known, known_states, prior, coefficients, allowed)
    if forced is not None:
        return random_forces(problem, recordings, forced)
    used = attempt(partial(while_driven, recordings, problem.inputs))
    if isinstance(used, NoModel):
        return by(["no model"], refused(problem, used.findings))
    if all(recording.exact for recording in used):
        found = by(["derivatives"], derivative_fit(problem, used))
    else:
        moving = moving_recordings(used)
        with limited(used) as work:
            begun = None if moving.findings else start
            found = work.doubted_if_ended(_searched(problem, moving.recordings, begun))
        found = with_findings(found, moving)
    found = with_inputs(beside_known(problem, found), recordings, used)
    return with_alias_rivals(problem, found)


def _searched(
    problem: Problem, recordings: list[Recording], start: Start | None
) -> IdentifiedModel:
    """The model of recordings without rests. Of a single coordinate, and where displacements are
    not measured, it is asked first whether the motion is free: that takes a tenth of a second, and
    much else need then not be sought.
    """
    if (motion := free_at_once(recordings)) is not None:
        with limited(recordings, FREE * MOST):
            found = free_model(problem, motion, partial(_followed_model, problem))
        if isinstance(found, IdentifiedModel):
            return found
    return _at_some_time_scale(problem, recordings, start)


def _followed_model(problem: Problem, recordings: list[Recording]) -> Outcome:
    """The model that follows free motion to the noise."""
    begun = attempt(partial(begin, problem, recordings))
    return begun if isinstance(begun, NoModel) else _from_any_rest(begun, _followed)


def _at_some_time_scale(
    problem: Problem, recordings: list[Recording], start: Start | None
) -> IdentifiedModel:
    """The model from the first time scale of which a start leads to a model. The spectrum shows the
    time scale of most of the power; a transient or a relaxation is quicker.
    """
    objections = []
    for share in starts.TIME_SCALES:
        if is_spent():
            break
        begun = start if share == 1.0 else None
        found = attempt(partial(_at_time_scale, problem, recordings, share, begun))
        if isinstance(found, IdentifiedModel):
            return found if share == 1.0 else by([f"time scale {share:g}"], found)
        objections.append(found.findings)
    first = objections[0] if objections else ()
    return by(["no model"], refused(problem, (*unmodelled(recordings), *first)))


def _at_time_scale(
    problem: Problem, recordings: list[Recording], share: float, begun: Start | None
) -> Outcome:
    """The outcome of the searches of a time scale, in their order: is there a model that follows
    the data, did random forces move the system, which model is near. Random forces are tried where
    the motion may be theirs, and first where no model follows the data in segments, or
    displacements are not measured.
    """
    first = replace(begun, problem=problem) if begun else begin(problem, recordings, share)
    begun, told = starts.rescaled(first, recordings, share)
    searches = [partial(_follow, begun), partial(_near, begun)]
    if share == 1.0:
        may_be_random = may_be_moved_at_random(first)
        follows = (
            not may_be_random
            or problem.tables.n_kinks  # beside kinks a start may miss the model
            or (not starts.rests_at_zero(first) and trajectory_fit.follows_in_segments(first))
        )
        tried = [partial(_free, first), *([partial(_in_forces, first)] if may_be_random else [])]
        place = 1 if follows else 0
        searches[place:place] = tried
    found = _first_of(searches, recordings)
    if isinstance(found, NoModel):
        return found
    return replace(found, diagnostics={**told, **found.diagnostics})


def _first_of(searches: Sequence[Search], recordings: list[Recording]) -> Outcome:
    """The outcome of the first search that leads to a model. Where that model is not sure, later
    searches have a quarter of the work to find a model that tells more.

    Each search is told what the searches before it found to speak against a model.
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
                limits.enter_context(limited(recordings, 0.25 * MOST))
    return unsure if unsure and found.tells_little else found


def _follow(begun: Start, _: Findings) -> tuple[Outcome, bool]:
    """The model that follows the data to the noise."""
    with portion(0.6):  # of the work that is left; the rest to come near
        return _from_any_rest(begun, _followed), True


def _from_any_rest(begun: Start, search: Callable[[Start], Outcome]) -> Outcome:
    """The outcome of a search; where displacements are not measured, the best outcome from several
    positions of rest, tried until two models have the same terms.
    """
    if not starts.rests_at_zero(begun):
        return attempt(partial(search, begun))
    found, objections = [], []
    for name, position in starts.positions_of_rest(begun):
        outcome = attempt(partial(search, position))
        if isinstance(outcome, NoModel):
            objections.append(outcome)
        else:
            found.append(by([name], outcome))
        if agree(found) or is_spent():
            break
    return on_terms_of(begun.problem, best_of(found)) if found else objections[0]


def _followed(begun: Start) -> Outcome:
    """The model that follows the data to the noise; `NoModel` where none of the library does."""
    problem, penalty, largest = begun.problem, begun.penalty, begun.largest
    joined = _joined(begun, largest)
    if joined is None:
        code = Code.LIMIT_OF_WORK if is_spent() else Code.ITERATION_DIVERGES
        return NoModel((Finding.of(code),))
    if joined.objection:
        is_cut = joined.objection.code == Code.LIMIT_OF_WORK  # for no cause that the data show
        causes = [] if is_cut else _causes_of_none(joined.free.fit, penalty)
        return NoModel((*causes, joined.objection))
    remaining, shown = _remaining(begun, joined.step.fit)
    if shown.coloured and shown.band < MOST_COLOUR:
        joined = _with_coloured_noise(begun, joined, shown)
        if joined.objection:
            return NoModel((joined.objection,))
        remaining, shown = _remaining(begun, joined.step.fit)
    step, fit, record = joined.step, joined.step.fit, joined.step.fit.record
    sigma, noise = _noise(fit, remaining)
    doubts = [Finding.of(Code.UNSETTLED)]
    if joined.settled:  # the residuals of another fit show that it is not the best, and no cause
        doubts, is_near = _objections(fit, shown, penalty)
        if doubts and not is_near and problem.inputs and free_run.forgets_start(fit):
            near = free_run.whole_approximation(fit, step.information, remaining, penalty, doubts)
            return by(joined.path, near)
        if doubts and not is_near:
            return NoModel(tuple(doubts))
    kept = sum(recording.samples for recording in begun.recordings)
    found = judged(
        problem,
        Regression(step.information, step.right, fit.support, penalty, largest, fit.free),
        doubts,
        fit.followed(begun.recordings),
        begun.period,
        initial_states=fit.starts[record.begins],
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
    return by(joined.path, found)


def _joined(begun: Start, largest: np.ndarray) -> trajectory_fit.JoinedFit | None:
    """The fit of the first start that settles, else of the first that follows the data, else of
    the first that can be integrated; None where none can.

    Beside kinks chi^2 has several minima: where a motion sticks, no slope leads to another. There a
    start counts as settled only if its residuals show nothing, and the best of the others is taken.
    """
    best, has_kinks = None, begun.problem.tables.n_kinks > 0
    for name, terms, dear in starts.starts_of_terms(begun):
        free = trajectory_fit.free_fit(begun, terms)
        if free is None:
            continue
        unseen = unseen_mixtures(free.information, largest) > 0
        joined = trajectory_fit.join(free, begun.price, dear, unseen)
        if has_kinks:
            joined = refined(joined, begun.price)
        joined = replace(joined, path=(name, *free.path(begun.period), *joined.path))
        if dear > 1.0 and joined.settled and unseen:
            # a model of fewer terms can have the same limit cycle
            told = unseen_mixtures(joined.step.information, largest) < joined.step.fit.support.sum()
            joined = replace(joined, settled=told)
        if joined.settled and not (has_kinks and _shows_misfit(begun, joined)):
            return joined
        if best is None or (best.objection and not joined.objection):
            best = joined
        elif has_kinks and not joined.objection:
            best = min(best, joined, key=lambda one: one.misfit)
    return best


def _shows_misfit(begun: Start, joined: trajectory_fit.JoinedFit) -> bool:
    """Whether the residuals of a settled fit show that it is not the model."""
    remaining = attempt(partial(_remaining, begun, joined.step.fit))
    condensed = joined.step.fit.record.condensed
    return isinstance(remaining, NoModel) or bool(
        remaining[1].objections(condensed.names(begun.problem.states))
    )


def _remaining(begun: Start, fit: ShootingFit) -> tuple[np.ndarray, Residue]:
    """Residuals of single shooting over every chain, and what they show.

    Raises FloatingPointError where the model diverges over a chain.
    """
    segments, bounds = fit.record.segments, fit.record.segments.bounds
    begins, each = bounds[:-1], np.arange(len(bounds) - 1)
    whole = Segments(segments.first[bounds], segments.recording[begins], each)
    record = replace(fit.record, segments=whole)
    remaining, _ = residuals(record, fit.free, fit.starts[begins])
    return remaining, residue(record.condensed, remaining, fit.parameters, begun.period)


def _with_coloured_noise(
    begun: Start, joined: trajectory_fit.JoinedFit, shown: Residue
) -> trajectory_fit.JoinedFit:
    """The fit joined again, the noise taken to be as strong as the residuals are at the frequencies
    of the motion.
    """
    fit = joined.step.fit
    noise = np.sqrt(np.where(np.isfinite(shown.band_power), shown.band_power, fit.sigma**2))
    record = replace(fit.record, floor=noise)
    fit = replace(fit, record=record, sigma=noise, reference=noise, chi2=np.inf)
    again = trajectory_fit.join(replace(joined.step, before=fit, fit=fit), begun.price, 1.0, False)
    path = (*joined.path, "coloured noise", *again.path)
    return replace(again, free=joined.free, path=path)


def _objections(fit: ShootingFit, shown: Residue, penalty: float) -> tuple[list[Finding], bool]:
    """What speaks against a settled fit, and whether its model is near all the same.

    It is near where the residuals are those of noise and only an instrument is suspected: one sound
    recording in two hundred is, by design, and keeps its model with the suspicion.
    """
    causes = faults(fit, penalty)
    misfit = shown.objections(fit.record.condensed.names(fit.record.problem.states))
    if misfit:
        excess = float(np.sum(shown.excess / fit.sigma**2))
        causes = [fault for fault in causes if fault.explains(excess)]
    is_fault = bool(causes) and not causes[0].or_model
    named = _missing(fit, penalty) if (misfit or causes) and not is_fault else []
    named = named or [fault.cause for fault in causes[:1]]
    return [*named, *misfit], is_fault and not misfit


def _missing(fit: ShootingFit, penalty: float) -> list[Finding]:
    """The kind of term that explains most of what a fit leaves, if any; none if no work is left."""
    found = [] if is_spent() else attempt(partial(missing_kind, fit, penalty))
    return [] if isinstance(found, NoModel) else found


def _causes_of_none(fit: ShootingFit, penalty: float) -> list[Finding]:
    """Why no model may follow the whole recording; nothing where no work is left."""
    if is_spent():
        return []
    if named := _missing(fit, penalty):
        return named
    over = np.maximum(1.0 - (fit.reference / fit.sigma) ** 2, 0.0)
    excess = float(np.sum(fit.record.condensed.rows * over))
    named = [fault.cause for fault in faults(fit, penalty) if fault.explains(excess)][:1]
    if fit.misfit < trajectory_fit.CLOSE and not any(each.code in FORCES for each in named):
        # a small fault does not keep the pieces from joining
        forces = FORCES[bool(fit.record.problem.inputs)]
        named += [Finding.of(Code.FOLLOWED_IN_PIECES), Finding.of(forces)]
    return named


def _noise(fit: ShootingFit, remaining: np.ndarray) -> tuple[np.ndarray, dict[str, float]]:
    """Standard deviation of a sample of each state, (n_recordings, n_states), and of each rate, by
    its name (see `Condensed.noise_told`). remaining: residuals of single shooting.
    """
    condensed = fit.record.condensed
    share = fit.parameters / max(int(np.count_nonzero(condensed.counts)), 1)
    squares = condensed.squares(remaining) + condensed.remainder
    variance = squares / np.maximum(condensed.counts - share, 1.0)
    variance = np.where(condensed.is_known, condensed.noise_variance, variance)
    return condensed.noise_told(fit.record.problem.states, np.sqrt(variance))


def _free(begun: Start, objections: Findings) -> tuple[Outcome, bool]:
    """The model of free motion of several coordinates, less its further modes and between events.
    If no model follows it to the noise, it is the linear one of its modes. Where free motion has
    none of that, no random force is asked after.
    """
    if is_of_one_coordinate(begun.recordings):  # which was asked before all else
        return NoModel(objections), False
    motion = motion_of(begun.recordings)
    if not (motion.is_linear or motion.kind == Kind.DECAYING):
        return NoModel(objections), False
    found: Outcome = NoModel(objections)
    if motion.further or motion.findings:
        alone = attempt(partial(begin, begun.problem, without_further_modes(motion)))
        found = alone if isinstance(alone, NoModel) else _follow(alone, objections)[0]
    if isinstance(found, IdentifiedModel):
        return by([PATH], with_beside(found, motion)), True
    if motion.is_linear:
        found = linear_model(begun.problem, motion)
    return (found, True) if isinstance(found, IdentifiedModel) else _near(begun, objections)


def _in_forces(begun: Start, _: Findings) -> tuple[Outcome, bool]:
    """The model in random forces, and whether it is plain that these moved the system. An input at
    the wrong times leaves what looks like random forces, and is named.
    """
    found, is_sure = moved_at_random(begun.problem, begun.recordings, begun.period)
    if found is None:
        return NoModel(), False
    return found.with_findings(*_late(begun)), is_sure


def _near(begun: Start, objections: Findings) -> tuple[Outcome, bool]:
    """The model that is near where none follows the data. objections: why none does."""
    late = _late(begun)  # a score test names a late input, but not by how much it is late
    named = {each.subject for each in late}
    other = (
        each
        for each in objections
        if not (each.code == Code.INPUT_DELAYED and each.subject in named)
    )
    return _from_any_rest(begun, partial(_near_data, objections=(*late, *other))), True


def _near_data(begun: Start, objections: Findings) -> Outcome:
    """The approximate model or, where inputs drive the motion, that whose free runs err least."""
    start = trajectory_fit.prepare(begun, begun.fit, STRETCH_PERIODS)
    near = approximation(start, begun.penalty, objections)
    if isinstance(near, NoModel):
        return near
    if begun.problem.inputs and near.status == "approximate":
        runs = partial(free_run.free_runs, start.record, near, begun.penalty, objections)
        run = attempt(runs)
        if isinstance(run, IdentifiedModel):
            return by(["approximation", str(near.diagnostics["path"])], run)
    return by(["approximation"], near)


def _late(begun: Start) -> list[Finding]:
    """Which inputs are late or early, and by how much. One that is held between its samples seems
    late by half of its step where it is taken for another.
    """
    held = held_inputs(begun.problem, begun.recordings)
    late = {} if held else attempt(partial(delayed_inputs, begun))
    found = [Finding.of(Code.INPUT_HELD, name) for name in held]
    if not isinstance(late, NoModel):
        found += [Finding.of(Code.INPUT_DELAYED_BY, name, delay_s=s) for name, s in late.items()]
    return found


def shared_evidence(recordings: Sequence[Recording], terms: tuple[Exponents, ...]) -> dict:
    """What `weak_gls` and `maximum_likelihood` take of a study: recordings, library, and the start
    that they share. The start is None where none is found, for a reason that each method finds
    again, and for exact states with derivatives, which need no start.
    """

    def found() -> Start | None:
        if all(recording.exact for recording in recordings):
            return None
        problem = asked(list(recordings), terms)
        return begin(problem, while_driven(list(recordings), problem.inputs))

    begun = attempt(found)
    start = None if isinstance(begun, NoModel) else begun
    return {"recordings": list(recordings), "terms": terms, "start": start}


def by_weak_gls(evidence: dict) -> IdentifiedModel:
    """`weak_gls` as a method of a study."""
    return weak_gls(**evidence)


def by_maximum_likelihood(evidence: dict) -> IdentifiedModel:
    """`maximum_likelihood` as a method of a study."""
    return maximum_likelihood(**evidence)
