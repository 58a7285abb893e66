"""Systems that random forces move: ambient excitation, turbulence, traffic.

The equations that are sought have white forces of unknown strength, dx = f(x) dt + dW. Where f is
linear, the likelihood of the samples is exact. Here is decided which motion is taken for one in
random forces, and which of its modes are modelled; the model itself is made in `model_in_forces`.
"""

from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from itertools import chain

from numpy.typing import ArrayLike

from galloping.arrays import one_thread
from galloping.identification.answers import beside_known, by, refused, with_inputs
from galloping.identification.inputs import asked, checked_recordings, driven
from galloping.identification.model import NO_MODEL, IdentifiedModel
from galloping.identification.preparation.rate_channels import scaled, scales_told
from galloping.identification.preparation.screening import prepared
from galloping.identification.problem import PRIOR, Coefficient, Prior, Problem
from galloping.identification.random_forces.model_in_forces import fitted_to_all, fitted_to_some
from galloping.identification.random_forces.several_modes import (
    CLOSE,
    Find,
    SeveralModes,
    may_be_two,
    parted,
)
from galloping.identification.random_forces.start import wavers
from galloping.identification.random_forces.whiteness import Whiteness
from galloping.identification.work import MOST, limited
from galloping.polynomial import Exponents, PolynomialModel, velocity_pairs
from galloping.recording import Recording

# s, of a trial beside inputs, and without: what takes more was mostly another motion.
TRIAL_BESIDE_INPUTS, TRIAL = 0.15 * MOST, 0.4 * MOST


@one_thread
def random_forces(
    recordings: Recording | Sequence[Recording],
    terms: tuple[Exponents, ...],
    known: PolynomialModel | None = None,
    known_states: tuple[str, ...] = (),
    prior: Prior | None = PRIOR,
    forced: Sequence[str] = (),
    coefficients: Sequence[Coefficient] = (),
    allowed: ArrayLike | None = None,
) -> IdentifiedModel:
    """Identify a model that random forces move, from one or several recordings of a system.

    All but `forced`: as of `maximum_likelihood`. forced: names of the coordinates or of the states
    in whose equations a force acts; by default all that are sought.
    Of more modes than coordinates the model is that of the slowest, and the reason says what was
    left out. The status is `ok`, `approximate` where what is left is no white noise, or `refused`;
    the covariance of the forces is in `forces`. Raises ValueError for other input.
    """
    given = checked_recordings(recordings)
    problem = asked(given, terms, known, known_states, prior, coefficients, allowed)
    places = forced_equations(problem, forced)

    def find(recordings: list[Recording], period: float, besides: int) -> IdentifiedModel:
        rescaled = scaled(recordings, period)
        question, whole, _ = fitted_to_some(problem, rescaled, places, besides=besides)
        found, _ = fitted_to_all(question, whole, rescaled, period)
        return _with_scales(found, recordings, rescaled)

    try:
        recordings = driven(given, problem.inputs)
        with limited(recordings) as work:
            cleaned, _, period = prepared(recordings)
            found = _of_some_modes(find, cleaned, period)
        return with_inputs(beside_known(problem, work.told(found)), given, recordings)
    except NO_MODEL as error:
        return by(["random forces"], refused(problem, str(error)))


def _of_some_modes(find: Find, recordings: list[Recording], period: float) -> IdentifiedModel:
    """The model of recordings or, where that is not `ok`, of their slowest modes or of more; where
    none is, the one that leaves least.
    """
    others, objection, several = [], None, SeveralModes(recordings, period)
    try:
        found = find(recordings, period, 0)
        if found.status == "ok":
            return _sharper(found, several, find)
        others.append(found)
    except NO_MODEL as error:
        objection = error
    of_modes = several.slowest(find), several.more(find), several.slowest(find, CLOSE)
    if found := _first_sound(chain.from_iterable(of_modes), others):
        return found
    if not others:
        raise objection
    return _whitest(others)


def _sharper(found: IdentifiedModel, several: SeveralModes, find: Find) -> IdentifiedModel:
    """The model of all that was recorded or, where a mode of it is two, one that tells these."""
    if not several.channels.rates:
        return parted(found, several.recordings, several.period, 0, find)
    if not may_be_two(found):
        return found
    # accelerations show how the forces differ from white ones, unless all beyond is filtered out
    more = _first_sound(several.more(find), [])
    return more if more and more.resonances else found


def _first_sound(
    models: Iterable[IdentifiedModel], others: list[IdentifiedModel]
) -> IdentifiedModel | None:
    """The first model that is `ok`; those before it are added to `others`."""
    for found in models:
        if found.status == "ok":
            return found
        others.append(found)
    return None


def _whitest(models: Sequence[IdentifiedModel]) -> IdentifiedModel | None:
    """The one whose innovations are told least by what came before; None where there is none."""
    return min(models, key=lambda found: found.diagnostics["innovations_told"], default=None)


@one_thread
def if_moved_at_random(
    recordings: Sequence[Recording],
    terms: tuple[Exponents, ...],
    known: PolynomialModel | None = None,
    known_states: tuple[str, ...] = (),
    prior: Prior | None = PRIOR,
    coefficients: Sequence[Coefficient] = (),
    allowed: ArrayLike | None = None,
) -> IdentifiedModel | None:
    """As `random_forces` in all equations; None where the motion may be another one."""
    problem = asked(list(recordings), terms, known, known_states, prior, coefficients, allowed)
    with limited(recordings) as work, suppress(*NO_MODEL):
        cleaned, _, period = prepared(list(recordings))
        found, is_sure = moved_at_random(problem, cleaned, period)
        if found and is_sure:
            return work.told(found)
    return None


def moved_at_random(
    problem: Problem, recordings: list[Recording], period: float
) -> tuple[IdentifiedModel | None, bool]:
    """The model of recordings that random forces moved, of their slowest modes where they have more
    of them than coordinates, or of more; and whether it is plain that these forces did.

    None where the motion may be another one. A model of which that is not plain is `approximate`,
    of some modes of many, whose sizes go up and down: better than none. recordings, period: of
    `screening.prepared`.
    """
    several, others = SeveralModes(recordings, period), []
    find = partial(_moved_at_random, problem)
    roughly = partial(find, for_lack_of_others=True)
    if found := _first_sound(several.slowest(roughly), others):
        return found, True
    found = find(recordings, period, 0)
    if found is not None and found.status == "ok":
        return _sharper(found, several, find), True
    at_random = wavers(recordings, period)
    if several.channels.rates or at_random:
        with limited(recordings, TRIAL / 2.0):
            more = _first_sound(several.more(roughly), others)
        found = more or _first_sound(several.slowest(roughly, CLOSE), others) or found
    if found is None and at_random:
        return _whitest(others), False
    return found, True


def _moved_at_random(
    problem: Problem,
    recordings: list[Recording],
    period: float,
    besides: int,
    for_lack_of_others: bool = False,
) -> IdentifiedModel | None:
    """The same of all modes. A motion that repeats leaves its harmonics in the innovations.

    for_lack_of_others: whether a model does that explains most of the motion.
    """

    def will_do(left: Whiteness) -> bool:  # beside inputs other models are near as well
        near = left.nearly and not (problem.inputs and left.relevant)
        return near or (for_lack_of_others and left.partly)

    try:
        rescaled = scaled(recordings, period)
        with limited(recordings, TRIAL_BESIDE_INPUTS if problem.inputs else TRIAL) as work:
            may_be_slow = wavers(recordings, period)
            question, whole, left = fitted_to_some(
                problem, rescaled, problem.unknown, may_be_slow, besides
            )
            unseen = set(question.channels.pairs) - set(question.channels.values)
            if unseen and not question.tracker(whole.model).is_linear:
                return None  # beside such terms forces imitate displacements that nothing measures
            if work.ended or not will_do(left):
                return None
            found, left = fitted_to_all(question, whole, rescaled, period)
            if work.ended or not will_do(left):
                return None
    except NO_MODEL:
        return None
    return _with_scales(found, recordings, rescaled)


def _with_scales(
    found: IdentifiedModel, recordings: list[Recording], rescaled: list[Recording]
) -> IdentifiedModel:
    told = scales_told(recordings, rescaled)
    return replace(found, diagnostics={**found.diagnostics, **told})


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
