"""What of recordings, rather than of a model, must be said before any number of the model."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from galloping.field.excerpt import excerpts
from galloping.field.forecast import Sensed, simulator_of
from galloping.identification.likelihood.maximum_likelihood import maximum_likelihood
from galloping.identification.model import IdentifiedModel
from galloping.identification.random_forces.unmodelled import unmodelled
from galloping.identification.random_forces.wavering import wavers
from galloping.polynomial import library, velocity_pairs
from galloping.recording import Recording

# A motion without random forces follows from its start: where the line is stable it dies out. A
# motion of a stable line that does not is forced (ambient vibration, buffeting).
LASTING = 1 / 3  # of a recording's motion that its last third has at least, where it does not decay
LARGER = 3.0  # times the model's own motion then
LITTLE_TOLD = 0.8  # R2 of forecasts over some periods, below which a model may only imitate forces
THIRDS = 3  # parts of a recording, which are compared
LEAST_PERIODS = 15  # of a part
# Share of the motion that one model misses, below which a difference changes no number of interest,
# and how many times as much as models of the parts it then misses. Measured: on lines in gusts of
# 5 % one model misses no more than those of the thirds do, in winds 4 % apart five times as much.
RELEVANT, WORSE = 0.03, 2.0
SHARE = "error_share_all_"  # and a channel: a diagnostic of approximate models

Identify = Callable[[Sequence[Recording]], IdentifiedModel]

FORCED = (
    "the motion lasts, where the line by itself comes to rest: random forces, such as those of "
    "gusts, traffic or other spans, keep it up (ambient vibration), and no model in such forces "
    "follows it"
)
BY_ITSELF = "identify each wind, and each state of the line, by itself"


def objected(
    identified: IdentifiedModel,
    recordings: Sequence[Recording],
    names: Sequence[str],
    period: float,
    identify: Identify,
    faults: Sequence[str] = (),
) -> IdentifiedModel:
    """The model, refused where its recordings are not motions of one system left to itself.

    Of a single recording, the parts of which are not, this is the first reason of an approximate
    model. names: of the recordings, for who reads the reason. period: s, the longest of the motion.
    identify: the method, with its library and known equations. faults: of the recordings, as
    `quality` names them, the first reasons where there is no model.
    """
    objection = _forced(identified, recordings, period)
    if objection:
        objection = unmodelled(list(recordings)) or objection
    else:
        objection = _differing(identified, recordings, names, identify)
    if objection or identified.status == "refused":
        reason = "; ".join([*faults, objection or identified.reason])
        return IdentifiedModel.refused(identified.model.states, identified.model.terms, reason)
    if len(recordings) == 1 and (change := _changing(identified, recordings[0], period, identify)):
        return replace(identified, reason=f"{change}; {identified.reason}")
    return identified


def _forced(identified: IdentifiedModel, recordings: Sequence[Recording], period: float) -> str:
    if identified.is_forced:
        return ""
    own = excerpts(list(recordings))
    if identified.status != "refused":
        if still := unmoved(identified):
            return (
                f"nothing recorded tells what accelerates {', '.join(still)}: it does not stand "
                "out of the noise, or random forces keep it up"
            )
        for parts in (own, recordings):  # whichever the model was found from
            if len(parts) == len(identified.initial_states) and kept_up(identified, parts):
                return FORCED
    exact = identified.status in ("ok", "not identifiable", "unjudged")
    if exact or not little_told(identified) or not wavers(recordings, period):
        return ""
    linear = maximum_likelihood(own, library(len(identified.model.states), 1))
    return FORCED if little_told(linear) or kept_up(linear, own) else ""


def _differing(
    identified: IdentifiedModel,
    recordings: Sequence[Recording],
    names: Sequence[str],
    identify: Identify,
) -> str:
    found = difference(identified, recordings, identify)
    return f"{', '.join(names)} do not share one model: {found}; {BY_ITSELF}" if found else ""


def _changing(
    identified: IdentifiedModel, recording: Recording, period: float, identify: Identify
) -> str:
    """The same of one recording, the thirds of which a gusty wind may set apart as well."""
    parts = parts_of(recording, period) if identified.status == "approximate" else []
    if (found := difference(identified, parts, identify)) is None:
        return ""
    spans = ", ".join(f"{part.time[0]:.0f} to {part.time[-1]:.0f} s" for part in parts)
    return (
        f"the parts of the recording ({spans}) do not share one model, as where a wind changes or "
        f"gusts: {found}; {BY_ITSELF}"
    )


def little_told(identified: IdentifiedModel) -> bool:
    """Whether an inexact model, if there is one, hardly tells the motion from what came before."""
    return identified.diagnostics.get("forecast_r2", 0.0) < LITTLE_TOLD


def unmoved(identified: IdentifiedModel) -> list[str]:
    """Coordinates of whose acceleration the model knows nothing."""
    states = identified.model.states
    return [
        states[i]
        for i, velocity in velocity_pairs(states).items()
        if velocity not in identified.known and not np.any(identified.model.coefficients[velocity])
    ]


def kept_up(identified: IdentifiedModel, recordings: Sequence[Recording]) -> bool:
    """Whether the recorded motion of every channel lasts while that of the model dies out.

    recordings: those that it was identified from, with a start of each in its `initial_states`.
    """
    kept = []
    for recording, start in zip(recordings, identified.initial_states, strict=True):
        sensed, time = Sensed.by(recording), recording.time
        driven = simulator_of(identified.model, recording)
        states = driven(identified.model, start, time).states
        motion = sensed.of(identified.model, states, driven.at(time))
        last = time > time[-1] - (time[-1] - time[0]) / 3
        for samples, own in zip(sensed.samples(recording).T, motion.T, strict=True):
            known = np.isfinite(samples)
            if (known & last).any():
                recorded = np.std(samples[known & last])
                lasts = recorded > LASTING * np.std(samples[known])
                kept.append(lasts and recorded > LARGER * np.std(own[last]))
    return bool(kept) and all(kept)


@dataclass(frozen=True)
class Difference:
    """How much worse one model of several parts is than a model of each.

    channel: of which this is plainest. together, alone: share of its motion that forecasts miss, by
    one model, NaN where there is none, and at the median by those of the parts.
    """

    channel: str
    together: float
    alone: float

    def __str__(self) -> str:
        own = f"{self.alone:.1%}" if self.alone else "nothing but noise"
        if np.isnan(self.together):
            return f"none follows all; models of each by itself miss {own} of {self.channel}"
        return (
            f"its forecasts miss {self.together:.1%} of {self.channel}, and models of each by "
            f"itself miss {own}"
        )


def parts_of(recording: Recording, period: float) -> list[Recording]:
    """A recording in thirds of its time, empty where they hold too few periods, s, to tell."""
    time = recording.time
    if np.ptp(time) < THIRDS * LEAST_PERIODS * period:
        return []
    edges = np.searchsorted(time, np.linspace(time[0], time[-1], THIRDS + 1))
    return [recording[slice(a, b)] for a, b in pairwise(edges)]


def difference(
    together: IdentifiedModel, parts: Sequence[Recording], identify: Identify
) -> Difference | None:
    """What sets parts of recordings apart that were identified together, None where nothing does.

    A model that is exact misses nothing, and what is followed by one is one system.
    """
    if together.status not in ("approximate", "refused") or len(parts) < 2:
        return None
    alone = [identify([part]) for part in parts]
    if any(each.status == "refused" for each in alone):
        return None
    names = {
        key.removeprefix(SHARE)
        for each in (together, *alone)
        for key in each.diagnostics
        if key.startswith(SHARE)
    }
    found = []
    for name in sorted(names) or [together.model.states[0]]:
        missed = together.diagnostics.get(SHARE + name, np.nan)
        own = float(np.median([each.diagnostics.get(SHARE + name, 0.0) for each in alone]))
        if together.status == "refused":
            found += [Difference(name, np.nan, own)] if own < RELEVANT else []
        elif missed > max(RELEVANT, WORSE * own):
            found.append(Difference(name, missed, own))
    return max(found, key=lambda each: each.together, default=None)
