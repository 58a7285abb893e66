"""Systems that random forces move: ambient excitation, turbulence, traffic.

The equations that are sought have white forces of unknown strength, dx = f(x) dt + dW. Where f is
linear, the likelihood of the samples is exact. Here is decided which motion is taken for one in
random forces, and which of its modes are modelled; the fit itself is made in `model_in_forces`.
"""

from collections.abc import Iterable, Sequence
from functools import partial
from itertools import chain

from galloping.arrays import one_thread
from galloping.identification.answers import (
    add_input_errors,
    check_prior_conflict,
    expand_terms,
    prepend_path,
    refused_model,
)
from galloping.identification.identified_model import IdentifiedModel
from galloping.identification.inputs import segments_with_inputs
from galloping.identification.no_model import NoModel, attempt
from galloping.identification.observations import Code, Finding
from galloping.identification.preparation.screening import prepared
from galloping.identification.problem import Problem
from galloping.identification.random_forces.fitting import ForcedFit
from galloping.identification.random_forces.model_in_forces import fit_in_forces
from galloping.identification.random_forces.several_modes import (
    CLOSE,
    Find,
    SeveralModes,
    may_be_two,
    with_split_mode,
)
from galloping.identification.random_forces.start import wavers
from galloping.identification.random_forces.verdict_in_forces import judged
from galloping.identification.work import MOST, limit_work
from galloping.model.polynomial import has_functions, velocity_pairs
from galloping.recording.samples import Recording

# s, of a trial beside inputs, and without: what takes more was mostly another motion.
TRIAL_BESIDE_INPUTS, TRIAL = 0.15 * MOST, 0.4 * MOST


def random_forces(
    problem: Problem, given: list[Recording], forced: Sequence[str]
) -> IdentifiedModel:
    """The model that random forces move, of recordings as they came.

    forced: names of the coordinates or of the states in whose equations a force acts, none for all
    that are sought.
    Of more modes than coordinates the model is that of the slowest, and a finding says what was
    left out. The status is `ok`, `approximate` where what is left is no white noise, or `refused`;
    the covariance of the forces is in `forces`. Raises ValueError for a name that is none.
    """
    places = forced_equations(problem, forced)

    def find(recordings: list[Recording], period: float, besides: int) -> IdentifiedModel | NoModel:
        return _identified(problem, recordings, period, places, besides)

    def search() -> IdentifiedModel | NoModel:
        recordings = segments_with_inputs(given, problem.inputs)
        with limit_work(recordings) as work:
            cleaned, _, period = prepared(recordings)
            found = _of_some_modes(find, cleaned, period)
        if isinstance(found, NoModel):
            return found
        return add_input_errors(
            check_prior_conflict(problem, work.doubted_if_ended(found)), given, recordings
        )

    found = attempt(search)
    if isinstance(found, NoModel):
        return prepend_path(["random forces"], refused_model(problem, found.findings))
    return found


def _identified(problem: Problem, *question: object) -> IdentifiedModel | NoModel:
    """The model of `fit_in_forces`, which takes no terms with functions.

    question: the other arguments of that.
    """
    polynomial, places = problem.without(has_functions), list(map(has_functions, problem.terms))
    if problem.known[:, places].any() or problem.precision[:, places].any():
        return NoModel((Finding.of(Code.FORCES_BESIDE_FUNCTIONS),))
    found = attempt(partial(fit_in_forces, polynomial, *question))
    return found if isinstance(found, NoModel) else expand_terms(problem, judged(found))


def _of_some_modes(
    find: Find, recordings: list[Recording], period: float
) -> IdentifiedModel | NoModel:
    """The model of recordings or, where that is not `ok`, of their slowest modes or of more; where
    none is, the one that leaves least.
    """
    several, found = SeveralModes(recordings, period), find(recordings, period, 0)
    if _is_ok(found):
        return _sharper(found, several, find)
    others = several.slowest(find), several.more(find), several.slowest(find, CLOSE)
    known = [] if isinstance(found, NoModel) else [found]
    return _best(chain(known, *others)) or found


def _sharper(found: IdentifiedModel, several: SeveralModes, find: Find) -> IdentifiedModel:
    """The model of all that was recorded or, where a mode of it is two, one that tells these."""
    if not several.channels.rates:
        return with_split_mode(found, several.recordings, several.period, 0, find)
    if not may_be_two(found):
        return found
    # accelerations show how the forces differ from white ones, unless all beyond is filtered out
    more = _best(several.more(find))
    return more if _is_ok(more) and more.resonances else found


def _is_ok(found: IdentifiedModel | NoModel | None) -> bool:
    return isinstance(found, IdentifiedModel) and found.status == "ok"


def _best(models: Iterable[IdentifiedModel]) -> IdentifiedModel | None:
    """The first model that is `ok`, or the one whose innovations are told least by what came
    before; None of none.
    """
    others = []
    for found in models:
        if _is_ok(found):
            return found
        others.append(found)
    return min(others, key=lambda one: one.diagnostics["innovations_told"], default=None)


@one_thread
def if_moved_at_random(problem: Problem, recordings: list[Recording]) -> IdentifiedModel | None:
    """As `random_forces` in all equations; None where the motion may be another one."""

    def search() -> IdentifiedModel | None:
        with limit_work(recordings) as work:
            cleaned, _, period = prepared(recordings)
            found, is_sure = moved_at_random(problem, cleaned, period)
            return work.doubted_if_ended(found) if is_sure else None

    found = attempt(search)
    return None if isinstance(found, NoModel) else found


def moved_at_random(
    problem: Problem, recordings: list[Recording], period: float
) -> tuple[IdentifiedModel | None, bool]:
    """The model of recordings that random forces moved, of their slowest modes where they have more
    of them than coordinates, or of more; and whether it is plain that these forces did.

    None where the motion may be another one. A model of which that is not plain is `approximate`,
    of some modes of many, whose sizes go up and down: better than none. recordings, period: of
    `screening.prepared`.
    """
    several = SeveralModes(recordings, period)
    find = partial(_on_trial, problem)
    roughly = partial(find, for_lack_of_others=True)
    some = _best(several.slowest(roughly))
    if _is_ok(some):
        return some, True
    found = find(recordings, period, 0)
    if _is_ok(found):
        return _sharper(found, several, find), True
    at_random = wavers(recordings, period)
    if several.channels.rates or at_random:
        with limit_work(recordings, TRIAL / 2.0):
            more = _best(several.more(roughly))
        known = [one for one in (some, more) if one]
        some = _best(chain(known, several.slowest(roughly, CLOSE)))
    if _is_ok(some):
        return some, True
    if isinstance(found, IdentifiedModel):
        return found, True
    return (some if at_random else None), False


def _on_trial(
    problem: Problem,
    recordings: list[Recording],
    period: float,
    besides: int,
    for_lack_of_others: bool = False,
) -> IdentifiedModel | NoModel:
    """The model in random forces of all modes; none where the motion may be another one: one that
    repeats leaves its harmonics in the innovations.

    for_lack_of_others: whether a model does that explains most of the motion.
    """
    with limit_work(recordings, TRIAL_BESIDE_INPUTS if problem.inputs else TRIAL) as work:

        def doubts(fit: ForcedFit) -> list[Finding]:
            channels, left = fit.posed.channels, fit.left
            unseen = set(channels.pairs) - set(channels.values)
            if unseen and not fit.posed.tracker(fit.model).is_linear:
                # beside such terms forces imitate displacements that nothing measures
                return [Finding.of(Code.FORCES_UNDETERMINED)]
            if work.ended:
                return [Finding.of(Code.LIMIT_OF_WORK)]
            # beside inputs other models are near as well
            near = left.nearly and not (problem.inputs and left.relevant)
            will_do = near or (for_lack_of_others and left.partly)
            return [] if will_do else [left.finding(channels.names)]

        question = recordings, period, problem.unknown, besides
        return _identified(problem, *question, wavers(recordings, period), doubts)


def forced_equations(problem: Problem, forced: Sequence[str]) -> tuple[int, ...]:
    """Indices of the equations of the coordinates or states `forced`, all that are sought if none.

    Raises ValueError for a name that is none.
    """
    pairs, states = velocity_pairs(problem.states), problem.states
    places = []
    for name in forced:
        if name not in states:
            raise ValueError(f"random force: {name!r:.60}; must be among {', '.join(states)}")
        place = states.index(name)
        place = pairs.get(place, place)
        if place not in problem.unknown:
            raise ValueError(f"random force: {name}: its equation is known, and no force is in it")
        places.append(place)
    return tuple(sorted(set(places))) or problem.unknown
