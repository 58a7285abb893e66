"""The methods at the physical limit, behind the interface of all methods.

Second-order systems name their velocities `dX`; that dX/dt is the state dX is then known.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from galloping.identification.likelihood import maximum_likelihood as likelihood
from galloping.identification.likelihood import weak_gls as weak
from galloping.identification.model import IdentifiedModel
from galloping.polynomial import Exponents
from galloping.recording import Recording


@dataclass(frozen=True)
class Start:
    """What both methods work on: recordings of one system, and the library."""

    recordings: list[Recording]
    terms: tuple[Exponents, ...]


def start(recordings: Sequence[Recording], terms: tuple[Exponents, ...]) -> Start:
    return Start(list(recordings), terms)


def weak_gls(start: Start) -> IdentifiedModel:
    """`likelihood.weak_gls` on the polynomial library."""
    return weak.weak_gls(start.recordings, start.terms)


def maximum_likelihood(start: Start) -> IdentifiedModel:
    """`likelihood.maximum_likelihood` on the polynomial library."""
    return likelihood.maximum_likelihood(start.recordings, start.terms)
