"""Where recordings are not motions of one system left to itself, and a model is refused for it."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from galloping.arrays import first_from
from galloping.field.dynamics import Surroundings, dynamics
from galloping.field.excerpts import excerpts
from galloping.field.following import Following
from galloping.identification.likelihood.instrument import DRIFTS
from galloping.identification.likelihood.maximum_likelihood import maximum_likelihood
from galloping.identification.model import LITTLE_TOLD, IdentifiedModel
from galloping.identification.random_forces.start import wavers
from galloping.identification.random_forces.unmodelled import unmodelled
from galloping.identification.work import ENDED
from galloping.intervals import NORMAL_95
from galloping.polynomial import library, velocity_pairs
from galloping.recording import Recording

# A motion without random forces follows from its start: where the line is stable it dies out. A
# motion of a stable line that does not is forced (ambient vibration, buffeting); a model that goes
# on moving where the recorded motion dies out is none of the line.
LASTING = 1 / 3  # of a motion that its last third has at least, where it does not decay
LARGER = 3.0  # times the other motion then: that of the model, or the recorded one
THIRDS = 3  # parts of a recording, which are compared
LEAST_PERIODS = 15  # of a part
# Share of the motion that one model misses, below which a difference changes no number of interest,
# and how many times as much as models of the parts it then misses. Measured: on lines in gusts of
# 5 % one model misses no more than those of the thirds do, in winds 4 % apart five times as much.
RELEVANT, WORSE = 0.03, 2.0
UNLIKE = 3.5  # standard errors between values of two halves: once in 500 of four by chance
SHARE = "error_share_all_"  # and a channel: a diagnostic of approximate models

Identify = Callable[[Sequence[Recording]], IdentifiedModel]

FORCED = (
    "the motion lasts, where the line by itself comes to rest: random forces, such as those of "
    "gusts, traffic or other spans, keep it up (ambient vibration), and no model in such forces "
    "follows it"
)
OUTLIVED = (
    "the recorded motion dies out, and that of every model that comes near it goes on: terms are "
    "missing, such as those of friction or play, or modes"
)
BY_ITSELF = "identify each wind, and each state of the line, by itself"


def objected(
    identified: IdentifiedModel,
    recordings: Sequence[Recording],
    names: Sequence[str],
    period: float,
    identify: Identify,
    faults: Sequence[str] = (),
    are_one: bool = False,
) -> IdentifiedModel:
    """The model, refused where its recordings are not motions of one system left to itself.

    Of a single recording, the parts of which are not, this is the first reason of an approximate
    model. are_one: whether the recordings are parts of a single one. names: of the recordings, for
    who reads the reason. period: s, the longest of the motion. identify: the method, with its
    library and known equations. faults: of the recordings, as `quality` names them, the first
    reasons where there is no model.
    """
    inexact = identified.status in ("approximate", "refused") and not identified.is_forced
    more = unmodelled(list(recordings)) if inexact else ""
    objection = _forced(identified, recordings, period) or _outlived(identified, recordings)
    if objection:
        objection = more or objection
    elif (not are_one or identified.status == "refused") and (
        found := difference(identified, recordings, identify)[0]
    ):
        objection = f"{', '.join(names)} do not share one model: {found}; {BY_ITSELF}"
    if objection or identified.status == "refused":
        reason = "; ".join([*faults, objection or identified.reason])
        model = identified.model
        return IdentifiedModel.refused(model.states, model.terms, reason, model.inputs)
    if (len(recordings) == 1 or are_one) and not more:
        more = _changing(identified, recordings, period, identify)
    alone = identified.is_forced and len(recordings) == 1 and not more
    if alone and (more := _changing_at_random(identified, recordings[0], period)):
        identified = replace(identified, status="approximate")
    return replace(identified, reason=f"{more}; {identified.reason}") if more else identified


def _forced(identified: IdentifiedModel, recordings: Sequence[Recording], period: float) -> str:
    if identified.is_forced:
        return ""
    own, has_model = excerpts(list(recordings)), identified.status != "refused"
    if has_model and (still := unmoved(identified)):
        return (
            f"nothing recorded tells what accelerates {', '.join(still)}: it does not stand "
            "out of the noise, or random forces keep it up"
        )
    if identified.model.inputs:  # they keep it up; a model that comes to rest may lack terms
        return ""
    for parts in (own, recordings) if has_model else ():  # whichever the model was found from
        if len(parts) == len(identified.initial_states) and kept_up(identified, parts):
            return FORCED
    if not identified.tells_little or not wavers(recordings, period):
        return ""
    linear = maximum_likelihood(own, library(len(identified.model.states), 1))
    if ENDED in identified.reason or ENDED in linear.reason:  # a search to its end may tell more
        return ""
    told = linear.diagnostics.get("forecast_r2", 0.0)  # none of a model in random forces
    return FORCED if told < LITTLE_TOLD or kept_up(linear, own) else ""


def _outlived(identified: IdentifiedModel, recordings: Sequence[Recording]) -> str:
    inexact = identified.status == "approximate" and not identified.is_forced
    if inexact and not identified.model.inputs:
        for parts in (excerpts(list(recordings)), recordings):
            if len(parts) == len(identified.initial_states) and outlived(identified, parts):
                return OUTLIVED
    return ""


def _changing(
    identified: IdentifiedModel, parts: Sequence[Recording], period: float, identify: Identify
) -> str:
    """What sets the parts of one recording apart, its thirds where it has no gaps, which a gusty
    wind may do as well.
    """
    if identified.status != "approximate" or identified.envelope:
        return ""
    if len(parts) == 1:
        (recording,), time = parts, parts[0].time
        if np.ptp(time) < THIRDS * LEAST_PERIODS * period:
            return ""
        edges = first_from(time, np.linspace(time[0], time[-1], THIRDS + 1))
        parts = [recording[a:b] for a, b in pairwise(edges)]
    found, missed = difference(identified, parts, identify)
    drifts = missed > 0.0 and DRIFTS in identified.reason  # which part by part it does as well
    if drifts or not found:
        return ""
    return _unlike(parts, found)


def _unlike(parts: Sequence[Recording], found: str) -> str:
    ends = ((float(f"{end:.3g}") for end in part.time[[0, -1]]) for part in parts)
    spans = ", ".join(f"{first:g} to {last:g} s" for first, last in ends)
    return (
        f"the parts of the recording ({spans}) do not share one model, as where a wind changes or "
        f"gusts, or a sensor's zero moves: {found}; {BY_ITSELF}"
    )


def _changing_at_random(identified: IdentifiedModel, recording: Recording, period: float) -> str:
    """What sets the halves of a recording apart that random forces moved: a frequency or a damping,
    by UNLIKE standard errors; '' where nothing does.
    """
    if identified.model.inputs or np.ptp(recording.time) < 2 * LEAST_PERIODS * period:
        return ""
    middle, model = len(recording.time) // 2, identified.model
    halves, told = [recording[:middle], recording[middle:]], []
    for half in halves:
        known = tuple(model.states[i] for i in identified.known)
        found = maximum_likelihood([half], model.terms, model, known, forced=())
        if found.status == "refused":
            return ""
        of = dynamics(found, Surroundings.of([half]), np.random.default_rng(0))
        told.append((of.frequencies, of.damping))
    for names, unit, factor in ((0, "Hz", 1.0), (1, "% of critical damping", 100.0)):
        first, second = told[0][names], told[1][names]
        for name in first.keys() & second.keys():
            one, other = first[name], second[name]
            error = np.hypot(one.high - one.low, other.high - other.low) / (2.0 * NORMAL_95)
            if abs(one.value - other.value) > UNLIKE * error:
                both = f"{factor * one.value:.3g} and then {factor * other.value:.3g} {unit}"
                return _unlike(halves, f"{name} has {both}")
    return ""


def unmoved(identified: IdentifiedModel) -> list[str]:
    """Coordinates of whose acceleration the model knows nothing."""
    states = identified.model.states
    return [
        states[i]
        for i, velocity in velocity_pairs(states).items()
        if velocity not in identified.known and not np.any(identified.model.coefficients[velocity])
    ]


def kept_up(identified: IdentifiedModel, recordings: Sequence[Recording]) -> bool:
    """Whether the recorded motion of every channel lasts, above its noise, while that of the model
    dies out.

    recordings: those that it was identified from, with a start of each in its `initial_states`.
    """
    kept = [
        recorded.last > LASTING * recorded.all and recorded.last > LARGER * own.last
        for recorded, own in _sizes(identified, recordings)
    ]
    return bool(kept) and all(kept)


def outlived(identified: IdentifiedModel, recordings: Sequence[Recording]) -> bool:
    """Whether the model's motion of a channel lasts, or runs away, where the recorded one dies out.

    recordings: as of `kept_up`.
    """
    return any(
        recorded.last < LASTING * recorded.all
        and not (own.last <= LASTING * own.all or own.last <= LARGER * recorded.last)
        for recorded, own in _sizes(identified, recordings)
    )


class _Size(NamedTuple):
    """Standard deviation of a motion, and of its last third."""

    all: float
    last: float


def _sizes(
    identified: IdentifiedModel, recordings: Sequence[Recording]
) -> Iterator[tuple[_Size, _Size]]:
    """Of each channel of each recording the size of its motion, and of the model's from its start.

    Those of the model are not finite where it diverges.
    """
    for recording, start in zip(recordings, identified.initial_states, strict=True):
        follow, time = Following(identified, recording), recording.time
        motion = follow.motion(identified.model, start, time)
        last = time > time[-1] - (time[-1] - time[0]) / 3
        for samples, own, noise in zip(follow.samples.T, motion.T, follow.sigma, strict=True):
            known = np.isfinite(samples)
            if (known & last).any():
                whole, end = _above(samples[known], noise), _above(samples[known & last], noise)
                yield _Size(whole, end), _Size(np.std(own), np.std(own[last]))


def _above(samples: np.ndarray, noise: float) -> float:
    """Standard deviation of samples (n,) without that of their noise."""
    return float(np.sqrt(max(np.var(samples) - noise**2, 0.0)))


def difference(
    together: IdentifiedModel, parts: Sequence[Recording], identify: Identify
) -> tuple[str, float]:
    """What sets parts of recordings apart that were identified together, '' where nothing does, and
    what share of the motion models of each miss.

    A model that is exact misses nothing, and what is followed by one is one system. Told is of the
    channel of which it is plainest, what share of its motion forecasts miss: by the one model, and
    at the median by those of the parts.
    """
    if together.status not in ("approximate", "refused") or len(parts) < 2:
        return "", 0.0
    alone = [identify([part]) for part in parts]
    if any(each.status == "refused" for each in alone):
        return "", 0.0
    told = {key for each in (together, *alone) for key in each.diagnostics if SHARE in key}
    found = []
    for key in sorted(told) or [SHARE + together.model.states[0]]:
        name, missed = key.removeprefix(SHARE), together.diagnostics.get(key, np.nan)
        own = float(np.median([each.diagnostics.get(key, 0.0) for each in alone]))
        miss = f"{own:.1%}" if own else "nothing but noise"
        if together.status == "refused" and own < RELEVANT:
            both = f"none follows all; models of each by itself miss {miss} of {name}"
            found.append((0.0, both, own))
        elif missed > max(RELEVANT, WORSE * own):
            both = f"its forecasts miss {missed:.1%} of {name}, and models of each by itself"
            found.append((missed, f"{both} miss {miss}", own))
    return max(found, key=lambda each: each[0], default=(0.0, "", 0.0))[1:]
