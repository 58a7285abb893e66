"""Identification of systems under random forces: ambient excitation, turbulence, traffic.

The equations have white forces of unknown strength, dx = f(x) dt + dW. If f is linear, the
likelihood of the samples is exact. This module decides which motion is interpreted as one in random
forces, and which of its modes are modelled; `model_in_forces` makes the fit.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import chain
from typing import TypeGuard

from galloping.arrays import one_thread
from galloping.identification.findings import Code, Finding
from galloping.identification.identified_model import IdentifiedModel
from galloping.identification.inputs import segments_with_inputs
from galloping.identification.no_model import NoModel, NoModelError, attempt
from galloping.identification.postprocessing import (
    add_input_errors,
    check_prior_conflict,
    expand_terms,
    prepend_path,
    refused_model,
)
from galloping.identification.preparation.screening import prepare_recordings
from galloping.identification.problem import Problem
from galloping.identification.random_forces.fitting import ForcedFit
from galloping.identification.random_forces.model_in_forces import fit_in_forces
from galloping.identification.random_forces.several_modes import (
    CLOSE_RATIOS,
    MAX_FURTHER_MODES,
    ModeSelection,
    SeveralModes,
    may_have_split_mode,
    splits_mode,
)
from galloping.identification.random_forces.start import amplitude_fluctuates
from galloping.identification.work import MAX_WORK, limit_work
from galloping.model.polynomial import has_functions, velocity_pairs
from galloping.recording.samples import Recording

# Most work of a trial of random forces beside inputs, s. Recordings that took more mostly had a
# motion of another kind.
INPUT_TRIAL_WORK = 0.15 * MAX_WORK
TRIAL_WORK = 0.4 * MAX_WORK  # most work of a trial of random forces without inputs, s

Outcome = IdentifiedModel | NoModel
Fit = Callable[[ModeSelection], IdentifiedModel]


def fit_random_forces(
    problem: Problem, raw_recordings: list[Recording], forced: Sequence[str]
) -> IdentifiedModel:
    """Identify the equations of a system that is driven by unmeasured random forces.

    raw_recordings: unprocessed. forced: names of the coordinates or states in whose equations a
    force acts; empty for all equations that are sought. If there are more modes than coordinates,
    the model has the slowest modes, and a finding says what was left out. Its status is `ok`,
    `approximate` if the innovations are not white, or `refused`. The covariance of the forces is in
    `forces`. Raises ValueError for an unknown name.
    """
    fit = partial(_identify_selection, problem, forced=forced_equations(problem, forced))

    def search() -> Outcome:
        recordings = segments_with_inputs(raw_recordings, problem.inputs)
        with limit_work(recordings) as work:
            cleaned, _, period = prepare_recordings(recordings)
            outcomes = _search_modes(SeveralModes(cleaned, period), fit, fit, True)
            models = [each for each in outcomes if isinstance(each, IdentifiedModel)]
            outcome = _best_model(models) or outcomes[0]  # that of the whole motion
        if isinstance(outcome, NoModel):
            return outcome
        return add_input_errors(
            check_prior_conflict(problem, work.downgrade_if_cut_short(outcome)),
            raw_recordings,
            recordings,
        )

    outcome = attempt(search)
    if isinstance(outcome, NoModel):
        return prepend_path(["random forces"], refused_model(problem, outcome.findings))
    return outcome


def _identify_selection(
    problem: Problem,
    selection: ModeSelection,
    forced: tuple[int, ...],
    may_be_slow: bool = True,
    check: Callable[[ForcedFit], None] = lambda _: None,
) -> IdentifiedModel:
    """Identify the model of `fit_in_forces`, which allows no terms with functions."""
    polynomial, places = problem.drop_terms(has_functions), list(map(has_functions, problem.terms))
    if problem.known[:, places].any() or problem.precision[:, places].any():
        raise NoModelError(Finding.of(Code.FORCES_BESIDE_FUNCTIONS))
    identified = fit_in_forces(
        polynomial, selection.recordings, selection.period, forced, selection.n_further,
        may_be_slow, check,
    )  # fmt: skip
    return expand_terms(problem, identified)


def _search_modes(
    several: SeveralModes, fit: Fit, fit_roughly: Fit, may_be_more: bool
) -> tuple[Outcome, IdentifiedModel | None]:
    """Search for a model of recordings or, if it is not `ok`, of their slowest modes or of more.

    The order of the searches: the slowest modes, if there are more of them than coordinates; the
    whole recordings; more modes than coordinates; the slowest modes, though the next one is close.
    fit_roughly: fit of selected modes. may_be_more: whether the last two searches are made. Returns
    the model of the whole recordings, and the best one of selected modes; the first is `ok` if
    there is such a model.
    """
    selection_model = _best_model(_identify_selections(several.slowest(), fit_roughly))
    if _is_ok(selection_model):
        return selection_model, selection_model
    whole_model = attempt(fit, several.whole)
    if _is_ok(whole_model):
        return _with_overlapping_modes(whole_model, several, fit), selection_model
    if may_be_more:
        others = chain(several.more(), several.slowest(CLOSE_RATIOS))
        models = [selection_model] if selection_model else []
        selection_model = _best_model(chain(models, _identify_selections(others, fit_roughly)))
    return selection_model if _is_ok(selection_model) else whole_model, selection_model


def _identify_selections(
    selections: Iterable[ModeSelection], fit: Fit
) -> Iterator[IdentifiedModel]:
    """Fit selections of modes one after the other, each when its model is needed."""
    for selection in selections:
        outcome = attempt(_identify_modes, selection, fit)
        if not isinstance(outcome, NoModel):
            yield outcome


def _identify_modes(selection: ModeSelection, fit: Fit) -> IdentifiedModel:
    """Identify the model of the selected modes, or of one that is two; raise if there is none."""
    identified = fit(selection)
    if not selection.has_modes_of(identified):
        raise NoModelError
    return selection.with_omissions(_with_split_mode(identified, selection, fit))


def _with_split_mode(
    identified: IdentifiedModel, selection: ModeSelection, fit: Fit
) -> IdentifiedModel:
    """Replace the model of a selection by one with a mode more, if one of its modes is two."""
    may_split = identified.status == "ok" and may_have_split_mode(identified)
    if not may_split or selection.n_further == MAX_FURTHER_MODES:
        return identified
    split = attempt(fit, replace(selection, n_further=selection.n_further + 1))
    return identified if isinstance(split, NoModel) or not splits_mode(split, identified) else split


def _with_overlapping_modes(
    identified: IdentifiedModel, several: SeveralModes, fit: Fit
) -> IdentifiedModel:
    """Replace the model of whole recordings by one that separates a mode that is two."""
    if not several.channels.rates:
        return _with_split_mode(identified, several.whole, fit)
    if not may_have_split_mode(identified):
        return identified
    # accelerations show that forces are not white, unless motion beyond the modes is filtered out
    more = _best_model(_identify_selections(several.more(), fit))
    return more if _is_ok(more) and more.resonances else identified


def _is_ok(outcome: Outcome | None) -> TypeGuard[IdentifiedModel]:
    return isinstance(outcome, IdentifiedModel) and outcome.status == "ok"


def _best_model(models: Iterable[IdentifiedModel]) -> IdentifiedModel | None:
    """Choose the first model that is `ok`, or the one with the least predictable innovations."""
    others = []
    for identified in models:
        if _is_ok(identified):
            return identified
        others.append(identified)
    return min(others, key=lambda one: float(one.diagnostics["innovations_told"]), default=None)


@one_thread
def identify_if_ambient(problem: Problem, recordings: list[Recording]) -> IdentifiedModel | None:
    """Identify a model under random forces; return None if the motion may have another cause.

    Forces act in all equations.
    """

    def search() -> IdentifiedModel | None:
        with limit_work(recordings) as work:
            cleaned, _, period = prepare_recordings(recordings)
            identified, is_sure = try_random_forces(problem, cleaned, period)
            return work.downgrade_if_cut_short(identified) if identified and is_sure else None

    outcome = attempt(search)
    return None if isinstance(outcome, NoModel) else outcome


def try_random_forces(
    problem: Problem, recordings: list[Recording], period: float
) -> tuple[IdentifiedModel | None, bool]:
    """Identify a model under random forces if these may have caused the recorded motion.

    Forces act in all equations. The order of the searches is that of `_search_modes`. recordings:
    as of `screening.prepare_recordings`. period: the shortest of the motion, s. Returns None as
    model if the motion may have another cause. Returns as well whether random forces certainly
    moved the recordings; if not, the model is `approximate`, has some modes of many, and their
    amplitudes fluctuate.
    """
    several = SeveralModes(recordings, period)
    fit = partial(_fit_on_trial, problem)
    fluctuates = amplitude_fluctuates(recordings, period)
    whole_model, selection_model = _search_modes(
        several, fit, partial(fit, as_fallback=True), bool(several.channels.rates) or fluctuates
    )
    if isinstance(whole_model, IdentifiedModel):
        return whole_model, True
    return (selection_model if fluctuates else None), False


def _fit_on_trial(
    problem: Problem, selection: ModeSelection, as_fallback: bool = False
) -> IdentifiedModel:
    """Fit the model in random forces of selected modes; raise if the motion has another cause.

    The innovations of a motion that repeats contain its harmonics. as_fallback: whether a model is
    accepted that explains most of the motion.
    """
    recordings, period = selection.recordings, selection.period
    with limit_work(recordings, INPUT_TRIAL_WORK if problem.inputs else TRIAL_WORK) as work:

        def check(fit: ForcedFit) -> None:
            channels, whiteness = fit.setup.channels, fit.whiteness
            unmeasured = set(channels.pairs) - set(channels.values)
            if unmeasured and not fit.setup.state_space_model(fit.model).is_linear:
                # with nonlinear terms, forces imitate displacements that no channel measures
                raise NoModelError(Finding.of(Code.FORCES_UNDETERMINED))
            if work.is_cut_short:
                raise NoModelError(Finding.of(Code.LIMIT_OF_WORK))
            # with inputs, other models may be as near
            is_near = whiteness.may_be_random and not (problem.inputs and whiteness.is_relevant)
            if not (is_near or (as_fallback and whiteness.explains_most)):
                raise NoModelError(fit.deviation)

        may_be_slow = amplitude_fluctuates(recordings, period)
        return _identify_selection(problem, selection, problem.unknown, may_be_slow, check)


def forced_equations(problem: Problem, forced: Sequence[str]) -> tuple[int, ...]:
    """Return the indices of the equations in which forces on the named coordinates act.

    forced: names of coordinates or states; if empty, all equations that are sought. Raises
    ValueError for an unknown name.
    """
    pairs, states = velocity_pairs(problem.states), problem.states
    places = set()
    for name in forced:
        if name not in states:
            raise ValueError(f"random force: {name!r:.60}; must be among {', '.join(states)}")
        index = states.index(name)
        index = pairs.get(index, index)
        if index not in problem.unknown:
            raise ValueError(f"random force: {name}: its equation is known, and no force is in it")
        places.add(index)
    return tuple(sorted(places)) or problem.unknown
