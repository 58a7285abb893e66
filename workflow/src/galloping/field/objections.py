"""What of recordings, rather than of a model, must be said before any number of the model."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize_scalar

from galloping.field.excerpt import excerpts
from galloping.field.following import Sensed, simulator_of
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
# Part of its size by which a motion that only repeats may differ from itself, many periods later.
SAME, PER_PERIOD = 0.01, 60
SHARE = "error_share_all_"  # and a channel: a diagnostic of approximate models

Identify = Callable[[Sequence[Recording]], IdentifiedModel]

FORCED = (
    "the motion lasts, where the line by itself comes to rest: random forces, such as those of "
    "gusts, traffic or other spans, keep it up (ambient vibration), and no model in such forces "
    "follows it"
)
REPEATS = "the motion only repeats, and other equations have the same limit cycle"
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

    Where they only repeat, it is not `ok`: a closed orbit is one of many systems.
    Of a single recording, the parts of which are not, this is the first reason of an approximate
    model. names: of the recordings, for who reads the reason. period: s, the longest of the motion.
    identify: the method, with its library and known equations. faults: of the recordings, as
    `quality` names them, the first reasons where there is no model.
    """
    inexact = identified.status in ("approximate", "refused") and not identified.is_forced
    more = unmodelled(list(recordings)) if inexact else ""
    objection = _forced(identified, recordings, period)
    if objection:
        objection = more or objection
    elif found := difference(identified, recordings, identify):
        objection = f"{', '.join(names)} do not share one model: {found}; {BY_ITSELF}"
    if objection or identified.status == "refused":
        reason = "; ".join([*faults, objection or identified.reason])
        model = identified.model
        return IdentifiedModel.refused(model.states, model.terms, reason, model.inputs)
    if identified.status == "ok" and merely_repeats(identified, recordings, period):
        reason = "; ".join(filter(None, [REPEATS, identified.reason]))
        return replace(identified, status="not identifiable", reason=reason)
    if len(recordings) == 1 and not more:
        more = _changing(identified, recordings[0], period, identify)
    return replace(identified, reason=f"{more}; {identified.reason}") if more else identified


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


def _changing(
    identified: IdentifiedModel, recording: Recording, period: float, identify: Identify
) -> str:
    """What sets the thirds of one recording apart, which a gusty wind may do as well."""
    parts = parts_of(recording, period) if identified.status == "approximate" else []
    if not (found := difference(identified, parts, identify)):
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


def merely_repeats(
    identified: IdentifiedModel, recordings: Sequence[Recording], period: float
) -> bool:
    """Whether all that was recorded is the same orbit again and again, as the exact model has it.

    Two tones without a common period come near to themselves once, but not at its multiples.
    """
    if identified.model.inputs or identified.is_forced:
        return False
    parts = excerpts(list(recordings))
    if len(parts) != len(identified.initial_states):
        parts = recordings
    simulator = simulator_of(identified.model)
    for part, start in zip(parts, identified.initial_states, strict=True):
        duration = float(part.time[-1] - part.time[0])
        time = np.arange(0.0, duration, period / PER_PERIOD)
        states = simulator(identified.model, start, time).states
        if not _repeats(time, states / states.std(axis=0), period):
            return False
    return True


def _repeats(time: np.ndarray, states: np.ndarray, period: float) -> bool:
    """Whether standardised states (n, n_states) return to themselves over two thirds of the time.

    Sought is the delay, of half a period to a third of the time, after which they differ least.
    """
    step, last = time[1] - time[0], time[-1]
    shifts = np.arange(int(period / step) // 2, len(time) // 3)
    if not len(shifts) or not np.all(np.isfinite(states)):
        return False
    best = step * min(shifts, key=lambda n: np.mean((states[n:] - states[:-n]) ** 2))
    curve = CubicSpline(time, states)

    def differ(delay: float) -> float:
        kept = time[time <= last - delay]
        return float(np.sqrt(np.mean((curve(kept + delay) - states[: len(kept)]) ** 2)))

    for times in (1, int(last * 2 / 3 // best)):
        width = times * step
        best = minimize_scalar(
            differ, bounds=(times * best - width, times * best + width), method="bounded"
        ).x
    return differ(best) < SAME


def parts_of(recording: Recording, period: float) -> list[Recording]:
    """A recording in thirds of its time, empty where they hold too few periods, s, to tell."""
    time = recording.time
    if np.ptp(time) < THIRDS * LEAST_PERIODS * period:
        return []
    edges = np.searchsorted(time, np.linspace(time[0], time[-1], THIRDS + 1))
    return [recording[slice(a, b)] for a, b in pairwise(edges)]


def difference(together: IdentifiedModel, parts: Sequence[Recording], identify: Identify) -> str:
    """What sets parts of recordings apart that were identified together, '' where nothing does.

    A model that is exact misses nothing, and what is followed by one is one system. Told is of the
    channel of which it is plainest, what share of its motion forecasts miss: by the one model, and
    at the median by those of the parts.
    """
    if together.status not in ("approximate", "refused") or len(parts) < 2:
        return ""
    alone = [identify([part]) for part in parts]
    if any(each.status == "refused" for each in alone):
        return ""
    told = {key for each in (together, *alone) for key in each.diagnostics if SHARE in key}
    found = []
    for key in sorted(told) or [SHARE + together.model.states[0]]:
        name, missed = key.removeprefix(SHARE), together.diagnostics.get(key, np.nan)
        own = float(np.median([each.diagnostics.get(key, 0.0) for each in alone]))
        miss = f"{own:.1%}" if own else "nothing but noise"
        if together.status == "refused" and own < RELEVANT:
            found.append((0.0, f"none follows all; models of each by itself miss {miss} of {name}"))
        elif missed > max(RELEVANT, WORSE * own):
            both = f"its forecasts miss {missed:.1%} of {name}, and models of each by itself"
            found.append((missed, f"{both} miss {miss}"))
    return max(found, key=lambda each: each[0], default=(0.0, ""))[1]
