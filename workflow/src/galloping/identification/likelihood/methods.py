"""The methods at the physical limit, behind the interface of all methods.

Second-order systems name their velocities `dX`; that dX/dt is the state dX is then known.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from galloping.identification.likelihood import maximum_likelihood as likelihood
from galloping.identification.likelihood import weak_gls as weak
from galloping.identification.likelihood.problem import Problem
from galloping.identification.likelihood.weak_gls import Start
from galloping.identification.model import IdentifiedModel
from galloping.polynomial import Exponents
from galloping.recording import Recording


@dataclass(frozen=True)
class Evidence:
    """What both methods work on: recordings of one system, the library, and a shared start."""

    recordings: list[Recording]
    terms: tuple[Exponents, ...]
    begin: Callable[..., Start]


def start(recordings: Sequence[Recording], terms: tuple[Exponents, ...]) -> Evidence:
    """Evidence whose start is made once, by the first method that needs it."""
    made: list[Start] = []

    def begin(problem: Problem, given: list[Recording], share: float = 1.0) -> Start:
        if share != 1.0:
            return weak.begin(problem, given, share)
        if not made:
            made.append(weak.begin(problem, given))
        return made[0]

    return Evidence(list(recordings), terms, begin)


def by_weak_gls(evidence: Evidence) -> IdentifiedModel:
    """`likelihood.weak_gls` on the polynomial library."""
    return weak.weak_gls(evidence.recordings, evidence.terms, start=evidence.begin)


def by_maximum_likelihood(evidence: Evidence) -> IdentifiedModel:
    """`likelihood.maximum_likelihood` on the polynomial library."""
    return likelihood.maximum_likelihood(evidence.recordings, evidence.terms, start=evidence.begin)
