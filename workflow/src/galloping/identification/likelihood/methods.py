"""The methods at the physical limit, behind the interface of all methods."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

from galloping.identification.likelihood import maximum_likelihood as likelihood
from galloping.identification.likelihood import weak_gls as weak
from galloping.identification.likelihood.inputs import driven
from galloping.identification.likelihood.problem import posed
from galloping.identification.model import NO_MODEL, IdentifiedModel
from galloping.polynomial import Exponents
from galloping.recording import Recording


@dataclass(frozen=True)
class Evidence:
    """What both methods work on: recordings of one system, the library, and the start that they
    share; None where there is none, for a reason that each of them finds again.
    """

    recordings: list[Recording]
    terms: tuple[Exponents, ...]
    start: weak.Start | None


def start(recordings: Sequence[Recording], terms: tuple[Exponents, ...]) -> Evidence:
    """Evidence with its start, which exact states with derivatives do not need."""
    begun = None
    if any(recording.derivatives is None for recording in recordings):
        with suppress(*NO_MODEL):
            inputs = tuple(recordings[0].inputs)
            problem = posed(recordings[0].states, terms, inputs=inputs)
            begun = weak.begin(problem, driven(list(recordings), problem.inputs))
    return Evidence(list(recordings), terms, begun)


def by_weak_gls(evidence: Evidence) -> IdentifiedModel:
    """`likelihood.weak_gls` on the polynomial library."""
    return weak.weak_gls(evidence.recordings, evidence.terms, start=evidence.start)


def by_maximum_likelihood(evidence: Evidence) -> IdentifiedModel:
    """`likelihood.maximum_likelihood` on the polynomial library."""
    return likelihood.maximum_likelihood(evidence.recordings, evidence.terms, start=evidence.start)
