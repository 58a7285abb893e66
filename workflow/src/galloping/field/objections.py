"""What of recordings, rather than of a model, must be said before any number of the model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from galloping.field.excerpt import excerpts
from galloping.field.forcing import kept_up, little_told, unmoved
from galloping.field.homogeneity import Identify, difference, parts_of
from galloping.identification.likelihood.maximum_likelihood import maximum_likelihood
from galloping.identification.model import IdentifiedModel
from galloping.identification.random_forces.wavering import wavers
from galloping.polynomial import library
from galloping.recording import Recording

FORCED = (
    "the motion lasts, where the line by itself comes to rest: random forces, such as those of "
    "gusts, traffic or other spans, keep it up (ambient vibration), and no model here has them"
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
    objection = _forced(identified, recordings, period) or _differing(
        identified, recordings, names, identify
    )
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
